//! Recordings whose odometry is commands, driven through chains that are known.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use common::commanded::{Departure, driven, joystick, with_sightings, without};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_mismatch::{
    Channel, ChannelResiduals, Evidence, MismatchError, Omission, Residual, compare, models, residuals_of,
};
use pleiad_physics::{ActiveEffect, Effect, RobotModel, Variable};
use pleiad_recording::Recording;

const ROBOT: RobotId = RobotId(1);
/// Euler's lag is short by half a step of 0.1 ms, and set-points change by up to 1 rad/s; the tool's arcs of
/// 50 ms add up to 1e-5. Metres and radians.
const EXACT: f64 = 6e-5;
/// What the lag and delay of these recordings are.
const LATE: Departure = Departure { lag_s: 0.15, delay_s: 0.06, speed_relative: 0.0, turn_relative: 0.0 };

fn with(effects: &[(Effect, &[f64])]) -> impl Fn(&RobotModel<f64>) -> RobotModel<f64> {
    move |model| {
        effects.iter().fold(model.clone(), |model, (effect, values)| {
            model.with(ActiveEffect::new(*effect, values).expect("as many values as parameters"))
        })
    }
}

fn late(model: &RobotModel<f64>) -> RobotModel<f64> {
    with(&[(Effect::ActuatorLag, &[LATE.lag_s]), (Effect::CommandDelay, &[LATE.delay_s])])(model)
}

fn commanded(
    recording: &Recording,
    change: impl Fn(&RobotModel<f64>) -> RobotModel<f64>,
) -> ChannelResiduals<f64> {
    let models = models(recording).expect("velocity odometry");
    let evidence = Evidence::new(recording, &models);
    residuals_of(&evidence, ROBOT, &change(&models[&ROBOT]), Channel::CommandedBody)
}

fn greatest(residuals: &ChannelResiduals<f64>) -> f64 {
    let values = residuals.rows.iter().flat_map(Residual::values);
    values.fold(0.0, |greatest, value| greatest.max(value.abs()))
}

#[test]
fn under_the_right_model_nothing_remains() {
    let recording = driven(60.0, LATE, joystick);
    let right = commanded(&recording, late);
    assert!(right.rows.len() >= 58, "{}", right.rows.len());
    assert!(greatest(&right) < EXACT, "{}", greatest(&right));
    // Windows before 0.6 s after the first command, and the last of the commands, are not compared.
    assert!(matches!(right.omissions[..], [Omission::NoCommand(1..=2)]), "{:?}", right.omissions);
    let wrong = commanded(&recording, RobotModel::clone);
    assert!(greatest(&wrong) > 0.05, "the same without lag and delay: {}", greatest(&wrong));
}

#[test]
fn a_step_of_the_speed_lacks_the_time_constant_times_the_step() {
    let (lag_s, speed, begin_s) = (0.2, 0.4, 5.1);
    let departure = Departure { lag_s, ..Departure::default() };
    let recording =
        driven(12.0, departure, |time_s| if time_s >= begin_s - 1e-9 { [speed, 0.0] } else { [0.0; 2] });
    let found = commanded(&recording, RobotModel::clone);
    let mut seen = 0;
    for row in &found.rows {
        let (from_s, to_s) = (row.time_s - 0.5, row.time_s + 0.5);
        // Distance minus that without lag: -v tau (1 - exp(-t/tau)) from the step on.
        let behind = |time_s: f64| speed * lag_s * (1.0 - (-(time_s - begin_s).max(0.0) / lag_s).exp());
        let expected = behind(from_s) - behind(to_s);
        assert!((row.values()[0] - expected).abs() < EXACT, "{row:?} for {expected}");
        assert!(row.values()[1].abs() < EXACT && row.values()[2].abs() < EXACT);
        seen += usize::from(expected.abs() > 0.01);
    }
    assert!(seen > 0, "a window holds the step");
}

#[test]
fn a_turn_scale_is_the_yaw_that_it_lacks() {
    let departure = Departure { turn_relative: -0.05, ..Departure::default() };
    let recording = driven(20.0, departure, |_| [0.08, 0.4]);
    let found = commanded(&recording, RobotModel::clone);
    assert!(found.rows.len() >= 18);
    for row in &found.rows {
        assert!((row.values()[2] + 0.05 * 0.4).abs() < EXACT, "{row:?}");
        // What the robot did, by its truth, and not what it was told.
        assert!((row.regime.yaw_rate_rad_s - 0.95 * 0.4).abs() < 1e-9, "{row:?}");
    }
    let right = commanded(&recording, with(&[(Effect::ActuatorGain, &[0.0, -0.05])]));
    assert!(greatest(&right) < EXACT);
}

#[test]
fn a_gap_of_the_truth_costs_its_windows_and_no_more() {
    let mut recording = driven(60.0, LATE, joystick);
    let whole = commanded(&recording, late).rows.len();
    without(&mut recording, (30.0, 32.0), true);
    let found = commanded(&recording, late);
    assert!(greatest(&found) < EXACT, "the servo is followed through the gap: {}", greatest(&found));
    assert!((whole - 4..=whole - 2).contains(&found.rows.len()), "{} of {whole}", found.rows.len());
    assert!(found.omissions.contains(&Omission::NoTruth(ROBOT, 1)), "{:?}", found.omissions);
    assert!(found.rows.iter().all(|row| !(29.5..32.5).contains(&row.time_s)));
}

#[test]
fn what_happened_in_a_gap_of_the_commands_is_not_guessed() {
    // In the gap the robot spins by commands that nobody recorded.
    let unseen = |time_s: f64| if (30.0..31.5).contains(&time_s) { [0.0, 1.0] } else { joystick(time_s) };
    let mut recording = driven(60.0, LATE, unseen);
    without(&mut recording, (30.0, 31.5), false);
    let found = commanded(&recording, late);
    // A second after the gap nothing of it is left but exp(-(1 - 0.06)/0.15) of the spin, for 0.15 s.
    assert!(greatest(&found) < 1e-3, "{}", greatest(&found));
    assert!(found.omissions.contains(&Omission::CommandGap(3)), "{:?}", found.omissions);
    assert!(found.rows.iter().all(|row| !(29.5..33.0).contains(&row.time_s)), "a gap and a second");
    assert!(found.rows.len() >= 53, "{}", found.rows.len());
}

#[test]
fn the_derivatives_are_those_of_central_differences() {
    let recording = driven(30.0, LATE, joystick);
    let models = models(&recording).expect("velocity odometry");
    let evidence = Evidence::new(&recording, &models);
    // Off the instants at which truth and commands fall together: there a delay has two slopes.
    let at = [0.12, 0.0512, 0.03, -0.04];
    let model = |[lag, delay, speed, turn]: [f64; 4]| {
        with(&[
            (Effect::ActuatorLag, &[lag]),
            (Effect::CommandDelay, &[delay]),
            (Effect::ActuatorGain, &[speed, turn]),
        ])(&models[&ROBOT])
    };
    let variables =
        [(0, 0), (1, 0), (2, 0), (2, 1)].map(|(index, parameter)| Variable::Effect { index, parameter });
    let exact = residuals_of(&evidence, ROBOT, &model(at).differentiated(&variables), Channel::CommandedBody);
    let half_step = 1e-5;
    for position in 0..4 {
        let [less, more] = [-half_step, half_step].map(|change| {
            let mut moved = at;
            moved[position] += change;
            residuals_of(&evidence, ROBOT, &model(moved), Channel::CommandedBody)
        });
        let mut steepest: f64 = 0.0;
        for (row, (less, more)) in exact.rows.iter().zip(less.rows.iter().zip(&more.rows)) {
            for component in 0..3 {
                let central = (more.values()[component] - less.values()[component]) / (2.0 * half_step);
                let found = row.values()[component].derivatives()[position];
                assert!((found - central).abs() < 1e-5, "{position} {component}: {found} {central} {row:?}");
                steepest = steepest.max(central.abs());
            }
        }
        assert!(steepest > 0.01, "the parameter {position} acts: {steepest}");
    }
}

#[test]
fn robots_and_landmarks_are_seen_from_true_poses_without_encoders() {
    let mut recording = driven(30.0, LATE, joystick);
    with_sightings(&mut recording, [2.0, 0.5], [-1.0, 1.5]);
    let compared = compare(&recording).expect("velocity odometry");
    for channel in
        [Channel::RangeToLandmark, Channel::BearingToLandmark, Channel::RangeToRobot, Channel::BearingToRobot]
    {
        let own = &compared[0].channel(channel).expect("every channel is there").residuals;
        assert!(own.rows.len() >= 148, "{channel}: {:?}", own.omissions);
        assert!(greatest(own) < 1e-9, "{channel}: {}", greatest(own));
    }
    let wheels = compared[0].channel(Channel::Body).expect("every channel is there");
    assert_eq!(wheels.residuals.omissions, [Omission::NotRecorded("wheel angles")]);
}

#[test]
fn without_truth_or_nominal_model_it_is_said_what_lacks() {
    let mut recording = driven(5.0, LATE, joystick);
    for own in recording.robots.values_mut() {
        own.truth.clear();
    }
    assert_eq!(commanded(&recording, late).omissions, [Omission::NotRecorded("truth")]);
    // Odometry of wheels needs their geometry.
    let own = recording.robots.get_mut(&ROBOT).expect("driven");
    own.odometry.clear();
    let error = compare(&recording).expect_err("nothing to predict with");
    assert_eq!(error, MismatchError::NoNominal { recording: "driven".to_owned() });
}

#[test]
fn stamps_of_unix_time_count_from_the_beginning() {
    let recording = driven(20.0, LATE, joystick);
    let mut shifted = recording.clone();
    let shift_ns = 1_248_444_187_000_000_000;
    for own in shifted.robots.values_mut() {
        own.commands.iter_mut().for_each(|command| command.time.0 += shift_ns);
        own.odometry.iter_mut().for_each(|sample| sample.time.0 += shift_ns);
        own.truth.iter_mut().for_each(|sample| sample.time.0 += shift_ns);
    }
    let origin = |recording: &Recording| {
        Evidence::new(recording, &models(recording).expect("velocity odometry")).origin()
    };
    assert_eq!((origin(&recording), origin(&shifted)), (Timestamp(0), Timestamp(shift_ns)));
    let (plain, moved) = (commanded(&recording, late), commanded(&shifted, late));
    assert_eq!(plain.rows.len(), moved.rows.len());
    for (plain, moved) in plain.rows.iter().zip(&moved.rows) {
        assert_eq!(plain.values(), moved.values());
        assert!((plain.time_s - moved.time_s).abs() < 1e-9);
    }
}

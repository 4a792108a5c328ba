//! UMBmark on runs whose wheels are known: arcs in closed form, and recordings that are no runs.

#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_mismatch::calibration::umbmark::{
    Kind, Run, Turning, UmbmarkError, WheelErrors, WheelFactors, calibrate, corrected, left_out, square_end,
    stage,
};
use pleiad_recording::{Nominal, NominalRobot, Recording, RobotRecording, TruthSample};

const ROBOT: RobotId = RobotId(1);
const RADIUS_M: f64 = 0.08;
const TRACK_M: f64 = 0.34;
const SIDE_M: f64 = 4.0;
/// Rows of odometry to a side and to a corner.
const ROWS: u32 = 50;

/// What the wheels roll, by the nominal robot: `[left, right]` metres, one after the other.
type Rolled = Vec<[f64; 2]>;

fn square(side_m: f64, sense: f64) -> Rolled {
    let quarter_m = sense * 0.25 * std::f64::consts::PI * TRACK_M;
    [[side_m, side_m], [-quarter_m, quarter_m]].repeat(4)
}

/// A recording of these motions, which truly ended at `end`.
fn recording(name: &str, rolled: &Rolled, end: Pose2) -> Recording {
    let mut angles = [0.0; 2];
    let mut odometry = vec![sample(0.0, angles)];
    for (number, motion) in rolled.iter().enumerate() {
        for row in 1..=ROWS {
            for (angle, rolled_m) in angles.iter_mut().zip(motion) {
                *angle += rolled_m / f64::from(ROWS) / RADIUS_M;
            }
            odometry.push(sample(10.0 * number as f64 + 0.1 * f64::from(row), angles));
        }
    }
    // Far from the origin and not along an axis: only the motion between start and end may count.
    let start = Pose2::new(3.0, -2.0, 2.1);
    let last = odometry.last().unwrap().time;
    let truth = vec![
        TruthSample { time: Timestamp(0), pose: start },
        TruthSample { time: last, pose: start.compose(&end) },
    ];
    let own = RobotRecording { odometry, truth, ..RobotRecording::default() };
    let robot = NominalRobot { wheel_radius: RADIUS_M, track_width: TRACK_M, ..NominalRobot::default() };
    Recording {
        name: name.to_owned(),
        nominal: Some(Nominal { robots: [(ROBOT, robot)].into(), ..Nominal::default() }),
        robots: [(ROBOT, own)].into(),
        ..Recording::default()
    }
}

fn sample(time_s: f64, [left_rad, right_rad]: [f64; 2]) -> Sample {
    Sample { time: Timestamp::from_seconds(time_s), reading: Reading::Wheels { left_rad, right_rad } }
}

/// A square of a robot with these wheels.
fn driven(errors: WheelErrors, turning: Turning) -> Recording {
    let end = square_end(errors, TRACK_M, SIDE_M, turning);
    let rolled = square(SIDE_M, turning.sign());
    recording(&turning.to_string(), &rolled, Pose2::new(end.x_m, end.y_m, end.yaw_rad))
}

fn both(errors: WheelErrors) -> Vec<Run> {
    [Turning::Clockwise, Turning::CounterClockwise]
        .map(|turning| Run::of(&driven(errors, turning), ROBOT).unwrap())
        .into()
}

#[test]
fn wheels_and_track_of_exact_arcs_are_recovered_to_second_order() {
    for errors in [
        WheelErrors { e_d: 1.0015, e_b: 1.02, e_s: 1.0 },
        WheelErrors { e_d: 0.999, e_b: 1.01, e_s: 1.0 },
        WheelErrors { e_d: 1.001, e_b: 0.98, e_s: 1.0 },
        WheelErrors { e_d: 1.0, e_b: 1.03, e_s: 1.0 },
        WheelErrors { e_d: 0.998, e_b: 1.0, e_s: 1.0 },
    ] {
        let runs = both(errors);
        let found = calibrate(&runs, WheelFactors::NONE).unwrap();
        // Angles of corners and sides add up over three corners; what is neglected is of the order of their squares.
        let beta = 2.0 * SIDE_M * (errors.e_d - 1.0) / (errors.e_d + 1.0) / (errors.e_b * TRACK_M);
        let alpha = std::f64::consts::FRAC_PI_2 * (1.0 - 1.0 / errors.e_b);
        let second = 4.0 * (alpha.abs() + beta.abs()).powi(2);
        assert!((found.angles.alpha_rad - alpha).abs() < second, "{errors:?}: {:?} {alpha}", found.angles);
        assert!((found.angles.beta_rad - beta).abs() < second, "{errors:?}: {:?} {beta}", found.angles);
        assert!(
            (found.e_d.value - errors.e_d).abs() < second * TRACK_M / SIDE_M,
            "{errors:?}: {:?}",
            found.e_d
        );
        assert!((found.e_b.value - errors.e_b).abs() < second, "{errors:?}: {:?}", found.e_b);
        assert!(found.angles.disagreement_rad < 2.0 * second, "{errors:?}: {:?}", found.angles);
        assert!((found.side_m - SIDE_M).abs() < 1e-9);
    }
}

#[test]
fn the_sign_of_every_error_is_that_of_its_cause() {
    // The right wheel larger: sides bend to the left. A wider track: corners fall short.
    let right = calibrate(&both(WheelErrors { e_d: 1.001, e_b: 1.0, e_s: 1.0 }), WheelFactors::NONE).unwrap();
    assert!(
        right.angles.beta_rad > 0.0 && right.factors.right > 1.0 && right.factors.left < 1.0,
        "{right:?}"
    );
    assert!(right.angles.alpha_rad.abs() < 0.1 * right.angles.beta_rad, "{right:?}");
    let wide = calibrate(&both(WheelErrors { e_d: 1.0, e_b: 1.01, e_s: 1.0 }), WheelFactors::NONE).unwrap();
    assert!(wide.angles.alpha_rad > 0.0 && wide.factors.track > 1.0, "{wide:?}");
    assert!(wide.angles.beta_rad.abs() < 0.1 * wide.angles.alpha_rad, "{wide:?}");
}

#[test]
fn the_correction_brings_the_robot_home_and_exchanged_labels_lead_it_astray() {
    let runs = both(WheelErrors { e_d: 1.0015, e_b: 1.02, e_s: 1.0 });
    let found = calibrate(&runs, WheelFactors::NONE).unwrap();
    let before_m = found.before.e_max_syst_m;
    let after_m = stage(&runs, found.factors).unwrap().e_max_syst_m;
    let swapped_m = stage(&runs, found.factors.swapped()).unwrap().e_max_syst_m;
    assert!(before_m > 0.3 && after_m < 0.1 * before_m, "{before_m} {after_m}");
    // Sides then bend by twice as much as they do with the wheels left alone.
    let track = WheelFactors { left: 1.0, right: 1.0, ..found.factors };
    let track_alone_m = stage(&runs, track).unwrap().e_max_syst_m;
    assert!((swapped_m / track_alone_m - 2.0).abs() < 0.2, "{track_alone_m} {swapped_m}");
    // A second round, on top of the first, leaves next to nothing of the neglected second order.
    let again = calibrate(&runs, found.factors).unwrap();
    assert!((again.e_d.value - 1.0015).abs() < 1e-5 && (again.e_b.value - 1.02).abs() < 1e-4, "{again:?}");
    let (judged, held_out) = left_out(&runs, WheelFactors::NONE).unwrap();
    assert!(!held_out && (judged.e_max_syst_m - after_m).abs() < 1e-12);
}

#[test]
fn a_model_that_has_the_correction_is_not_corrected_twice() {
    let errors = WheelErrors { e_d: 1.0015, e_b: 1.02, e_s: 1.0 };
    let mut recordings =
        [Turning::Clockwise, Turning::CounterClockwise].map(|turning| driven(errors, turning));
    for recording in &mut recordings {
        let robot = recording.nominal.as_mut().unwrap().robots.get_mut(&ROBOT).unwrap();
        *robot = corrected(robot, errors.factors(), [None; 3]);
    }
    let runs = recordings.map(|recording| Run::of(&recording, ROBOT).unwrap());
    let found = calibrate(&runs, errors.factors()).unwrap();
    assert!(found.before.e_max_syst_m < 1e-9, "{found:?}");
    assert!((found.e_d.value - 1.0015).abs() < 1e-12 && (found.e_b.value - 1.02).abs() < 1e-12, "{found:?}");
}

#[test]
fn one_direction_is_refused_even_if_it_comes_home() {
    let masked = WheelErrors { e_d: 1.0015, e_b: 1.0, e_s: 1.0 };
    let run = Run::of(&driven(masked, Turning::CounterClockwise), ROBOT).unwrap();
    let error = calibrate(&[run.clone(), run], WheelFactors::NONE).unwrap_err();
    assert!(
        matches!(error, UmbmarkError::OneDirection { runs: 2, other: Turning::Clockwise, .. }),
        "{error}"
    );
    let words = error.to_string();
    assert!(words.contains("clockwise from the same start"), "{words}");
}

#[test]
fn straight_lines_give_the_scale_and_turns_on_the_spot_the_ratio_of_turning() {
    let errors = WheelErrors { e_d: 1.0, e_b: 1.02, e_s: 1.01 };
    let mut runs = both(errors);
    let straight = recording("straight", &vec![[SIDE_M, SIDE_M]], Pose2::new(1.01 * SIDE_M, 0.0, 0.0));
    runs.push(Run::of(&straight, ROBOT).unwrap());
    // One and a half turns, by odometry; truth knows headings, and not how many turns.
    let turn_m = 1.5 * std::f64::consts::PI * TRACK_M;
    let turned_rad = 3.0 * std::f64::consts::PI * 1.01 / 1.02;
    let turn = recording("turn", &vec![[-turn_m, turn_m]], Pose2::new(0.0, 0.0, turned_rad));
    runs.push(Run::of(&turn, ROBOT).unwrap());
    assert_eq!((runs[2].kind, runs[3].kind), (Kind::Straight, Kind::Turn));
    let found = calibrate(&runs, WheelFactors::NONE).unwrap();
    assert!((found.e_s.unwrap().value - 1.01).abs() < 1e-12);
    assert!((found.turn_ratio.unwrap().value - 1.01 / 1.02).abs() < 1e-9);
    assert!((found.e_b.value - 1.02).abs() < 1e-3, "{:?}", found.e_b);
    // Without the line the scale goes unseen, and the track is that of nominal wheels.
    let blind = calibrate(&runs[..2], WheelFactors::NONE).unwrap();
    assert!(blind.e_s.is_none() && (blind.e_b.value - 1.02 / 1.01).abs() < 1e-3, "{blind:?}");
}

#[test]
fn what_is_no_run_is_refused_with_place_value_and_remedy() {
    let refused = |recording: &Recording, words: &[&str]| {
        let error = Run::of(recording, ROBOT).unwrap_err().to_string();
        for word in words.iter().chain(&["recording `odd`, robot 1"]) {
            assert!(error.contains(word), "{word:?} is not in {error:?}");
        }
    };
    let home = Pose2::identity();
    refused(&recording("odd", &square(0.3, 1.0), home), &["1.20 m", "at least 2 m around"]);
    let mut twice = square(SIDE_M, 1.0);
    twice.extend(square(SIDE_M, 1.0));
    refused(&recording("odd", &twice, home), &["720 degrees", "each lap as a recording"]);
    refused(&recording("odd", &square(SIDE_M, 1.0), Pose2::new(2.5, 0.0, 0.0)), &["2.50 m", "come back"]);
    // A triangle that turns by 360 degrees.
    let third_m = std::f64::consts::PI * TRACK_M / 3.0;
    let triangle = [[SIDE_M, SIDE_M], [-third_m, third_m]].repeat(3);
    refused(&recording("odd", &triangle, home), &["found the robot at", "starts at a corner"]);
    let mut odd = recording("odd", &square(SIDE_M, 1.0), home);
    odd.robots.get_mut(&ROBOT).unwrap().truth.pop();
    refused(&odd, &["found 1 true poses", "write both rows"]);
    let mut odd = recording("odd", &square(SIDE_M, 1.0), home);
    odd.robots.get_mut(&ROBOT).unwrap().truth[0].time = Timestamp::from_seconds(3.0);
    refused(&odd, &["before the first true pose", "at standstill"]);
    let mut odd = recording("odd", &square(SIDE_M, 1.0), home);
    odd.robots.get_mut(&ROBOT).unwrap().odometry.clear();
    refused(&odd, &["0 samples of odometry", "wheel_odometry.csv"]);
    odd.nominal = None;
    refused(&odd, &["no nominal model", "track_width"]);
}

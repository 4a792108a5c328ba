//! The standard deviations that residuals declare, against the noise that is in the recording.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use common::{SIGMAS, recorded};
use pleiad_estimation::RobotId;
use pleiad_mismatch::{Channel, Evidence, command_agitation, end_to_end, models, residuals_of};
use pleiad_physics::{ActiveEffect, Effect, RobotModel, Scalar, Variable};
use pleiad_recording::Recording;

const ROBOT: RobotId = RobotId(1);

/// The declared model with the noise that was recorded.
fn model(recording: &Recording) -> RobotModel<f64> {
    let mut model = models(recording).expect("has a nominal model")[&ROBOT].clone();
    let [_, gyro, gps, heading, range, bearing] = SIGMAS;
    (model.nominal.gyro_sigma_rad_s, model.nominal.gps_sigma_m) = (gyro, gps);
    model.nominal.heading_sigma_rad = heading;
    (model.nominal.range_sigma_m, model.nominal.bearing_sigma_rad) = (range, bearing);
    model
}

#[test]
fn residuals_of_a_clean_recording_are_one_sigma_in_size() {
    let recording = recorded(None);
    let model = model(&recording);
    let evidence = Evidence::new(&recording, &[(ROBOT, model.clone())].into());
    for channel in
        [Channel::Gyro, Channel::Gps, Channel::Heading, Channel::RangeToLandmark, Channel::BearingToLandmark]
    {
        let own = residuals_of(&evidence, ROBOT, &model, channel);
        let mut squares = Vec::new();
        for row in &own.rows {
            squares
                .extend(row.values().iter().zip(row.sigmas()).map(|(value, sigma)| (value / sigma).powi(2)));
        }
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        // Of n squares of normal numbers the mean is 1 within sqrt(2/n); truth adds a millimetre and a
        // milliradian, up to a hundredth of the square of the bearing noise.
        let allowed = 4.0 * (2.0 / squares.len() as f64).sqrt() + 0.02;
        assert!((mean - 1.0).abs() < allowed, "{channel}: {mean} of {}", squares.len());
    }
    let body = residuals_of(&evidence, ROBOT, &model, Channel::Body);
    assert!(body.rows.iter().all(|row| row.sigmas() == [1.0; 3]), "to be estimated");
}

#[test]
fn effects_of_variance_have_a_slope_where_they_are_off() {
    let recording = recorded(None);
    let model = model(&recording);
    let evidence = Evidence::new(&recording, &[(ROBOT, model.clone())].into());
    let with = model
        .with(ActiveEffect::off(Effect::MotionBlur))
        .with(ActiveEffect::off(Effect::RangeDependentNoise))
        .differentiated(&[(0, 0), (1, 1)].map(|(index, parameter)| Variable::Effect { index, parameter }));
    let bearings = residuals_of(&evidence, ROBOT, &with, Channel::BearingToLandmark);
    for row in &bearings.rows {
        let [by_blur, by_range] = row.sigmas()[0].derivatives();
        assert!((by_blur - row.regime.yaw_rate_rad_s.abs()).abs() < 1e-12 && *by_range == 0.0, "{row:?}");
    }
    let ranges = residuals_of(&evidence, ROBOT, &with, Channel::RangeToLandmark);
    assert!(ranges.rows.len() > 1000);
    for row in &ranges.rows {
        let pose = row.regime.pose.expect("placed by truth");
        // The landmarks are 7 at (3, 2) and 8 at (-4, 1).
        let [x, y] = if row.target.map(|target| format!("{target:?}")).is_some_and(|name| name.contains('7'))
        {
            [3.0, 2.0]
        } else {
            [-4.0, 1.0]
        };
        let range = (x - pose.x_m).hypot(y - pose.y_m);
        assert!((row.sigmas()[0].derivatives()[1] - range).abs() < 1e-9, "{row:?} {range}");
    }
}

#[test]
fn a_walking_bias_gains_variance_with_the_time_since_the_first_reading() {
    let recording = recorded(None);
    let model = model(&recording);
    let evidence = Evidence::new(&recording, &[(ROBOT, model.clone())].into());
    let walk = ActiveEffect::new(Effect::GyroRandomWalk, &[0.001]).expect("a number");
    let still = residuals_of(&evidence, ROBOT, &model, Channel::Gyro);
    let walking = residuals_of(&evidence, ROBOT, &model.with(walk), Channel::Gyro);
    for (still, walking) in still.rows.iter().zip(&walking.rows) {
        let gained = walking.sigmas()[0].square() - still.sigmas()[0].square();
        // The first reading is at 7 ms.
        assert!((gained - 1e-6 * (still.time_s - 0.007)).abs() < 1e-12, "{gained}");
    }
}

/// The turning that a model misses in the window about an instant, with one command moved in time.
fn turned(recording: &Recording, command: usize, later_s: f64, about_s: f64) -> [f64; 2] {
    let mut moved = recording.clone();
    let own = moved.robots.get_mut(&ROBOT).expect("recorded");
    own.commands[command].time = own.commands[command].time.plus_seconds(later_s);
    let model = model(recording).with(ActiveEffect::new(Effect::CommandDelay, &[0.07]).expect("a number"));
    let evidence = Evidence::new(&moved, &[(ROBOT, model.clone())].into());
    let found = residuals_of(&evidence, ROBOT, &model, Channel::Actuator);
    let row = found.rows.iter().find(|row| (row.time_s - about_s).abs() < 0.05).expect("a window");
    [row.values()[0], row.values()[1]]
}

#[test]
fn a_window_is_agitated_by_what_it_changes_with_the_stamp_of_each_command() {
    let recording = recorded(None);
    let model = model(&recording).with(ActiveEffect::new(Effect::CommandDelay, &[0.07]).expect("a number"));
    let evidence = Evidence::new(&recording, &[(ROBOT, model.clone())].into());
    let found = residuals_of(&evidence, ROBOT, &model, Channel::Actuator);
    let commands = &recording.robots[&ROBOT].commands;
    let agitation = command_agitation(&evidence, ROBOT, &model);
    assert_eq!(agitation.len(), found.rows.len());
    for (row, agitation) in found.rows.iter().zip(agitation).skip(40).step_by(230) {
        let mut expected = [0.0; 2];
        for (index, command) in commands.iter().enumerate() {
            // The window is 0.2 s long and the servo forgets in 0.25 s.
            if !(-0.5..0.1).contains(&(command.time.seconds() - row.time_s)) {
                continue;
            }
            let h = 1e-4;
            let [late, early] = [h, -h].map(|later_s| turned(&recording, index, later_s, row.time_s));
            for part in 0..2 {
                expected[part] += ((late[part] - early[part]) / (2.0 * h)).powi(2);
            }
        }
        for (found, expected) in agitation.iter().zip(expected) {
            assert!((found - expected).abs() < 0.01 * expected, "{row:?} {expected}");
        }
    }
}

#[test]
fn from_end_to_end_a_clean_robot_is_predicted_by_its_commands() {
    let recording = recorded(None);
    let model = model(&recording);
    let evidence = Evidence::new(&recording, &[(ROBOT, model.clone())].into());
    let found = end_to_end(&evidence, ROBOT, &model);
    assert!(found.rows.len() >= 118, "{:?}", found.omissions);
    // Two truth samples of a millimetre and a milliradian, and the heading of one over up to 0.7 m.
    let mean_square =
        found.rows.iter().map(|row| row.values()[1].powi(2)).sum::<f64>() / found.rows.len() as f64;
    assert!(mean_square.sqrt() < 1.3 * SIGMAS[0] * (2.0_f64 + 0.5).sqrt(), "{}", mean_square.sqrt());
    let stages = residuals_of(&evidence, ROBOT, &model, Channel::CommandedBody);
    assert!(stages.rows.is_empty() && !stages.omissions.is_empty(), "encoders are there: stage by stage");
}

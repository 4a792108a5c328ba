//! The published recordings under their declared nominal models. Runs with `--features recordings` and
//! the environment variable `PLEIAD_RECORDINGS` naming the folder that holds `physics-engine/` and `mrclam/`.
//!
//! Expected values are those of `TABLE.md` beside the recordings, made by the engine that made them, and for
//! MRCLAM those of a fit outside of this project.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use std::path::PathBuf;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{
    Channel, Evidence, MismatchError, RobotComparison, Summary, compare, models, residuals_of,
};
use pleiad_physics::{ActiveEffect, Effect, RobotModel};
use pleiad_recording::{ReadOptions, Recording, open};

fn read(name: &str) -> Recording {
    let root = std::env::var_os("PLEIAD_RECORDINGS")
        .expect("set PLEIAD_RECORDINGS to the folder with physics-engine/ and mrclam/");
    let folder = PathBuf::from(root).join(name);
    open(&folder, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")).0
}

fn compared(name: &str) -> Vec<RobotComparison> {
    compare(&read(&format!("physics-engine/{name}"))).unwrap_or_else(|error| panic!("{error}"))
}

fn summary(robots: &[RobotComparison], robot: u32, channel: Channel, component: usize) -> Option<Summary> {
    let own = robots.iter().find(|own| own.robot == RobotId(robot))?;
    own.channel(channel)?.summary.as_ref().map(|components| components[component])
}

#[test]
fn a_misaligned_sensor_is_in_the_bearings_of_its_robot_alone() {
    let robots = compared("p03_blind");
    let bearing = |robot| summary(&robots, robot, Channel::BearingToLandmark, 0).expect("sees landmarks");
    let misaligned = bearing(2);
    assert!((misaligned.mean + 0.045).abs() < 0.001, "{misaligned:?}");
    assert!((misaligned.rms - 0.04634).abs() < 0.0003, "{misaligned:?}");
    for robot in [1, 3] {
        assert!(bearing(robot).mean.abs() < 0.001, "robot {robot}: {:?}", bearing(robot));
    }
    for robot in 1..=3 {
        let range = summary(&robots, robot, Channel::RangeToLandmark, 0).expect("sees landmarks");
        assert!(range.mean.abs() < 4.0 * 0.025 / (range.count as f64).sqrt(), "robot {robot}: {range:?}");
    }
}

#[test]
fn clean_robots_follow_their_encoders_to_a_millimetre_and_a_milliradian() {
    let robots = compared("p01_clean");
    for robot in 1..=3 {
        for component in 0..3 {
            let body = summary(&robots, robot, Channel::Body, component).expect("has truth");
            // Two truth samples of 1 mm or 1 mrad make 0.0014; the declared floor adds up to 0.0015.
            assert!((0.001..0.0021).contains(&body.rms), "robot {robot}: {body:?}");
            assert!(body.mean.abs() < 4.0 * body.rms / (body.count as f64).sqrt(), "robot {robot}: {body:?}");
        }
    }
}

#[test]
fn three_effects_show_in_three_channels_of_three_robots() {
    let robots = compared("p07_multi");
    let of = |robot, channel, component| summary(&robots, robot, channel, component).expect("recorded");
    assert!((of(1, Channel::Body, 2).rms - 0.01714).abs() < 0.0005);
    assert!((of(2, Channel::Actuator, 0).rms - 0.08752).abs() < 0.0005);
    assert!(of(3, Channel::Body, 2).rms < 0.002 && of(3, Channel::Actuator, 0).rms < 0.002);
    let gps = [of(3, Channel::Gps, 0), of(3, Channel::Gps, 1)];
    assert!((gps[0].mean - 0.22).abs() < 0.008 && (gps[1].mean + 0.10).abs() < 0.008, "{gps:?}");
    assert!(summary(&robots, 2, Channel::Gps, 0).is_none());
}

/// Windows, the total of lag and delay in seconds that leaves the least yaw, and the share by which the robot
/// then turns more than commanded.
fn lateness_and_turn(evidence: &Evidence<'_>, robot: RobotId, model: &RobotModel<f64>) -> (usize, f64, f64) {
    let mut best = (f64::INFINITY, 0, 0.0, 0.0);
    let steps = [0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3];
    for (lag, delay) in steps.into_iter().flat_map(|lag| steps.map(|delay| (lag, delay))) {
        let late = [(Effect::ActuatorLag, lag), (Effect::CommandDelay, delay)];
        let model = late.into_iter().fold(model.clone(), |model, (effect, seconds)| {
            model.with(ActiveEffect::new(effect, &[seconds]).expect("one parameter"))
        });
        let found = residuals_of(evidence, robot, &model, Channel::CommandedBody);
        // A tenth less of the commanded turns leaves a tenth of the predicted yaw.
        let less = ActiveEffect::new(Effect::ActuatorGain, &[0.0, -0.1]).expect("two parameters");
        let slower = residuals_of(evidence, robot, &model.with(less), Channel::CommandedBody);
        let (mut left, mut product, mut square) = (0.0, 0.0, 0.0);
        for (row, slower) in found.rows.iter().zip(&slower.rows) {
            let yaw = row.values()[2];
            let predicted = (slower.values()[2] - yaw) / 0.1;
            left += yaw.abs();
            product += yaw * predicted;
            square += predicted * predicted;
        }
        if left < best.0 {
            best = (left, found.rows.len(), lag + delay, product / square);
        }
    }
    (best.1, best.2, best.3)
}

#[test]
fn robots_without_encoders_turn_late_and_less_than_commanded() {
    let recording = read("mrclam/MRCLAM_Dataset6");
    let models = models(&recording).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(models.len(), 5);
    let evidence = Evidence::new(&recording, &models);
    for (&robot, model) in &models {
        let (windows, late_s, turn) = lateness_and_turn(&evidence, robot, model);
        // 884 to 888 s of commands, of robot 1 772 s with truth; gaps of the commands cost the rest.
        assert!((650..885).contains(&windows), "robot {robot}: {windows} windows");
        // The outside fit: 0.15 to 0.30 s in total, turn scale -2 to -8 %.
        assert!((0.149..0.301).contains(&late_s), "robot {robot}: {late_s} s");
        assert!((-0.08..-0.02).contains(&turn), "robot {robot}: {turn}");
        for channel in [Channel::BearingToLandmark, Channel::BearingToRobot] {
            let bearings = residuals_of(&evidence, robot, model, channel);
            let mut sizes: Vec<f64> = bearings.rows.iter().map(|row| row.values()[0].abs()).collect();
            sizes.sort_by(f64::total_cmp);
            // A wrong pose or association would be tenths of a radian off.
            assert!(sizes.len() > 250 && sizes[sizes.len() / 2] < 0.03, "robot {robot}, {channel}");
        }
    }
}

#[test]
fn wheels_whose_geometry_nobody_declares_are_refused() {
    let mut recording = read("physics-engine/p01_clean");
    recording.nominal = None;
    let error = compare(&recording).expect_err("nothing to predict with");
    assert_eq!(error, MismatchError::NoNominal { recording: "p01_clean".to_owned() });
}

//! The published recordings under their declared nominal models. Runs with `--features recordings` and
//! the environment variable `PLEIAD_RECORDINGS` naming the folder that holds `physics-engine/`.
//!
//! Expected values are those of `TABLE.md` beside the recordings, made by the engine that made them.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use std::path::PathBuf;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{Channel, RobotComparison, Summary, compare};
use pleiad_recording::{ReadOptions, open};

fn compared(name: &str) -> Vec<RobotComparison> {
    let root = std::env::var_os("PLEIAD_RECORDINGS")
        .expect("set PLEIAD_RECORDINGS to the folder with physics-engine/");
    let folder = PathBuf::from(root).join("physics-engine").join(name);
    let (recording, _) = open(&folder, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    compare(&recording).unwrap_or_else(|error| panic!("{error}"))
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

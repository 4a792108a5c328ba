//! Noise of what wheels and steering read, which the body does not notice, and rear steering.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::Drive;
use pleiad_recording::RobotRecording;

use crate::{assert_standard, assert_uncorrelated, run};

const ROBOT: RobotId = RobotId(1);
const RADIUS_M: f64 = 0.08;
const RATE_HZ: f64 = 25.0;

/// A robot on a curve of 0.5 m/s and 0.4 rad/s.
fn recorded(odometry: &str, drive: &str) -> (RobotRecording, Option<Drive>) {
    let text = format!(
        "name = \"readings\"\nduration_s = 60.0\nteam_size = 1\n[defaults]\ndrive = {{ {drive} }}\n\
         [defaults.motion]\npolicy = \"script\"\nscript = [[0.5, 0.4, 40.0]]\n\
         [defaults.odometry]\nkind = \"wheels\"\n{odometry}\n"
    );
    let run = run(&text, 3);
    let drive = run.recording.nominal.as_ref().map(|nominal| nominal.robots[&ROBOT].drive);
    (run.recording.robots[&ROBOT].clone(), drive)
}

fn increments(recorded: &RobotRecording) -> Vec<[f64; 2]> {
    let angles = |reading: Reading| match reading {
        Reading::Wheels { left_rad, right_rad } => [left_rad, right_rad],
        other => panic!("{other:?}"),
    };
    let pairs = recorded.odometry.windows(2);
    pairs.map(|pair| [0, 1].map(|k| angles(pair[1].reading)[k] - angles(pair[0].reading)[k])).collect()
}

#[test]
fn wheels_turn_without_rolling_by_the_declared_law_and_the_body_does_not_notice() {
    let differential = "kind = \"differential\"";
    let (clean, _) = recorded("", differential);
    let (noisy, _) =
        recorded("wheel_noise = { left_m_per_sqrt_s = 0.01, right_m_per_sqrt_s = 0.03 }", differential);
    assert_eq!(clean.truth, noisy.truth);
    assert_eq!(clean.commands, noisy.commands);
    let pairs = increments(&clean).into_iter().zip(increments(&noisy));
    let scaled: Vec<[f64; 2]> = pairs
        .filter(|(clean, _)| clean[0] != 0.0)
        .map(|(clean, noisy)| {
            let idle = |k: usize, sigma: f64| (noisy[k] - clean[k]) * RADIUS_M / (sigma / RATE_HZ.sqrt());
            [idle(0, 0.01), idle(1, 0.03)]
        })
        .collect();
    assert_standard("left wheel", &scaled.iter().map(|own| own[0]).collect::<Vec<_>>());
    assert_standard("right wheel", &scaled.iter().map(|own| own[1]).collect::<Vec<_>>());
    assert_uncorrelated("left and right", scaled.iter().map(|own| (own[0], own[1])));
    // From 41 s on it stands, and its wheels with it.
    let last = noisy.odometry[noisy.odometry.len() - 1].reading;
    assert_eq!(noisy.odometry[noisy.odometry.len() - 300].reading, last);
}

#[test]
fn a_rear_steered_car_drives_the_same_curve_with_its_wheels_the_other_way() {
    let car = "kind = \"car_like\", wheelbase_m = 0.5";
    let (front, _) = recorded("", car);
    let (rear, drive) = recorded("", &format!("{car}, rear_steering = true"));
    assert_eq!(front.truth, rear.truth);
    assert_eq!(drive, Some(Drive::CarLike { wheelbase_m: -0.5 }));
    for (front, rear) in front.steer.iter().zip(&rear.steer) {
        assert!((front.angle_rad + rear.angle_rad).abs() < 1e-12);
    }
    let steady = front.steer[500].angle_rad;
    assert!((steady - (0.4_f64 * 0.5 / 0.5).atan()).abs() < 1e-9, "{steady}");
}

#[test]
fn steering_angles_are_read_with_their_noise() {
    let car = "kind = \"car_like\"";
    let (clean, _) = recorded("", car);
    let (noisy, _) = recorded("", &format!("{car}, steer_sigma_rad = 0.02"));
    assert_eq!(clean.truth, noisy.truth);
    let pairs = clean.steer.iter().zip(&noisy.steer);
    let scaled: Vec<f64> = pairs.map(|(clean, noisy)| (noisy.angle_rad - clean.angle_rad) / 0.02).collect();
    assert_standard("steering", &scaled);
}

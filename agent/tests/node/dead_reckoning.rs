//! Dead reckoning from every kind of odometry against the closed form of the motion.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

use pleiad_agent::{AgentConfig, Node};
use pleiad_estimation::Pose2;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_protocol::Estimate;

use crate::support::{
    FORWARD_M_S, YAW_RATE_RAD_S, agent, assert_pose, circle, feed, node_of, on_circle, sample, start,
    velocity,
};

const RADIUS_M: f64 = 0.06;
const TRACK_M: f64 = 0.35;

fn with_wheels() -> AgentConfig {
    let mut config = agent(1);
    config.motion.wheel_radius_m = Some(RADIUS_M);
    config.motion.track_width_m = Some(TRACK_M);
    config
}

fn wheels(time_s: f64, rates: [f64; 2]) -> Sample {
    // Wheel angles are cumulative and begin anywhere.
    let [left, right] = rates.map(|rate| 17.0 + rate * time_s);
    sample(time_s, Reading::Wheels { left_rad: left, right_rad: right })
}

/// Feeds odometry and checks `odom_from_robot` of every estimate against the closed form at its time.
fn check(node: &mut Node, samples: impl IntoIterator<Item = Sample>, expected: impl Fn(f64) -> Pose2) {
    let mut seen: Vec<Estimate> = Vec::new();
    for sample in samples {
        let handled = feed(node, sample);
        assert!(handled.notices.is_empty(), "{:?}", handled.notices);
        seen.extend(handled.estimates);
    }
    assert!(seen.len() > 3);
    for estimate in &seen {
        // Composing a few hundred steps costs a few hundred roundings.
        assert_pose(&estimate.odom_from_robot, &expected(estimate.time.seconds()), 1e-12);
        // Without a measurement after the prior the map frame is that of the odometry.
        assert_pose(&estimate.map_from_robot, &estimate.odom_from_robot, 1e-12);
    }
}

fn ticks(count: u32, step: f64) -> impl Iterator<Item = f64> {
    (0..=count).map(move |k| f64::from(k) * step)
}

#[test]
fn a_constant_velocity_is_a_circle() {
    let mut node = node_of(&agent(1), 1);
    check(&mut node, ticks(200, 0.05).map(velocity), |t| on_circle(start(), t));
}

#[test]
fn uneven_stamps_change_nothing() {
    let mut node = node_of(&agent(1), 1);
    let times = [0.0, 0.3, 0.31, 1.9, 2.0, 3.7, 3.700_001, 5.0];
    check(&mut node, times.map(velocity), |t| on_circle(start(), t));
}

#[test]
fn a_velocity_holds_from_its_stamp_to_the_next() {
    let mut node = node_of(&agent(1), 1);
    let reading = |forward_m_s| Reading::Velocity { forward_m_s, yaw_rate_rad_s: 0.0 };
    let samples = [(0.0, 1.0), (1.0, 0.5), (2.0, 0.0), (3.0, 9.0)].map(|(t, v)| sample(t, reading(v)));
    // A metre in the first second, half in the next, none after.
    let along = |t: f64| t.min(1.0) + 0.5 * (t - 1.0).clamp(0.0, 1.0);
    check(&mut node, samples, |t| start().compose(&Pose2::new(along(t), 0.0, 0.0)));
}

#[test]
fn wheel_angles_at_constant_rates_are_a_circle() {
    let (left, right) = (9.0, 14.0);
    let (v, w) = (RADIUS_M * (left + right) / 2.0, RADIUS_M * (right - left) / TRACK_M);
    let mut node = node_of(&with_wheels(), 1);
    check(&mut node, ticks(100, 0.05).map(|t| wheels(t, [left, right])), |t| circle(start(), v, w, t));
}

#[test]
fn four_increments_around_a_square_come_back() {
    let mut node = node_of(&agent(1), 1);
    let corner = Pose2::new(1.0, 0.0, FRAC_PI_2);
    let samples = ticks(4, 1.0).map(|t| sample(t, Reading::Increment(corner)));
    // The first one is motion from before the boot.
    check(&mut node, samples, |t| {
        // Each corner is the one before turned by 90 degrees about the centre.
        let angle = FRAC_PI_2 * t - 3.0 * FRAC_PI_4;
        let (x, y) = (0.5 + angle.cos() / SQRT_2, 0.5 + angle.sin() / SQRT_2);
        start().compose(&Pose2::new(x, y, FRAC_PI_2 * t))
    });
}

#[test]
fn yaw_from_the_gyro_replaces_that_of_the_odometry_and_its_bias_is_subtracted() {
    let bias = 0.03;
    let mut config = agent(1);
    config.motion.yaw_source = pleiad_agent::config::YawName::Gyro;
    config.motion.gyro_bias_rad_s = bias;
    let mut node = node_of(&config, 1);
    let gyro = |t| sample(t, Reading::Gyro { yaw_rate_rad_s: YAW_RATE_RAD_S + bias });
    let straight = |t| sample(t, Reading::Velocity { forward_m_s: FORWARD_M_S, yaw_rate_rad_s: 0.0 });
    let samples = ticks(100, 0.05).flat_map(|t| [gyro(t), straight(t)]);
    check(&mut node, samples, |t| on_circle(start(), t));
}

#[test]
fn a_gyro_beside_odometry_yaw_changes_nothing() {
    let mut node = node_of(&agent(1), 1);
    let gyro = |t| sample(t, Reading::Gyro { yaw_rate_rad_s: 3.0 });
    check(&mut node, ticks(100, 0.05).flat_map(|t| [gyro(t), velocity(t)]), |t| on_circle(start(), t));
}

#[test]
fn the_distance_is_the_length_of_the_arc() {
    let mut node = node_of(&agent(1), 1);
    for t in ticks(200, 0.05) {
        feed(&mut node, velocity(t));
    }
    assert!((node.distance_m() - FORWARD_M_S * 10.0).abs() < 1e-11);
}

#[test]
fn sigma_of_a_straight_drive_grows_with_the_root_of_time() {
    // Straight along x from a certain heading: forward q_x t, sideways q_yaw v^2 t^3 / 3 from the heading's walk,
    // yaw q_yaw t. Steps of h with the noise at their end sum v^2 h^3 q k^2 over k < n.
    let (qx, qyaw, v, h, n) = (0.02f64, 0.01f64, 0.7, 0.1, 50u32);
    let mut config = agent(1);
    let prior = config.prior.as_mut().unwrap();
    (prior.heading_rad, prior.sigma_position_m, prior.sigma_heading_rad) = (0.0, 1e-6, 1e-6);
    config.motion.forward_m_per_sqrt_s = qx;
    config.motion.yaw_rad_per_sqrt_s = qyaw;
    let mut node = node_of(&config, 1);
    let mut last = None;
    for t in ticks(n, h) {
        let reading = Reading::Velocity { forward_m_s: v, yaw_rate_rad_s: 0.0 };
        last = feed(&mut node, sample(t, reading)).estimates.pop();
    }
    let t = f64::from(n) * h;
    let squares: u32 = (0..n).map(|k| k * k).sum();
    let sideways = (qyaw * v * h).powi(2) * h * f64::from(squares);
    let expected = [qx * t.sqrt(), sideways.sqrt(), qyaw * t.sqrt()];
    for (found, expected) in last.unwrap().sigma.into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-8, "found {found}, expected {expected}");
    }
}

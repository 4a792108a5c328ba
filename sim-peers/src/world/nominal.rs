//! What the nominal simulation believes of a simulated team: the settings themselves, but for what they
//! declare otherwise.

use std::collections::BTreeMap;

use pleiad_recording::{Nominal, NominalNoise, NominalRangeSensor, NominalRobot};

use crate::Scenario;
use crate::scenario::{OdometryKind, RelativeSensor, RobotSettings};

/// The nominal of a scenario. Noises and the range sensor are stated once for the team: where robots
/// differ, the largest noise and the widest sensor among those that have the channel.
pub(super) fn nominal(scenario: &Scenario) -> Nominal {
    let greatest = |has: fn(&RobotSettings) -> f64, value: fn(&RobotSettings) -> f64| {
        scenario.robots.values().filter(|settings| has(settings) > 0.0).map(value).fold(0.0, f64::max)
    };
    let seeing: fn(&RobotSettings) -> f64 = |robot| robot.relative.rate_hz;
    let noise = NominalNoise {
        gyro_sigma_rad_s: greatest(|robot| robot.gyro.rate_hz, |robot| robot.gyro.sigma_rad_s),
        gps_sigma_m: greatest(|robot| robot.gps.rate_hz, |robot| robot.gps.sigma_m),
        heading_sigma_rad: greatest(|robot| robot.heading.rate_hz, |robot| robot.heading.sigma_rad),
        range_sigma_m: greatest(seeing, |robot| robot.relative.sigma_range_m),
        bearing_sigma_rad: greatest(seeing, |robot| robot.relative.sigma_bearing_rad),
        truth_sigma_m: scenario.truth_sigma_m,
        truth_sigma_rad: scenario.truth_sigma_rad,
        command_jitter_s: greatest(|_| 1.0, |robot| robot.command_jitter_s),
        odometry_floor_pos_sigma_m_per_1s: greatest(|_| 1.0, |robot| one_second(robot)[0]),
        odometry_floor_heading_sigma_rad_per_1s: greatest(|_| 1.0, |robot| one_second(robot)[2]),
        ..NominalNoise::default()
    };
    // Where nobody has one, some sensor is declared all the same: the format knows no absence.
    let absent = RelativeSensor::default();
    let mut sensors: Vec<&RelativeSensor> =
        scenario.robots.values().filter(|robot| seeing(robot) > 0.0).map(|robot| &robot.relative).collect();
    if sensors.is_empty() {
        sensors.push(&absent);
    }
    let widest = |value: fn(&RelativeSensor) -> f64| sensors.iter().map(|own| value(own)).fold(0.0, f64::max);
    let range_sensor = NominalRangeSensor {
        max_range_m: widest(|sensor| sensor.max_range_m),
        min_range_m: sensors.iter().map(|sensor| sensor.min_range_m).fold(f64::INFINITY, f64::min),
        half_fov_rad: widest(|sensor| sensor.half_fov_rad),
        detection_probability: widest(|sensor| 1.0 - sensor.drop_out),
        range_scale: 1.0,
        ..NominalRangeSensor::default()
    };
    let declared = |settings: &RobotSettings| {
        let mut nominal = true_nominal(settings);
        settings.declared.apply(&mut nominal);
        nominal
    };
    let robots = scenario.robots.iter().map(|(robot, settings)| (*robot, declared(settings))).collect();
    Nominal { noise, range_sensor, robots }
}

/// Standard deviations over one second of driving at cruising speed and full turn.
fn one_second(robot: &RobotSettings) -> [f64; 3] {
    let motion = &robot.motion;
    let white = robot.odometry.noise.variance(motion.speed_m_s, motion.max_yaw_rate_rad_s, 1.0);
    let lasting = robot.odometry.lasting.variance(1.0);
    [0, 1, 2].map(|axis| (white[axis] + lasting[axis]).sqrt())
}

/// What would be declared of a robot if nothing were mis-tuned.
pub(crate) fn true_nominal(robot: &RobotSettings) -> NominalRobot {
    let odometry = match robot.odometry.kind {
        OdometryKind::Wheels => "wheel_odometry_rate_hz",
        OdometryKind::Velocity | OdometryKind::Increment => "odometry_rate_hz",
    };
    let rates_hz = BTreeMap::from(
        [
            ("command_rate_hz", robot.command_rate_hz),
            (odometry, robot.odometry.rate_hz),
            ("gyro_rate_hz", robot.gyro.rate_hz),
            ("gps_rate_hz", robot.gps.rate_hz),
            ("heading_rate_hz", robot.heading.rate_hz),
            ("relative_rate_hz", robot.relative.rate_hz),
        ]
        .map(|(key, rate_hz)| (key.to_owned(), rate_hz)),
    );
    NominalRobot {
        wheel_radius: robot.wheel_radius_m,
        track_width: robot.track_width_m,
        encoder_ticks_per_rev: f64::from(robot.encoder_ticks_per_rev),
        servo_time_constant_s: robot.servo_time_constant_s,
        servo_time_constant_turn_s: robot.servo_time_constant_turn_s,
        // The mean of a delay that is uniform from zero.
        command_latency_s: 0.5 * robot.command_jitter_s,
        gyro_bias_rad_s: robot.gyro.bias_rad_s,
        gyro_scale: 1.0,
        rates_hz,
        drive: robot.drive.drive(),
        ..NominalRobot::default()
    }
}

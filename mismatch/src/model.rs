//! The model that predicts, from what a recording declares.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_physics::{Drive, Nominal, RobotModel};
use pleiad_recording::{NominalNoise, NominalRangeSensor, NominalRobot, Recording};

use crate::error::MismatchError;

/// The declared parameters of one robot as a model on which no effect acts.
pub fn nominal_model(
    robot: &NominalRobot,
    sensor: &NominalRangeSensor,
    noise: &NominalNoise,
) -> RobotModel<f64> {
    let nominal = Nominal {
        wheel_radius: robot.wheel_radius,
        track_width: robot.track_width,
        encoder_ticks_per_rev: robot.encoder_ticks_per_rev,
        servo_time_constant_s: robot.servo_time_constant_s,
        servo_time_constant_turn_s: robot.servo_time_constant_turn_s,
        command_latency_s: robot.command_latency_s,
        gyro_bias_rad_s: robot.gyro_bias_rad_s,
        gyro_scale: robot.gyro_scale,
        gps_mount_x_m: robot.gps_mount_x_m,
        gps_mount_y_m: robot.gps_mount_y_m,
        gps_latency_s: robot.gps_latency_s,
        clock_offset_s: robot.clock_offset_s,
        clock_drift_ppm: robot.clock_drift_ppm,
        range_bias_m: robot.range_bias_m,
        sensor_mount_x_m: sensor.mount_x_m,
        sensor_mount_y_m: sensor.mount_y_m,
        sensor_mount_yaw_rad: sensor.mount_yaw_rad,
        sensor_latency_s: sensor.latency_s,
        range_scale: sensor.range_scale,
        detection_probability: sensor.detection_probability,
        gyro_sigma_rad_s: noise.gyro_sigma_rad_s,
        gps_sigma_m: noise.gps_sigma_m,
        heading_sigma_rad: noise.heading_sigma_rad,
        range_sigma_m: noise.range_sigma_m,
        bearing_sigma_rad: noise.bearing_sigma_rad,
    };
    RobotModel::nominal(Drive::Differential, nominal)
}

/// The nominal model of every robot that recorded.
///
/// # Errors
/// The recording has no nominal model, or it lacks a robot.
pub fn nominal_models(recording: &Recording) -> Result<BTreeMap<RobotId, RobotModel<f64>>, MismatchError> {
    let name = || recording.name.clone();
    let nominal = recording.nominal.as_ref().ok_or_else(|| MismatchError::NoNominal { recording: name() })?;
    let model = |&robot: &RobotId| {
        let declared = nominal
            .robots
            .get(&robot)
            .ok_or_else(|| MismatchError::NoNominalRobot { recording: name(), robot })?;
        Ok((robot, nominal_model(declared, &nominal.range_sensor, &nominal.noise)))
    };
    recording.robots.keys().map(model).collect()
}

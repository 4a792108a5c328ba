//! From what a file declares of a robot to a physical model of it.

use std::path::Path;

use pleiad_estimation::{RobotId, Timestamp};
use pleiad_physics::{Nominal as Parameters, RobotModel};

use crate::error::RecordingError;
use crate::folder::write_whole;
use crate::nominal::{nominal_text, read_nominal};
use crate::types::{Nominal, NominalNoise, NominalRangeSensor, NominalRobot};

/// Stamps beyond this, seconds, count from an epoch elsewhere (three years after zero), not from the start.
const FOREIGN_EPOCH_S: f64 = 1e8;

/// From when times in effects count (onsets, drifts, warming up), given the first stamp of a recording or of a
/// robot: from zero, or, where stamps count from a foreign epoch as Unix time does, from the whole second of the
/// first.
pub fn effect_epoch(first: Timestamp) -> Timestamp {
    let first_s = first.seconds();
    if first_s > FOREIGN_EPOCH_S { Timestamp::from_seconds(first_s.floor()) } else { Timestamp(0) }
}

/// The model of one robot: its declared parameters, drive and effects.
pub fn nominal_model(
    robot: &NominalRobot,
    sensor: &NominalRangeSensor,
    noise: &NominalNoise,
) -> RobotModel<f64> {
    let nominal = Parameters {
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
    let effects = robot.effects.iter().map(|declared| declared.active).collect();
    RobotModel { drive: robot.drive, nominal, effects }
}

impl Nominal {
    /// The model of a robot; `None` if there is none of it.
    pub fn model(&self, robot: RobotId) -> Option<RobotModel<f64>> {
        Some(nominal_model(self.robots.get(&robot)?, &self.range_sensor, &self.noise))
    }
}

/// Reads a model on its own: a `nominal.toml` or a `corrected.toml`, wherever it is. What was not read or
/// taken as ideal is named in `warnings`.
///
/// # Errors
/// As [`read_nominal`]; there is no such file.
pub fn read_model(path: &Path, warnings: &mut Vec<String>) -> Result<Nominal, RecordingError> {
    read_nominal(path, warnings)?.ok_or_else(|| RecordingError::MissingFile {
        path: path.to_path_buf(),
        needed_for: "it was named as the model of the robots".to_owned(),
        remedy: "name a file such as nominal.toml or corrected.toml",
    })
}

/// Writes a model on its own, whole or not at all. `comment` becomes its first lines.
///
/// # Errors
/// A value is outside its range, or the file system refuses.
pub fn write_model(path: &Path, model: &Nominal, comment: &str) -> Result<(), RecordingError> {
    let text = nominal_text(model, comment, None).map_err(|reason| RecordingError::Unwritable { reason })?;
    write_whole(path, &text)
}

//! The model that predicts: what a recording declares, or else what its kind of odometry implies.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::{Drive, Nominal, RobotModel};
use pleiad_recording::{Recording, RobotRecording};

use crate::error::MismatchError;
use crate::model::nominal_models;

/// Range noise of a camera that reads barcodes, metres: the order of what MRCLAM robots have. Levels are
/// estimated from the residuals; this one only begins.
const RANGE_SIGMA_M: f64 = 0.1;
/// Its bearing noise, radians.
const BEARING_SIGMA_RAD: f64 = 0.04;
/// Radius of the wheels of an iRobot Create, the robot of MRCLAM, metres.
const WHEEL_RADIUS_M: f64 = 0.033;
/// Distance between them, metres: 258 mm in its Open Interface.
const TRACK_WIDTH_M: f64 = 0.258;

/// The model of every robot that recorded: by `nominal.toml`, or without one, where odometry is velocity
/// commands, the unicycle that does at once what it is told.
///
/// # Errors
/// There is no nominal model and odometry of another kind, or the nominal model lacks a robot.
pub fn models(recording: &Recording) -> Result<BTreeMap<RobotId, RobotModel<f64>>, MismatchError> {
    let commanded = !recording.robots.is_empty() && recording.robots.values().all(is_commanded);
    if recording.nominal.is_some() || !commanded {
        return nominal_models(recording);
    }
    Ok(recording.robots.keys().map(|&robot| (robot, unicycle())).collect())
}

fn is_commanded(robot: &RobotRecording) -> bool {
    let velocity = |reading: &Reading| matches!(reading, Reading::Velocity { .. });
    !robot.odometry.is_empty() && robot.odometry.iter().all(|sample| velocity(&sample.reading))
}

/// From commands to the body the wheels' geometry cancels. What acts on a wheel alone, such as a limit of its
/// speed, does not: it needs a geometry like the robot's, or effects are tried that no robot could show.
fn unicycle() -> RobotModel<f64> {
    let mut nominal = Nominal::ideal(WHEEL_RADIUS_M, TRACK_WIDTH_M);
    nominal.range_sigma_m = RANGE_SIGMA_M;
    nominal.bearing_sigma_rad = BEARING_SIGMA_RAD;
    RobotModel::nominal(Drive::Differential, nominal)
}

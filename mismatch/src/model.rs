//! The model that predicts, from what a recording declares.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_physics::RobotModel;
use pleiad_recording::Recording;
pub use pleiad_recording::nominal_model;

use crate::error::MismatchError;

/// The nominal model of every robot that recorded, with the effects that it declares.
///
/// # Errors
/// The recording has no nominal model, or it lacks a robot.
pub fn nominal_models(recording: &Recording) -> Result<BTreeMap<RobotId, RobotModel<f64>>, MismatchError> {
    let name = || recording.name.clone();
    let nominal = recording.nominal.as_ref().ok_or_else(|| MismatchError::NoNominal { recording: name() })?;
    let model = |&robot: &RobotId| {
        let model = nominal.model(robot);
        Ok((robot, model.ok_or_else(|| MismatchError::NoNominalRobot { recording: name(), robot })?))
    };
    recording.robots.keys().map(model).collect()
}

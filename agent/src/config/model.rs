//! The model of a robot, from the file that the configuration names.

use pleiad_estimation::RobotId;
use pleiad_physics::correct::Correction;
use pleiad_physics::{Drive, Nominal};
use pleiad_recording::read_model;

use super::{AgentConfig, ConfigError, VelocityName};

/// What is taken out of a robot's readings.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotCorrection {
    /// The model against what the estimator believes in.
    pub correction: Correction,
    /// What velocity odometry is.
    pub velocity: VelocityName,
    /// What of the model is not used, for an operator to know.
    pub remarks: Vec<String>,
}

impl AgentConfig {
    /// Reads the model, if there is one.
    ///
    /// # Errors
    /// [`ConfigError::Model`], [`ConfigError::NotInModel`].
    pub fn correction(&self) -> Result<Option<RobotCorrection>, ConfigError> {
        let Some(path) = &self.model else { return Ok(None) };
        let mut remarks = Vec::new();
        let models = read_model(path, &mut remarks).map_err(|error| ConfigError::Model(Box::new(error)))?;
        let robot = self.robot;
        let model = models
            .model(RobotId(robot))
            .ok_or_else(|| ConfigError::NotInModel { path: path.clone(), robot })?;
        let ratio = match model.drive {
            Drive::SkidSteer { track_ratio } => track_ratio,
            Drive::Differential | Drive::CarLike { .. } => 1.0,
        };
        // Increments and velocities were made of wheel angles by the geometry in `[motion]`.
        let radius_m = self.motion.wheel_radius_m.unwrap_or(model.nominal.wheel_radius);
        let track_m = self.motion.track_width_m.unwrap_or(model.nominal.track_width * ratio);
        let correction = Correction::new(model, Nominal::ideal(radius_m, track_m));
        remarks.extend(correction.not_corrected().into_iter().map(|(effect, reason)| {
            format!("effect {} is not taken out of readings: {reason}", effect.name())
        }));
        Ok(Some(RobotCorrection { correction, velocity: self.motion.velocity, remarks }))
    }
}

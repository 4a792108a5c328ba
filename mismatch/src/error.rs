//! Errors of this crate.

use pleiad_estimation::RobotId;

/// A recording that cannot be compared at all.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MismatchError {
    /// The recording does not say what the nominal simulation believes.
    #[error("recording `{recording}` has no nominal model: put a nominal.toml into its folder")]
    NoNominal {
        /// Its name.
        recording: String,
    },
    /// The nominal model lacks a robot.
    #[error(
        "nominal.toml of recording `{recording}` has no section [robots.r{robot}], but the robot recorded: add it"
    )]
    NoNominalRobot {
        /// Its name.
        recording: String,
        /// The robot that is not described.
        robot: RobotId,
    },
}

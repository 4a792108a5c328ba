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
    /// Nothing is left to fit on.
    #[error("no recording to fit on: {names} {verb} all tested on; name fewer to test on, or one more recording", names = tested_on.join(", "), verb = if tested_on.len() == 1 { "is" } else { "are" })]
    NothingToFit {
        /// Those that are tested on.
        tested_on: Vec<String>,
    },
    /// A name that no recording has.
    #[error("there is no recording `{name}` among those given ({})", given.join(", "))]
    UnknownRecording {
        /// The name.
        name: String,
        /// The names there are.
        given: Vec<String>,
    },
    /// The nominal model predicts something that is no finite number.
    #[error(
        "the nominal model of recording `{recording}` predicts values that are no finite numbers: check nominal.toml"
    )]
    NotFinite {
        /// The recording.
        recording: String,
    },
    /// Nobody knows where a robot began.
    #[error(
        "without ground truth recording `{recording}` must say where robot {robot} began and how it drove: give it one true pose in truth.csv, and odometry or commands around it"
    )]
    NoStart {
        /// The recording.
        recording: String,
        /// The robot.
        robot: RobotId,
    },
}

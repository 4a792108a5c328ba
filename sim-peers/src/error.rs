//! What can be wrong with a scenario.

use std::path::PathBuf;

use pleiad_estimation::RobotId;

/// Why a scenario cannot be loaded or simulated.
///
/// `place` is `file:line` for a scenario read from a file, else the scenario's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not TOML, or a number does not fit its key.
    #[error("{place}: {message}")]
    Syntax {
        /// Where.
        place: String,
        /// What the TOML reader said.
        message: String,
    },
    /// A key that no scenario has.
    #[error(
        "{place}: unknown key `{key}`; the nearest known key is `{nearest}` (all keys: docs/scenario.md)"
    )]
    UnknownKey {
        /// Where.
        place: String,
        /// The key as written, with the tables it is in.
        key: String,
        /// The known key of the same table that is spelled most like it.
        nearest: String,
    },
    /// A value that makes no sense.
    #[error("{place}: `{key}` is {found}; expected {expected}")]
    Value {
        /// Where.
        place: String,
        /// The key, with the tables it is in.
        key: String,
        /// The value found.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// An effect that the catalogue does not have, or not so.
    #[error("{place}: `{key}`: found {found}, expected {expected}")]
    Effect {
        /// Where.
        place: String,
        /// The key, with the tables it is in.
        key: String,
        /// What was found.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// A `[[fault]]` that makes no sense.
    #[error(transparent)]
    Fault(#[from] pleiad_bus::FaultsError),
    /// Automatic placement found no free place.
    #[error(
        "no start for robot {robot} at {separation_m} m from the other robots in {attempts} attempts; \
         enlarge the arena or the robot's area, or give `start`"
    )]
    Placement {
        /// The robot without a place.
        robot: RobotId,
        /// The distance kept between starts, metres.
        separation_m: f64,
        /// How many random places were tried.
        attempts: u32,
    },
}

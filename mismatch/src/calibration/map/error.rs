//! Why a recording cannot be calibrated on.

/// A recording or options that give no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// Something is not in the recording.
    #[error("recording `{recording}`, robot {robot}: found no {missing}; {remedy}")]
    Missing {
        /// Its name.
        recording: String,
        /// The robot's number.
        robot: u32,
        /// What is missing.
        missing: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// An option out of range.
    #[error("{name} = {value}: expected {expected}")]
    Option {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// Not one stretch could be matched.
    #[error(
        "recording `{recording}`, robot {robot}: of {stretches} stretches of {length_m} m none could be matched with the map: \
         lower mu_min, and check that scans lie within the odometry, and walls.csv and the first true pose in one frame"
    )]
    NoMatch {
        /// Its name.
        recording: String,
        /// The robot's number.
        robot: u32,
        /// How many there were.
        stretches: usize,
        /// Their length, metres.
        length_m: f64,
    },
    /// A map too large for a grid.
    #[error(
        "walls.csv spans {width_m:.0} m by {height_m:.0} m: with cells of {cell_m} m that is too large a grid; raise the cell"
    )]
    TooLarge {
        /// Along x, metres.
        width_m: f64,
        /// Along y, metres.
        height_m: f64,
        /// Side of a cell, metres.
        cell_m: f64,
    },
}

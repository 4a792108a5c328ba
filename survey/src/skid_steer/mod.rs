//! A skid-steered robot indoors and outdoors: raw odometry, calibrated odometry, and a filter with a gyro, on the same
//! runs (`goel1999`, Pioneer AT).

mod calibrate;
mod drive;
mod fixes;
mod methods;
mod page;

use crate::error::SurveyError;
use crate::solo::seeds;
use crate::study::{Study, StudyOptions};

pub use calibrate::{Effective, calibrate};
pub use drive::Path;
pub use fixes::{FixOutcome, Laps, laps, short_run};
pub use methods::{Method, relative_errors};

pub(crate) const NAME: &str = "skid-steer";
/// Seeds where none are asked for.
const SEEDS: usize = 120;
/// Fewer give no interval worth printing.
const LEAST_SEEDS: usize = 10;
/// Runs on which odometry is calibrated.
const CALIBRATION_RUNS: u64 = 12;
/// Their seeds begin here, far from those of the study.
const CALIBRATION_FROM: u64 = 1 << 40;

/// Runs the study.
///
/// # Errors
/// [`SurveyError`] for too few seeds, a scenario that cannot be simulated, a measurement that cannot be used.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    page::study(&seeds(NAME, options, SEEDS, LEAST_SEEDS)?)
}

/// What odometry is calibrated to, from runs of their own.
///
/// # Errors
/// As [`calibrate`].
pub fn usual_calibration() -> Result<Effective, SurveyError> {
    calibrate(CALIBRATION_FROM, CALIBRATION_RUNS)
}

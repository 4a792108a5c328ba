//! A planetary rover: encoders, rear steering and a gyro at 50 Hz, and a slow sun sensor that alone says where the
//! rover heads (`roumeliotis1997`).

mod late;
mod page;
mod run;

use crate::error::SurveyError;
use crate::solo::seeds;
use crate::study::{Study, StudyOptions};

pub use late::{Late, late};
pub use run::{JUDGED_S, Method, Outcome, outcome};

pub(crate) const NAME: &str = "rover";
/// Seeds where none are asked for.
const SEEDS: usize = 100;
/// Fewer give no interval of a spread worth printing.
const LEAST_SEEDS: usize = 10;

/// Runs the study.
///
/// # Errors
/// [`SurveyError`] for too few seeds, a scenario that cannot be simulated, a measurement that cannot be used.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    page::study(&seeds(NAME, options, SEEDS, LEAST_SEEDS)?)
}

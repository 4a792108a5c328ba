//! Wheels and a gyro in one filter, and what the correlation of the wheels' noise is worth.
//!
//! Two encoders give `V = (R + L)/2` and `w = (R - L)/a`. Where one wheel is worse than the other, the noises of `V`
//! and `w` are correlated: `cov(V, w) = (var R - var L) / (2 a)`.

mod page;
mod run;

use crate::error::SurveyError;
use crate::solo::seeds;
use crate::study::{Study, StudyOptions};

pub use run::{Judged, Variant, Wheels, judged};

pub(crate) const NAME: &str = "gyro";
/// Seeds where none are asked for.
const SEEDS: usize = 300;
/// Fewer do not tell a consistent filter from another.
const LEAST_SEEDS: usize = 20;

/// Runs the study.
///
/// # Errors
/// [`SurveyError`] for too few seeds, a scenario that cannot be simulated, a measurement that cannot be used.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    page::study(&seeds(NAME, options, SEEDS, LEAST_SEEDS)?)
}

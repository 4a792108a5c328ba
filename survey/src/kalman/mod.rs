//! The Kalman filter itself: what it settles to, against closed forms, and whether it is as good as it says.

mod consistency;
mod page;
mod steady;

use crate::error::SurveyError;
use crate::study::{Study, StudyOptions};

pub use consistency::{Consistency, System, Told, consistency, one_run};
pub use steady::{
    AlphaBeta, ScalarWalk, Settled, kalata, settle_constant_velocity, settle_walk, vanishing_noise,
};

pub(crate) const NAME: &str = "kalman";
/// Seeds where none are asked for.
const SEEDS: usize = 400;
/// Fewer give no interval worth printing.
const LEAST_SEEDS: usize = 20;

/// Runs the study.
///
/// # Errors
/// [`SurveyError::TooFewSeeds`] below 20 seeds; [`SurveyError::Diverged`] if a filter refuses a measurement.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    let seeds = options.seeds.unwrap_or(SEEDS);
    if seeds < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: NAME, found: seeds, least: LEAST_SEEDS });
    }
    let seeds: Vec<u64> = (options.first_seed..).take(seeds).collect();
    page::study(&seeds)
}

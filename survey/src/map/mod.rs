//! Map-based maximum-likelihood calibration on a simulated robot whose odometry changes half-way: what
//! `pleiad calibrate map` shows.

mod page;
mod trial;

pub use page::followed;
pub use trial::{Trial, Window};

use pleiad_sim_peers::Scenario;

use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;
use crate::study::{Study, StudyOptions};

const NAME: &str = "map";
const SCENARIO: &str = include_str!("../../../scenarios/map_calibration.toml");
const SEEDS: usize = 20;
const LEAST_SEEDS: usize = 2;

/// The study on the ready scenario.
///
/// # Errors
/// Too few seeds.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: NAME, found: count, least: LEAST_SEEDS });
    }
    let scenario = scenario()?;
    let seeds: Vec<u64> = (options.first_seed..).take(count).collect();
    let trials = over_seeds(&seeds, |seed| Trial::run(&scenario, seed))?;
    Ok(page::study(&trials))
}

/// The ready scenario.
///
/// # Errors
/// None, unless it was changed for the worse.
pub fn scenario() -> Result<Scenario, SurveyError> {
    Scenario::from_toml(SCENARIO, "map_calibration.toml").map_err(failed)
}

fn failed(source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> SurveyError {
    SurveyError::Scenario { study: NAME, source: source.into() }
}

//! UMBmark on a simulated robot: what `pleiad calibrate umbmark --simulate` shows.

mod drive;
mod page;
mod shown;
mod trial;

use pleiad_mismatch::calibration::umbmark::WheelErrors;
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_sim_peers::Scenario;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

pub use drive::{Driven, SQUARES};
pub use shown::{angles, masked, returns, stages};
pub use trial::Trial;

use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;
use crate::study::{Study, StudyOptions};

const NAME: &str = "umbmark";
const SCENARIO: &str = include_str!("../../../scenarios/umbmark.toml");
/// So many seeds give intervals that are narrow against the bounds of the claims.
const SEEDS: usize = 40;
const LEAST_SEEDS: usize = 2;
/// Other robots: `E_d - 1`, `E_b - 1` and `E_s - 1` at random within these.
const SPREAD: [f64; 3] = [0.002, 0.03, 0.02];

/// All seeds of a scenario.
pub struct Trials {
    /// The scenario's own robot, a procedure per seed.
    pub own: Vec<Trial>,
    /// A robot drawn anew for every seed: injected, and what was found.
    pub drawn: Vec<(WheelErrors, WheelErrors)>,
}

/// The study on the ready scenario.
///
/// # Errors
/// Too few seeds.
pub fn run(options: &StudyOptions) -> Result<Study, SurveyError> {
    Ok(study(&trials(&scenario()?, options)?))
}

/// The ready scenario.
///
/// # Errors
/// None, unless it was changed for the worse.
pub fn scenario() -> Result<Scenario, SurveyError> {
    Scenario::from_toml(SCENARIO, "umbmark.toml")
        .map_err(|source| SurveyError::Scenario { study: NAME, source: Box::new(source) })
}

/// Drives the procedure with every seed.
///
/// # Errors
/// The scenario cannot be driven, or there are too few seeds.
pub fn trials(scenario: &Scenario, options: &StudyOptions) -> Result<Trials, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: NAME, found: count, least: LEAST_SEEDS });
    }
    let seeds: Vec<u64> = (options.first_seed..).take(count).collect();
    let own = over_seeds(&seeds, |seed| Trial::run(scenario, seed))?;
    let drawn = over_seeds(&seeds, |seed| {
        let trial = Trial::run(&drawn(scenario, seed)?, seed)?;
        Ok((trial.injected, trial.calibration.factors.errors()))
    })?;
    Ok(Trials { own, drawn })
}

/// The study of what was driven.
pub fn study(trials: &Trials) -> Study {
    page::study(trials)
}

/// The scenario with another robot: its wheels and track at random.
fn drawn(scenario: &Scenario, seed: u64) -> Result<Scenario, SurveyError> {
    let mut random = ChaCha12Rng::seed_from_u64(seed);
    // A stream of its own, apart from those of the world.
    random.set_stream(1996);
    let [unequal, track, radius] = SPREAD.map(|most| random.random_range(-most..most));
    let mut scenario = scenario.clone();
    let effects = [
        (Effect::UnequalWheelRadii, unequal),
        (Effect::TrackWidthError, track),
        (Effect::WheelRadiusError, radius),
    ];
    for settings in scenario.robots.values_mut() {
        settings.effects.retain(|active| effects.iter().all(|(effect, _)| *effect != active.effect()));
        for (effect, value) in effects {
            let active = ActiveEffect::new(effect, &[value]);
            settings.effects.push(active.map_err(|error| drive::refused(error.to_string()))?);
        }
    }
    Ok(scenario)
}

//! `pleiad survey slam`: the theorems, the choice of the error, association, bearings.

mod filters;
mod limits;

use pleiad_estimation::Pose2;
use pleiad_sim_peers::Scenario;
use serde_json::{Map, Value};

use super::input::{Luck, SlamInput};
use super::measure::{Watched, measured, strained};
use super::page::{error_figure, map_figure, sigma_figure};
use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;
use crate::study::{Claim, Shown, Study, StudyOptions};

/// Seeds of the study where none are asked for.
const SEEDS: usize = 24;
/// An interval needs two.
const LEAST_SEEDS: usize = 2;
/// Below the limit by more than this is more than rounding.
pub(super) const AT_LIMIT: f64 = 1.0 - 1e-6;
/// Ways that they are tried on.
const WAYS: usize = 3;

/// Runs the study.
///
/// # Errors
/// Fewer than two seeds; a scenario or a run that fails.
pub fn study(options: &StudyOptions) -> Result<Study, SurveyError> {
    let count = options.seeds.unwrap_or(SEEDS);
    if count < LEAST_SEEDS {
        return Err(SurveyError::TooFewSeeds { study: super::NAME, found: count, least: LEAST_SEEDS });
    }
    let scenario = Scenario::from_toml(super::SCENARIO, "scenarios/slam.toml")
        .map_err(|error| SurveyError::Scenario { study: super::NAME, source: Box::new(error) })?;
    let seeds: Vec<u64> = (0..count as u64).map(|k| options.first_seed + k).collect();
    let all = over_seeds(&seeds, |seed| measured(&scenario, seed))?;
    let grid = limits::grid(&scenario, &seeds[..WAYS.min(count)])?;
    let mut parts = Parts::default();
    limits::determinants(&all, &mut parts);
    limits::correlations(&all, &mut parts);
    limits::limits(&grid, &mut parts);
    filters::forms(&all, &mut parts);
    filters::consistency(&all, &mut parts);
    filters::association(&all, &mut parts);
    filters::bearings(&all, scenario.landmarks.len(), &mut parts);
    if let Some(first) = all.first() {
        let input = SlamInput::simulated(&strained(&scenario), seeds[0], Luck::Drawn)?;
        example(&input, &first.forms[0], seeds[0], &mut parts);
    }
    Ok(Study {
        name: super::NAME,
        title: "EKF SLAM: what a map converges to".to_owned(),
        lead: format!(
            "A car with range and bearing among {} landmarks that it does not know, 300 s, {count} seeds from {} (Dissanayake, \
             Newman, Clark, Durrant-Whyte, Csorba 2001). The theorems are of the linear case: they are measured on runs \
             without chance, whose estimates and linearization stay at the truth, and then on runs with it.",
            scenario.landmarks.len(),
            options.first_seed
        ),
        claims: parts.claims,
        shown: parts.shown,
        numbers: parts.numbers,
    })
}

#[derive(Default)]
struct Parts {
    claims: Vec<Claim>,
    shown: Vec<Shown>,
    numbers: Map<String, Value>,
}

impl Parts {
    fn claim(&mut self, statement: &str, measured: String, holds: bool) {
        self.claims.push(Claim { statement: statement.to_owned(), measured, holds });
    }

    fn number(&mut self, key: &str, value: Value) {
        self.numbers.insert(key.to_owned(), value);
    }
}

fn example(input: &SlamInput, run: &Watched, seed: u64, parts: &mut Parts) {
    let whose = format!("Seed {seed}, heading told to 0.1 rad, sensor noise doubled, invariant error");
    parts.shown.push(Shown::Figure(
        map_figure(input, &run.ran, &Pose2::identity()),
        format!("{whose}: the map as it is. Ellipses hold 95 %; the map is turned as the start was."),
    ));
    parts.shown.push(Shown::Figure(
        sigma_figure(&run.ran, run.over_limit.map(|limit| limit.limit_sigma_m)),
        format!("{whose}: standard deviations and the mean of the landmarks' limits."),
    ));
    parts.shown.push(Shown::Figure(
        error_figure(&run.ran),
        format!("{whose}: errors of the vehicle with three standard deviations."),
    ));
}

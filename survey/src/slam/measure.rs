//! What the study measures of one seed.

use std::collections::BTreeMap;

use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::motion::MotionNoise;
use pleiad_estimation::slam::Association;
use pleiad_estimation::statistics::{Alignment, nees};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Timestamp};
use pleiad_sim_peers::Scenario;

use super::input::{Luck, SlamInput};
use super::judge::Associated;
use super::page::LikenessSeries;
use super::run::{Ran, RunOptions, pose_error, run, seen_map_error};
use super::theorems::{DeterminantWatch, OverLimit, covariance_at_truth, likeness_of, over_limit};
use crate::error::SurveyError;

/// At which times errors are compared with their covariance, seconds.
pub(super) const NEES_AT_S: [f64; 5] = [60.0, 120.0, 180.0, 240.0, 299.0];
/// Length of the runs that show what correlations tend to, seconds.
pub(super) const LONG_S: f64 = 1200.0;
/// Between two looks at the correlations, scans.
const LIKENESS_EVERY: usize = 8;
/// A second landmark stands so far east of each where look-alikes are planted, metres.
const TWIN_M: f64 = 0.35;
/// Numbers of the second ones.
const TWIN_IDS: u32 = 1000;
/// A gate that lets nearly everything through.
pub(super) const WIDE_GATE: f64 = 1e3;

/// Errors over their covariance: the sum and its degrees of freedom.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Nees {
    pub sum: f64,
    pub dimension: usize,
}

/// One run under the theorems' eyes.
pub(super) struct Watched {
    pub ran: Ran,
    pub determinants: DeterminantWatch,
    pub over_limit: Option<OverLimit>,
    /// At [`NEES_AT_S`]: of the pose, and of the map as the vehicle sees it.
    pub nees: Vec<[Nees; 2]>,
}

pub(super) fn watched(input: &SlamInput, options: &RunOptions, seed: u64) -> Result<Watched, SurveyError> {
    let mut determinants = DeterminantWatch::new(seed);
    let mut errors = Vec::new();
    let ran = run(input, options, |slam, time, births| {
        let (ids, covariance) = covariance_at_truth(slam, births, &input.landmarks);
        determinants.take(&ids, &covariance);
        let due = NEES_AT_S.get(errors.len()).is_some_and(|at| time >= Timestamp::from_seconds(*at));
        if due && let Some(truth) = input.recorded.truth_at(time, 0.3) {
            let (error, covariance) = pose_error(slam, &truth);
            let of =
                |sum: Option<f64>, dimension: usize| Nees { sum: sum.unwrap_or(f64::INFINITY), dimension };
            let pose = of(nees(&error, &covariance), error.len());
            let map = seen_map_error(slam, &truth, births, &input.landmarks)
                .map_or_else(Nees::default, |(error, covariance)| of(nees(&error, &covariance), error.len()));
            errors.push([pose, map]);
        }
    })?;
    Ok(Watched { determinants, over_limit: over_limit(input, &ran.slam), nees: errors, ran })
}

/// A start and a sensor that the filter is told of, where nothing is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Told {
    pub sigma_position_m: f64,
    pub sigma_heading_rad: f64,
    /// Of the sensor's noise.
    pub times: f64,
    /// What is told of the wheels.
    pub wheels: Wheels,
}

/// What the filter is told of the noise of its motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wheels {
    /// As the scenario says.
    AsTheyAre,
    /// No noise in yaw: with a known heading, the linear case.
    ExactYaw,
    /// No noise.
    Exact,
}

/// A run whose estimates stay at the truth, with other noises told.
pub(super) fn at_truth(exact: &SlamInput, told: Told, seed: u64) -> Result<Watched, SurveyError> {
    watched(&with_told(exact, told), &RunOptions::default(), seed)
}

/// How alike the errors of the landmarks become.
fn alike(input: &SlamInput) -> Result<LikenessSeries, SurveyError> {
    let (mut series, mut scans) = (LikenessSeries::new(), 0_usize);
    run(input, &RunOptions::default(), |slam, time, _| {
        if scans.is_multiple_of(LIKENESS_EVERY)
            && let Some(found) = likeness_of(slam)
        {
            series.push((time, found));
        }
        scans += 1;
    })?;
    Ok(series)
}

fn with_told(exact: &SlamInput, told: Told) -> SlamInput {
    let square = |sigma: f64| sigma * sigma;
    let position = square(told.sigma_position_m);
    let mut input = exact.clone();
    input.start_noise = Symmetric3::diagonal(position, position, square(told.sigma_heading_rad));
    for noise in [&mut input.noises.range_bearing, &mut input.noises.bearing].into_iter().flatten() {
        noise.lower = noise.lower.map(|entry| entry * square(told.times));
    }
    let noise = &mut input.motion.noise;
    match told.wheels {
        Wheels::AsTheyAre => {}
        Wheels::ExactYaw => (noise.yaw_rad_per_sqrt_s, noise.yaw_rad_per_sqrt_rad) = (0.0, 0.0),
        Wheels::Exact => *noise = MotionNoise::default(),
    }
    input
}

/// The scenario with a start and a sensor that strain the linearization: the heading known to a tenth of a radian, the
/// sensor's noise doubled.
pub(super) fn strained(scenario: &Scenario) -> Scenario {
    let mut strained = scenario.clone();
    for settings in strained.robots.values_mut() {
        settings.prior.sigma_heading_rad = 0.1;
        settings.relative.sigma_range_m *= 2.0;
        settings.relative.sigma_bearing_rad *= 2.0;
    }
    strained
}

/// The scenario with a second landmark beside every one.
pub(super) fn with_twins(scenario: &Scenario) -> Scenario {
    let mut twins = scenario.clone();
    let second: BTreeMap<LandmarkId, [f64; 2]> = scenario
        .landmarks
        .iter()
        .map(|(id, [x, y])| (LandmarkId(id.0 + TWIN_IDS), [x + TWIN_M, *y]))
        .collect();
    twins.landmarks.extend(second);
    twins
}

/// A run that is judged by its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    pub associated: Associated,
    pub landmarks: usize,
    pub map_error_m: Option<f64>,
    pub way_error_m: Option<f64>,
}

pub(super) fn ended(input: &SlamInput, options: &RunOptions) -> Result<Ended, SurveyError> {
    let ran = run(input, options, |_, _, _| {})?;
    Ok(Ended {
        associated: ran.associated,
        landmarks: ran.map.len(),
        map_error_m: ran.map_error_m(Alignment::Se2),
        way_error_m: ran.trajectory_error_m(Alignment::None),
    })
}

/// Everything of one seed.
pub(super) struct Measured {
    /// At the truth, as the scenario says.
    pub exact: Watched,
    /// At the truth, for [`LONG_S`]: with the heading known, the linear case; and as the scenario says.
    pub linear: LikenessSeries,
    pub turning: LikenessSeries,
    /// With chance, strained: invariant and additive.
    pub forms: [Watched; 2],
    /// Without names: as it should be, with the gate far too wide, among look-alikes.
    pub nearest: Ended,
    pub wide_gate: Ended,
    pub twins: Ended,
    /// Bearings alone: with names, and without.
    pub bearing: Watched,
    pub bearing_nearest: Ended,
}

pub(super) fn measured(scenario: &Scenario, seed: u64) -> Result<Measured, SurveyError> {
    let with_seed = |error: SurveyError| match error {
        SurveyError::Diverged { study, what, .. } => SurveyError::Diverged { study, seed, what },
        other => other,
    };
    of_seed(scenario, seed).map_err(with_seed)
}

fn of_seed(scenario: &Scenario, seed: u64) -> Result<Measured, SurveyError> {
    let simulated = |scenario: &Scenario, luck| SlamInput::simulated(scenario, seed, luck);
    let exact = simulated(scenario, Luck::None)?;
    let long = simulated(&Scenario { duration_s: LONG_S, ..scenario.clone() }, Luck::None)?;
    let drawn = simulated(scenario, Luck::Drawn)?;
    let hard = simulated(&strained(scenario), Luck::Drawn)?;
    let twins = simulated(&with_twins(scenario), Luck::Drawn)?;
    let form = |form| RunOptions { form, ..RunOptions::default() };
    let nearest = RunOptions { association: Association::Nearest, ..RunOptions::default() };
    let bearing = RunOptions { without_ranges: true, ..RunOptions::default() };
    let linear = Told { sigma_position_m: 0.1, sigma_heading_rad: 0.0, times: 1.0, wheels: Wheels::ExactYaw };
    Ok(Measured {
        exact: watched(&exact, &RunOptions::default(), seed)?,
        linear: alike(&with_told(&long, linear))?,
        turning: alike(&long)?,
        forms: [
            watched(&hard, &form(ErrorForm::Invariant), seed)?,
            watched(&hard, &form(ErrorForm::Additive), seed)?,
        ],
        nearest: ended(&drawn, &nearest)?,
        wide_gate: ended(&drawn, &RunOptions { gate_factor: WIDE_GATE, ..nearest })?,
        twins: ended(&twins, &nearest)?,
        bearing: watched(&drawn, &bearing, seed)?,
        bearing_nearest: ended(&drawn, &RunOptions { association: Association::Nearest, ..bearing })?,
    })
}

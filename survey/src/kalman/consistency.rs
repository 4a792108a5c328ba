//! Whether the filter's variance is that of its error, over many draws of the system it is told of.

use nalgebra::{DMatrix, DVector, Matrix1, SMatrix, SVector, Vector1};
use pleiad_estimation::linear::Gaussian;
use pleiad_estimation::statistics::{NeesSummary, NisSummary};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::NAME;
use super::steady::constant_velocity;
use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;

/// Steps of a run.
const STEPS: usize = 100;
/// Every so many of them the error is judged: later than the filter remembers, so that they say different things.
const JUDGED_EVERY: usize = 20;
/// Probability with which a consistent filter fails the judgement anywhere.
pub(super) const ALPHA: f64 = 0.01;

/// A linear system of `N` states, the first of which is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct System<const N: usize> {
    transition: SMatrix<f64, N, N>,
    /// `Q = push push^T`: one source of noise.
    push: SVector<f64, N>,
    variance: f64,
    prior: SVector<f64, N>,
}

impl System<1> {
    /// A random walk with `Q = 0.04` and `R = 1`, from a prior of standard deviation 2.
    pub fn walk() -> Self {
        Self {
            transition: Matrix1::new(1.0),
            push: Vector1::new(0.2),
            variance: 1.0,
            prior: Vector1::new(2.0),
        }
    }
}

impl System<2> {
    /// Constant velocity: period 0.5 s, acceleration noise 0.4 m/s^2, position measured to 0.5 m.
    pub fn constant_velocity() -> Self {
        let (transition, _) = constant_velocity(0.5, 0.4);
        let push = SVector::from([0.5 * 0.5 * 0.5, 0.5]) * 0.4;
        Self { transition, push, variance: 0.25, prior: SVector::from([1.0, 0.5]) }
    }
}

/// What the filter is told of the system's noises, as factors of the true variances: 1 and 1 is the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// Of the process noise.
    pub process: f64,
    /// Of the measurement noise.
    pub measurement: f64,
}

impl Told {
    /// The truth.
    pub const TRUTH: Self = Self { process: 1.0, measurement: 1.0 };
}

/// One run: true state, measurement, belief after it, at every step.
#[derive(Clone, Debug)]
pub struct Run<const N: usize> {
    /// The true states.
    pub truth: Vec<SVector<f64, N>>,
    /// The measurements.
    pub measured: Vec<f64>,
    /// The beliefs.
    pub beliefs: Vec<Gaussian<N>>,
    /// Normalized innovations squared.
    pub nis: Vec<f64>,
}

/// Draws the system and filters it.
///
/// # Errors
/// [`SurveyError::Diverged`] if the filter refuses a measurement.
pub fn one_run<const N: usize>(system: &System<N>, told: Told, seed: u64) -> Result<Run<N>, SurveyError> {
    let mut random = ChaCha12Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let System { transition, push, variance, prior } = *system;
    let mut state: SVector<f64, N> = SVector::from_fn(|k, _| prior[k] * normal());
    let noise = push * push.transpose() * told.process;
    let mut observation = SMatrix::<f64, 1, N>::zeros();
    observation[0] = 1.0;
    let mut belief = Gaussian::new(SVector::zeros(), SMatrix::from_diagonal(&prior.component_mul(&prior)));
    let mut run = Run { truth: Vec::new(), measured: Vec::new(), beliefs: Vec::new(), nis: Vec::new() };
    for _ in 0..STEPS {
        state = transition * state + push * normal();
        let measured = state[0] + variance.sqrt() * normal();
        belief.predict(&transition, &noise);
        let correction = belief
            .update(&Vector1::new(measured), &observation, &Matrix1::new(variance * told.measurement))
            .map_err(|error| SurveyError::Diverged { study: NAME, seed, what: error.to_string() })?;
        run.truth.push(state);
        run.measured.push(measured);
        run.beliefs.push(belief);
        run.nis.push(correction.nis);
    }
    Ok(run)
}

/// Consistency over many runs.
#[derive(Clone, Debug)]
pub struct Consistency {
    /// Normalized errors at a few times, across runs.
    pub nees: NeesSummary,
    /// Normalized innovations of all runs together.
    pub nis: NisSummary,
}

impl Consistency {
    /// Whether the normalized errors lie in their intervals at all times and the innovations in theirs of 99 %.
    pub fn holds(&self) -> bool {
        self.nees.is_consistent() && self.nis.lower_tail.min(self.nis.upper_tail) > 0.5 * ALPHA
    }
}

/// Draws and filters the system for every seed.
///
/// # Errors
/// As [`one_run`].
pub fn consistency<const N: usize>(
    system: &System<N>,
    told: Told,
    seeds: &[u64],
) -> Result<Consistency, SurveyError> {
    let runs = over_seeds(seeds, |seed| one_run(system, told, seed))?;
    let judged = |run: &Run<N>| -> Vec<(DVector<f64>, DMatrix<f64>)> {
        let at = |k: usize| {
            let error = run.truth[k] - run.beliefs[k].mean;
            let covariance = run.beliefs[k].covariance;
            (
                DVector::from_column_slice(error.as_slice()),
                DMatrix::from_column_slice(N, N, covariance.as_slice()),
            )
        };
        (JUDGED_EVERY - 1..STEPS).step_by(JUDGED_EVERY).map(at).collect()
    };
    let all: Vec<_> = runs.iter().map(judged).collect();
    let nothing = || SurveyError::Diverged { study: NAME, seed: 0, what: "no runs to judge".to_owned() };
    let nees = NeesSummary::from_runs(&all, ALPHA).ok_or_else(nothing)?;
    let values = runs.iter().flat_map(|run| run.nis.iter().map(|nis| (*nis, 1)));
    Ok(Consistency { nees, nis: NisSummary::from_values(values).ok_or_else(nothing)? })
}

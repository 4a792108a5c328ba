//! Maximum likelihood of a few parameters on many rows, whatever their densities: ascent by the outer product
//! of the rows' scores (`berndt1974`), damped, within bounds.

use nalgebra::{DMatrix, DVector};

use crate::diagnosis::white::floored;

/// Largest number of steps.
const STEPS: usize = 60;
/// The ascent ends where a step gains less than this in log-likelihood.
const CONVERGED: f64 = 1e-5;
/// Steps are given up at this damping.
const MAX_DAMPING: f64 = 1e6;
/// Finite differences, as a share of a parameter's scale.
const SHARE: f64 = 1e-4;

/// A parameter: the values it may have, and a size at which it matters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) scale: f64,
}

/// The log-density of every row given those before it, under parameters.
pub(super) trait Density: Sync {
    fn rows(&self) -> usize;
    /// The block in time of each row: their scores are summed before they are squared.
    fn blocks(&self) -> &[usize];
    fn fill(&self, parameters: &[f64], into: &mut [f64]);
}

/// Where an ascent ended.
#[derive(Clone, Debug)]
pub(super) struct Optimum {
    pub(super) parameters: Vec<f64>,
    pub(super) log_likelihood: f64,
}

/// What is known of the parameters that were moved.
#[derive(Clone, Debug)]
pub(super) struct Uncertainty {
    /// Which parameters; those that ended at a bound are not among them.
    pub(super) free: Vec<usize>,
    /// Robust against correlation in blocks of time.
    pub(super) covariance: DMatrix<f64>,
    /// As if rows were independent and the density right.
    naive: DMatrix<f64>,
}

impl Uncertainty {
    /// The covariance of two parameters; `None` if one was not moved.
    pub(super) fn between(&self, one: usize, other: usize) -> Option<f64> {
        let place = |parameter| self.free.iter().position(|own| *own == parameter);
        Some(self.covariance[(place(one)?, place(other)?)])
    }

    /// The part of the covariance that belongs to some parameters, robust and naive.
    fn parts(&self, which: &[usize]) -> Option<[DMatrix<f64>; 2]> {
        let places: Option<Vec<usize>> =
            which.iter().map(|own| self.free.iter().position(|free| free == own)).collect();
        let places = places?;
        let part = |whole: &DMatrix<f64>| {
            DMatrix::from_fn(places.len(), places.len(), |i, j| whole[(places[i], places[j])])
        };
        Some([part(&self.covariance), part(&self.naive)])
    }

    /// How much more the scores of some parameters vary than if rows were independent; at least 1.
    pub(super) fn inflation(&self, which: &[usize]) -> f64 {
        let inflated = |[robust, naive]: [DMatrix<f64>; 2]| {
            let solved = naive.cholesky()?.solve(&robust);
            Some(solved.trace() / which.len().max(1) as f64)
        };
        self.parts(which)
            .and_then(inflated)
            .filter(|value| value.is_finite())
            .map_or(1.0, |value| value.max(1.0))
    }

    /// The Wald statistic of a departure of some parameters.
    pub(super) fn wald(&self, which: &[usize], departure: &[f64]) -> Option<f64> {
        let [robust, _] = self.parts(which)?;
        let departure = DVector::from_column_slice(departure);
        Some(departure.dot(&robust.cholesky()?.solve(&departure)))
    }
}

/// Moves the parameters `free` from `start` to the maximum of the likelihood of the rows that are kept.
pub(super) fn maximize(
    density: &dyn Density,
    bounds: &[Bounds],
    start: &[f64],
    free: &[usize],
    kept: &dyn Fn(usize) -> bool,
) -> Optimum {
    let mut parameters = start.to_vec();
    clamp(&mut parameters, bounds, free);
    let mut values = vec![0.0; density.rows()];
    let mut best = total(density, &parameters, kept, &mut values);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let scores = scores(density, bounds, &parameters, free, kept);
        let (gradient, outer) = normal(&scores);
        // A parameter at a bound that wants beyond it stays.
        let moving: Vec<usize> = (0..free.len())
            .filter(|&position| {
                let (value, own) = (parameters[free[position]], bounds[free[position]]);
                let stuck = (value <= own.low && gradient[position] <= 0.0)
                    || (value >= own.high && gradient[position] >= 0.0);
                !stuck && outer[(position, position)] > 0.0
            })
            .collect();
        if moving.is_empty() {
            break;
        }
        let before = best;
        while damping < MAX_DAMPING {
            let moved = step(&gradient, &outer, &moving, damping).map(|step| {
                let mut moved = parameters.clone();
                for (&position, change) in moving.iter().zip(step.iter()) {
                    moved[free[position]] += change;
                }
                clamp(&mut moved, bounds, free);
                moved
            });
            if let Some(moved) = moved {
                let after = total(density, &moved, kept, &mut values);
                if after > best {
                    (best, parameters) = (after, moved);
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
            }
            damping *= 10.0;
        }
        if best - before < CONVERGED {
            break;
        }
    }
    Optimum { parameters, log_likelihood: best }
}

/// The covariance of what was moved, at the optimum: the sandwich of curvature and scores summed in blocks.
pub(super) fn uncertainty(
    density: &dyn Density,
    bounds: &[Bounds],
    optimum: &Optimum,
    free: &[usize],
) -> Option<Uncertainty> {
    let parameters = &optimum.parameters;
    let inside = |index: &usize| {
        let (value, own) = (parameters[*index], bounds[*index]);
        value > own.low && value < own.high
    };
    let free: Vec<usize> = free.iter().copied().filter(inside).collect();
    let size = free.len();
    if size == 0 {
        return None;
    }
    let all = |_: usize| true;
    let mut curvature = DMatrix::zeros(size, size);
    for (column, &index) in free.iter().enumerate() {
        let reach = reach(parameters[index], &bounds[index]) * 10.0;
        let at = |change: f64| {
            let mut moved = parameters.clone();
            moved[index] = (moved[index] + change).clamp(bounds[index].low, bounds[index].high);
            (normal(&scores(density, bounds, &moved, &free, &all)).0, moved[index])
        };
        let ((above, high), (below, low)) = (at(reach), at(-reach));
        for row in 0..size {
            curvature[(row, column)] = (below[row] - above[row]) / (high - low);
        }
    }
    curvature = 0.5 * (&curvature + curvature.transpose());
    let scores = scores(density, bounds, parameters, &free, &all);
    let blocks = density.blocks();
    let count = blocks.iter().max().map_or(0, |last| last + 1);
    let mut sums: DMatrix<f64> = DMatrix::zeros(size, count);
    for (row, &block) in blocks.iter().enumerate() {
        for position in 0..size {
            sums[(position, block)] += scores[position][row];
        }
    }
    let (meat, _) = floored(&(&sums * sums.transpose()), &curvature)?;
    let naive = curvature.cholesky()?.inverse();
    let covariance = &naive * meat * &naive;
    covariance.iter().all(|value| value.is_finite()).then_some(Uncertainty { free, covariance, naive })
}

fn total(density: &dyn Density, parameters: &[f64], kept: &dyn Fn(usize) -> bool, values: &mut [f64]) -> f64 {
    density.fill(parameters, values);
    let sum: f64 = values.iter().enumerate().filter(|(row, _)| kept(*row)).map(|(_, value)| value).sum();
    if sum.is_nan() { f64::NEG_INFINITY } else { sum }
}

/// How far a difference reaches from a value.
fn reach(value: f64, bounds: &Bounds) -> f64 {
    SHARE * bounds.scale.max(0.1 * value.abs().min(bounds.scale * 1e3))
}

/// The derivatives of every row's log-density, by parameter; zero for rows that are not kept.
fn scores(
    density: &dyn Density,
    bounds: &[Bounds],
    parameters: &[f64],
    free: &[usize],
    kept: &dyn Fn(usize) -> bool,
) -> Vec<Vec<f64>> {
    let mut moved = parameters.to_vec();
    let (mut above, mut below) = (vec![0.0; density.rows()], vec![0.0; density.rows()]);
    let one = |&index: &usize| {
        let (value, own) = (parameters[index], bounds[index]);
        let reach = reach(value, &own);
        let (high, low) = ((value + reach).min(own.high), (value - reach).max(own.low));
        moved[index] = high;
        density.fill(&moved, &mut above);
        moved[index] = low;
        density.fill(&moved, &mut below);
        moved[index] = value;
        let slope = |row: usize| if kept(row) { (above[row] - below[row]) / (high - low) } else { 0.0 };
        (0..above.len()).map(slope).map(|slope| if slope.is_finite() { slope } else { 0.0 }).collect()
    };
    free.iter().map(one).collect()
}

/// The gradient, and the sum of the outer products of the rows' scores.
fn normal(scores: &[Vec<f64>]) -> (DVector<f64>, DMatrix<f64>) {
    let size = scores.len();
    let gradient = DVector::from_fn(size, |index, _| scores[index].iter().sum());
    let product =
        |row: usize, column: usize| scores[row].iter().zip(&scores[column]).map(|(a, b)| a * b).sum();
    let mut outer = DMatrix::zeros(size, size);
    for row in 0..size {
        for column in 0..=row {
            let value: f64 = product(row, column);
            outer[(row, column)] = value;
            outer[(column, row)] = value;
        }
    }
    (gradient, outer)
}

/// The step of the parameters at these positions.
fn step(
    gradient: &DVector<f64>,
    outer: &DMatrix<f64>,
    moving: &[usize],
    damping: f64,
) -> Option<DVector<f64>> {
    let size = moving.len();
    let scale: Vec<f64> = moving.iter().map(|&own| outer[(own, own)].sqrt()).collect();
    let mut scaled = DMatrix::from_fn(size, size, |i, j| outer[(moving[i], moving[j])] / scale[i] / scale[j]);
    for position in 0..size {
        scaled[(position, position)] += damping;
    }
    let right = DVector::from_fn(size, |i, _| gradient[moving[i]] / scale[i]);
    let solved = scaled.cholesky()?.solve(&right);
    let step = DVector::from_fn(size, |i, _| solved[i] / scale[i]);
    step.iter().all(|change| change.is_finite()).then_some(step)
}

fn clamp(parameters: &mut [f64], bounds: &[Bounds], free: &[usize]) {
    for &index in free {
        parameters[index] = parameters[index].clamp(bounds[index].low, bounds[index].high);
    }
}

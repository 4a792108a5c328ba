//! Maximum likelihood of a few parameters on many rows, whatever their densities: quasi-Newton ascent
//! (`nocedal2006`, BFGS) within bounds, begun with the outer product of the rows' scores for a curvature.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::diagnosis::spread::check::Check;
use crate::diagnosis::white::raised;

/// Largest number of steps.
const STEPS: usize = 60;
/// The ascent ends where a step gains less than this in log-likelihood.
const CONVERGED: f64 = 1e-4;
/// Steps are given up below this share of their length.
const SHORTEST: f64 = 1e-6;
/// A step must gain this share of what its slope promises.
const LEAST_GAIN: f64 = 1e-4;
/// The diagonal is raised by this share.
const RIDGE: f64 = 1e-9;
/// The least curvature, over the sum of the squares of the scores.
const FLATTEST: f64 = 1e-3;
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

    /// The derivatives of every row's log-density with respect to the parameters `free`; `None` for those that
    /// are to be differenced.
    fn scores(&self, _parameters: &[f64], free: &[usize]) -> Vec<Option<Vec<f64>>> {
        vec![None; free.len()]
    }

    /// What the density leaves of the rows, to see whether it is structured.
    fn checks(&self, _parameters: &[f64]) -> Vec<Check> {
        Vec::new()
    }
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

    /// The error of one of some parameters if the others of them are known.
    pub(super) fn alone(&self, which: &[usize], one: usize) -> Option<f64> {
        let [robust, _] = self.parts(which)?;
        let position = which.iter().position(|own| *own == one)?;
        let information = robust.cholesky()?.inverse()[(position, position)];
        (information > 0.0).then(|| 1.0 / information.sqrt())
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
    let mut scores = scores_at(density, bounds, &parameters, free, kept);
    let mut gradient = sums(&scores);
    // The inverse of minus the curvature of those that move.
    let mut inverse: Option<(Vec<usize>, DMatrix<f64>)> = None;
    for _ in 0..STEPS {
        // A parameter at a bound that wants beyond it stays.
        let moving: Vec<usize> = (0..free.len())
            .filter(|&position| {
                let (value, own) = (parameters[free[position]], bounds[free[position]]);
                let stuck = (value <= own.low && gradient[position] <= 0.0)
                    || (value >= own.high && gradient[position] >= 0.0);
                !stuck && scores[position].iter().any(|score| *score != 0.0)
            })
            .collect();
        if moving.is_empty() {
            break;
        }
        let fresh = inverse.as_ref().is_none_or(|(known, _)| *known != moving);
        if fresh {
            inverse = outer_inverse(&scores, &moving).map(|outer| (moving.clone(), outer));
        }
        let Some((_, approximation)) = &mut inverse else { break };
        let slope = DVector::from_fn(moving.len(), |i, _| gradient[moving[i]]);
        let direction = &*approximation * &slope;
        let promised = direction.dot(&slope);
        let before = best;
        let old = parameters.clone();
        let mut length = 1.0;
        while length > SHORTEST {
            let mut moved = old.clone();
            for (&position, change) in moving.iter().zip(direction.iter()) {
                moved[free[position]] += length * change;
            }
            clamp(&mut moved, bounds, free);
            let after = total(density, &moved, kept, &mut values);
            if after > before + LEAST_GAIN * length * promised {
                (best, parameters) = (after, moved);
                break;
            }
            length *= 0.25;
        }
        if best - before < CONVERGED {
            if fresh {
                break;
            }
            // What was learned of the curvature may mislead: once more from scratch.
            inverse = None;
            continue;
        }
        scores = scores_at(density, bounds, &parameters, free, kept);
        let next = sums(&scores);
        let step = DVector::from_fn(moving.len(), |i, _| parameters[free[moving[i]]] - old[free[moving[i]]]);
        let change = DVector::from_fn(moving.len(), |i, _| gradient[moving[i]] - next[moving[i]]);
        update(approximation, &step, &change, fresh);
        gradient = next;
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
    let all = |_: usize| true;
    // What no row depends on, as the time constant of what vanishes, is not known and moves nothing.
    let scores = scores_at(density, bounds, parameters, &free, &all);
    let shown = |own: &usize| scores[*own].iter().any(|score| *score != 0.0);
    let shown: Vec<usize> = (0..free.len()).filter(shown).collect();
    let (free, scores): (Vec<usize>, Vec<Vec<f64>>) =
        shown.iter().map(|&own| (free[own], scores[own].clone())).unzip();
    let size = free.len();
    if size == 0 {
        return None;
    }
    let mut curvature = DMatrix::zeros(size, size);
    for (column, &index) in free.iter().enumerate() {
        let reach = reach(parameters[index], &bounds[index]) * 10.0;
        let at = |change: f64| {
            let mut moved = parameters.clone();
            moved[index] = (moved[index] + change).clamp(bounds[index].low, bounds[index].high);
            (sums(&scores_at(density, bounds, &moved, &free, &all)), moved[index])
        };
        let ((above, high), (below, low)) = (at(reach), at(-reach));
        for row in 0..size {
            curvature[(row, column)] = (below[row] - above[row]) / (high - low);
        }
    }
    curvature = 0.5 * (&curvature + curvature.transpose());
    let blocks = density.blocks();
    let count = blocks.iter().max().map_or(0, |last| last + 1);
    let mut sums: DMatrix<f64> = DMatrix::zeros(size, count);
    for (row, &block) in blocks.iter().enumerate() {
        for position in 0..size {
            sums[(position, block)] += scores[position][row];
        }
    }
    let curvature = positive(curvature, &scores)?;
    let (meat, _) = raised(&(&sums * sums.transpose()), &curvature, 1.0)?;
    let naive = curvature.cholesky()?.inverse();
    let covariance = &naive * meat * &naive;
    covariance.iter().all(|value| value.is_finite()).then_some(Uncertainty { free, covariance, naive })
}

/// A curvature that is positive in every direction: where rows say next to nothing it may bend the wrong way. Its
/// eigenvalues, over the sums of the squares of the scores, are at least [`FLATTEST`].
fn positive(curvature: DMatrix<f64>, scores: &[Vec<f64>]) -> Option<DMatrix<f64>> {
    if curvature.clone().cholesky().is_some() {
        return Some(curvature);
    }
    let size = curvature.nrows();
    let scale: Vec<f64> =
        scores.iter().map(|own| own.iter().map(|score| score * score).sum::<f64>().sqrt()).collect();
    let scaled = DMatrix::from_fn(size, size, |i, j| curvature[(i, j)] / scale[i] / scale[j]);
    if !scaled.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(scaled);
    let raised = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(FLATTEST)));
    let whole = &eigen.eigenvectors * raised * eigen.eigenvectors.transpose();
    Some(DMatrix::from_fn(size, size, |i, j| whole[(i, j)] * scale[i] * scale[j]))
}

/// What would be known of parameters, by the outer product of the scores of rows: each has the mean zero given
/// the rows before it. It is never negative, as the curvature may be where a variance is off.
pub(super) fn expected(
    density: &dyn Density,
    bounds: &[Bounds],
    there: &Optimum,
    free: &[usize],
) -> Option<Uncertainty> {
    let scores = scores_at(density, bounds, &there.parameters, free, &|_| true);
    let shown: Vec<usize> =
        (0..free.len()).filter(|&own| scores[own].iter().any(|score| *score != 0.0)).collect();
    let covariance = outer_inverse(&scores, &shown)?;
    let free = shown.into_iter().map(|own| free[own]).collect();
    Some(Uncertainty { free, naive: covariance.clone(), covariance })
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
fn scores_at(
    density: &dyn Density,
    bounds: &[Bounds],
    parameters: &[f64],
    free: &[usize],
    kept: &dyn Fn(usize) -> bool,
) -> Vec<Vec<f64>> {
    let mut moved = parameters.to_vec();
    let (mut above, mut below) = (vec![0.0; density.rows()], vec![0.0; density.rows()]);
    let one = |(&index, known): (&usize, Option<Vec<f64>>)| {
        if let Some(mut scores) = known {
            for (row, score) in scores.iter_mut().enumerate() {
                if !(kept(row) && score.is_finite()) {
                    *score = 0.0;
                }
            }
            return scores;
        }
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
    free.iter().zip(density.scores(parameters, free)).map(one).collect()
}

fn sums(scores: &[Vec<f64>]) -> DVector<f64> {
    DVector::from_fn(scores.len(), |index, _| scores[index].iter().sum())
}

/// The inverse of the sum of the outer products of the scores of those that move.
fn outer_inverse(scores: &[Vec<f64>], moving: &[usize]) -> Option<DMatrix<f64>> {
    let size = moving.len();
    let product = |i: usize, j: usize| -> f64 {
        scores[moving[i]].iter().zip(&scores[moving[j]]).map(|(a, b)| a * b).sum()
    };
    let scale: Vec<f64> = (0..size).map(|i| product(i, i).sqrt()).collect();
    let scaled = DMatrix::from_fn(size, size, |i, j| {
        product(i, j) / scale[i] / scale[j] + if i == j { RIDGE } else { 0.0 }
    });
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(size, size, |i, j| inverse[(i, j)] / scale[i] / scale[j]))
}

/// Learns from a step how far the gradient fell. The first time it learns the scale too.
fn update(inverse: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>, first: bool) {
    let product = step.dot(change);
    if !(product > 0.0 && product.is_finite()) {
        return;
    }
    if first {
        *inverse *= product / change.dot(&(&*inverse * change));
    }
    let through = &*inverse * change;
    let scale = (1.0 + change.dot(&through) / product) / product;
    *inverse += step * step.transpose() * scale;
    *inverse -= (&through * step.transpose() + step * through.transpose()) / product;
}

fn clamp(parameters: &mut [f64], bounds: &[Bounds], free: &[usize]) {
    for &index in free {
        parameters[index] = parameters[index].clamp(bounds[index].low, bounds[index].high);
    }
}

#[cfg(test)]
mod tests;

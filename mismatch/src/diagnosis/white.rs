//! Residuals and derivatives divided by the noise, summed in blocks of time.
//!
//! Errors are correlated in time: what one block says counts once. Variances of scores are those of their
//! block sums (a cluster-robust sandwich, `liang1986`), never below half of what independent errors would
//! give.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::diagnosis::fit::State;
use crate::diagnosis::noise::{self, Noise};
use crate::diagnosis::unit::{Column, Unit};

/// The least variance of a score, as a share of that of independent errors.
const LEAST_SHARE: f64 = 0.5;

/// A unit with its residuals in sigmas and the columns of a model, all in sigmas.
pub(crate) struct White<'u, 'a> {
    pub(crate) unit: &'u Unit<'a>,
    /// Residuals in sigmas, times the root of their weight.
    pub(crate) errors: Vec<f64>,
    noise: &'u Noise,
    /// What residuals and columns in sigmas are multiplied by: the root of the weight. Both alike, so that an effect
    /// far above the noise is seen at its size; what it does not explain pulls no more than it may.
    factors: Vec<f64>,
    /// What the model's parameters predict, per parameter: minus the derivative of the residual.
    active: Vec<Vec<Option<Vec<f64>>>>,
}

impl<'u, 'a> White<'u, 'a> {
    pub(crate) fn new(unit: &'u Unit<'a>, state: &'u State, columns: &[Column]) -> Self {
        let mut errors = state.noise.whitened(unit, &state.residuals);
        let factors: Vec<f64> = errors.iter().map(|error| noise::weight(*error).sqrt()).collect();
        for (error, factor) in errors.iter_mut().zip(&factors) {
            *error *= factor;
        }
        let mut white = Self { unit, errors, noise: &state.noise, factors, active: Vec::new() };
        white.active = white.all_of(columns);
        white
    }

    /// The model's parameters that show in a stretch, with what they predict there.
    pub(crate) fn columns(&self, which: usize) -> impl Iterator<Item = (usize, &[f64])> {
        self.active
            .iter()
            .enumerate()
            .filter_map(move |(slot, column)| Some((slot, column[which].as_deref()?)))
    }

    /// What columns predict, in sigmas, per stretch.
    fn all_of(&self, columns: &[Column]) -> Vec<Vec<Option<Vec<f64>>>> {
        let mut all = self.noise.whitened_columns(self.unit, columns);
        for (stretch, part) in all.iter_mut().flat_map(|parts| self.unit.stretches.iter().zip(parts)) {
            let Some(part) = part else { continue };
            for (value, factor) in part.iter_mut().zip(&self.factors[stretch.range()]) {
                *value *= -factor;
            }
        }
        all
    }

    /// What a column predicts, in sigmas, per stretch.
    pub(crate) fn of(&self, column: &Column) -> Vec<Option<Vec<f64>>> {
        self.all_of(std::slice::from_ref(column)).pop().unwrap_or_default()
    }
}

/// A hypothesis of one step beyond a fit.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// The parameters, from the start.
    pub(crate) change: DVector<f64>,
    /// Twice the log-likelihood gained if errors were independent.
    pub(crate) gain: f64,
    /// The Wald statistic with the robust covariance, to be compared with chi-square of as many degrees as
    /// there are parameters.
    pub(crate) wald: f64,
    /// Mean of robust over independent variance.
    pub(crate) inflation: f64,
    /// The robust covariance of the parameters.
    pub(crate) covariance: DMatrix<f64>,
}

/// The best step in `columns` (one list per white unit) beside the active parameters, which follow it.
/// `None` if there are none, or if they say nothing that the active parameters do not.
#[allow(clippy::too_many_lines, reason = "one computation from top to bottom: Gram matrices, step, sandwich")]
pub(crate) fn step(whites: &[&White<'_, '_>], columns: &[&[Column]]) -> Option<Step> {
    let size = columns.first()?.len();
    if size == 0 {
        return None;
    }
    let active = whites.first()?.active.len();
    let own: Vec<Vec<Vec<Option<Vec<f64>>>>> =
        whites.iter().zip(columns).map(|(white, columns)| white.all_of(columns)).collect();
    // Gram matrices over the stretches that the columns show in.
    let mut both = DMatrix::zeros(size, active);
    let mut within = DMatrix::zeros(size, size);
    let mut among = DMatrix::zeros(active, active);
    let mut right = DVector::zeros(size);
    let mut right_active = DVector::zeros(active);
    for (white, own) in whites.iter().zip(&own) {
        for (which, stretch) in white.unit.stretches.iter().enumerate() {
            let errors = &white.errors[stretch.range()];
            for (i, a) in own.iter().enumerate() {
                let Some(a) = &a[which] else { continue };
                right[i] += dot(a, errors);
                for (j, b) in own.iter().enumerate().take(i + 1) {
                    let Some(b) = &b[which] else { continue };
                    within[(i, j)] += dot(a, b);
                }
                for (j, b) in white.active.iter().enumerate() {
                    let Some(b) = &b[which] else { continue };
                    both[(i, j)] += dot(a, b);
                }
            }
            for (i, a) in white.active.iter().enumerate() {
                let Some(a) = &a[which] else { continue };
                right_active[i] += dot(a, errors);
                for (j, b) in white.active.iter().enumerate().take(i + 1) {
                    let Some(b) = &b[which] else { continue };
                    among[(i, j)] += dot(a, b);
                }
            }
        }
    }
    symmetric(&mut within);
    symmetric(&mut among);
    // Parameters that do not show here get a unit diagonal and stay out of it.
    for slot in 0..active {
        if among[(slot, slot)] == 0.0 {
            among[(slot, slot)] = 1.0;
        }
    }
    let full = DVector::from_fn(size, |i, _| within[(i, i)]);
    let project = if active == 0 { None } else { Some(ridge(among)?) };
    let (coefficients, information, score) = match &project {
        None => (DMatrix::zeros(active, size), within, right),
        Some(factor) => {
            let coefficients = factor.solve(&both.transpose());
            let information = &within - &both * &coefficients;
            let score = &right - coefficients.transpose() * &right_active;
            (coefficients, information, score)
        }
    };
    // What is left of a column beside the active ones must be more than rounding.
    if (0..size)
        .any(|i| information[(i, i)].partial_cmp(&(1e-6 * full[i])) != Some(std::cmp::Ordering::Greater))
    {
        return None;
    }
    let scale = DVector::from_fn(size, |i, _| 1.0 / information[(i, i)].sqrt());
    let scaled = DMatrix::from_fn(size, size, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let eigen = SymmetricEigen::new(scaled.clone());
    if eigen.eigenvalues.iter().any(|value| *value < 1e-7) {
        return None;
    }
    let inverse = information.clone().cholesky()?.inverse();
    let change = &inverse * &score;
    // Block sums of the scores after the step.
    let mut meat: DMatrix<f64> = DMatrix::zeros(size, size);
    for (white, own) in whites.iter().zip(&own) {
        let mut sums: DMatrix<f64> = DMatrix::zeros(size, white.unit.blocks);
        for (which, stretch) in white.unit.stretches.iter().enumerate() {
            let range = stretch.range();
            let shown: Vec<(usize, &[f64])> =
                own.iter().enumerate().filter_map(|(i, a)| Some((i, a[which].as_deref()?))).collect();
            let active: Vec<(usize, &[f64])> = white
                .active
                .iter()
                .enumerate()
                .filter_map(|(j, b)| Some((j, b[which].as_deref()?)))
                .collect();
            if shown.is_empty() && active.is_empty() {
                continue;
            }
            let mut left = vec![0.0; size];
            for row in 0..range.len() {
                left.fill(0.0);
                for (i, a) in &shown {
                    left[*i] = a[row];
                }
                for (j, b) in &active {
                    for (i, value) in left.iter_mut().enumerate() {
                        *value -= b[row] * coefficients[(*j, i)];
                    }
                }
                let fitted: f64 = left.iter().zip(change.iter()).map(|(a, b)| a * b).sum();
                let error = white.errors[range.start + row] - fitted;
                let block = white.unit.block_of[range.start + row];
                for (i, value) in left.iter().enumerate() {
                    sums[(i, block)] += value * error;
                }
            }
        }
        meat += &sums * sums.transpose();
    }
    let (meat, inflation) = floored(&meat, &information)?;
    let covariance = &inverse * meat * &inverse;
    let wald = change.dot(&(covariance.clone().cholesky()?.solve(&change)));
    let gain = change.dot(&score);
    Some(Step { change, gain, wald, inflation, covariance })
}

/// The meat of a sandwich, at least [`LEAST_SHARE`] of `bread` in every direction, and their mean ratio.
pub(crate) fn floored(meat: &DMatrix<f64>, bread: &DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
    raised(meat, bread, LEAST_SHARE)
}

/// The meat of a sandwich, at least a share of `bread` in every direction, and their mean ratio.
pub(crate) fn raised(meat: &DMatrix<f64>, bread: &DMatrix<f64>, least: f64) -> Option<(DMatrix<f64>, f64)> {
    let size = bread.nrows();
    let factor = bread.clone().cholesky()?.l();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(size, size))?;
    let whitened = &inverse * meat * inverse.transpose();
    let eigen = SymmetricEigen::new(0.5 * (&whitened + whitened.transpose()));
    let raised = eigen.eigenvalues.map(|value| value.max(least));
    let inflation = raised.sum() / size as f64;
    let vectors = &factor * &eigen.eigenvectors;
    Some((&vectors * DMatrix::from_diagonal(&raised) * vectors.transpose(), inflation))
}

fn ridge(mut matrix: DMatrix<f64>) -> Option<nalgebra::Cholesky<f64, nalgebra::Dyn>> {
    for slot in 0..matrix.nrows() {
        matrix[(slot, slot)] *= 1.0 + 1e-10;
    }
    matrix.cholesky()
}

pub(crate) fn symmetric(matrix: &mut DMatrix<f64>) {
    for row in 0..matrix.nrows() {
        for column in row + 1..matrix.ncols() {
            matrix[(row, column)] = matrix[(column, row)];
        }
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums at a time, always in this order: one sum would wait for itself.
    let (fours, rest) = a.as_chunks::<4>();
    let (other_fours, other_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in fours.iter().zip(other_fours) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f64 = rest.iter().zip(other_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

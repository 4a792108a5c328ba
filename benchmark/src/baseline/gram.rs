//! Normal equations of a regression, whole and fold by fold: all that the methods need.

use nalgebra::{DMatrix, DVector};
use pleiad_mismatch::Design;

/// How many contiguous folds.
pub const FOLDS: usize = 5;

/// Normal equations, of columns of unit length.
#[derive(Clone, Debug)]
pub struct Regression {
    /// Columns times columns.
    pub gram: DMatrix<f64>,
    /// Columns times what they are to explain.
    pub right: DVector<f64>,
    /// The square of what is to be explained.
    pub square: f64,
    /// How many rows.
    pub rows: usize,
}

impl Regression {
    fn empty(size: usize) -> Self {
        Self { gram: DMatrix::zeros(size, size), right: DVector::zeros(size), square: 0.0, rows: 0 }
    }

    /// Sum of squares left by coefficients.
    pub fn left(&self, coefficients: &DVector<f64>) -> f64 {
        self.square - 2.0 * coefficients.dot(&self.right) + coefficients.dot(&(&self.gram * coefficients))
    }

    /// The least squares of some columns; a little ridge for those that are the same.
    pub fn solved(&self, kept: &[usize]) -> DVector<f64> {
        let size = kept.len();
        let mut whole = DVector::zeros(self.right.len());
        if size == 0 {
            return whole;
        }
        let trace = kept.iter().map(|&own| self.gram[(own, own)]).fold(0.0, f64::max);
        let gram = DMatrix::from_fn(size, size, |i, j| {
            self.gram[(kept[i], kept[j])] + if i == j { RIDGE * trace.max(f64::MIN_POSITIVE) } else { 0.0 }
        });
        let right = DVector::from_fn(size, |i, _| self.right[kept[i]]);
        if let Some(factor) = gram.cholesky() {
            let solved = factor.solve(&right);
            for (position, &own) in kept.iter().enumerate() {
                whole[own] = solved[position];
            }
        }
        whole
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            gram: &self.gram - &other.gram,
            right: &self.right - &other.right,
            square: self.square - other.square,
            rows: self.rows - other.rows,
        }
    }
}

/// As a share of the largest diagonal.
const RIDGE: f64 = 1e-8;

/// A regression and its parts.
#[derive(Clone, Debug)]
pub struct Folds {
    /// All rows.
    pub whole: Regression,
    /// The rows of each fold.
    pub held: Vec<Regression>,
    /// All rows but those of each fold.
    pub rest: Vec<Regression>,
}

impl Folds {
    /// Of a design: columns are brought to unit length, folds are contiguous in time.
    pub fn of(design: &Design) -> Self {
        let size = design.columns.len();
        let lengths: Vec<f64> = design
            .columns
            .iter()
            .map(|own| {
                own.parts.iter().flat_map(|(_, values)| values).map(|value| value * value).sum::<f64>()
            })
            .map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 })
            .collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
        let fold = |share: f64| ((share * FOLDS as f64) as usize).min(FOLDS - 1);
        let of_row: Vec<usize> = design.shares.iter().map(|&share| fold(share)).collect();
        let mut held = vec![Regression::empty(size); FOLDS];
        for (error, &fold) in design.errors.iter().zip(&of_row) {
            held[fold].square += error * error;
            held[fold].rows += 1;
        }
        for (i, a) in design.columns.iter().enumerate() {
            for (from, values) in &a.parts {
                for (offset, value) in values.iter().enumerate() {
                    let row = from + offset;
                    held[of_row[row]].right[i] += value * lengths[i] * design.errors[row];
                }
            }
            for (j, b) in design.columns.iter().enumerate().take(i + 1) {
                for (from, values) in &a.parts {
                    // Parts are whole stretches: two either are of the same rows or share none.
                    let Some((_, others)) = b.parts.iter().find(|(own, _)| own == from) else { continue };
                    let scale = lengths[i] * lengths[j];
                    for (offset, (value, other)) in values.iter().zip(others).enumerate() {
                        held[of_row[from + offset]].gram[(i, j)] += value * other * scale;
                    }
                }
            }
        }
        for own in &mut held {
            for i in 0..size {
                for j in i + 1..size {
                    own.gram[(i, j)] = own.gram[(j, i)];
                }
            }
        }
        let mut whole = Regression::empty(size);
        for own in &held {
            whole.gram += &own.gram;
            whole.right += &own.right;
            whole.square += own.square;
            whole.rows += own.rows;
        }
        let rest = held.iter().map(|own| whole.minus(own)).collect();
        Self { whole, held, rest }
    }

    /// The one of several penalties with the least sum of squares on folds left out.
    pub fn best(&self, penalties: &[f64], fit: &dyn Fn(&Regression, f64) -> DVector<f64>) -> f64 {
        let cost = |penalty: f64| -> f64 {
            let pairs = self.rest.iter().zip(&self.held);
            pairs.map(|(rest, held)| held.left(&fit(rest, penalty))).sum()
        };
        let costs = penalties.iter().map(|&penalty| (cost(penalty), penalty));
        costs.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, penalty)| penalty)
    }
}

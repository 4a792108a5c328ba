//! The lasso (`tibshirani1996`) by coordinate descent, its penalty cross-validated.

use nalgebra::DVector;

use super::gram::{Folds, Regression};

/// Penalties below the least that keeps nothing: so many, each this share of the one before.
const COUNT: i32 = 25;
const SHARE: f64 = 0.75;
/// Rounds over all coordinates, at the most, and the change at which it has converged, in sigmas.
const ROUNDS: usize = 2000;
const CONVERGED: f64 = 1e-4;

/// The coefficients, of columns of unit length; 0 of those left out.
pub fn lasso(folds: &Folds) -> Vec<f64> {
    let most = folds.whole.right.amax();
    let penalties: Vec<f64> = (0..COUNT).map(|power| most * SHARE.powi(power)).collect();
    // The penalty goes with the number of rows, as the squares do.
    let of = |own: &Regression, penalty: f64| {
        descended(own, penalty * own.rows as f64 / folds.whole.rows.max(1) as f64)
    };
    let best = folds.best(&penalties, &of);
    descended(&folds.whole, best).iter().copied().collect()
}

/// Minimizes half the sum of squares plus the penalty times the sum of absolute values.
pub(super) fn descended(own: &Regression, penalty: f64) -> DVector<f64> {
    let size = own.right.len();
    let mut found: DVector<f64> = DVector::zeros(size);
    // What is left of the right side: kept up to date, a column at a time.
    let mut left = own.right.clone();
    for _ in 0..ROUNDS {
        let mut change: f64 = 0.0;
        for index in 0..size {
            let diagonal = own.gram[(index, index)];
            if diagonal <= 0.0 {
                continue;
            }
            let pull: f64 = left[index] + diagonal * found[index];
            let next = pull.signum() * (pull.abs() - penalty).max(0.0) / diagonal;
            let step: f64 = next - found[index];
            if step != 0.0 {
                left.axpy(-step, &own.gram.column(index), 1.0);
                found[index] = next;
                change = change.max(step.abs());
            }
        }
        if change < CONVERGED {
            break;
        }
    }
    found
}

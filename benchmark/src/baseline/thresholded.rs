//! Sparse regression: sequentially thresholded least squares (`brunton2016`), its threshold cross-validated.

use nalgebra::DVector;

use super::gram::{Folds, Regression};

/// Thresholds of a coefficient of a column of unit length, in sigmas: from one that noise passes to one that little
/// does.
const LEAST: f64 = 1.0;
const RATIO: f64 = 1.35;
const COUNT: i32 = 22;
/// Rounds of thresholding.
const ROUNDS: usize = 20;

/// The coefficients, of columns of unit length; 0 of those left out.
pub fn thresholded(folds: &Folds) -> Vec<f64> {
    let thresholds: Vec<f64> = (0..COUNT).map(|power| LEAST * RATIO.powi(power)).collect();
    // A threshold is one of the rows that there are; those of a fit to fewer rows are smaller by the root.
    let of = |own: &Regression, threshold: f64| {
        fitted(own, threshold * (own.rows as f64 / folds.whole.rows.max(1) as f64).sqrt())
    };
    let best = folds.best(&thresholds, &of);
    fitted(&folds.whole, best).iter().copied().collect()
}

fn fitted(own: &Regression, threshold: f64) -> DVector<f64> {
    let mut kept: Vec<usize> = (0..own.right.len()).collect();
    for _ in 0..ROUNDS {
        let solved = own.solved(&kept);
        let next: Vec<usize> =
            kept.iter().copied().filter(|&index| solved[index].abs() >= threshold).collect();
        if next.len() == kept.len() {
            return solved;
        }
        kept = next;
    }
    own.solved(&kept)
}

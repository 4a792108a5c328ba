//! One fit of the whole catalogue at once; what is then significant among so many is named.

use statrs::distribution::{ContinuousCDF, Normal};

use super::gram::Folds;

/// Probability that anything is named where nothing acts, if errors were independent.
const FAMILYWISE: f64 = 0.002;

/// The coefficients, of columns of unit length; 0 of those that are not significant.
pub fn joint(folds: &Folds) -> Vec<f64> {
    let own = &folds.whole;
    let size = own.right.len();
    let all: Vec<usize> = (0..size).collect();
    let solved = own.solved(&all);
    let critical = Normal::standard().inverse_cdf(1.0 - 0.5 * FAMILYWISE / size.max(1) as f64);
    let mut gram = own.gram.clone();
    let trace = gram.diagonal().max();
    for index in 0..size {
        gram[(index, index)] += 1e-8 * trace;
    }
    let Some(factor) = gram.cholesky() else { return vec![0.0; size] };
    let covariance = factor.inverse();
    let freedom = own.rows.saturating_sub(size).max(1) as f64;
    let noise = own.left(&solved).max(0.0) / freedom;
    let significant =
        |index: usize| solved[index].abs() > critical * (noise * covariance[(index, index)]).sqrt();
    all.iter().map(|&index| if significant(index) { solved[index] } else { 0.0 }).collect()
}

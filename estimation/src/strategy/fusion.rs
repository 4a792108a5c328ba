//! Covariance intersection of an estimate with a measurement whose error may be correlated with it in a way
//! nobody knows (`julier1997`), and its split form, in which only the part that may be correlated is inflated
//! (`julier2001`).
//!
//! With weight `w`, `P_w = P_c / w + P_i` and `R_w = R_c / (1 - w) + R_i`, then the ordinary update with
//! `P_w` and `R_w`. For every `w` in (0, 1) the result bounds the true covariance, whatever the correlation
//! of the parts `c`. With no correlated part it is the Kalman update; with no independent part covariance
//! intersection: for `H = I`, `P^-1 = w P_c^-1 + (1 - w) R_c^-1`.

use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;

/// A covariance in two parts, whose sum it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// May be correlated with anything.
    pub correlated: Matrix3,
    /// Is not.
    pub independent: Matrix3,
}

/// A measurement of the estimate: `innovation = H e + n`, `n` in three parts. Rows beyond the dimension are
/// zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Measured less predicted.
    pub innovation: Vector3,
    /// `H`.
    pub jacobian: Matrix3,
    /// Covariance of the part of `n` that may be correlated with the estimate.
    pub correlated: Matrix3,
    /// Of the part that is not, and that somebody else knows of.
    pub independent: Matrix3,
    /// Of the part that is not, and that nobody else will ever see: the sensor's own noise.
    pub noise: Matrix3,
}

/// A fused estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused {
    /// Correction of the estimate.
    pub correction: Vector3,
    /// Its covariance after it.
    pub covariance: Matrix3,
    /// The part of the covariance that is independent of all others: what was before, and the noise.
    pub independent: Matrix3,
    /// `K`.
    pub gain: Matrix3,
    /// Normalized innovation squared, with the inflated covariances.
    pub nis: f64,
    /// `w`.
    pub weight: f64,
}

/// Steps of the golden section: the weight is then known to 1e-9.
const STEPS: u32 = 44;
/// Weights at the ends, where the inflated covariances are still numbers.
const LEAST: f64 = 1e-6;
/// `(sqrt(5) - 1) / 2`.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Fuses with a given weight; `None` if the covariance of the innovation is not positive definite.
pub fn fuse(prior: &Split, measured: &Measured, weight: f64) -> Option<Fused> {
    let h = &measured.jacobian;
    let inflated = prior.correlated / weight + prior.independent;
    let mut noise = measured.correlated / (1.0 - weight) + measured.independent + measured.noise;
    for row in measured.dimension..3 {
        // So that rows which do not exist have an inverse; nothing multiplies it.
        noise[(row, row)] = 1.0;
    }
    let s = h * inflated * h.transpose() + noise;
    let cholesky = s.cholesky()?;
    let gain = cholesky.solve(&(h * inflated)).transpose();
    let keep = Matrix3::identity() - gain * h;
    let covariance = symmetric(&(keep * inflated * keep.transpose() + gain * noise * gain.transpose()));
    let independent = keep * prior.independent * keep.transpose() + gain * measured.noise * gain.transpose();
    Some(Fused {
        correction: gain * measured.innovation,
        covariance,
        independent: symmetric(&independent),
        gain,
        nis: measured.innovation.dot(&cholesky.solve(&measured.innovation)),
        weight,
    })
}

/// Fuses with the weight that makes the determinant of the result least; `None` if no weight makes it
/// smaller than it was: the measurement then says nothing that is not already known.
pub fn fuse_best(prior: &Split, measured: &Measured) -> Option<Fused> {
    let before = (prior.correlated + prior.independent).determinant();
    let weight = least(|weight| {
        fuse(prior, measured, weight).map_or(f64::INFINITY, |fused| fused.covariance.determinant())
    });
    fuse(prior, measured, weight).filter(|fused| fused.covariance.determinant() < before)
}

/// The weight in (0, 1) at which a function with one minimum has it.
pub fn least(cost: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (LEAST, 1.0 - LEAST);
    let (mut first, mut second) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut at_first, mut at_second) = (cost(first), cost(second));
    for _ in 0..STEPS {
        if at_first <= at_second {
            (high, second, at_second) = (second, first, at_first);
            first = high - GOLDEN * (high - low);
            at_first = cost(first);
        } else {
            (low, first, at_first) = (first, second, at_second);
            second = low + GOLDEN * (high - low);
            at_second = cost(second);
        }
    }
    let middle = 0.5 * (low + high);
    // The minimum may lie at an end.
    [LEAST, 1.0 - LEAST].into_iter().fold(middle, |best, end| if cost(end) < cost(best) { end } else { best })
}

/// The symmetric part.
pub(super) fn symmetric(m: &Matrix3) -> Matrix3 {
    0.5 * (m + m.transpose())
}

/// The nearest positive semidefinite matrix: a difference of two covariances may fall short of it by
/// rounding.
pub(super) fn positive(m: &Matrix3) -> Matrix3 {
    let m = symmetric(m);
    if Symmetric3::from_lower(&m).is_positive_semidefinite() {
        return m;
    }
    let mut eigen = m.symmetric_eigen();
    eigen.eigenvalues.apply(|value| *value = value.max(0.0));
    symmetric(&eigen.recompose())
}

#[cfg(test)]
mod tests;

//! The Kalman filter itself, of a state of fixed size: predict, update, innovation, gain, and the covariance in
//! Joseph's form.
//!
//! The team's filter (`joint`) has a block per robot and a layout of its own. This one is for small states: a
//! linear system, or one robot alone, whose extended filter ([`crate::single`]) brings its own derivatives.

use nalgebra::{Cholesky, SMatrix, SVector};

/// A normal belief about a state, and the two steps of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// The mean.
    pub mean: SVector<f64, N>,
    /// The covariance, symmetric.
    pub covariance: SMatrix<f64, N, N>,
}

/// What an update of `M` values did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction<const N: usize, const M: usize> {
    /// Measured minus predicted.
    pub innovation: SVector<f64, M>,
    /// Its covariance `S = H P H^T + R`.
    pub innovation_covariance: SMatrix<f64, M, M>,
    /// `K = P H^T S^-1`.
    pub gain: SMatrix<f64, N, M>,
    /// Normalized innovation squared: chi-square of `M` degrees of freedom if the filter is consistent.
    pub nis: f64,
}

/// Why an update was refused; the belief is then as it was.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// The covariance of the innovation is not positive definite: a noise of zero or less.
    #[error("the covariance of the innovation is not positive definite; is a noise zero or negative?")]
    NotPositiveDefinite,
    /// The measurement is NaN or infinite.
    #[error("the measurement is not finite")]
    NotFinite,
}

impl<const N: usize> Gaussian<N> {
    /// From a mean and a covariance, of which the symmetric part is taken.
    pub fn new(mean: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        Self { mean, covariance: symmetric(covariance) }
    }

    /// From a mean and a standard deviation for every state, independent of each other.
    pub fn from_sigmas(mean: [f64; N], sigmas: [f64; N]) -> Self {
        let variances = SVector::from(sigmas.map(|sigma| sigma * sigma));
        Self { mean: SVector::from(mean), covariance: SMatrix::from_diagonal(&variances) }
    }

    /// Standard deviation of a state; NaN beyond the last.
    pub fn sigma(&self, state: usize) -> f64 {
        if state < N { self.covariance[(state, state)].sqrt() } else { f64::NAN }
    }

    /// `x <- F x`, `P <- F P F^T + Q` (`barshalom2001`, section 5.2).
    pub fn predict(&mut self, transition: &SMatrix<f64, N, N>, noise: &SMatrix<f64, N, N>) {
        self.carry(transition * self.mean, transition, noise);
    }

    /// The same of a system that is not linear: `mean` is where the state goes, `transition` the derivative.
    pub fn carry(
        &mut self,
        mean: SVector<f64, N>,
        transition: &SMatrix<f64, N, N>,
        noise: &SMatrix<f64, N, N>,
    ) {
        self.mean = mean;
        self.covariance = symmetric(transition * self.covariance * transition.transpose() + noise);
    }

    /// Takes `z = H x + v`, `v ~ N(0, R)`.
    ///
    /// # Errors
    /// [`LinearError`]; the belief is then unchanged.
    pub fn update<const M: usize>(
        &mut self,
        measured: &SVector<f64, M>,
        observation: &SMatrix<f64, M, N>,
        noise: &SMatrix<f64, M, M>,
    ) -> Result<Correction<N, M>, LinearError> {
        self.correct(measured - observation * self.mean, observation, noise)
    }

    /// Takes an innovation that was formed elsewhere; `observation` is the derivative of the prediction.
    ///
    /// # Errors
    /// [`LinearError`]; the belief is then unchanged.
    pub fn correct<const M: usize>(
        &mut self,
        innovation: SVector<f64, M>,
        observation: &SMatrix<f64, M, N>,
        noise: &SMatrix<f64, M, M>,
    ) -> Result<Correction<N, M>, LinearError> {
        if !innovation.iter().all(|component| component.is_finite()) {
            return Err(LinearError::NotFinite);
        }
        let spread = observation * self.covariance;
        let innovation_covariance = symmetric(spread * observation.transpose() + noise);
        let factor = Cholesky::new(innovation_covariance).ok_or(LinearError::NotPositiveDefinite)?;
        let gain = factor.solve(&spread).transpose();
        let nis = innovation.dot(&factor.solve(&innovation));
        self.mean += gain * innovation;
        self.covariance = joseph(&self.covariance, &gain, observation, noise);
        Ok(Correction { innovation, innovation_covariance, gain, nis })
    }

    /// One value: no matrix is factored. Values with independent noises, one after the other, do what all at
    /// once would; noises that are correlated are made independent before.
    ///
    /// # Errors
    /// [`LinearError`]; the belief is then unchanged.
    pub fn correct_scalar(
        &mut self,
        innovation: f64,
        row: &SVector<f64, N>,
        variance: f64,
    ) -> Result<Correction<N, 1>, LinearError> {
        if !innovation.is_finite() {
            return Err(LinearError::NotFinite);
        }
        let spread = self.covariance * row;
        let total = row.dot(&spread) + variance;
        if !(total.is_finite() && total > 0.0 && variance >= 0.0) {
            return Err(LinearError::NotPositiveDefinite);
        }
        let gain = spread / total;
        self.mean += gain * innovation;
        self.covariance =
            joseph(&self.covariance, &gain, &row.transpose(), &SMatrix::<f64, 1, 1>::new(variance));
        Ok(Correction {
            innovation: SVector::<f64, 1>::new(innovation),
            innovation_covariance: SMatrix::<f64, 1, 1>::new(total),
            gain,
            nis: innovation * innovation / total,
        })
    }
}

/// `(I - K H) P (I - K H)^T + K R K^T`: positive semidefinite whatever the gain (`barshalom2001`, section 5.2).
fn joseph<const N: usize, const M: usize>(
    covariance: &SMatrix<f64, N, N>,
    gain: &SMatrix<f64, N, M>,
    observation: &SMatrix<f64, M, N>,
    noise: &SMatrix<f64, M, M>,
) -> SMatrix<f64, N, N> {
    let kept = SMatrix::<f64, N, N>::identity() - gain * observation;
    symmetric(kept * covariance * kept.transpose() + gain * noise * gain.transpose())
}

fn symmetric<const N: usize>(matrix: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    0.5 * (matrix + matrix.transpose())
}

#[cfg(test)]
mod tests;

//! What a filter settles to, and the closed forms of it.

use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};
use pleiad_estimation::linear::Gaussian;

use super::NAME;
use crate::error::SurveyError;

/// No filter here needs more steps: the slowest forgets a share of one in a thousand at each.
const MOST_STEPS: usize = 200_000;
/// Settled: neither step of the filter changes the covariance by a larger share.
const SETTLED: f64 = 1e-16;

/// A random walk of variance `q` a step, measured with variance `r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarWalk {
    /// Process noise of a step.
    pub q: f64,
    /// Measurement noise.
    pub r: f64,
}

impl ScalarWalk {
    /// Posterior variance in the steady state, `(-Q + sqrt(Q^2 + 4 Q R)) / 2`, written so that it loses no digits
    /// where `Q` is far above `R`.
    pub fn steady_variance(&self) -> f64 {
        let Self { q, r } = *self;
        if q == 0.0 {
            return 0.0;
        }
        2.0 * q * r / (q + (q * q + 4.0 * q * r).sqrt())
    }

    /// Gain in the steady state: the posterior variance over that of the measurement.
    pub fn steady_gain(&self) -> f64 {
        self.steady_variance() / self.r
    }
}

/// What a scalar filter settled to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settled {
    /// Posterior variance.
    pub variance: f64,
    /// Gain.
    pub gain: f64,
    /// Steps it took.
    pub steps: usize,
}

/// Runs the filter of a walk from ten times the variance of a measurement until nothing changes.
///
/// # Errors
/// [`SurveyError::Diverged`] if it does not settle.
pub fn settle_walk(walk: ScalarWalk) -> Result<Settled, SurveyError> {
    let mut belief = Gaussian::new(Vector1::new(0.0), Matrix1::new(10.0 * walk.r));
    let one = Matrix1::new(1.0);
    for steps in 1..=MOST_STEPS {
        let before = belief.covariance[0];
        belief.predict(&one, &Matrix1::new(walk.q));
        let correction =
            belief.update(&Vector1::new(0.0), &one, &Matrix1::new(walk.r)).map_err(|e| diverged(&e))?;
        let variance = belief.covariance[0];
        if (variance - before).abs() <= SETTLED * variance {
            return Ok(Settled { variance, gain: correction.gain[0], steps });
        }
    }
    Err(diverged(&format!("Q = {}, R = {} did not settle in {MOST_STEPS} steps", walk.q, walk.r)))
}

/// The gains of a filter without process noise after `k` measurements, from a prior of variance `prior`, and the
/// closed form `1 / (k + R / prior)` beside them.
///
/// # Errors
/// [`SurveyError::Diverged`] if the filter refuses a measurement.
pub fn vanishing_noise(r: f64, prior: f64, measurements: usize) -> Result<Vec<[f64; 2]>, SurveyError> {
    let mut belief = Gaussian::new(Vector1::new(0.0), Matrix1::new(prior));
    let one = Matrix1::new(1.0);
    (1..=measurements)
        .map(|k| {
            let correction =
                belief.update(&Vector1::new(0.0), &one, &Matrix1::new(r)).map_err(|e| diverged(&e))?;
            Ok([correction.gain[0], 1.0 / (k as f64 + r / prior)])
        })
        .collect()
}

/// The steady state of the constant-velocity filter: position measured, acceleration noise piecewise constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaBeta {
    /// Gain of the position.
    pub alpha: f64,
    /// Gain of the velocity times the period.
    pub beta: f64,
    /// Posterior variances of position and velocity and their covariance, in units of the measurement noise and of
    /// the period.
    pub posterior: [f64; 3],
}

/// Kalata's closed form by the tracking index `sigma_a T^2 / sigma_r` (`kalata1984`; `barshalom2001`, section 6.5).
pub fn kalata(index: f64) -> AlphaBeta {
    let root = ((8.0 + index) * index).sqrt();
    let r = (4.0 + index - root) / 4.0;
    let alpha = 1.0 - r * r;
    let beta = 2.0 * (2.0 - alpha) - 4.0 * r;
    AlphaBeta { alpha, beta, posterior: [alpha, beta * (alpha - beta / 2.0) / (1.0 - alpha), beta] }
}

/// Runs the constant-velocity filter until nothing changes, with a period and a measurement noise of their own.
///
/// # Errors
/// [`SurveyError::Diverged`] if it does not settle.
pub fn settle_constant_velocity(index: f64, period_s: f64, sigma_m: f64) -> Result<AlphaBeta, SurveyError> {
    let t = period_s;
    let acceleration = index * sigma_m / (t * t);
    let (transition, noise) = constant_velocity(t, acceleration);
    let observation = RowVector2::new(1.0, 0.0);
    let variance = sigma_m * sigma_m;
    let mut belief = Gaussian::new(Vector2::zeros(), Matrix2::from_diagonal_element(10.0 * variance));
    for _ in 0..MOST_STEPS {
        let before = belief.covariance;
        belief.predict(&transition, &noise);
        let correction = belief
            .update(&Vector1::new(0.0), &observation, &Matrix1::new(variance))
            .map_err(|e| diverged(&e))?;
        let p = belief.covariance;
        let change = (p - before).abs();
        if (0..2).all(|k| change[(k, k)] <= 10.0 * SETTLED * p[(k, k)]) {
            let units = variance / t;
            return Ok(AlphaBeta {
                alpha: correction.gain[0],
                beta: correction.gain[1] * t,
                posterior: [p[(0, 0)] / variance, p[(1, 1)] * t / units, p[(0, 1)] / units],
            });
        }
    }
    Err(diverged(&format!("tracking index {index} did not settle in {MOST_STEPS} steps")))
}

/// `x += v T + a T^2/2`, `v += a T` with `a` drawn anew each step.
pub(super) fn constant_velocity(t: f64, acceleration_m_s2: f64) -> (Matrix2<f64>, Matrix2<f64>) {
    let push = Vector2::new(0.5 * t * t, t) * acceleration_m_s2;
    (Matrix2::new(1.0, t, 0.0, 1.0), push * push.transpose())
}

fn diverged(what: &impl ToString) -> SurveyError {
    SurveyError::Diverged { study: NAME, seed: 0, what: what.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closed_form_is_a_fixed_point_of_the_riccati_recursion() {
        for (q, r) in [(1e-6, 1.0), (0.3, 2.0), (40.0, 0.1)] {
            let walk = ScalarWalk { q, r };
            let p = walk.steady_variance();
            // P = R (P + Q) / (P + Q + R).
            assert!((p - r * (p + q) / (p + q + r)).abs() < 1e-15 * r, "{q} {r}");
            #[allow(clippy::manual_midpoint, reason = "as it is printed")]
            let as_printed = (-q + (q * q + 4.0 * q * r).sqrt()) / 2.0;
            assert!((p - as_printed).abs() < 1e-14 * (q + r));
        }
    }

    #[test]
    fn kalatas_gains_obey_his_relations() {
        // index^2 = beta^2 / (1 - alpha), beta = 2 (2 - alpha) - 4 sqrt(1 - alpha): what defines them.
        for index in [0.01, 0.3, 1.0, 8.0] {
            let AlphaBeta { alpha, beta, .. } = kalata(index);
            assert!((beta * beta / (1.0 - alpha) - index * index).abs() < 1e-12 * (1.0 + index * index));
            assert!((beta - 2.0 * (2.0 - alpha) + 4.0 * (1.0 - alpha).sqrt()).abs() < 1e-12);
        }
    }
}

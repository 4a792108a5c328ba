//! From samples of velocity to increments of a nominal trajectory.
//!
//! **What is assumed.** A gyro gives the angular rate and something else the velocity of the body's origin, both in the
//! body frame: wheels or legs, a Doppler log, optical flow, an airspeed with known wind. Both vary linearly between two
//! samples. Biases are taken off before; a bias that is left is not in the noise model, nor a rate of the Earth.
//!
//! **Accelerations are not taken.** Their integral is a velocity, whose error is the same at all later times: it belongs in
//! the state (the group of double direct isometries of `barrau2017`), and increments with independent noise would claim
//! that it does not. Who has accelerations alone integrates them elsewhere, with gravity, and gives the velocity found there
//! with a noise that covers its error.

use crate::Timestamp;
use crate::geometry::{Tangent6, Vector3};
use crate::group_fold::{Step, Symmetric};

/// Velocities of a body at one instant, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyRates {
    /// When.
    pub time: Timestamp,
    /// Velocity of the origin of the body frame, m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular rate, rad/s.
    pub angular_rad_s: [f64; 3],
}

impl BodyRates {
    fn twist(&self) -> Tangent6 {
        let ([x, y, z], [a, b, c]) = (self.velocity_m_s, self.angular_rad_s);
        Tangent6::new(x, y, z, a, b, c)
    }
}

/// White noise of the rates, body frame: the covariance of an increment grows with its duration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateNoise {
    /// Random walk of position along each axis, m per square root of a second.
    pub velocity_m_per_sqrt_s: [f64; 3],
    /// Angular random walk about each axis, rad per square root of a second.
    pub angular_rad_per_sqrt_s: [f64; 3],
}

impl RateNoise {
    /// Covariance of an increment that took `seconds`: m^2, rad^2.
    pub fn covariance(&self, seconds: f64) -> Symmetric<6> {
        let ([x, y, z], [a, b, c]) = (self.velocity_m_per_sqrt_s, self.angular_rad_per_sqrt_s);
        Symmetric::diagonal([x, y, z, a, b, c].map(|sigma| sigma * sigma * seconds))
    }
}

/// Why a sample was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SampleRefused {
    /// It is not later than the one before.
    #[error("a sample of {time:?} after one of {last:?}")]
    NotLater {
        /// Of the sample.
        time: Timestamp,
        /// Of the one before.
        last: Timestamp,
    },
    /// More time has passed than a sample may stand for.
    #[error("{seconds} s without a sample, more than {limit_s} s")]
    Gap {
        /// Time between the samples.
        seconds: f64,
        /// The limit.
        limit_s: f64,
    },
    /// A rate is NaN or infinite.
    #[error("a rate is not finite")]
    NotFinite,
}

/// Turns samples into increments: one for each sample but the first.
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    noise: RateNoise,
    limit_s: f64,
    last: Option<BodyRates>,
}

impl DeadReckoning {
    /// With a noise, and the longest time between two samples, seconds.
    pub fn new(noise: RateNoise, limit_s: f64) -> Self {
        Self { noise, limit_s, last: None }
    }

    /// Takes a sample; the increment from the one before to it, if there was one.
    ///
    /// # Errors
    /// [`SampleRefused`]. After a gap the sample is kept as the first of what follows; otherwise nothing has changed.
    pub fn sample(&mut self, rates: BodyRates) -> Result<Option<Step<6>>, SampleRefused> {
        let twist = rates.twist();
        if !twist.iter().all(|rate| rate.is_finite()) {
            return Err(SampleRefused::NotFinite);
        }
        let Some(last) = self.last else {
            self.last = Some(rates);
            return Ok(None);
        };
        if rates.time <= last.time {
            return Err(SampleRefused::NotLater { time: rates.time, last: last.time });
        }
        self.last = Some(rates);
        let seconds = rates.time.seconds_since(last.time);
        if seconds > self.limit_s {
            return Err(SampleRefused::Gap { seconds, limit_s: self.limit_s });
        }
        Ok(Some(Step {
            from: last.time,
            to: rates.time,
            motion: increment(&last.twist(), &twist, seconds),
            covariance: self.noise.covariance(seconds),
        }))
    }
}

/// `u` with `exp(u)` the motion of a body whose twist goes linearly from `a` to `b` in `h` seconds: the first two terms of
/// the Magnus expansion, `h (a + b)/2 + h^2 [a, b]/12`, with an error of the order of `h^5` (`blanes2009`; the sign of the
/// bracket is that for `X' = X a`). The second term is what strapdown navigation calls coning and sculling.
fn increment(a: &Tangent6, b: &Tangent6, h: f64) -> Tangent6 {
    let bracket = bracket(a, b);
    Tangent6::from(std::array::from_fn::<f64, 6, _>(|k| 0.5 * h * (a[k] + b[k]) + h * h / 12.0 * bracket[k]))
}

/// The Lie bracket of two twists `(v, w)`: `(w1 x v2 - w2 x v1, w1 x w2)`.
fn bracket(a: &Tangent6, b: &Tangent6) -> [f64; 6] {
    let parts = |t: &Tangent6| (Vector3::new(t[0], t[1], t[2]), Vector3::new(t[3], t[4], t[5]));
    let ((v1, w1), (v2, w2)) = (parts(a), parts(b));
    let (one, two, turn) = (cross(&w1, &v2), cross(&w2, &v1), cross(&w1, &w2));
    [one.x - two.x, one.y - two.y, one.z - two.z, turn.x, turn.y, turn.z]
}

fn cross(a: &Vector3, b: &Vector3) -> Vector3 {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

#[cfg(test)]
mod tests;

//! One robot on its own: an extended Kalman filter over named states, into which every sensor comes as scalar
//! measurements at its own instants.
//!
//! A [`Process`] says which states there are and how they move, a [`Sensor`] what a reading of them is. Readings
//! are taken one at a time, whichever is there (Roumeliotis & Bekey 1997), so that sensors may have any rates. One that
//! arrives late goes through [`Replay`] to the instant at which it was taken.

mod process;
mod replay;
mod sensor;

pub use process::{PairOfWheels, Prediction, Process, RandomWalks, Unicycle};
pub use replay::Replay;
pub use sensor::Sensor;

use crate::Timestamp;
use crate::geometry::wrap_angle;
use crate::linear::{Gaussian, LinearError};

/// A reading of one value of one sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<const N: usize> {
    /// When it was taken.
    pub time: Timestamp,
    /// What it reads.
    pub sensor: Sensor<N>,
    /// What was read; angles in radians.
    pub value: f64,
    /// Variance of its noise.
    pub variance: f64,
}

/// What an update did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It was used.
    Used {
        /// Measured minus predicted; angles wrapped.
        innovation: f64,
        /// Normalized innovation squared, of one degree of freedom.
        nis: f64,
    },
    /// The sensor says nothing of a robot in this state (a steering angle at standstill); nothing was changed but
    /// the time.
    NoDerivative,
}

/// Why a measurement was refused; the filter is then as it was.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SingleError {
    /// Taken before the filter's present: for [`Replay`].
    #[error("the measurement at {time} is before the filter's {now}; late ones go through a replay")]
    BeforeNow {
        /// When it was taken.
        time: Timestamp,
        /// Where the filter is.
        now: Timestamp,
    },
    /// Taken before everything that a [`Replay`] has kept.
    #[error(
        "the measurement at {time} is older than what is kept, which begins after {from}; keep a longer window"
    )]
    TooOld {
        /// When it was taken.
        time: Timestamp,
        /// After when measurements are accepted.
        from: Timestamp,
    },
    /// Its numbers cannot be used.
    #[error("the measurement at {time}: {source}")]
    Value {
        /// When it was taken.
        time: Timestamp,
        /// Why.
        source: LinearError,
    },
}

/// The filter of one robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Ekf<P, const N: usize> {
    process: P,
    time: Timestamp,
    belief: Gaussian<N>,
}

impl<P: Process<N>, const N: usize> Ekf<P, N> {
    /// Begins with a belief at an instant.
    pub fn new(process: P, time: Timestamp, belief: Gaussian<N>) -> Self {
        Self { process, time, belief }
    }

    /// Where the filter is: the last measurement.
    pub fn time(&self) -> Timestamp {
        self.time
    }

    /// What is believed now.
    pub fn belief(&self) -> &Gaussian<N> {
        &self.belief
    }

    /// The belief carried to another instant, from which the filter does not go on: a question changes nothing.
    /// An earlier instant gives the present belief.
    pub fn at(&self, time: Timestamp) -> Gaussian<N> {
        let mut belief = self.belief;
        self.carry(&mut belief, time);
        belief
    }

    /// Mean and standard deviation of a state by its name; `None` if there is none of this name.
    pub fn state(&self, name: &str) -> Option<(f64, f64)> {
        let index = self.process.names().iter().position(|own| *own == name)?;
        Some((self.belief.mean[index], self.belief.sigma(index)))
    }

    /// Goes on to the instant of a measurement and takes it.
    ///
    /// # Errors
    /// [`SingleError`]; the filter is then unchanged.
    pub fn take(&mut self, measurement: &Measurement<N>) -> Result<Outcome, SingleError> {
        let time = measurement.time;
        if time < self.time {
            return Err(SingleError::BeforeNow { time, now: self.time });
        }
        let mut belief = self.at(time);
        let mut outcome = Outcome::NoDerivative;
        if let Some((predicted, row)) = measurement.sensor.predict(&belief.mean) {
            let plain = measurement.value - predicted;
            let innovation = if measurement.sensor.is_angle() { wrap_angle(plain) } else { plain };
            let correction = belief
                .correct_scalar(innovation, &row, measurement.variance)
                .map_err(|source| SingleError::Value { time, source })?;
            self.wrap(&mut belief);
            outcome = Outcome::Used { innovation, nis: correction.nis };
        }
        self.belief = belief;
        self.time = time;
        Ok(outcome)
    }

    fn carry(&self, belief: &mut Gaussian<N>, time: Timestamp) {
        let seconds = time.seconds_since(self.time);
        if seconds <= 0.0 {
            return;
        }
        let Prediction { mean, transition, noise } = self.process.predict(&belief.mean, seconds);
        belief.carry(mean, &transition, &noise);
        self.wrap(belief);
    }

    fn wrap(&self, belief: &mut Gaussian<N>) {
        let heading = self.process.heading();
        belief.mean[heading] = wrap_angle(belief.mean[heading]);
    }
}

#[cfg(test)]
mod tests;

//! The nominal trajectory `N(t)` of one boot and its accumulated process noise `C(t)`, for any group.

use std::collections::VecDeque;

use super::Symmetric;
use crate::Timestamp;
use crate::geometry::{LieGroup, Tangent};

/// A robot's nominal trajectory and accumulated process noise at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NominalState<G, const D: usize> {
    /// `N(t)`: increments composed from the start of the boot, never corrected.
    pub nominal: G,
    /// `C(t) = sum Ad_N Q Ad_N^T`, in the frame of the nominal trajectory.
    pub noise_sum: Symmetric<D>,
}

/// The motion of a body from one instant to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<const D: usize> {
    /// Begin.
    pub from: Timestamp,
    /// End.
    pub to: Timestamp,
    /// `u` with `N <- N exp(u)`, body frame.
    pub motion: Tangent<D>,
    /// Covariance of `w` in `X <- X exp(u) exp(w)`: body frame after the step.
    pub covariance: Symmetric<D>,
}

/// Why a trajectory has no state at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Before its start.
    Before,
    /// Within it, but no longer kept.
    Forgotten,
    /// After its last increment: it may still come.
    After,
}

/// Why a step was refused; the trajectory is then as it was.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepRefused {
    /// It does not begin where the trajectory ends.
    #[error("the step begins at {from:?}, the trajectory ends at {end:?}")]
    Gap {
        /// End of the trajectory.
        end: Timestamp,
        /// Begin of the step.
        from: Timestamp,
    },
    /// It does not end after it begins.
    #[error("the step takes no time: it ends at {to:?}")]
    NoTime {
        /// End of the step.
        to: Timestamp,
    },
    /// The motion is not finite.
    #[error("the motion is not finite")]
    Motion,
    /// The covariance is not finite or not positive semidefinite.
    #[error("the covariance of the step is not positive semidefinite")]
    Covariance,
}

/// Increments composed from the start of a boot, never corrected, with a history to look back into.
#[derive(Clone, Debug)]
pub struct Trajectory<G, const D: usize> {
    // Never empty: built with one tick, and only the oldest of three or more is dropped.
    ticks: VecDeque<(Timestamp, NominalState<G, D>)>,
    horizon: usize,
    start: Timestamp,
    last: (Timestamp, NominalState<G, D>),
}

impl<G: LieGroup<D>, const D: usize> NominalState<G, D> {
    /// Of a boot that begins.
    pub fn begin(nominal: G) -> Self {
        Self { nominal, noise_sum: Symmetric::zero() }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.nominal.is_finite() && self.noise_sum.is_finite()
    }
}

impl<G: LieGroup<D>, const D: usize> Trajectory<G, D> {
    /// Starts at `time` with `N = nominal` and `C = 0`, keeping the last `horizon` ticks (at least two).
    pub fn new(time: Timestamp, nominal: G, horizon: usize) -> Self {
        let last = (time, NominalState::begin(nominal));
        Self { ticks: VecDeque::from([last]), horizon: horizon.max(2), start: time, last }
    }

    /// The last increment.
    pub fn end(&self) -> (Timestamp, NominalState<G, D>) {
        self.last
    }

    /// `N <- N exp(u)`, `C <- C + Ad_N Q Ad_N^T` with the adjoint at the pose after the step.
    ///
    /// # Errors
    /// [`StepRefused`] if the step does not continue the trajectory or is not a motion.
    pub fn extend(&mut self, step: &Step<D>) -> Result<(), StepRefused> {
        let (end, last) = self.last;
        if step.from != end {
            return Err(StepRefused::Gap { end, from: step.from });
        }
        if step.to <= step.from {
            return Err(StepRefused::NoTime { to: step.to });
        }
        if !step.motion.iter().all(|component| component.is_finite()) {
            return Err(StepRefused::Motion);
        }
        if !(step.covariance.is_finite() && step.covariance.is_positive_semidefinite()) {
            return Err(StepRefused::Covariance);
        }
        let nominal = last.nominal.compose(&G::exp(&step.motion));
        let noise_sum = last.noise_sum.plus(&step.covariance.congruence(&nominal.adjoint()));
        self.last = (step.to, NominalState { nominal, noise_sum });
        self.ticks.push_back(self.last);
        if self.ticks.len() > self.horizon {
            self.ticks.pop_front();
        }
        Ok(())
    }

    /// The state at `time`: the pose interpolated on the group, the noise sum linearly.
    ///
    /// A share of the noise of a step is positive semidefinite; the adjoint taken anew inside of it need not leave it so.
    ///
    /// # Errors
    /// [`Outside`] if the trajectory does not cover `time`.
    pub fn at(&self, time: Timestamp) -> Result<NominalState<G, D>, Outside> {
        if time < self.start {
            return Err(Outside::Before);
        }
        let after = self.ticks.partition_point(|(tick, _)| *tick < time);
        let Some((to, next)) = self.ticks.get(after) else { return Err(Outside::After) };
        if *to == time {
            return Ok(*next);
        }
        let Some((from, last)) = after.checked_sub(1).and_then(|before| self.ticks.get(before)) else {
            return Err(Outside::Forgotten);
        };
        let share = time.seconds_since(*from) / to.seconds_since(*from);
        let motion = last.nominal.between(&next.nominal).log() * share;
        let grown = next.noise_sum.minus(&last.noise_sum).scaled(share);
        Ok(NominalState {
            nominal: last.nominal.compose(&G::exp(&motion)),
            noise_sum: last.noise_sum.plus(&grown),
        })
    }
}

//! One robot's own block in the invariant error: what every approximate strategy but `factored` keeps.

use super::fusion::{self, Fused, Measured, Split};
use crate::fact::{Noise, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::joint::ErrorForm;
use crate::measurement;
use crate::symmetric::Symmetric3;
use crate::{Pose2, Timestamp};

use super::View;

/// A robot's nominal state at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instant {
    pub time: Timestamp,
    pub state: NominalState,
}

/// Correction and covariance of one robot as of its last event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    /// `G`: the estimate at any time is `G N(t)`.
    pub correction: Pose2,
    /// Of the invariant error at the last event.
    pub covariance: Matrix3,
    /// The part of it that no other robot has been told and that came from none.
    pub independent: Matrix3,
    /// The noise sum already folded into the covariance.
    pub folded: Symmetric3,
    /// The last event.
    pub last: Timestamp,
}

impl Block {
    /// From a prior with noise in its own body frame: independent of everybody.
    pub fn placed(at: &Instant, pose: &Pose2, noise: &Noise) -> Self {
        let adjoint = pose.adjoint();
        let covariance = adjoint * measurement::noise_matrix(noise) * adjoint.transpose();
        Self {
            correction: pose.compose(&at.state.nominal.inverse()),
            covariance,
            independent: covariance,
            folded: at.state.noise_sum,
            last: at.time,
        }
    }

    /// The estimate on the nominal trajectory.
    pub fn pose(&self, state: &NominalState) -> Pose2 {
        self.correction.compose(&state.nominal)
    }

    /// With the process noise up to `at`. An instant before the last event leaves the block as it is: the
    /// noise of the little time between counts as if it had come first.
    pub fn at(&self, at: &Instant) -> Self {
        if at.time <= self.last {
            return *self;
        }
        let adjoint = self.correction.adjoint();
        let grown = at.state.noise_sum.minus(self.folded).congruence(&adjoint).to_matrix();
        Self {
            covariance: self.covariance + grown,
            independent: self.independent + grown,
            folded: at.state.noise_sum,
            last: at.time,
            ..*self
        }
    }

    /// Both parts of the covariance, as covariance intersection weighs them.
    pub fn split(&self) -> Split {
        Split { correlated: self.covariance - self.independent, independent: self.independent }
    }

    /// Moves the estimate and takes over the new covariance.
    pub fn take(&mut self, fused: &Fused) {
        self.correction = Pose2::exp(fused.correction).compose(&self.correction);
        self.covariance = fused.covariance;
        self.independent = fused.independent;
    }

    /// The Kalman update with a measurement against the map, or why not. The result is what [`Block::take`]
    /// takes, with the matrix that the update multiplies the error with.
    pub fn against_map(
        &self,
        at: &Instant,
        quantity: &Quantity,
        noise: &Noise,
        gate: &[f64; 3],
    ) -> Option<Result<(Fused, Matrix3), Rejected>> {
        let (linearization, sign) = match quantity {
            Quantity::Absolute(absolute) => (measurement::of_map(absolute, &self.pose(&at.state)), 1.0),
            Quantity::Landmark { position_m: [x, y], relative, .. } => {
                let seen = measurement::of_point(relative, &self.pose(&at.state), Vector2::new(*x, *y));
                (seen.ok()?, -1.0)
            }
            Quantity::Robot { .. } | Quantity::Feature { .. } => return None,
        };
        let measured = Measured {
            dimension: linearization.dimension,
            innovation: linearization.innovation,
            jacobian: linearization.jacobian * sign,
            correlated: Matrix3::zeros(),
            independent: Matrix3::zeros(),
            noise: measurement::noise_matrix(noise),
        };
        // Nothing of this can be correlated with the robot's own error: the ordinary update.
        let own = Split { correlated: Matrix3::zeros(), independent: self.covariance };
        let mut fused = fusion::fuse(&own, &measured, 0.5)?;
        if fused.nis > gate[measured.dimension - 1] {
            return Some(Err(Rejected));
        }
        let keep = Matrix3::identity() - fused.gain * measured.jacobian;
        fused.independent =
            keep * self.independent * keep.transpose() + fused.gain * measured.noise * fused.gain.transpose();
        Some(Ok((fused, keep)))
    }

    /// The view of it at an instant.
    pub fn view(&self, at: &Instant) -> View {
        let now = self.at(at);
        View {
            time: at.time,
            pose: now.pose(&at.state),
            form: ErrorForm::Invariant,
            covariance: now.covariance,
            row: std::collections::BTreeMap::new(),
        }
    }
}

/// The gate refused a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rejected;

/// A correction as a vector, for messages.
pub(super) fn apply(correction: &Pose2, by: Vector3) -> Pose2 {
    Pose2::exp(by).compose(correction)
}

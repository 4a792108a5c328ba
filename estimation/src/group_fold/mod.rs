//! The fold of facts into a joint filter, written once for every group a robot's pose can live in.
//!
//! The same filter as [`crate::fold`] and [`crate::joint`], of which it is the part that knows no plane: propagation by
//! differences of noise sums, right-invariant errors, one form of update (`docs/theory.md`, sections 2 to 6 and "Three
//! dimensions"). With [`Pose2`](crate::Pose2) it gives the numbers of the planar fold; with
//! [`Pose3`](crate::geometry::Pose3) it is the filter in space. What a group must say of its measurements is [`Space`].
//!
//! Not here: the additive form, calibration, clutter, maps of unknown landmarks, relinearization.

mod covariance;
mod fact;
mod joint;
mod nominal;
mod planar;
mod set;
mod space;
mod symmetric;

pub use covariance::TeamCovariance;
pub use fact::{Continuation, Fact, Noise, Quantity, Unsound};
pub use joint::{FoldConfig, Joint, Member, Outcome, Residual, SkipReason};
pub use nominal::{NominalState, Outside, Step, StepRefused, Trajectory};
pub use set::{FactSet, Insertion};
pub use space::{Linearization, Measured, Space, Unusable};
pub use symmetric::Symmetric;

#[cfg(test)]
mod tests;

//! Robots in space: what they measure of each other and how they move.
//!
//! Poses are [`Pose3`](crate::geometry::Pose3), the body frame is x forward, y left, z up, the map frame z up. The filter is
//! [`crate::group_fold`] with that group; this module gives it the measurement models (`docs/theory.md`, "Three dimensions") and
//! turns samples of velocity into increments.

mod direction;
mod measurement;
mod rates;

pub use direction::{between_directions, tangent_basis};
pub use measurement::{Absolute3, Direction, NotADirection, Point3, Relative3};
pub use rates::{BodyRates, DeadReckoning, RateNoise, SampleRefused};

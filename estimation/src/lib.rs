//! The estimator of Pleiad: geometry, motion, measurement models, and the fold of facts
//! into a joint extended Kalman filter that no machine owns.
//!
//! Nothing here reads a clock, opens a file, spawns a task, knows a serialization format or logs.
//! Time and randomness come in as arguments; the same facts give the same bits everywhere.
//!
//! Conventions are stated once in `docs/notation.md`: planar pose `map_from_robot`, tangent order
//! `(x, y, yaw)`, SI units, right-invariant error `X = exp(xi) X_hat`.

pub mod fact;
pub mod fold;
pub mod geometry;
pub mod group_fold;
pub mod hypotheses;
pub mod identity;
pub mod joint;
pub mod ledger;
pub mod likelihood;
pub mod linear;
pub mod measurement;
pub mod motion;
pub mod nominal;
pub mod observability;
pub mod reference;
pub mod sample;
pub mod single;
pub mod slam;
pub mod spatial;
pub mod statistics;
pub mod strategy;
pub mod symmetric;

pub use geometry::Pose2;
pub use identity::{BootIndex, LandmarkId, RobotId, Sequence, Timestamp};

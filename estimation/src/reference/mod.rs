//! Reference filters: centralized, slow and plain, written from the equations and not from the code
//! they check. Nothing here is shared with the production fold but the plain data types.
//!
//! - [`JointEkf`] folds a set of facts, in the invariant or the additive error;
//! - [`PerTickEkf`] is the textbook joint filter that steps every robot at every odometry tick;
//! - [`spatial::SpatialEkf`] is the textbook joint filter in space, with numerical derivatives;
//! - [`RoumeliotisBekey`] is the published distributed form, each robot keeping its row of factors.
//!
//! Dense matrices of dynamic size, trigonometry of the standard library, the full Joseph form:
//! results are exact to rounding but not bit-identical between processors.

mod facts;
mod joint;
mod joint_ekf;
mod models;
mod per_tick;
mod roumeliotis_bekey;
pub mod spatial;

pub use facts::{FactContent, Measurement, ReferenceFact, State, facts_from_entries, halves_from_entries};
pub use joint::JointCovariance;
pub use joint_ekf::{DEFAULT_GATE, FactRecord, JointEkf, JointEstimate, RobotEstimate};
pub use models::{ErrorForm, Linearized, Outcome, SkipReason, linearize};
pub use per_tick::{PerTickEkf, Tick, TimedMeasurement};
pub use roumeliotis_bekey::{Broadcast, ReferenceError, RoumeliotisBekey};

#[cfg(test)]
mod simulation;

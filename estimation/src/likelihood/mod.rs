//! Noise levels from what a team recorded of itself: the likelihood of the fold's own innovations, and where it is largest.
//!
//! The likelihood of a set of facts under noise levels is the product of the densities with which the fold predicts each
//! measurement from those before it (prediction-error decomposition, Schweppe 1965; `docs/theory.md`, noise levels):
//!
//! ```text
//! log L = sum_k log( (1 - share) N(nu_k; 0, S_k) + share / V_k )
//! ```
//!
//! with innovation `nu_k` and its covariance `S_k` as the fold forms them, and `V_k` the volume of the readings the
//! sensor can give: with probability `share` a measurement is of nothing, which is the model of
//! [`Clutter`](crate::fold::Clutter), and the fold that is run is the one of that model, without a gate. So a measurement
//! far off contributes a bounded amount and moves nothing, and the value is a smooth function of the levels.
//!
//! Everything here needs the levels only through the variances that each contributes ([`UnitTrajectory`]), so that facts are
//! gathered once and folded again under other levels.

mod density;
mod facts;
mod information;
mod levels;
mod maximize;
mod problem;

pub use density::{FactScore, scores};
pub use facts::{TunableFact, UnitSums, UnitTrajectory};
pub use information::{Information, Range, information};
pub use levels::{Level, Levels};
pub use maximize::{Evaluate, Maximum, maximize};
pub use problem::{Problem, largest_reading_m};

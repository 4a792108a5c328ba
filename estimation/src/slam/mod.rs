//! Simultaneous localization and mapping by an extended Kalman filter (`dissanayake2001`): one vehicle and the
//! landmarks it sees in one state.
//!
//! **The error.** A landmark is written as a robot that never moves, left behind where the vehicle saw it: its
//! block is the right-invariant error `xi` of a pose whose heading is the one the vehicle had then. So every block
//! of the state is what it is in the team's filter (`docs/theory.md`): motion has `Phi = I` and touches the vehicle's
//! block alone, and a measurement has `H_observer = -H_landmark` exactly, whatever the estimates. The map's
//! common shift and turn, which no sighting measures, are in the null space of every update, and the limit of a
//! landmark's covariance is the vehicle's first one at any linearization. The additive error, the textbook's,
//! is there to be compared: it linearizes that turn at different estimates and gains what was not measured
//! (`julier2001slam`, `huang2007slam`). Others keep two numbers per landmark in the group SE_{n+1}(2) and pay with process
//! noise in all of them (`barrau2015slam`); here a landmark takes three and a step costs nothing.
//!
//! **The parts.** `initialize` places a landmark from one range and bearing or from two bearings; `associate`
//! decides which landmark was seen; [`BearingTrack`] waits until bearings of one landmark cross well. None of
//! them knows the filter. [`SlamState`] is the filter's algebra, [`Slam`] takes scans, [`JointSlam`] takes scans with several
//! maps side by side, [`SlamRun`] takes samples.
//!
//! **Cost.** An update of `n` landmarks takes `O(n^2)` and inverts nothing larger than 2x2; a new landmark takes `O(n)`.

mod associate;
mod bearings;
mod filter;
mod initialize;
mod run;
mod state;

pub use associate::{Candidate, Choice, associate};
pub use bearings::{BearingTrack, DelayedRules, KeptBearing};
pub use filter::{Association, JointRules, JointSlam, MapEntry, MapId, Outcome, Slam, SlamSettings};
pub use initialize::{Initialized, Sight, from_bearings, from_one};
pub use run::{Refused, ScanOutcome, SlamRun};
pub use state::{Block, Innovation, SlamState};

#[cfg(test)]
mod joint_tests;
#[cfg(test)]
mod tests;

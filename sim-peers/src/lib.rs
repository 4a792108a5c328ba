//! Simulated robots: a world in which true motion and every sensor follow from one seed.
//!
//! [`Scenario`] says who moves how and senses what; [`simulate`] turns it into a
//! [`pleiad_recording::Recording`] with truth, landmarks, nominal and commands, much faster than real
//! time. What is random is drawn from one generator per robot and channel, so that adding a robot or a
//! sensor leaves the noise of all others as it was.
//!
//! [`Fleet`] runs real nodes on such samples, or on recorded ones, in one process under virtual time;
//! [`feed()`] hands them to running agents through their sensor keys.

pub mod agents;
pub mod error;
pub mod feed;
pub mod fleet;
mod injected;
pub mod reckoning;
pub mod scenario;
pub mod simulation;
pub mod strategies;
pub mod world;

pub use error::Error;
pub use feed::{FeedOptions, FeedReport, feed};
pub use fleet::{Fleet, FleetOptions, MemberOutcome};
pub use injected::injected_text;
pub use scenario::Scenario;
pub use world::{Prior, SimulatedRun, connectivity, simulate};

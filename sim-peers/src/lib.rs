//! Simulated robots: a world in which true motion and every sensor follow from one seed.
//!
//! [`Scenario`] says who moves how and senses what; [`simulate`] turns it into a
//! [`pleiad_recording::Recording`] with truth, landmarks, nominal and commands, much faster than real
//! time. What is random is drawn from one generator per robot and channel, so that adding a robot or a
//! sensor leaves the noise of all others as it was.

pub mod error;
pub mod scenario;
pub mod world;

pub use error::Error;
pub use scenario::Scenario;
pub use world::{Prior, SimulatedRun, connectivity, simulate};

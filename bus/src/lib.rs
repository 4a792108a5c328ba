//! The message bus. This is the one crate that names zenoh; everything else speaks to [`Bus`], which an
//! in-memory network implements as well, so that the same test body runs on both.
//!
//! [`faults`] is a network under virtual time, for fleets in one thread: seeded loss, delay, jitter,
//! duplicates and partitions.

mod channel;
mod expression;
pub mod faults;
mod faulty;
mod memory;
mod traits;
mod zenoh_bus;
mod zenoh_config;

pub use faults::{FaultPlan, FaultsError, Injector, LinkFaults, VirtualNetwork};
pub use faulty::FaultyBus;
pub use memory::{MemoryBus, MemoryNetwork, MemoryToken};
pub use traits::{Bus, BusError, Incoming, Liveliness, Query};
pub use zenoh_bus::{ZenohBus, ZenohToken};
pub use zenoh_config::{ZenohConfig, ZenohMode};

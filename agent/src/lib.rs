//! One robot's part of the distributed filter: the [`Node`], a pure state machine that takes events and
//! gives commands, and the driver that connects it to a bus, a clock and a journal on disk.
//!
//! Simulated, replayed and live runs differ in the driver alone.

pub mod approximate;
pub mod config;
pub mod driver;
pub mod journal;
mod node;
pub mod results;
pub mod role;
pub mod strategy;

pub use approximate::Approximate;
pub use config::{AgentConfig, ConfigError, NodeConfig};
pub use node::{Command, Event, Node, Notice, Record, SettledEstimate};
pub use pleiad_estimation::sample::SampleRefusal;
pub use role::Role;
pub use strategy::Participant;

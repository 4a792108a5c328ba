//! One robot's part of the distributed filter: the [`Node`], a pure state machine that takes events and
//! gives commands, and the driver that connects it to a bus, a clock and a journal on disk.
//!
//! Simulated, replayed and live runs differ in the driver alone.

pub mod config;
pub mod driver;
pub mod journal;
mod node;
pub mod results;
pub mod strategy;

pub use config::{AgentConfig, ConfigError, NodeConfig};
pub use node::{Command, Event, Node, Notice, Record, SampleRefusal, SettledEstimate};
pub use strategy::Participant;

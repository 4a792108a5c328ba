//! Launches a team of agents as processes, watches them, asks for their statuses, ends them, and records
//! what they publish.
//!
//! The coordinator is off the critical path: agents need neither it nor its network links, run in process
//! groups of their own, and do not notice when it is killed. It compares estimates by their fingerprints
//! and never looks into one.

pub mod config;
mod control;
mod endpoints;
mod error;
mod handle;
mod log_tail;
mod membership;
mod process;
pub mod recorder;
mod remote;
mod restart;
mod run;
mod schedule;
mod settled;
mod supervisor;
mod team;

pub use config::{AgentEntry, BusMode, BusSection, ConfigError, CoordinatorConfig};
pub use endpoints::{Endpoint, endpoints};
pub use error::{CoordinatorError, Trouble};
pub use handle::{Departure, How};
pub use membership::{Member, ProcessState, TeamEvent};
pub use process::ProcessSignal;
pub use recorder::{Recorder, RecorderError, Traffic};
pub use remote::{EvictError, Remote};
pub use restart::{Backoff, Exit, Restart};
pub use run::{RunReport, run};
pub use schedule::{Act, Schedule, ScheduleError};
pub use settled::{Difference, differences};
pub use team::Team;

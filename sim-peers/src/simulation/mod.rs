//! A whole team of real nodes under virtual time, over a virtual network and virtual disks, everything from
//! one seed: what is lost, when who is killed, which disks lose what was not synced. After every event the
//! invariants of the ledger are checked on the node that handled it; in the end the team must agree, with an
//! oracle too.
//!
//! `docs/ledger.md` says what is checked, and which mistakes were planted to see that it is found.

mod chance;
mod check;
mod disk;
mod network;
mod oracle;
mod plan;
mod run;
mod team;
mod units;

pub use check::Violation;
pub use plan::Plan;
#[cfg(feature = "planted")]
pub use pleiad_estimation::ledger::Planted;
pub use run::{Hour, Outcome, operate, run};

/// What is simulated besides what the seed decides.
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// A mistake in every node.
    #[cfg(feature = "planted")]
    pub planted: Option<Planted>,
    /// Only losses and partitions: no process dies and no disk fails.
    pub partitions_only: bool,
    /// Operators and majorities evict robots too.
    pub evictions: bool,
    /// With so many items in memory a robot observes nothing more; else as by default.
    pub most_items: Option<usize>,
    /// Facts are linearized together. There is no oracle of that: the estimate is held against one fold of all that is
    /// accepted.
    pub relinearize: bool,
    /// Robots ask for their parameters, for the place of the landmark, and weigh garbage. There is no oracle of that either.
    pub calibrate: bool,
}

//! Entries that robots wrote down, folded from nothing.

use pleiad_estimation::fact::{Entry, LogId};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::ledger::{Insertion, Ledger};
use pleiad_estimation::{BootIndex, RobotId};

/// Entries folded from nothing, in the order given.
///
/// # Panics
/// If one of them contradicts another or can never be used.
pub fn fold(entries: impl IntoIterator<Item = Entry>) -> Ledger {
    let mut ledger = Ledger::new(FoldConfig::default());
    for entry in entries {
        let id = entry.id;
        let insertion = ledger.insert(entry);
        let good = matches!(insertion, Insertion::Added { .. } | Insertion::Duplicate | Insertion::Waiting);
        assert!(good, "{id}: {insertion:?}");
    }
    ledger.settle();
    ledger
}

/// The log of a robot's boot.
pub fn log(robot: RobotId, boot: u32) -> LogId {
    LogId { robot, boot: BootIndex(boot) }
}

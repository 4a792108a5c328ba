//! Entries by which a team closes its past: seals and votes on its membership. The rules are in
//! `docs/ledger.md`.

use super::LogId;
use crate::{BootIndex, RobotId, Timestamp};

/// A promise in two stages, and how much of its logs a robot has written. All times only ever grow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seal {
    /// Stage one: no further observation of this robot's own is stamped at or before this.
    pub observed: Timestamp,
    /// Stage two: this robot holds every member's logs as far as a stage one at or after this, and has
    /// answered everything in them that names it and is stamped at or before this.
    pub answered: Timestamp,
    /// What this robot has closed itself: it needs nothing from before that cut any more.
    pub closed: Timestamp,
    /// This robot's other logs that may still be open.
    pub logs: Vec<SealedLog>,
}

/// One of a robot's older logs, as stated in a seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SealedLog {
    /// Of which boot.
    pub boot: BootIndex,
    /// Its number of entries when the seal was written.
    pub length: u64,
    /// Whether it ends there: what anyone holds beyond was lost by its author, and is not accepted.
    pub last: bool,
}

/// A vote on who belongs to the team from now on. It takes effect once every member that would stay has
/// given the same one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vote {
    /// How many changes came before.
    pub epoch: u32,
    /// Members to be evicted, ascending.
    pub removed: Vec<RobotId>,
    /// How much of their logs is accepted, ascending.
    pub held: Vec<(LogId, u64)>,
    /// Robots to be admitted, and from which boot on, ascending.
    pub added: Vec<(RobotId, BootIndex)>,
    /// They take part in what happens after this.
    pub from: Timestamp,
    /// An operator wants it: no majority is needed.
    pub operator: bool,
}

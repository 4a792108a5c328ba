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

/// One attempt of a robot to change the team. Later ones are greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ballot {
    /// Rounds before it in this epoch.
    pub round: u32,
    /// Whose attempt it is.
    pub robot: RobotId,
}

/// Stands for the length of a log that is over, accounted for and forgotten, as all before it of its robot are.
pub const WHOLE: u64 = u64::MAX;

/// How much of a log a list says is held or accepted.
pub fn length_of(lengths: &[(LogId, u64)], log: LogId) -> Option<u64> {
    let whole = |of: LogId, length| length == WHOLE && of.robot == log.robot && log.boot <= of.boot;
    let stated = lengths.iter().filter(|(of, length)| *of == log || whole(*of, *length));
    stated.map(|(_, length)| *length).max()
}

/// A vote on who belongs to the team from now on. The robot whose ballot it is asks by promising itself,
/// proposes by accepting first, and the others follow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vote {
    /// How many changes came before.
    pub epoch: u32,
    /// In which attempt.
    pub ballot: Ballot,
    /// The proposal of the ballot is accepted. Otherwise a promise to accept none of an earlier ballot; the
    /// fields below are then what the promising robot itself holds and has sealed.
    pub accepted: bool,
    /// Members to be evicted, ascending.
    pub removed: Vec<RobotId>,
    /// How much of their logs is accepted, ascending, see [`length_of`]. A promise relies on nothing beyond.
    pub held: Vec<(LogId, u64)>,
    /// Robots to be admitted, and from which boot on, ascending.
    pub added: Vec<(RobotId, BootIndex)>,
    /// They take part in what happens after this. A promise seals nothing beyond before the epoch is decided.
    pub from: Timestamp,
    /// An operator wants it: no majority is needed.
    pub operator: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_log_stands_for_all_before_it_of_its_robot_alone() {
        let log = |robot, boot| LogId { robot: RobotId(robot), boot: BootIndex(boot) };
        let lengths = [(log(1, 0), 7), (log(1, 2), WHOLE), (log(1, 3), 5), (log(2, 1), 4)];
        let found = [(1, 0), (1, 1), (1, 2), (1, 3), (1, 4), (2, 0), (2, 1)];
        let found = found.map(|(robot, boot)| length_of(&lengths, log(robot, boot)));
        let expected = [Some(WHOLE), Some(WHOLE), Some(WHOLE), Some(5), None, None, Some(4)];
        assert_eq!(found, expected);
    }
}

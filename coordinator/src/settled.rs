//! Whether a team has settled: everyone has done what can be done, holds the same entries, and has the
//! same estimate. Told from statuses alone; an estimate is compared by its fingerprint, never looked into.
//!
//! Pending facts need no rule of their own. A robot is `drained` when every observation *it knows of* that
//! names it is answered; where all hold the same logs, everyone knows all observations, so what is then
//! still pending names a robot that is gone or waits for a join that the facts do not allow.

use std::collections::BTreeMap;
use std::fmt;

use pleiad_protocol::{RobotId, Status};

/// In what a team differs from a settled one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Difference {
    /// No status came.
    Silent {
        /// From whom.
        robot: RobotId,
        /// Why not.
        cause: String,
    },
    /// Another configuration of what decides bits: these two will never agree.
    Configuration {
        /// Who differs.
        robot: RobotId,
        /// Its hash.
        found: u64,
        /// From whom.
        other: RobotId,
        /// The other's hash.
        expected: u64,
    },
    /// Sensor input is still expected.
    InputOpen {
        /// By whom.
        robot: RobotId,
    },
    /// Observations are still to be answered.
    NotDrained {
        /// By whom.
        robot: RobotId,
        /// How many facts are pending in its eyes.
        pending: u64,
    },
    /// Entries are missing.
    Behind {
        /// Who lacks them.
        robot: RobotId,
        /// The log: whose, and of which boot.
        log: (RobotId, u32),
        /// How many entries it holds.
        held: u64,
        /// Who holds more.
        other: RobotId,
        /// How many.
        expected: u64,
    },
    /// Equally many entries of a log, but not the same ones: these two will never agree.
    Fork {
        /// Who differs.
        robot: RobotId,
        /// From whom.
        other: RobotId,
        /// The log: whose, and of which boot.
        log: (RobotId, u32),
        /// How many entries both hold.
        held: u64,
    },
    /// The estimates differ.
    Estimate {
        /// Who differs.
        robot: RobotId,
        /// Its fingerprint.
        found: String,
        /// From whom.
        other: RobotId,
        /// The other's fingerprint.
        expected: String,
    },
}

impl Difference {
    /// Whether waiting cannot help.
    pub fn permanent(&self) -> bool {
        matches!(self, Self::Configuration { .. } | Self::Fork { .. })
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent { robot, cause } => write!(f, "robot {robot} gave no status: {cause}"),
            Self::Configuration { robot, found, other, expected } => write!(
                f,
                "robot {robot} has configuration {found:016x}, robot {other} {expected:016x}: give both the \
                 same strategy and [filter]"
            ),
            Self::InputOpen { robot } => write!(f, "robot {robot} still expects sensor input"),
            Self::NotDrained { robot, pending } => {
                write!(f, "robot {robot} has observations to answer ({pending} facts pending)")
            }
            Self::Behind { robot, log: (of, boot), held, other, expected } => write!(
                f,
                "robot {robot} holds {held} entries of the log of robot {of} boot {boot}, robot {other} \
                 {expected}"
            ),
            Self::Fork { robot, other, log: (of, boot), held } => write!(
                f,
                "robots {robot} and {other} hold different entries among the first {held} of the log of \
                 robot {of} boot {boot}"
            ),
            Self::Estimate { robot, found, other, expected } => {
                write!(f, "robot {robot} has the estimate {found}, robot {other} {expected}")
            }
        }
    }
}

/// In what these robots differ from a settled team; empty if it is settled. Every robot is compared with
/// the one of the lowest number, or for a log with the first one that holds most of it.
pub fn differences<E: fmt::Display>(statuses: &BTreeMap<RobotId, Result<Status, E>>) -> Vec<Difference> {
    let mut found = Vec::new();
    let mut known = BTreeMap::new();
    for (robot, status) in statuses {
        match status {
            Ok(status) => {
                known.insert(*robot, status);
            }
            Err(cause) => found.push(Difference::Silent { robot: *robot, cause: cause.to_string() }),
        }
    }
    for (robot, status) in &known {
        if !status.input_ended {
            found.push(Difference::InputOpen { robot: *robot });
        } else if !status.drained {
            found.push(Difference::NotDrained { robot: *robot, pending: status.facts.pending });
        }
    }
    let before = found.len();
    logs(&known, &mut found);
    let same_logs = found.len() == before;
    if let Some((first, reference)) = known.first_key_value() {
        for (robot, status) in known.iter().skip(1) {
            compare(*robot, status, *first, reference, same_logs, &mut found);
        }
    }
    found
}

fn compare(
    robot: RobotId,
    status: &Status,
    other: RobotId,
    reference: &Status,
    same_logs: bool,
    found: &mut Vec<Difference>,
) {
    if status.configuration != reference.configuration {
        let (hash, expected) = (status.configuration, reference.configuration);
        found.push(Difference::Configuration { robot, found: hash, other, expected });
    }
    // With different entries, different estimates say nothing new.
    if same_logs && status.estimate != reference.estimate {
        let (print, expected) = (status.estimate.to_string(), reference.estimate.to_string());
        found.push(Difference::Estimate { robot, found: print, other, expected });
    }
}

fn logs(known: &BTreeMap<RobotId, &Status>, found: &mut Vec<Difference>) {
    // The most that anyone holds of each log, and who does first.
    let mut most = BTreeMap::new();
    for (robot, status) in known {
        for log in &status.logs {
            let best = most.entry(log.log).or_insert((*robot, *log));
            if log.held > best.1.held {
                *best = (*robot, *log);
            }
        }
    }
    for (robot, status) in known {
        for (other, best) in most.values() {
            let mine = status.logs.iter().find(|log| log.log == best.log);
            let held = mine.map_or(0, |log| log.held);
            let (robot, other, log) = (*robot, *other, (best.log.robot, best.log.boot.0));
            if held < best.held {
                found.push(Difference::Behind { robot, log, held, other, expected: best.held });
            } else if mine.is_some_and(|log| log.chain != best.chain) {
                found.push(Difference::Fork { robot, other, log, held });
            }
        }
    }
}

#[cfg(test)]
mod tests;

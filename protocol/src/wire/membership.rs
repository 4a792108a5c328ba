//! Seals and votes.

use pleiad_estimation::fact::{Ballot, Seal, SealedLog, Vote};
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::entry::WireLog;
use crate::error::ProtocolError;
use crate::limits;

/// Times in ns; logs as (boot, length, whether it ends there).
#[derive(Serialize, Deserialize)]
pub struct WireSeal {
    observed_ns: i64,
    answered_ns: i64,
    closed_ns: i64,
    logs: Vec<(u32, u64, bool)>,
}

/// A vote in the ballot `(round, of)`.
#[derive(Serialize, Deserialize)]
pub struct WireVote {
    epoch: u32,
    round: u32,
    of: u32,
    accepted: bool,
    removed: Vec<u32>,
    held: Vec<(WireLog, u64)>,
    added: Vec<(u32, u32)>,
    from_ns: i64,
    operator: bool,
}

impl From<&Seal> for WireSeal {
    fn from(seal: &Seal) -> Self {
        Self {
            observed_ns: seal.observed.0,
            answered_ns: seal.answered.0,
            closed_ns: seal.closed.0,
            logs: seal.logs.iter().map(|log| (log.boot.0, log.length, log.last)).collect(),
        }
    }
}

impl TryFrom<WireSeal> for Seal {
    type Error = ProtocolError;

    fn try_from(wire: WireSeal) -> Result<Self, ProtocolError> {
        few("seal.logs", wire.logs.len())?;
        let logs = wire.logs.into_iter();
        Ok(Self {
            observed: Timestamp(wire.observed_ns),
            answered: Timestamp(wire.answered_ns),
            closed: Timestamp(wire.closed_ns),
            logs: logs
                .map(|(boot, length, last)| SealedLog { boot: BootIndex(boot), length, last })
                .collect(),
        })
    }
}

impl From<&Vote> for WireVote {
    fn from(vote: &Vote) -> Self {
        Self {
            epoch: vote.epoch,
            round: vote.ballot.round,
            of: vote.ballot.robot.0,
            accepted: vote.accepted,
            removed: vote.removed.iter().map(|robot| robot.0).collect(),
            held: vote.held.iter().map(|(log, held)| ((*log).into(), *held)).collect(),
            added: vote.added.iter().map(|(robot, boot)| (robot.0, boot.0)).collect(),
            from_ns: vote.from.0,
            operator: vote.operator,
        }
    }
}

impl TryFrom<WireVote> for Vote {
    type Error = ProtocolError;

    fn try_from(wire: WireVote) -> Result<Self, ProtocolError> {
        for (field, found) in [
            ("vote.removed", wire.removed.len()),
            ("vote.held", wire.held.len()),
            ("vote.added", wire.added.len()),
        ] {
            few(field, found)?;
        }
        Ok(Self {
            epoch: wire.epoch,
            ballot: Ballot { round: wire.round, robot: RobotId(wire.of) },
            accepted: wire.accepted,
            removed: wire.removed.into_iter().map(RobotId).collect(),
            held: wire.held.into_iter().map(|(log, held)| (log.into(), held)).collect(),
            added: wire.added.into_iter().map(|(robot, boot)| (RobotId(robot), BootIndex(boot))).collect(),
            from: Timestamp(wire.from_ns),
            operator: wire.operator,
        })
    }
}

/// A list within an entry that is not longer than one of logs may be.
fn few(field: &str, found: usize) -> Result<(), ProtocolError> {
    if found > limits::LOGS {
        let (found, limit) = (found as u64, limits::LOGS as u64);
        return Err(ProtocolError::TooMany { field: field.into(), found, limit });
    }
    Ok(())
}

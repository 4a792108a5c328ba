//! What an agent holds and does.

use pleiad_estimation::fact::Fingerprint;
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::entry::WireLog;
use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::messages::{ClosureStatus, FactCounts, LogStatus, SampleCounts, Status};

/// Everything but the logs, which follow as a list.
#[derive(Serialize, Deserialize)]
struct WireStatus {
    robot: u32,
    boot: u32,
    configuration: u64,
    relative: u64,
    absolute: u64,
    used: u64,
    rejected: u64,
    pending: u64,
    void: u64,
    estimate: [u8; 16],
    odometry_until_ns: Option<i64>,
    accepted: u64,
    refused: u64,
    input_ended: bool,
    drained: bool,
    closure: Option<WireClosure>,
}

#[derive(Serialize, Deserialize)]
struct WireClosure {
    cut: Option<(i64, [u8; 16])>,
    epoch: u32,
    joining: Option<u32>,
    firsts: Vec<(WireLog, u64)>,
    expired: u64,
}

impl From<&ClosureStatus> for WireClosure {
    fn from(closure: &ClosureStatus) -> Self {
        Self {
            cut: closure.cut.map(|(time, hash)| (time.0, hash.0)),
            epoch: closure.epoch,
            joining: closure.joining.map(|boot| boot.0),
            firsts: closure.firsts.iter().map(|(log, first)| ((*log).into(), *first)).collect(),
            expired: closure.expired,
        }
    }
}

impl TryFrom<WireClosure> for ClosureStatus {
    type Error = ProtocolError;

    fn try_from(wire: WireClosure) -> Result<Self, ProtocolError> {
        if wire.firsts.len() > limits::LOGS {
            let (found, limit) = (wire.firsts.len() as u64, limits::LOGS as u64);
            return Err(ProtocolError::TooMany { field: "status.firsts".into(), found, limit });
        }
        Ok(Self {
            cut: wire.cut.map(|(time_ns, hash)| (Timestamp(time_ns), Fingerprint(hash))),
            epoch: wire.epoch,
            joining: wire.joining.map(BootIndex),
            firsts: wire.firsts.into_iter().map(|(log, first)| (log.into(), first)).collect(),
            expired: wire.expired,
        })
    }
}

#[derive(Serialize, Deserialize)]
struct WireLogStatus {
    log: WireLog,
    held: u64,
    chain: [u8; 16],
}

impl TryFrom<WireLogStatus> for LogStatus {
    type Error = ProtocolError;

    fn try_from(wire: WireLogStatus) -> Result<Self, ProtocolError> {
        Ok(Self { log: wire.log.into(), held: wire.held, chain: Fingerprint(wire.chain) })
    }
}

/// Appends a status.
pub fn put_status(bytes: &mut Vec<u8>, status: &Status) {
    let wire = WireStatus {
        robot: status.robot.0,
        boot: status.boot.0,
        configuration: status.configuration,
        relative: status.facts.relative,
        absolute: status.facts.absolute,
        used: status.facts.used,
        rejected: status.facts.rejected,
        pending: status.facts.pending,
        void: status.facts.void,
        estimate: status.estimate.0,
        odometry_until_ns: status.odometry_until.map(|time| time.0),
        accepted: status.samples.accepted,
        refused: status.samples.refused,
        input_ended: status.input_ended,
        drained: status.drained,
        closure: status.closure.as_ref().map(WireClosure::from),
    };
    codec::put(bytes, &wire);
    let logs = status.logs.iter();
    codec::put_list(
        bytes,
        logs.map(|log| WireLogStatus { log: log.log.into(), held: log.held, chain: log.chain.0 }),
    );
}

/// The next status.
pub fn take_status(reader: &mut Reader<'_>) -> Result<Status, ProtocolError> {
    let wire: WireStatus = reader.take("status")?;
    let logs = reader.list::<WireLogStatus, _>("status.logs", limits::LOGS)?;
    Ok(Status {
        robot: RobotId(wire.robot),
        boot: BootIndex(wire.boot),
        configuration: wire.configuration,
        logs,
        facts: FactCounts {
            relative: wire.relative,
            absolute: wire.absolute,
            used: wire.used,
            rejected: wire.rejected,
            pending: wire.pending,
            void: wire.void,
        },
        estimate: Fingerprint(wire.estimate),
        odometry_until: wire.odometry_until_ns.map(Timestamp),
        samples: SampleCounts { accepted: wire.accepted, refused: wire.refused },
        input_ended: wire.input_ended,
        drained: wire.drained,
        closure: wire.closure.map(ClosureStatus::try_from).transpose()?,
    })
}

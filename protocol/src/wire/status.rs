//! What an agent holds and does.

use pleiad_estimation::fact::Fingerprint;
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::entry::WireLog;
use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::messages::{FactCounts, LogStatus, SampleCounts, Status};

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
    })
}

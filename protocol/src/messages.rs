//! What is said besides entries and samples.

use pleiad_estimation::fact::{Fingerprint, LogId};
use pleiad_estimation::sample::Sample;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Timestamp};

/// What a robot's agent holds and does: published periodically, and the digest by which peers find out
/// what they miss.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Whose status.
    pub robot: RobotId,
    /// Its boot.
    pub boot: BootIndex,
    /// Hash of the configuration that decides bits.
    pub configuration: u64,
    /// What it holds of every log it knows.
    pub logs: Vec<LogStatus>,
    /// How its facts fare.
    pub facts: FactCounts,
    /// Hash of the bits of its estimate of the team: equal sets of facts give equal hashes.
    pub estimate: Fingerprint,
    /// Its odometry reaches to here.
    pub odometry_until: Option<Timestamp>,
    /// Sensor input so far.
    pub samples: SampleCounts,
    /// Whether its sensor input has ended.
    pub input_ended: bool,
    /// Whether nothing is left to do: the input has ended, every observation that names this robot is
    /// answered, and no entry is known to be missing.
    pub drained: bool,
    /// How far its past is closed; `None` if it keeps everything.
    pub closure: Option<ClosureStatus>,
}

/// How far an agent has closed its past, and its place in the team.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClosureStatus {
    /// The last cut, and the hash of the snapshot there: equal on all robots.
    pub cut: Option<(Timestamp, Fingerprint)>,
    /// Number of changes of the membership it knows of.
    pub epoch: u32,
    /// It is not of the team, and asks to be, with its logs from this boot on.
    pub joining: Option<BootIndex>,
    /// Logs of which it no longer has the first entries, and the first one it has.
    pub firsts: Vec<(LogId, u64)>,
    /// Facts that came, or stayed without an answer, beyond a cut.
    pub expired: u64,
}

/// How much of a log is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogStatus {
    /// Which log.
    pub log: LogId,
    /// How many entries without a gap from sequence 0: the first one missing has this sequence.
    pub held: u64,
    /// Chained fingerprint of these entries.
    pub chain: Fingerprint,
}

/// How the facts fare in the fold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FactCounts {
    /// Relative observations known, whatever became of them.
    pub relative: u64,
    /// Observations against the map known.
    pub absolute: u64,
    /// Used in the estimate.
    pub used: u64,
    /// Rejected by the gate.
    pub rejected: u64,
    /// Waiting for a half, a profile or a join.
    pub pending: u64,
    /// Answered with a void half.
    pub void: u64,
}

/// Sensor input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCounts {
    /// Taken.
    pub accepted: u64,
    /// Refused: out of order, invalid, of a sensor that is not configured.
    pub refused: u64,
}

/// Asks a peer for what is missing. The answer is a message of entries, in order and perhaps not all of
/// them; the rest is asked for again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FactsRequest {
    /// What is missing.
    pub ranges: Vec<LogRange>,
}

/// A stretch of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogRange {
    /// Which log.
    pub log: LogId,
    /// First sequence.
    pub from: u64,
    /// The sequence after the last; [`u64::MAX`] for all there is.
    pub to: u64,
}

/// Asks a peer for its snapshot, in parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SnapshotRequest {
    /// The cut of the snapshot of which parts are held; any if there are none.
    pub cut: Option<Timestamp>,
    /// From this byte on.
    pub offset: u64,
}

/// A part of a snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotPart {
    /// The cut.
    pub cut: Timestamp,
    /// Hash of the snapshot.
    pub hash: Fingerprint,
    /// Its length in bytes.
    pub total: u64,
    /// Where this part begins.
    pub offset: u64,
    /// The part, at most [`crate::limits::SNAPSHOT_PART_BYTES`].
    pub bytes: Vec<u8>,
}

/// A robot's estimate of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Whose.
    pub robot: RobotId,
    /// Its boot.
    pub boot: BootIndex,
    /// When it holds.
    pub time: Timestamp,
    /// The correction; may jump.
    pub map_from_odom: Pose2,
    /// The nominal trajectory; continuous.
    pub odom_from_robot: Pose2,
    /// Their product.
    pub map_from_robot: Pose2,
    /// Covariance of the additive error (x, y, yaw) of `map_from_robot`: m^2, m rad, rad^2.
    pub covariance: Symmetric3,
    /// Its standard deviations: m, m, rad.
    pub sigma: [f64; 3],
    /// How many facts it rests on.
    pub facts_used: u64,
}

/// Samples for a robot's agent, asked of `sensor/batch` and acknowledged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorBatch {
    /// Counts the batches from 0; a batch sent again carries its number again and is taken once.
    pub number: u64,
    /// In the order of their stamps.
    pub samples: Vec<Sample>,
    /// Whether this is the last batch.
    pub end: bool,
}

/// The answer to a batch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SensorAck {
    /// The batch answered.
    pub number: u64,
    /// How many of its samples were taken.
    pub accepted: u32,
    /// How many were not.
    pub refused: u32,
    /// Why the first of these was not; cut to [`crate::limits::TEXT_BYTES`] when sent.
    pub first_refusal: Option<String>,
}

/// Asked of an agent's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlRequest {
    /// Answer with the status as of now.
    Status,
    /// Sensor input has ended: settle what is open, write the results, keep serving peers.
    Finish,
    /// Leave the team and end the process.
    Shutdown,
    /// Evict a robot that will not come back, so that the others can close their past without it.
    Evict(RobotId),
}

/// The answer of an agent's process.
#[derive(Clone, Debug, PartialEq)]
pub enum ControlReply {
    /// The status as of now.
    Status(Status),
    /// It will be done.
    Accepted,
    /// It will not, and why; cut to [`crate::limits::TEXT_BYTES`] when sent.
    Refused(String),
}

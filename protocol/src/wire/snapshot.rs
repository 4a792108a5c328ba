//! Snapshots: the request, the parts it is sent in, and its bytes.

use pleiad_estimation::fact::{ClockMap, Entry, EntryId, Fingerprint, LogId, Noise, Seal, Vote};
use pleiad_estimation::joint::{Contradiction, ErrorForm, Joint, JointParts, Tie};
use pleiad_estimation::ledger::{Checkpoint, FactCounts, LogBase, Term, Views};
use pleiad_estimation::{BootIndex, LandmarkId, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::entry::{WireEntry, WireId, WireLog, WireNoise};
use super::joint::{
    WireBlock, WireContradiction, WireNumber, WireStated, WireTie, wire_block, wire_contradiction, wire_tie,
};
use super::membership::{WireSeal, WireVote};
use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::messages::{SnapshotPart, SnapshotRequest};

#[derive(Serialize, Deserialize)]
struct WireRequest {
    cut_ns: Option<i64>,
    offset: u64,
}

/// Everything but the bytes, which follow.
#[derive(Serialize, Deserialize)]
struct WirePart {
    cut_ns: i64,
    hash: [u8; 16],
    total: u64,
    offset: u64,
}

/// Appends a request.
pub fn put_request(bytes: &mut Vec<u8>, request: SnapshotRequest) {
    let SnapshotRequest { cut, offset } = request;
    codec::put(bytes, &WireRequest { cut_ns: cut.map(|cut| cut.0), offset });
}

/// The next request.
pub fn take_request(reader: &mut Reader<'_>) -> Result<SnapshotRequest, ProtocolError> {
    let WireRequest { cut_ns, offset } = reader.take("snapshot request")?;
    Ok(SnapshotRequest { cut: cut_ns.map(Timestamp), offset })
}

/// Appends a part.
pub fn put_part(bytes: &mut Vec<u8>, part: &SnapshotPart) {
    let SnapshotPart { cut, hash, total, offset, bytes: content } = part;
    codec::put(bytes, &WirePart { cut_ns: cut.0, hash: hash.0, total: *total, offset: *offset });
    codec::put_bytes(bytes, content);
}

/// The next part.
pub fn take_part(reader: &mut Reader<'_>) -> Result<SnapshotPart, ProtocolError> {
    let WirePart { cut_ns, hash, total, offset } = reader.take("snapshot part")?;
    let bytes = reader.bytes("snapshot part", limits::SNAPSHOT_PART_BYTES)?;
    Ok(SnapshotPart { cut: Timestamp(cut_ns), hash: Fingerprint(hash), total, offset, bytes })
}

#[derive(Serialize, Deserialize)]
struct WireHead {
    version: u8,
    cut_ns: i64,
    configuration: u64,
    additive: bool,
    updates: u64,
    epoch: u32,
    counts: [u64; 8],
}

#[derive(Serialize, Deserialize)]
struct WireLogBase(WireLog, u64, [u8; 16], Option<u64>);

#[derive(Serialize, Deserialize)]
struct WireFloor(u32, u32);

#[derive(Serialize, Deserialize)]
struct WireProfile(WireLog, u16, WireNoise);

#[derive(Serialize, Deserialize)]
struct WireClock(WireLog, i64, i64, i32);

#[derive(Serialize, Deserialize)]
struct WireSealed(WireId, WireSeal);

#[derive(Serialize, Deserialize)]
struct WireVoted(u32, WireId, WireVote);

#[derive(Serialize, Deserialize)]
struct WireTerm {
    robot: u32,
    from_ns: i64,
    boot: u32,
    until_ns: Option<i64>,
    limits: Vec<(WireLog, u64)>,
}

impl TryFrom<WireLogBase> for (LogId, LogBase) {
    type Error = ProtocolError;

    fn try_from(WireLogBase(log, start, chain, limit): WireLogBase) -> Result<Self, ProtocolError> {
        Ok((log.into(), LogBase { start, chain: Fingerprint(chain), limit }))
    }
}

impl TryFrom<WireFloor> for (RobotId, BootIndex) {
    type Error = ProtocolError;

    fn try_from(WireFloor(robot, boot): WireFloor) -> Result<Self, ProtocolError> {
        Ok((RobotId(robot), BootIndex(boot)))
    }
}

impl TryFrom<WireProfile> for ((LogId, u16), Noise) {
    type Error = ProtocolError;

    fn try_from(WireProfile(log, index, noise): WireProfile) -> Result<Self, ProtocolError> {
        Ok(((log.into(), index), noise.try_into()?))
    }
}

impl TryFrom<WireClock> for (LogId, ClockMap) {
    type Error = ProtocolError;

    fn try_from(WireClock(log, reference, offset_ns, rate_ppb): WireClock) -> Result<Self, ProtocolError> {
        Ok((log.into(), ClockMap { reference: Timestamp(reference), offset_ns, rate_ppb }))
    }
}

impl TryFrom<WireSealed> for (EntryId, Seal) {
    type Error = ProtocolError;

    fn try_from(WireSealed(id, seal): WireSealed) -> Result<Self, ProtocolError> {
        Ok((id.into(), seal.try_into()?))
    }
}

impl TryFrom<WireVoted> for ((u32, EntryId), Vote) {
    type Error = ProtocolError;

    fn try_from(WireVoted(epoch, id, vote): WireVoted) -> Result<Self, ProtocolError> {
        Ok(((epoch, id.into()), vote.try_into()?))
    }
}

impl TryFrom<WireTerm> for Term {
    type Error = ProtocolError;

    fn try_from(wire: WireTerm) -> Result<Self, ProtocolError> {
        Ok(Self {
            robot: RobotId(wire.robot),
            from: Timestamp(wire.from_ns),
            boot: BootIndex(wire.boot),
            until: wire.until_ns.map(Timestamp),
            limits: wire.limits.into_iter().map(|(log, held)| (log.into(), held)).collect(),
        })
    }
}

const VERSION: u8 = 3;

/// A snapshot in bytes.
pub fn encode(checkpoint: &Checkpoint) -> Vec<u8> {
    let mut bytes = Vec::new();
    let parts = checkpoint.joint.parts();
    let head = WireHead {
        version: VERSION,
        cut_ns: checkpoint.time.0,
        configuration: checkpoint.configuration,
        additive: checkpoint.joint.form() == ErrorForm::Additive,
        updates: parts.updates,
        epoch: checkpoint.views.epoch,
        counts: checkpoint.counts.numbers().map(|count| count as u64),
    };
    codec::put(&mut bytes, &head);
    codec::put_list(&mut bytes, parts.blocks.iter().map(|(block, placed)| wire_block(block, *placed)));
    codec::put_list(&mut bytes, parts.lower.iter().map(|entry| WireNumber(*entry)));
    codec::put_list(&mut bytes, parts.ties.iter().map(wire_tie));
    codec::put_list(&mut bytes, parts.contradictions.iter().map(wire_contradiction));
    codec::put_list(&mut bytes, parts.stated.iter().map(|(id, place)| WireStated(id.0, *place)));
    let logs = checkpoint.logs.iter();
    codec::put_list(
        &mut bytes,
        logs.map(|(id, base)| WireLogBase((*id).into(), base.start, base.chain.0, base.limit)),
    );
    codec::put_list(&mut bytes, checkpoint.floors.iter().map(|(robot, boot)| WireFloor(robot.0, boot.0)));
    let profiles = checkpoint.profiles.iter();
    codec::put_list(
        &mut bytes,
        profiles.map(|((log, index), noise)| WireProfile((*log).into(), *index, noise.into())),
    );
    let clocks = checkpoint.clocks.iter();
    codec::put_list(
        &mut bytes,
        clocks.map(|(log, map)| WireClock((*log).into(), map.reference.0, map.offset_ns, map.rate_ppb)),
    );
    let seals = checkpoint.seals.values();
    codec::put_list(&mut bytes, seals.map(|(id, seal)| WireSealed((*id).into(), seal.into())));
    codec::put_list(
        &mut bytes,
        checkpoint.views.terms.iter().map(|term| WireTerm {
            robot: term.robot.0,
            from_ns: term.from.0,
            boot: term.boot.0,
            until_ns: term.until.map(|until| until.0),
            limits: term.limits.iter().map(|(log, held)| ((*log).into(), *held)).collect(),
        }),
    );
    let votes = checkpoint.views.votes.iter();
    codec::put_list(
        &mut bytes,
        votes.map(|((epoch, id), vote)| WireVoted(*epoch, (*id).into(), vote.into())),
    );
    codec::put_list(&mut bytes, checkpoint.open.values().map(WireEntry::from));
    bytes
}

/// The snapshot in `bytes`.
pub fn decode(bytes: &[u8]) -> Result<Checkpoint, ProtocolError> {
    if bytes.len() > limits::SNAPSHOT_BYTES {
        return Err(ProtocolError::TooLong { bytes: bytes.len(), limit: limits::SNAPSHOT_BYTES });
    }
    let mut reader = Reader::new(bytes);
    let head: WireHead = reader.take("snapshot")?;
    if head.version != VERSION {
        return Err(ProtocolError::Version { found: head.version });
    }
    let most = limits::SNAPSHOT_ITEMS;
    let blocks = reader.list::<WireBlock, _>("snapshot.blocks", most)?;
    let lower = reader.list::<WireNumber, f64>("snapshot.covariance", most)?;
    let ties = reader.list::<WireTie, Tie>("snapshot.ties", most)?;
    let contradictions = reader.list::<WireContradiction, Contradiction>("snapshot.contradictions", most)?;
    let stated = reader.list::<WireStated, (LandmarkId, [f64; 2])>("snapshot.stated", most)?;
    let found = lower.len() as u64;
    let form = if head.additive { ErrorForm::Additive } else { ErrorForm::Invariant };
    let parts = JointParts { blocks, lower, ties, contradictions, stated, updates: head.updates };
    let limit = (3 * parts.blocks.len() * (3 * parts.blocks.len() + 1) / 2) as u64;
    let joint = Joint::from_parts(form, parts).ok_or(ProtocolError::TooMany {
        field: "snapshot.covariance".into(),
        found,
        limit,
    })?;
    let logs = reader.list::<WireLogBase, (LogId, LogBase)>("snapshot.logs", most)?;
    let floors = reader.list::<WireFloor, (RobotId, BootIndex)>("snapshot.floors", most)?;
    let profiles = reader.list::<WireProfile, ((LogId, u16), Noise)>("snapshot.profiles", most)?;
    let clocks = reader.list::<WireClock, (LogId, ClockMap)>("snapshot.clocks", most)?;
    let seals = reader.list::<WireSealed, (EntryId, Seal)>("snapshot.seals", most)?;
    let terms = reader.list::<WireTerm, Term>("snapshot.terms", most)?;
    let votes = reader.list::<WireVoted, ((u32, EntryId), Vote)>("snapshot.votes", most)?;
    let open = reader.list::<WireEntry, Entry>("snapshot.open", most)?;
    reader.end()?;
    Ok(Checkpoint {
        time: Timestamp(head.cut_ns),
        configuration: head.configuration,
        joint,
        logs: logs.into_iter().collect(),
        floors: floors.into_iter().collect(),
        profiles: profiles.into_iter().collect(),
        clocks: clocks.into_iter().collect(),
        seals: seals.into_iter().map(|(id, seal)| (id.robot, (id, seal))).collect(),
        views: Views { epoch: head.epoch, terms, votes: votes.into_iter().collect() },
        open: open.into_iter().map(|entry| (entry.id, entry)).collect(),
        counts: FactCounts::from_numbers(
            head.counts.map(|count| usize::try_from(count).unwrap_or(usize::MAX)),
        ),
    })
}

//! Snapshots: the request, the parts it is sent in, and its bytes.

use pleiad_estimation::fact::{ClockMap, Entry, EntryId, Fingerprint, LogId, Noise, Seal, Vote};
use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::joint::{
    Anchor, Block, Component, End, ErrorForm, Joint, JointParts, MappedLandmark, Measured, Member,
    ParameterKind, Parameters, Tie,
};
use pleiad_estimation::ledger::{Checkpoint, FactCounts, LogBase, Term, Views};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::check::{self, WirePose, WireSymmetric};
use super::entry::{WireEntry, WireId, WireLog, WireNoise};
use super::membership::{WireSeal, WireVote};
use super::sample::WireRelative;
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
struct WireMember {
    robot: u32,
    boot: u32,
    correction: WirePose,
    nominal: WirePose,
    folded_noise: WireSymmetric,
    /// By columns; none if nothing was ever folded.
    folded_motion: Option<[f64; 9]>,
    component: WireComponent,
    placed: bool,
}

/// Who began a frame, and when; none is the map.
type WireComponent = Option<(i64, u32)>;

#[derive(Serialize, Deserialize)]
enum WireEnd {
    Map,
    Point([f64; 2]),
    Anchor(u32),
}

#[derive(Serialize, Deserialize)]
struct WireTie {
    time_ns: i64,
    ends: [WireEnd; 2],
    /// None is a heading.
    relative: Option<WireRelative>,
    heading: f64,
    noise: WireSymmetric,
}

#[derive(Serialize, Deserialize)]
enum WireBlock {
    Robot(WireMember),
    Parameters { robot: u32, kind: WireParameters, value: [f64; 3], since_ns: i64 },
    Landmark(u32, WirePose, WireComponent),
    Anchor(WirePose, WireComponent),
    Free,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
enum WireParameters {
    Motion,
    Mount,
    Clock,
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

#[derive(Serialize, Deserialize)]
struct WireNumber(f64);

impl TryFrom<WireNumber> for f64 {
    type Error = ProtocolError;

    fn try_from(WireNumber(found): WireNumber) -> Result<Self, ProtocolError> {
        check::number("covariance", found)
    }
}

impl TryFrom<WireMember> for (Member, bool) {
    type Error = ProtocolError;

    fn try_from(wire: WireMember) -> Result<Self, ProtocolError> {
        let correction = check::pose("correction", wire.correction)?;
        let nominal = check::pose("nominal", wire.nominal)?;
        for entry in wire.folded_noise {
            check::number("folded_noise", entry)?;
        }
        let (robot, boot) = (RobotId(wire.robot), BootIndex(wire.boot));
        let mut member = Member::new(robot, boot, correction, nominal, Symmetric3(wire.folded_noise));
        if let Some(columns) = wire.folded_motion {
            for entry in columns {
                check::number("folded_motion", entry)?;
            }
            member.folded_motion = Matrix3::from_column_slice(&columns);
        }
        member.component = component(wire.component);
        Ok((member, wire.placed))
    }
}

impl TryFrom<WireBlock> for (Block, bool) {
    type Error = ProtocolError;

    fn try_from(wire: WireBlock) -> Result<Self, ProtocolError> {
        Ok(match wire {
            WireBlock::Robot(member) => {
                let (member, placed) = member.try_into()?;
                (Block::Robot(member), placed)
            }
            WireBlock::Parameters { robot, kind, value, since_ns } => {
                for entry in value {
                    check::number("parameter", entry)?;
                }
                let kind = match kind {
                    WireParameters::Motion => ParameterKind::Motion,
                    WireParameters::Mount => ParameterKind::Mount,
                    WireParameters::Clock => ParameterKind::Clock,
                };
                let (robot, since) = (RobotId(robot), Timestamp(since_ns));
                (Block::Parameters(Parameters { robot, kind, value: value.into(), since }), false)
            }
            WireBlock::Landmark(landmark, pose, of) => {
                let (pose, component) = (check::pose("landmark", pose)?, component(of));
                (Block::Landmark(MappedLandmark { landmark: LandmarkId(landmark), pose, component }), false)
            }
            WireBlock::Anchor(pose, of) => {
                let (pose, component) = (check::pose("anchor", pose)?, component(of));
                (Block::Anchor(Anchor { pose, component }), false)
            }
            WireBlock::Free => (Block::Free, false),
        })
    }
}

fn component(wire: WireComponent) -> Component {
    wire.map_or(Component::MAP, |(since_ns, robot)| Component::new(Timestamp(since_ns), RobotId(robot)))
}

fn wire_component(component: Component) -> WireComponent {
    let (since, robot) = component.origin();
    (component != Component::MAP).then_some((since.0, robot.0))
}

impl TryFrom<WireTie> for Tie {
    type Error = ProtocolError;

    fn try_from(wire: WireTie) -> Result<Self, ProtocolError> {
        let end = |end: WireEnd| {
            Ok(match end {
                WireEnd::Map => End::Map,
                WireEnd::Point(place) => End::Point(check::pair("tie.place", place)?),
                WireEnd::Anchor(index) => End::Anchor(index as usize),
            })
        };
        let [one, other] = wire.ends;
        let measured = match wire.relative {
            Some(relative) => Measured::Relative(relative.try_into()?),
            None => Measured::Heading(check::number("tie.heading", wire.heading)?),
        };
        for entry in wire.noise {
            check::number("tie.noise", entry)?;
        }
        let ends = [end(one)?, end(other)?];
        Ok(Self { time: Timestamp(wire.time_ns), ends, measured, noise: Symmetric3(wire.noise) })
    }
}

fn wire_tie(tie: &Tie) -> WireTie {
    let end = |end: &End| match end {
        End::Map => WireEnd::Map,
        End::Point(place) => WireEnd::Point(*place),
        #[allow(clippy::cast_possible_truncation, reason = "a team has fewer blocks")]
        End::Anchor(index) => WireEnd::Anchor(*index as u32),
    };
    let (relative, heading) = match &tie.measured {
        Measured::Relative(relative) => (Some(relative.into()), 0.0),
        Measured::Heading(heading) => (None, *heading),
    };
    WireTie { time_ns: tie.time.0, ends: tie.ends.each_ref().map(end), relative, heading, noise: tie.noise.0 }
}

fn wire_block(block: &Block, placed: bool) -> WireBlock {
    match block {
        Block::Robot(member) => {
            let motion = member.folded_motion;
            WireBlock::Robot(WireMember {
                robot: member.robot.0,
                boot: member.boot.0,
                correction: check::wire_pose(&member.correction),
                nominal: check::wire_pose(&member.nominal),
                folded_noise: member.folded_noise.0,
                folded_motion: (motion != Matrix3::zeros())
                    .then(|| std::array::from_fn(|entry| motion[entry])),
                component: wire_component(member.component),
                placed,
            })
        }
        Block::Parameters(of) => WireBlock::Parameters {
            robot: of.robot.0,
            kind: match of.kind {
                ParameterKind::Motion => WireParameters::Motion,
                ParameterKind::Mount => WireParameters::Mount,
                ParameterKind::Clock => WireParameters::Clock,
            },
            value: of.value.into(),
            since_ns: of.since.0,
        },
        Block::Landmark(mapped) => WireBlock::Landmark(
            mapped.landmark.0,
            check::wire_pose(&mapped.pose),
            wire_component(mapped.component),
        ),
        Block::Anchor(anchor) => {
            WireBlock::Anchor(check::wire_pose(&anchor.pose), wire_component(anchor.component))
        }
        Block::Free => WireBlock::Free,
    }
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

const VERSION: u8 = 2;

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
    let found = lower.len() as u64;
    let form = if head.additive { ErrorForm::Additive } else { ErrorForm::Invariant };
    let parts = JointParts { blocks, lower, ties, updates: head.updates };
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

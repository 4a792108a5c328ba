//! The joint in a snapshot: what its rows stand for, and what waits between two frames.

use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::joint::{
    Anchor, Block, Component, Contradiction, Distrust, End, MappedLandmark, Measured, Member, ParameterKind,
    Parameters, Party, Reputation, Tie,
};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::check::{self, WirePose, WireSymmetric};
use super::sample::WireRelative;
use crate::error::ProtocolError;

#[derive(Serialize, Deserialize)]
pub(super) struct WireMember {
    robot: u32,
    boot: u32,
    correction: WirePose,
    nominal: WirePose,
    folded_noise: WireSymmetric,
    /// By columns; none if nothing was ever folded.
    folded_motion: Option<[f64; 9]>,
    component: WireComponent,
    /// None as long as nothing is known.
    reputation: Option<WireReputation>,
    placed: bool,
}

#[derive(Serialize, Deserialize)]
struct WireReputation {
    noise_level: f64,
    doubt: [f64; 2],
    detached_ns: Option<i64>,
    /// Since when, and whether in whole.
    distrust: Option<(i64, bool)>,
}

impl TryFrom<WireReputation> for Reputation {
    type Error = ProtocolError;

    fn try_from(wire: WireReputation) -> Result<Self, ProtocolError> {
        let noise_level = check::number("noise_level", wire.noise_level)?;
        if noise_level < 1.0 {
            let (field, expected) = ("noise_level".into(), "at least 1");
            return Err(ProtocolError::Number { field, found: noise_level, expected });
        }
        Ok(Self {
            noise_level,
            doubt: check::pair("doubt", wire.doubt)?,
            detached: wire.detached_ns.map(Timestamp),
            distrust: wire.distrust.map(|(since, whole)| Distrust { since: Timestamp(since), whole }),
        })
    }
}

fn wire_reputation(of: &Reputation) -> Option<WireReputation> {
    let Reputation { noise_level, doubt, detached, distrust } = *of;
    (*of != Reputation::default()).then(|| WireReputation {
        noise_level,
        doubt,
        detached_ns: detached.map(|at| at.0),
        distrust: distrust.map(|of| (of.since.0, of.whole)),
    })
}

/// Who began a frame, and when; none is the map.
pub(super) type WireComponent = Option<(i64, u32)>;

#[derive(Serialize, Deserialize)]
pub(super) enum WireEnd {
    Map,
    Point([f64; 2]),
    Anchor(u32),
}

#[derive(Serialize, Deserialize)]
pub(super) struct WireTie {
    time_ns: i64,
    ends: [WireEnd; 2],
    /// None is a heading.
    relative: Option<WireRelative>,
    heading: f64,
    noise: WireSymmetric,
}

#[derive(Serialize, Deserialize)]
pub(super) enum WireBlock {
    Robot(Box<WireMember>),
    Parameters { robot: u32, kind: WireParameters, value: [f64; 3], since_ns: i64 },
    Landmark(u32, WirePose, WireComponent),
    Anchor(WirePose, WireComponent),
    Free,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) enum WireParameters {
    Motion,
    Mount,
    Clock,
}

#[derive(Serialize, Deserialize)]
pub(super) struct WireNumber(pub f64);

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
        member.reputation = wire.reputation.map_or_else(|| Ok(Reputation::default()), TryInto::try_into)?;
        Ok((member, wire.placed))
    }
}

impl TryFrom<WireBlock> for (Block, bool) {
    type Error = ProtocolError;

    fn try_from(wire: WireBlock) -> Result<Self, ProtocolError> {
        Ok(match wire {
            WireBlock::Robot(member) => {
                let (member, placed) = (*member).try_into()?;
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

#[derive(Serialize, Deserialize)]
pub(super) struct WireContradiction {
    author: u32,
    of: WireParty,
    level: f64,
    readings: f64,
    surprises: f64,
    last_ns: i64,
}

/// A landmark and where it is said to be.
#[derive(Serialize, Deserialize)]
pub(super) struct WireStated(pub u32, pub [f64; 2]);

impl TryFrom<WireStated> for (LandmarkId, [f64; 2]) {
    type Error = ProtocolError;

    fn try_from(WireStated(id, place): WireStated) -> Result<Self, ProtocolError> {
        Ok((LandmarkId(id), check::pair("stated", place)?))
    }
}

#[derive(Serialize, Deserialize)]
enum WireParty {
    Robot(u32),
    Landmark(u32),
    Map,
}

impl TryFrom<WireContradiction> for Contradiction {
    type Error = ProtocolError;

    fn try_from(wire: WireContradiction) -> Result<Self, ProtocolError> {
        Ok(Self {
            author: RobotId(wire.author),
            of: match wire.of {
                WireParty::Robot(robot) => Party::Robot(RobotId(robot)),
                WireParty::Landmark(landmark) => Party::Landmark(LandmarkId(landmark)),
                WireParty::Map => Party::Map,
            },
            level: check::number("contradiction.level", wire.level)?,
            readings: check::number("contradiction.readings", wire.readings)?,
            surprises: check::number("contradiction.surprises", wire.surprises)?,
            last: Timestamp(wire.last_ns),
        })
    }
}

pub(super) fn wire_contradiction(of: &Contradiction) -> WireContradiction {
    let Contradiction { author, of, level, readings, surprises, last } = *of;
    let of = match of {
        Party::Robot(robot) => WireParty::Robot(robot.0),
        Party::Landmark(landmark) => WireParty::Landmark(landmark.0),
        Party::Map => WireParty::Map,
    };
    WireContradiction { author: author.0, of, level, readings, surprises, last_ns: last.0 }
}

pub(super) fn wire_tie(tie: &Tie) -> WireTie {
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

pub(super) fn wire_block(block: &Block, placed: bool) -> WireBlock {
    match block {
        Block::Robot(member) => {
            let motion = member.folded_motion;
            WireBlock::Robot(Box::new(WireMember {
                robot: member.robot.0,
                boot: member.boot.0,
                correction: check::wire_pose(&member.correction),
                nominal: check::wire_pose(&member.nominal),
                folded_noise: member.folded_noise.0,
                folded_motion: (motion != Matrix3::zeros())
                    .then(|| std::array::from_fn(|entry| motion[entry])),
                component: wire_component(member.component),
                reputation: wire_reputation(&member.reputation),
                placed,
            }))
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

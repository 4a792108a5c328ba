//! Entries of logs. An observation and its half go to every robot of the team, so their bytes count.

use pleiad_estimation::fact::{
    Absolute, Answer, Body, Boot, ClockMap, Continuation, Entry, EntryId, Half, LogId, Noise, NoiseRef,
    NominalState, Observation, Profile, Quantity, VoidReason, read_extension,
};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::{BootIndex, LandmarkId, RobotId, Sequence, Timestamp};
use serde::{Deserialize, Serialize};

use super::check::{self, WirePose, WireSymmetric};
use super::membership::{WireSeal, WireVote};
use super::sample::WireRelative;
use crate::error::ProtocolError;
use crate::limits;

/// An entry.
#[derive(Serialize, Deserialize)]
pub struct WireEntry {
    id: WireId,
    body: WireBody,
    extension: Vec<u8>,
}

/// A log.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct WireLog {
    robot: u32,
    boot: u32,
}

/// An identity.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct WireId {
    log: WireLog,
    sequence: u64,
}

#[derive(Serialize, Deserialize)]
enum WireBody {
    Boot {
        time_ns: i64,
        nonce: u64,
        configuration: u64,
        nominal: WirePose,
        continuation: Option<WireContinuation>,
    },
    Profile {
        index: u16,
        noise: WireNoise,
    },
    ClockMap {
        reference_ns: i64,
        offset_ns: i64,
        rate_ppb: i32,
    },
    Observation {
        time_ns: i64,
        quantity: WireQuantity,
        noise: WireNoiseRef,
        observer: WireState,
    },
    Half {
        observation: WireId,
        answer: WireAnswer,
    },
    Seal(WireSeal),
    Vote(WireVote),
}

#[derive(Serialize, Deserialize)]
struct WireContinuation {
    previous: u32,
    time_ns: i64,
    last: WireState,
    gap: WireSymmetric,
}

#[derive(Serialize, Deserialize)]
struct WireState {
    nominal: WirePose,
    noise_sum: WireSymmetric,
}

/// A noise.
#[derive(Serialize, Deserialize)]
pub struct WireNoise {
    dimension: u8,
    lower: [f64; 6],
}

#[derive(Serialize, Deserialize)]
enum WireNoiseRef {
    Profile(u16),
    Explicit(WireNoise),
}

#[derive(Serialize, Deserialize)]
enum WireQuantity {
    Robot(u32, WireRelative),
    Landmark(u32, [f64; 2], WireRelative),
    Pose(WirePose),
    Position([f64; 2]),
    Heading(f64),
    Feature(u32, WireRelative),
}

#[derive(Serialize, Deserialize)]
enum WireAnswer {
    State { boot: u32, state: WireState },
    Void(WireVoid),
}

#[derive(Clone, Copy, Serialize, Deserialize)]
enum WireVoid {
    BeforeBoot,
    OdometryGap,
    TrajectoryLost,
    Clock,
}

impl From<LogId> for WireLog {
    fn from(log: LogId) -> Self {
        Self { robot: log.robot.0, boot: log.boot.0 }
    }
}

impl From<WireLog> for LogId {
    fn from(wire: WireLog) -> Self {
        Self { robot: RobotId(wire.robot), boot: BootIndex(wire.boot) }
    }
}

impl From<EntryId> for WireId {
    fn from(id: EntryId) -> Self {
        Self { log: id.log().into(), sequence: id.sequence.0 }
    }
}

impl From<WireId> for EntryId {
    fn from(wire: WireId) -> Self {
        let LogId { robot, boot } = wire.log.into();
        Self { robot, boot, sequence: Sequence(wire.sequence) }
    }
}

impl From<&NominalState> for WireState {
    fn from(state: &NominalState) -> Self {
        Self { nominal: check::wire_pose(&state.nominal), noise_sum: state.noise_sum.0 }
    }
}

impl TryFrom<WireState> for NominalState {
    type Error = ProtocolError;

    fn try_from(wire: WireState) -> Result<Self, ProtocolError> {
        Ok(Self {
            nominal: check::pose("nominal", wire.nominal)?,
            noise_sum: check::covariance("noise_sum", wire.noise_sum)?,
            // In the extension of the entry.
            sensitivity: None,
        })
    }
}

impl TryFrom<WireNoise> for Noise {
    type Error = ProtocolError;

    fn try_from(wire: WireNoise) -> Result<Self, ProtocolError> {
        check::noise("noise", wire.dimension, wire.lower)
    }
}

impl From<&Noise> for WireNoise {
    fn from(noise: &Noise) -> Self {
        Self { dimension: noise.dimension, lower: noise.lower }
    }
}

impl From<&Quantity> for WireQuantity {
    fn from(quantity: &Quantity) -> Self {
        match quantity {
            Quantity::Robot { robot, relative } => Self::Robot(robot.0, relative.into()),
            Quantity::Landmark { landmark, position_m, relative } => {
                Self::Landmark(landmark.0, *position_m, relative.into())
            }
            Quantity::Feature { landmark, relative } => Self::Feature(landmark.0, relative.into()),
            Quantity::Absolute(Absolute::Pose(pose)) => Self::Pose(check::wire_pose(pose)),
            Quantity::Absolute(Absolute::Position(position)) => Self::Position(*position),
            Quantity::Absolute(Absolute::Heading(heading)) => Self::Heading(*heading),
        }
    }
}

impl TryFrom<WireQuantity> for Quantity {
    type Error = ProtocolError;

    fn try_from(wire: WireQuantity) -> Result<Self, ProtocolError> {
        Ok(match wire {
            WireQuantity::Robot(robot, relative) => {
                Self::Robot { robot: RobotId(robot), relative: relative.try_into()? }
            }
            WireQuantity::Landmark(landmark, position_m, relative) => Self::Landmark {
                landmark: LandmarkId(landmark),
                position_m: check::pair("position_m", position_m)?,
                relative: relative.try_into()?,
            },
            WireQuantity::Feature(landmark, relative) => {
                Self::Feature { landmark: LandmarkId(landmark), relative: relative.try_into()? }
            }
            WireQuantity::Pose(pose) => Self::Absolute(Absolute::Pose(check::pose("pose", pose)?)),
            WireQuantity::Position(position) => {
                Self::Absolute(Absolute::Position(check::pair("position", position)?))
            }
            WireQuantity::Heading(heading) => {
                Self::Absolute(Absolute::Heading(check::number("heading", heading)?))
            }
        })
    }
}

/// How many numbers a quantity has, and what to call that.
fn dimension(quantity: &Quantity) -> (u8, &'static str) {
    match quantity {
        Quantity::Absolute(Absolute::Heading(_)) => (1, "1 for a heading"),
        Quantity::Absolute(Absolute::Position(_)) => (2, "2 for a position"),
        Quantity::Absolute(Absolute::Pose(_)) => (3, "3 for a pose"),
        Quantity::Robot { relative, .. }
        | Quantity::Landmark { relative, .. }
        | Quantity::Feature { relative, .. } => match relative {
            Relative::Range { .. } => (1, "1 for a range"),
            Relative::Bearing { .. } => (1, "1 for a bearing"),
            Relative::RangeBearing { .. } => (2, "2 for range and bearing"),
            Relative::Position { .. } => (2, "2 for a relative position"),
            Relative::Pose(_) => (3, "3 for a relative pose"),
        },
    }
}

fn noise_of(quantity: &Quantity, wire: &WireNoiseRef) -> Result<NoiseRef, ProtocolError> {
    Ok(match *wire {
        WireNoiseRef::Profile(index) => NoiseRef::Profile(index),
        WireNoiseRef::Explicit(WireNoise { dimension: found, lower }) => {
            let (fitting, expected) = dimension(quantity);
            if found != fitting {
                return Err(ProtocolError::Dimension { field: "noise".into(), found, expected });
            }
            NoiseRef::Explicit(check::noise("noise", found, lower)?)
        }
    })
}

impl From<&Body> for WireBody {
    fn from(body: &Body) -> Self {
        match body {
            Body::Boot(boot) => Self::Boot {
                time_ns: boot.time.0,
                nonce: boot.nonce,
                configuration: boot.configuration,
                nominal: check::wire_pose(&boot.nominal),
                continuation: boot.continuation.as_ref().map(|continuation| WireContinuation {
                    previous: continuation.previous.0,
                    time_ns: continuation.time.0,
                    last: (&continuation.last).into(),
                    gap: continuation.gap.0,
                }),
            },
            Body::Profile(profile) => Self::Profile { index: profile.index, noise: (&profile.noise).into() },
            Body::ClockMap(map) => Self::ClockMap {
                reference_ns: map.reference.0,
                offset_ns: map.offset_ns,
                rate_ppb: map.rate_ppb,
            },
            Body::Observation(observation) => Self::Observation {
                time_ns: observation.time.0,
                quantity: (&observation.quantity).into(),
                noise: match &observation.noise {
                    NoiseRef::Profile(index) => WireNoiseRef::Profile(*index),
                    NoiseRef::Explicit(noise) => WireNoiseRef::Explicit(noise.into()),
                },
                observer: (&observation.observer).into(),
            },
            Body::Seal(seal) => Self::Seal(seal.into()),
            Body::Vote(vote) => Self::Vote(vote.into()),
            Body::Half(half) => Self::Half {
                observation: half.observation.into(),
                answer: match &half.answer {
                    Answer::State { boot, state } => WireAnswer::State { boot: boot.0, state: state.into() },
                    Answer::Void(reason) => WireAnswer::Void(match reason {
                        VoidReason::BeforeBoot => WireVoid::BeforeBoot,
                        VoidReason::OdometryGap => WireVoid::OdometryGap,
                        VoidReason::TrajectoryLost => WireVoid::TrajectoryLost,
                        VoidReason::Clock => WireVoid::Clock,
                    }),
                },
            },
        }
    }
}

impl TryFrom<WireContinuation> for Continuation {
    type Error = ProtocolError;

    fn try_from(wire: WireContinuation) -> Result<Self, ProtocolError> {
        Ok(Self {
            previous: BootIndex(wire.previous),
            time: Timestamp(wire.time_ns),
            last: wire.last.try_into().map_err(|cause: ProtocolError| cause.within("last"))?,
            gap: check::covariance("gap", wire.gap)?,
        })
    }
}

impl TryFrom<WireBody> for Body {
    type Error = ProtocolError;

    fn try_from(wire: WireBody) -> Result<Self, ProtocolError> {
        let inside = |outer: &'static str| move |cause: ProtocolError| cause.within(outer);
        Ok(match wire {
            WireBody::Boot { time_ns, nonce, configuration, nominal, continuation } => Self::Boot(Boot {
                time: Timestamp(time_ns),
                nonce,
                configuration,
                nominal: check::pose("boot.nominal", nominal)?,
                continuation: continuation
                    .map(Continuation::try_from)
                    .transpose()
                    .map_err(inside("boot.continuation"))?,
                calibration: None,
            }),
            WireBody::Profile { index, noise } => Self::Profile(Profile {
                index,
                noise: check::noise("profile.noise", noise.dimension, noise.lower)?,
            }),
            WireBody::ClockMap { reference_ns, offset_ns, rate_ppb } => {
                Self::ClockMap(ClockMap { reference: Timestamp(reference_ns), offset_ns, rate_ppb })
            }
            WireBody::Observation { time_ns, quantity, noise, observer } => {
                let quantity = quantity.try_into().map_err(inside("observation.quantity"))?;
                let noise = noise_of(&quantity, &noise).map_err(inside("observation"))?;
                let observer = observer.try_into().map_err(inside("observation.observer"))?;
                Self::Observation(Observation { time: Timestamp(time_ns), quantity, noise, observer })
            }
            WireBody::Seal(seal) => Self::Seal(seal.try_into()?),
            WireBody::Vote(vote) => Self::Vote(vote.try_into()?),
            WireBody::Half { observation, answer } => Self::Half(Half {
                observation: observation.into(),
                answer: match answer {
                    WireAnswer::State { boot, state } => Answer::State {
                        boot: BootIndex(boot),
                        state: state.try_into().map_err(inside("half.state"))?,
                    },
                    WireAnswer::Void(reason) => Answer::Void(match reason {
                        WireVoid::BeforeBoot => VoidReason::BeforeBoot,
                        WireVoid::OdometryGap => VoidReason::OdometryGap,
                        WireVoid::TrajectoryLost => VoidReason::TrajectoryLost,
                        WireVoid::Clock => VoidReason::Clock,
                    }),
                },
            }),
        })
    }
}

impl From<&Entry> for WireEntry {
    fn from(entry: &Entry) -> Self {
        Self { id: entry.id.into(), body: (&entry.body).into(), extension: entry.extension.clone() }
    }
}

impl TryFrom<WireEntry> for Entry {
    type Error = ProtocolError;

    fn try_from(wire: WireEntry) -> Result<Self, ProtocolError> {
        let id = wire.id.into();
        let named = |cause| ProtocolError::Entry { id, cause: Box::new(cause) };
        if wire.extension.len() > limits::EXTENSION_BYTES {
            return Err(named(ProtocolError::TooMany {
                field: "extension".into(),
                found: wire.extension.len() as u64,
                limit: limits::EXTENSION_BYTES as u64,
            }));
        }
        let body = wire.body.try_into().map_err(named)?;
        let mut entry = Self { id, body, extension: wire.extension };
        read_extension(&mut entry);
        Ok(entry)
    }
}

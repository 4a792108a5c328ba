//! Random valid messages: for round trips here, and for fuzzing from outside (feature `testing`). The same
//! generator state gives the same message.

use std::f64::consts::PI;

use pleiad_estimation::fact::{
    Absolute, Answer, Ballot, Body, Boot, ClockMap, Continuation, Entry, EntryId, Fingerprint, Half, LogId,
    Noise, NoiseRef, NominalState, Observation, Profile, Quantity, Seal, SealedLog, VoidReason, Vote,
};
use pleiad_estimation::geometry::{Matrix3, Vector3};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::strategy as said;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use rand::{Rng, RngExt};

use crate::{
    ClosureStatus, ControlReply, ControlRequest, Estimate, FactCounts, FactsRequest, LogRange, LogStatus,
    Message, SampleCounts, SensorAck, SensorBatch, SnapshotPart, SnapshotRequest, Status, limits,
};

/// A number, the awkward ones included.
pub fn number(rng: &mut impl Rng) -> f64 {
    match rng.random_range(0..8) {
        0 => 0.0,
        1 => -0.0,
        2 => rng.random_range(-1.0..1.0) * f64::MIN_POSITIVE,
        3 => rng.random_range(-1.0..1.0) * limits::MAGNITUDE,
        _ => rng.random_range(-100.0..100.0),
    }
}

/// An integer, all magnitudes alike, so that every length of varint occurs.
pub fn integer(rng: &mut impl Rng) -> u64 {
    rng.random::<u64>() >> rng.random_range(0..64)
}

#[allow(clippy::cast_possible_truncation, reason = "any 32 bits will do")]
fn small(rng: &mut impl Rng) -> u32 {
    integer(rng) as u32
}

fn time(rng: &mut impl Rng) -> Timestamp {
    let nanoseconds = integer(rng).cast_signed();
    Timestamp(if rng.random() { nanoseconds } else { nanoseconds.wrapping_neg() })
}

fn maybe<R: Rng, T>(rng: &mut R, make: impl FnOnce(&mut R) -> T) -> Option<T> {
    rng.random::<bool>().then(|| make(rng))
}

fn several<R: Rng, T>(rng: &mut R, make: impl Fn(&mut R) -> T) -> Vec<T> {
    (0..rng.random_range(0..8)).map(|_| make(rng)).collect()
}

/// A pose.
pub fn pose(rng: &mut impl Rng) -> Pose2 {
    let yaw_rad = match rng.random_range(0..8) {
        0 => PI,
        1 => -0.0,
        2 => (-PI).next_up(),
        _ => rng.random_range(-3.1..3.1),
    };
    Pose2::new(number(rng), number(rng), yaw_rad)
}

/// A product `L L^T` of 3x3 with `L` from the diagonal entries `least..2` and others within +-2.
fn product(rng: &mut impl Rng, least: f64) -> [f64; 6] {
    let [a, c, f] = [(); 3].map(|()| rng.random_range(least..2.0));
    let [b, d, e] = [(); 3].map(|()| rng.random_range(-2.0..2.0));
    [a * a, a * b, b * b + c * c, a * d, b * d + c * e, d * d + e * e + f * f]
}

/// A covariance, singular ones included.
pub fn covariance(rng: &mut impl Rng) -> Symmetric3 {
    match rng.random_range(0..8) {
        0 => Symmetric3::zero(),
        1 => Symmetric3([0.0, -0.0, 1.0, 0.0, 0.0, 2.0]),
        _ => Symmetric3(product(rng, 0.0)).scaled(10.0_f64.powi(rng.random_range(-9..9))),
    }
}

/// A noise of a given dimension.
pub fn noise(rng: &mut impl Rng, dimension: u8) -> Noise {
    let mut lower = product(rng, 0.5);
    let inside = usize::from(dimension) * (usize::from(dimension) + 1) / 2;
    lower[inside..].fill(0.0);
    Noise { dimension, lower }
}

fn state(rng: &mut impl Rng) -> NominalState {
    NominalState::new(pose(rng), covariance(rng))
}

fn relative(rng: &mut impl Rng) -> (Relative, u8) {
    match rng.random_range(0..5) {
        0 => (Relative::Pose(pose(rng)), 3),
        1 => (Relative::Position { x_m: number(rng), y_m: number(rng) }, 2),
        2 => (Relative::Range { range_m: number(rng) }, 1),
        3 => (Relative::Bearing { bearing_rad: number(rng) }, 1),
        _ => (Relative::RangeBearing { range_m: number(rng), bearing_rad: number(rng) }, 2),
    }
}

fn quantity(rng: &mut impl Rng) -> (Quantity, u8) {
    match rng.random_range(0..6) {
        0 => {
            let (relative, dimension) = relative(rng);
            (Quantity::Robot { robot: RobotId(small(rng)), relative }, dimension)
        }
        1 => {
            let (relative, dimension) = relative(rng);
            let position_m = [number(rng), number(rng)];
            (Quantity::Landmark { landmark: LandmarkId(small(rng)), position_m, relative }, dimension)
        }
        5 => {
            let (relative, dimension) = relative(rng);
            (Quantity::Feature { landmark: LandmarkId(small(rng)), relative }, dimension)
        }
        2 => (Quantity::Absolute(Absolute::Pose(pose(rng))), 3),
        3 => (Quantity::Absolute(Absolute::Position([number(rng), number(rng)])), 2),
        _ => (Quantity::Absolute(Absolute::Heading(number(rng))), 1),
    }
}

fn log(rng: &mut impl Rng) -> LogId {
    LogId { robot: RobotId(small(rng)), boot: BootIndex(small(rng)) }
}

fn id(rng: &mut impl Rng) -> EntryId {
    let LogId { robot, boot } = log(rng);
    EntryId { robot, boot, sequence: Sequence(integer(rng)) }
}

fn observation(rng: &mut impl Rng) -> Observation {
    let (quantity, dimension) = quantity(rng);
    let noise = match maybe(rng, |rng| noise(rng, dimension)) {
        Some(noise) => NoiseRef::Explicit(noise),
        None => NoiseRef::Profile(rng.random()),
    };
    Observation { time: time(rng), quantity, noise, observer: state(rng) }
}

fn answer(rng: &mut impl Rng) -> Answer {
    match rng.random_range(0..8) {
        0 => Answer::Void(VoidReason::BeforeBoot),
        1 => Answer::Void(VoidReason::OdometryGap),
        2 => Answer::Void(VoidReason::TrajectoryLost),
        3 => Answer::Void(VoidReason::Clock),
        _ => Answer::State { boot: BootIndex(small(rng)), state: state(rng) },
    }
}

fn seal(rng: &mut impl Rng) -> Seal {
    let logs = several(rng, |rng| SealedLog {
        boot: BootIndex(small(rng)),
        length: integer(rng),
        last: rng.random(),
    });
    Seal { observed: time(rng), answered: time(rng), closed: time(rng), logs }
}

fn vote(rng: &mut impl Rng) -> Vote {
    Vote {
        epoch: small(rng),
        ballot: Ballot { round: small(rng), robot: RobotId(small(rng)) },
        accepted: rng.random(),
        removed: several(rng, |rng| RobotId(small(rng))),
        held: several(rng, |rng| (log(rng), integer(rng))),
        added: several(rng, |rng| (RobotId(small(rng)), BootIndex(small(rng)))),
        from: time(rng),
        operator: rng.random(),
    }
}

/// An entry.
pub fn entry(rng: &mut impl Rng) -> Entry {
    let body = match rng.random_range(0..7) {
        0 => Body::Boot(Boot {
            time: time(rng),
            nonce: rng.random(),
            configuration: rng.random(),
            nominal: pose(rng),
            continuation: maybe(rng, |rng| Continuation {
                previous: BootIndex(small(rng)),
                time: time(rng),
                last: state(rng),
                gap: covariance(rng),
            }),
            calibration: None,
        }),
        1 => {
            let dimension = rng.random_range(1..=3);
            Body::Profile(Profile { index: rng.random(), noise: noise(rng, dimension) })
        }
        2 => Body::ClockMap(ClockMap {
            reference: time(rng),
            offset_ns: time(rng).0,
            rate_ppb: small(rng).cast_signed(),
        }),
        3 => Body::Observation(observation(rng)),
        5 => Body::Seal(seal(rng)),
        6 => Body::Vote(vote(rng)),
        _ => Body::Half(Half { observation: id(rng), answer: answer(rng) }),
    };
    let length = if rng.random() { 0 } else { rng.random_range(0..=limits::EXTENSION_BYTES) };
    Entry { id: id(rng), body, extension: (0..length).map(|_| rng.random()).collect() }
}

/// A sample.
pub fn sample(rng: &mut impl Rng) -> Sample {
    let reading = match rng.random_range(0..8) {
        0 => Reading::Velocity { forward_m_s: number(rng), yaw_rate_rad_s: number(rng) },
        1 => Reading::Wheels { left_rad: number(rng), right_rad: number(rng) },
        2 => Reading::Increment(pose(rng)),
        3 => Reading::Gyro { yaw_rate_rad_s: number(rng) },
        4 => Reading::Gps { x_m: number(rng), y_m: number(rng) },
        5 => Reading::Heading { heading_rad: number(rng) },
        6 => Reading::Sighting { target: Target::Robot(RobotId(small(rng))), relative: relative(rng).0 },
        _ => {
            let target = Target::Landmark(LandmarkId(small(rng)));
            Reading::Sighting { target, relative: relative(rng).0 }
        }
    };
    Sample { time: time(rng), reading }
}

/// A status.
pub fn status(rng: &mut impl Rng) -> Status {
    Status {
        robot: RobotId(small(rng)),
        boot: BootIndex(small(rng)),
        configuration: rng.random(),
        logs: several(rng, |rng| LogStatus {
            log: log(rng),
            held: integer(rng),
            chain: Fingerprint(rng.random()),
        }),
        facts: FactCounts {
            relative: integer(rng),
            absolute: integer(rng),
            used: integer(rng),
            rejected: integer(rng),
            pending: integer(rng),
            void: integer(rng),
        },
        estimate: Fingerprint(rng.random()),
        odometry_until: maybe(rng, |rng| time(rng)),
        samples: SampleCounts { accepted: integer(rng), refused: integer(rng) },
        input_ended: rng.random(),
        drained: rng.random(),
        closure: maybe(rng, |rng| ClosureStatus {
            cut: maybe(rng, |rng| (time(rng), Fingerprint(rng.random()))),
            epoch: small(rng),
            joining: maybe(rng, |rng| BootIndex(small(rng))),
            firsts: several(rng, |rng| (log(rng), integer(rng))),
            expired: integer(rng),
        }),
    }
}

fn text(rng: &mut impl Rng) -> String {
    let length = rng.random_range(0..limits::TEXT_BYTES / 4);
    (0..length).map(|_| rng.random::<char>()).collect()
}

fn meeting(rng: &mut impl Rng) -> said::MeetingId {
    said::MeetingId { observer: RobotId(small(rng)), number: integer(rng) }
}

fn matrix(rng: &mut impl Rng) -> Matrix3 {
    Matrix3::from_fn(|_, _| number(rng))
}

/// What an approximate strategy may say.
pub fn strategy(rng: &mut impl Rng) -> said::Message {
    match rng.random_range(0..6) {
        0 => {
            let (relative, dimension) = relative(rng);
            said::Message::Sighting(said::Sighting {
                id: meeting(rng),
                time: time(rng),
                relative,
                noise: noise(rng, dimension),
                pose: pose(rng),
                correlated: covariance(rng),
                independent: covariance(rng),
            })
        }
        1 => said::Message::Question(said::Question { id: meeting(rng), time: time(rng) }),
        2 => said::Message::Answer(said::Answer {
            id: meeting(rng),
            pose: pose(rng),
            covariance: covariance(rng),
            factor: maybe(rng, |rng| (meeting(rng), matrix(rng))),
        }),
        3 => said::Message::Verdict(said::Verdict {
            id: meeting(rng),
            change: maybe(rng, |rng| said::Change {
                correction: Vector3::new(number(rng), number(rng), number(rng)),
                covariance: covariance(rng),
                agreed: rng.random(),
            }),
        }),
        4 => said::Message::RowAnswer(said::RowAnswer {
            id: meeting(rng),
            pose: pose(rng),
            covariance: covariance(rng),
            motion: matrix(rng),
            row: several(rng, |rng| (RobotId(small(rng)), matrix(rng))),
        }),
        _ => said::Message::TeamUpdate(said::TeamUpdate {
            id: meeting(rng),
            dimension: rng.random_range(1..=3),
            innovation: Vector3::new(number(rng), number(rng), number(rng)),
            innovation_covariance: covariance(rng),
            gains: several(rng, |rng| said::Gain { robot: RobotId(small(rng)), without_motion: matrix(rng) }),
        }),
    }
}

/// Any message.
pub fn message(rng: &mut impl Rng) -> Message {
    match rng.random_range(0..12) {
        11 => Message::Strategy(strategy(rng)),
        0 => Message::Entries(several(rng, |rng| entry(rng))),
        1 => Message::Status(status(rng)),
        2 => Message::FactsRequest(FactsRequest {
            ranges: several(rng, |rng| {
                let [a, b] = [integer(rng), integer(rng)];
                LogRange { log: log(rng), from: a.min(b), to: a.max(b) }
            }),
        }),
        3 => Message::Estimate(Estimate {
            robot: RobotId(small(rng)),
            boot: BootIndex(small(rng)),
            time: time(rng),
            map_from_odom: pose(rng),
            odom_from_robot: pose(rng),
            map_from_robot: pose(rng),
            covariance: covariance(rng),
            sigma: [(); 3].map(|()| number(rng).abs()),
            facts_used: integer(rng),
        }),
        4 => Message::Sample(sample(rng)),
        5 => Message::SensorBatch(SensorBatch {
            number: integer(rng),
            samples: several(rng, |rng| sample(rng)),
            end: rng.random(),
        }),
        6 => Message::SensorAck(SensorAck {
            number: integer(rng),
            accepted: small(rng),
            refused: small(rng),
            first_refusal: maybe(rng, |rng| text(rng)),
        }),
        9 => Message::SnapshotRequest(SnapshotRequest {
            cut: maybe(rng, |rng| time(rng)),
            offset: integer(rng),
        }),
        10 => Message::SnapshotPart(SnapshotPart {
            cut: time(rng),
            hash: Fingerprint(rng.random()),
            total: integer(rng),
            offset: integer(rng),
            bytes: several(rng, RngExt::random),
        }),
        7 => Message::ControlRequest(match rng.random_range(0..4) {
            3 => ControlRequest::Evict(RobotId(small(rng))),
            0 => ControlRequest::Status,
            1 => ControlRequest::Finish,
            _ => ControlRequest::Shutdown,
        }),
        _ => Message::ControlReply(match rng.random_range(0..3) {
            0 => ControlReply::Status(status(rng)),
            1 => ControlReply::Accepted,
            _ => ControlReply::Refused(text(rng)),
        }),
    }
}

//! Round trips and sizes.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use pleiad_estimation::fact::{
    Absolute, Answer, Body, Boot, Continuation, EntryId, Fingerprint, Half, LogId, Noise, NoiseRef,
    NominalState, Observation, Profile, Quantity, VoidReason,
};
use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::messages::{LogRange, LogStatus};
use crate::testing;

mod damage;
mod refusals;

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn state() -> NominalState {
    NominalState::new(Pose2::new(1.0, 2.0, 0.5), Symmetric3::diagonal(1e-4, 1e-4, 1e-6))
}

/// What varies with the team and its age, at the ends the sizes are stated for.
fn extreme_id() -> EntryId {
    EntryId { robot: RobotId(249), boot: BootIndex(249), sequence: Sequence(99_999) }
}

fn entry(id: EntryId, body: Body) -> Entry {
    Entry { id, body, extension: Vec::new() }
}

fn observation(relative: Relative, noise: NoiseRef) -> Observation {
    let quantity = Quantity::Robot { robot: RobotId(3), relative };
    Observation { time: Timestamp(17), quantity, noise, observer: state() }
}

fn plain_id() -> EntryId {
    EntryId { robot: RobotId(1), boot: BootIndex(0), sequence: Sequence(5) }
}

const RANGE_BEARING: Relative = Relative::RangeBearing { range_m: 2.0, bearing_rad: 0.3 };

#[test]
fn every_kind_of_message_round_trips_bit_exactly() {
    let mut kinds = BTreeSet::new();
    for seed in 0..3000 {
        let message = testing::message(&mut rng(seed));
        kinds.insert(message.kind());
        let bytes = message.encode();
        assert_eq!(Message::kind_of(&bytes), Some(message.kind()));
        let decoded = Message::decode(&bytes).unwrap_or_else(|refused| panic!("seed {seed}: {refused}"));
        assert_eq!(decoded, message, "seed {seed}");
        // Equality of numbers does not tell -0.0 from 0.0; bytes do.
        assert_eq!(decoded.encode(), bytes, "seed {seed}");
    }
    assert_eq!(kinds.len(), 12, "{kinds:?}");
}

#[test]
fn entries_keep_their_fingerprint() {
    for seed in 0..1000 {
        let entries = [testing::entry(&mut rng(seed)), testing::entry(&mut rng(seed + 1_000_000))];
        let decoded = decode_entries(&encode_entries(&entries)).unwrap();
        let fingerprints = |entries: &[Entry]| entries.iter().map(Fingerprint::of).collect::<Vec<_>>();
        assert_eq!(fingerprints(&decoded), fingerprints(&entries), "seed {seed}");
    }
}

#[test]
fn decoded_poses_act_like_the_original_bit_for_bit() {
    let mut rng = rng(7);
    for _ in 0..500 {
        let pose = testing::pose(&mut rng);
        let sample = Sample { time: Timestamp(0), reading: Reading::Increment(pose) };
        let Reading::Increment(decoded) = decode_sample(&encode_sample(&sample)).unwrap().reading else {
            panic!("another reading")
        };
        let bits = |m: Matrix3| m.map(f64::to_bits);
        assert_eq!(bits(decoded.adjoint()), bits(pose.adjoint()));
        assert_eq!(decoded.yaw_rad().to_bits(), pose.yaw_rad().to_bits());
    }
}

#[test]
fn negative_zero_is_kept() {
    let sample = Sample { time: Timestamp(0), reading: Reading::Gyro { yaw_rate_rad_s: -0.0 } };
    let Reading::Gyro { yaw_rate_rad_s } = decode_sample(&encode_sample(&sample)).unwrap().reading else {
        panic!("another reading")
    };
    assert_eq!(yaw_rate_rad_s.to_bits(), (-0.0_f64).to_bits());
}

/// Bytes of an observation and its half, each in a message of its own.
fn fact_bytes(relative: Relative) -> usize {
    // Ten years of nanoseconds, on either side of the epoch.
    let ten_years_ns = 3_155_760_000 * 100_000_000;
    let sizes = [-ten_years_ns, ten_years_ns].map(|time_ns| {
        let seen = Observation {
            time: Timestamp(time_ns),
            quantity: Quantity::Robot { robot: RobotId(249), relative },
            noise: NoiseRef::Profile(249),
            observer: state(),
        };
        let answer = Answer::State { boot: BootIndex(249), state: state() };
        let half = Half { observation: extreme_id(), answer };
        encode_entries(&[entry(extreme_id(), Body::Observation(seen))]).len()
            + encode_entries(&[entry(extreme_id(), Body::Half(half))]).len()
    });
    sizes.into_iter().max().unwrap()
}

#[test]
fn a_range_bearing_fact_in_two_halves_takes_at_most_220_bytes() {
    let bytes = fact_bytes(RANGE_BEARING);
    assert!(bytes <= 220, "{bytes}");
}

#[test]
fn a_relative_pose_fact_in_two_halves_takes_at_most_225_bytes() {
    let bytes = fact_bytes(Relative::Pose(Pose2::new(1.0, 2.0, 3.0)));
    assert!(bytes <= 225, "{bytes}");
}

#[test]
fn the_greatest_lists_fit_in_a_message() {
    // An entry of the longest kind: a boot carried on, with the longest extension.
    let longest = (0..1000)
        .map(|seed| testing::entry(&mut rng(seed)))
        .map(|entry| Entry { extension: vec![0; limits::EXTENSION_BYTES], ..entry })
        .max_by_key(|entry| encode_entries(std::slice::from_ref(entry)).len())
        .unwrap();
    let entries = vec![longest; limits::ENTRIES];
    assert_eq!(decode_entries(&encode_entries(&entries)).unwrap().len(), limits::ENTRIES);

    let log = LogId { robot: RobotId(u32::MAX), boot: BootIndex(u32::MAX) };
    let mut status = testing::status(&mut rng(1));
    status.logs = vec![LogStatus { log, held: u64::MAX, chain: Fingerprint([255; 16]) }; limits::LOGS];
    assert!(Message::decode(&Message::Status(status).encode()).is_ok());

    let ranges = vec![LogRange { log, from: u64::MAX, to: u64::MAX }; limits::RANGES];
    assert!(Message::decode(&Message::FactsRequest(FactsRequest { ranges }).encode()).is_ok());

    let relative = Relative::Pose(Pose2::new(1.0, 2.0, 3.0));
    let target = Target::Robot(RobotId(u32::MAX));
    let sample = Sample { time: Timestamp::MIN, reading: Reading::Sighting { target, relative } };
    let batch = SensorBatch { samples: vec![sample; limits::SAMPLES], ..SensorBatch::default() };
    assert!(Message::decode(&Message::SensorBatch(batch).encode()).is_ok());
}

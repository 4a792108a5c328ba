//! A canonical hash of an entry: it tells two different entries with one identity apart, whoever
//! encoded them and however.

use super::entry::{
    Absolute, Answer, Body, Entry, EntryId, Noise, NoiseRef, NominalState, Quantity, VoidReason,
};
use super::seal::{Seal, Vote};
use crate::sample::Relative;
use crate::{Pose2, Timestamp};

/// BLAKE3 of an entry's canonical bytes, truncated to 128 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fingerprint(pub [u8; 16]);

impl Fingerprint {
    /// The fingerprint of an entry.
    pub fn of(entry: &Entry) -> Self {
        let mut canonical = Canonical(blake3::Hasher::new());
        canonical.entry(entry);
        Self::truncated(&canonical.0)
    }

    /// The fingerprint of `self` followed by `next`: a chain over a log's prefix, so that one hash
    /// tells whether two peers hold the same one.
    pub fn chained(self, next: Self) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.0).update(&next.0);
        Self::truncated(&hasher)
    }

    /// The fingerprint of a list of 64-bit words: for estimates, whose bits are to be compared.
    pub fn of_words(words: impl IntoIterator<Item = u64>) -> Self {
        let mut canonical = Canonical(blake3::Hasher::new());
        for word in words {
            canonical.word(word);
        }
        Self::truncated(&canonical.0)
    }

    fn truncated(hasher: &blake3::Hasher) -> Self {
        let mut bytes = [0; 16];
        bytes.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
        Self(bytes)
    }
}

impl std::fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Feeds fields to the hash one by one: every variant starts with its own tag, every number has a
/// fixed width, so that no two entries give the same bytes.
struct Canonical(blake3::Hasher);

impl Canonical {
    fn tag(&mut self, tag: u8) {
        self.0.update(&[tag]);
    }

    fn word(&mut self, word: u64) {
        self.0.update(&word.to_le_bytes());
    }

    fn number(&mut self, number: f64) {
        self.word(number.to_bits());
    }

    fn time(&mut self, time: Timestamp) {
        self.0.update(&time.0.to_le_bytes());
    }

    fn pose(&mut self, pose: &Pose2) {
        self.number(pose.x_m());
        self.number(pose.y_m());
        self.number(pose.yaw_rad());
    }

    fn id(&mut self, id: EntryId) {
        self.word(u64::from(id.robot.0));
        self.word(u64::from(id.boot.0));
        self.word(id.sequence.0);
    }

    fn state(&mut self, state: &NominalState) {
        self.pose(&state.nominal);
        state.noise_sum.0.iter().for_each(|entry| self.number(*entry));
    }

    fn noise(&mut self, noise: &Noise) {
        self.tag(noise.dimension);
        noise.lower.iter().for_each(|entry| self.number(*entry));
    }

    fn relative(&mut self, relative: &Relative) {
        match relative {
            Relative::Pose(pose) => {
                self.tag(0);
                self.pose(pose);
            }
            Relative::Position { x_m, y_m } => {
                self.tag(1);
                self.number(*x_m);
                self.number(*y_m);
            }
            Relative::Range { range_m } => {
                self.tag(2);
                self.number(*range_m);
            }
            Relative::Bearing { bearing_rad } => {
                self.tag(3);
                self.number(*bearing_rad);
            }
            Relative::RangeBearing { range_m, bearing_rad } => {
                self.tag(4);
                self.number(*range_m);
                self.number(*bearing_rad);
            }
        }
    }

    fn quantity(&mut self, quantity: &Quantity) {
        match quantity {
            Quantity::Robot { robot, relative } => {
                self.tag(0);
                self.word(u64::from(robot.0));
                self.relative(relative);
            }
            Quantity::Landmark { landmark, position_m, relative } => {
                self.tag(1);
                self.word(u64::from(landmark.0));
                self.number(position_m[0]);
                self.number(position_m[1]);
                self.relative(relative);
            }
            Quantity::Absolute(Absolute::Pose(pose)) => {
                self.tag(2);
                self.pose(pose);
            }
            Quantity::Absolute(Absolute::Position(position)) => {
                self.tag(3);
                self.number(position[0]);
                self.number(position[1]);
            }
            Quantity::Absolute(Absolute::Heading(heading)) => {
                self.tag(4);
                self.number(*heading);
            }
            Quantity::Feature { landmark, relative } => {
                self.tag(5);
                self.word(u64::from(landmark.0));
                self.relative(relative);
            }
        }
    }

    fn entry(&mut self, entry: &Entry) {
        self.id(entry.id);
        match &entry.body {
            Body::Boot(boot) => {
                self.tag(0);
                self.time(boot.time);
                self.word(boot.nonce);
                self.word(boot.configuration);
                self.pose(&boot.nominal);
                match &boot.continuation {
                    None => self.tag(0),
                    Some(continuation) => {
                        self.tag(1);
                        self.word(u64::from(continuation.previous.0));
                        self.time(continuation.time);
                        self.state(&continuation.last);
                        continuation.gap.0.iter().for_each(|entry| self.number(*entry));
                    }
                }
            }
            Body::Profile(profile) => {
                self.tag(1);
                self.word(u64::from(profile.index));
                self.noise(&profile.noise);
            }
            Body::ClockMap(map) => {
                self.tag(2);
                self.time(map.reference);
                self.word(map.offset_ns.cast_unsigned());
                self.word(u64::from(map.rate_ppb.cast_unsigned()));
            }
            Body::Observation(observation) => {
                self.tag(3);
                self.time(observation.time);
                self.quantity(&observation.quantity);
                match &observation.noise {
                    NoiseRef::Profile(index) => {
                        self.tag(0);
                        self.word(u64::from(*index));
                    }
                    NoiseRef::Explicit(noise) => {
                        self.tag(1);
                        self.noise(noise);
                    }
                }
                self.state(&observation.observer);
            }
            Body::Seal(seal) => {
                self.tag(5);
                self.seal(seal);
            }
            Body::Vote(vote) => {
                self.tag(6);
                self.vote(vote);
            }
            Body::Half(half) => {
                self.tag(4);
                self.id(half.observation);
                match &half.answer {
                    Answer::State { boot, state } => {
                        self.tag(0);
                        self.word(u64::from(boot.0));
                        self.state(state);
                    }
                    Answer::Void(reason) => {
                        self.tag(1);
                        self.tag(match reason {
                            VoidReason::BeforeBoot => 0,
                            VoidReason::OdometryGap => 1,
                            VoidReason::TrajectoryLost => 2,
                            VoidReason::Clock => 3,
                        });
                    }
                }
            }
        }
        self.word(entry.extension.len() as u64);
        self.0.update(&entry.extension);
    }

    fn seal(&mut self, seal: &Seal) {
        for time in [seal.observed, seal.answered, seal.closed] {
            self.time(time);
        }
        self.word(seal.logs.len() as u64);
        for log in &seal.logs {
            self.word(u64::from(log.boot.0));
            self.word(log.length);
            self.tag(u8::from(log.last));
        }
    }

    fn vote(&mut self, vote: &Vote) {
        self.word(u64::from(vote.epoch));
        self.word(u64::from(vote.ballot.round) << 32 | u64::from(vote.ballot.robot.0));
        self.tag(u8::from(vote.accepted));
        self.word(vote.removed.len() as u64);
        vote.removed.iter().for_each(|robot| self.word(u64::from(robot.0)));
        self.word(vote.held.len() as u64);
        for (log, held) in &vote.held {
            self.word(u64::from(log.robot.0));
            self.word(u64::from(log.boot.0));
            self.word(*held);
        }
        self.word(vote.added.len() as u64);
        for (robot, boot) in &vote.added {
            self.word(u64::from(robot.0));
            self.word(u64::from(boot.0));
        }
        self.time(vote.from);
        self.tag(u8::from(vote.operator));
    }
}

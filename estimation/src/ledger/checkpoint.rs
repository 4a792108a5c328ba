//! The state of a ledger at a cut: all that is needed of what came before it.

use std::collections::BTreeMap;

use super::counts::FactCounts;
use super::views::Views;
use crate::fact::{ClockMap, Entry, EntryId, Fingerprint, LogId, Noise, Seal};
use crate::joint::Joint;
use crate::{BootIndex, RobotId, Timestamp};

/// Where a log stands at a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogBase {
    /// Entries before this are accounted for.
    pub start: u64,
    /// Chained fingerprint of those.
    pub chain: Fingerprint,
    /// The log ends there.
    pub limit: Option<u64>,
}

/// The snapshot at a cut: a function of the logs of the team up to it, the same on every robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The cut: everything stamped at or before it is in `joint`, or lost.
    pub time: Timestamp,
    /// Hash of the configuration it was folded under.
    pub configuration: u64,
    /// Corrections, covariance, and the noise already folded of each robot.
    pub joint: Joint,
    /// Where the logs stand.
    pub logs: BTreeMap<LogId, LogBase>,
    /// Logs of earlier boots than this are over and forgotten.
    pub floors: BTreeMap<RobotId, BootIndex>,
    /// Noise profiles declared in them.
    pub profiles: BTreeMap<(LogId, u16), Noise>,
    /// Clock maps declared in them.
    pub clocks: BTreeMap<LogId, ClockMap>,
    /// The last seal of each robot.
    pub seals: BTreeMap<RobotId, (EntryId, Seal)>,
    /// The membership.
    pub views: Views,
    /// Entries accounted for that still matter: what is stamped after the cut, and answers to it.
    pub open: BTreeMap<EntryId, Entry>,
    /// What became of the facts up to the cut. Decided for good, with the gate.
    pub counts: FactCounts,
}

impl Checkpoint {
    /// Hash of everything in it: robots compare it to know that they agree.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut words = vec![self.time.0.cast_unsigned(), self.configuration];
        words.extend(self.joint.words());
        words.push(self.joint.updates());
        let log = |id: &LogId| u64::from(id.robot.0) << 32 | u64::from(id.boot.0);
        let bytes = |print: Fingerprint| {
            let (high, low) = print.0.split_at(8);
            [high, low].map(|half| half.iter().fold(0, |word, byte| word << 8 | u64::from(*byte)))
        };
        for (id, base) in &self.logs {
            words.extend([log(id), base.start, base.limit.unwrap_or(u64::MAX)]);
            words.extend(bytes(base.chain));
        }
        words.extend(self.floors.iter().map(|(robot, boot)| u64::from(robot.0) << 32 | u64::from(boot.0)));
        for ((id, index), noise) in &self.profiles {
            words.extend([log(id), u64::from(*index), u64::from(noise.dimension)]);
            words.extend(noise.lower.map(f64::to_bits));
        }
        for (id, clock) in &self.clocks {
            words.extend([log(id), clock.reference.0.cast_unsigned(), clock.offset_ns.cast_unsigned()]);
            words.push(u64::from(clock.rate_ppb.cast_unsigned()));
        }
        let mut entry = |id: &EntryId, body: crate::fact::Body| {
            words.extend(bytes(Fingerprint::of(&Entry { id: *id, body, extension: Vec::new() })));
        };
        for (id, seal) in self.seals.values() {
            entry(id, crate::fact::Body::Seal(seal.clone()));
        }
        for ((_, id), vote) in &self.views.votes {
            entry(id, crate::fact::Body::Vote(vote.clone()));
        }
        words.push(u64::from(self.views.epoch));
        for term in &self.views.terms {
            words.extend([u64::from(term.robot.0), u64::from(term.boot.0), term.from.0.cast_unsigned()]);
            words.push(term.until.unwrap_or(Timestamp::MAX).0.cast_unsigned());
            words.extend(term.limits.iter().flat_map(|(id, held)| [log(id), *held]));
        }
        for entry in self.open.values() {
            words.extend(bytes(Fingerprint::of(entry)));
        }
        words.extend(self.counts.numbers().map(|count| count as u64));
        Fingerprint::of_words(words)
    }
}

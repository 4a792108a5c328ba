//! What a ledger tells of what it holds.

use std::collections::{BTreeMap, BTreeSet};

use super::{FactRecord, Ledger, Log, LogDigest};
use crate::fact::{Entry, EntryId, Fingerprint, LogId, Quantity, VoidReason};
use crate::fold::FactKey;
use crate::joint::Joint;
use crate::{BootIndex, RobotId, Timestamp};

impl Ledger {
    /// The estimate as of the last [`Ledger::settle`].
    pub fn joint(&self) -> &Joint {
        &self.joint
    }

    /// How many folds of single facts were done, repeated ones counted again: the price of late facts.
    pub fn folds(&self) -> u64 {
        self.refolded
    }

    /// The logs held, with how far and the hash of the prefix.
    pub fn digests(&self) -> impl Iterator<Item = LogDigest> + '_ {
        self.logs.iter().map(|(id, log)| log.digest(*id))
    }

    /// The entries of a log from sequence `from` on.
    pub fn entries(&self, log: LogId, from: u64) -> &[Entry] {
        self.logs.get(&log).map_or(&[], |log| log.entries_from(from))
    }

    /// A log, if anything of it is held.
    pub fn log(&self, log: LogId) -> Option<&Log> {
        self.logs.get(&log)
    }

    /// Observations of `robot` that wait for its half, in the order of their identities.
    pub fn unanswered(&self, robot: RobotId) -> impl Iterator<Item = (EntryId, Timestamp)> + '_ {
        // Where names may be wrong, whoever keeps this ledger answers all.
        let all = self.owed(robot);
        let named = self.pending.iter().filter(move |(_, observation)| Self::names(observation, robot));
        let named = named.map(|(id, observation)| (*id, observation.time));
        let owed = all.into_iter().flatten().map(|(id, time)| (*id, *time));
        owed.chain(named.filter(move |_| all.is_none()))
            .filter(move |(_, time)| self.takes_part(robot, BootIndex(u32::MAX), *time))
    }

    /// Observations that wait for their half, per robot that owes it.
    pub fn pending_by_robot(&self) -> BTreeMap<RobotId, usize> {
        let mut counts = BTreeMap::new();
        for observation in self.pending.values() {
            if let Quantity::Robot { robot, .. } = observation.quantity {
                *counts.entry(robot).or_insert(0) += 1;
            }
        }
        counts
    }

    /// Observations that wait for the half of `robot`.
    pub fn pending_of(&self, robot: RobotId) -> usize {
        self.unanswered(robot).count()
    }

    /// Robots that published two different entries under one identity.
    pub fn quarantined(&self) -> &BTreeSet<RobotId> {
        &self.quarantined
    }

    /// The complete facts in the order of the fold. Their residuals are those of the last
    /// [`Ledger::settle`].
    pub fn facts(&self) -> impl Iterator<Item = (&FactKey, &FactRecord)> {
        self.facts.iter()
    }

    /// Observations answered with a reason why they can never be used.
    pub fn voids(&self) -> impl Iterator<Item = (&EntryId, &VoidReason)> {
        self.void.iter()
    }

    /// Hash of the bits of the estimate and of the prefixes it is a function of. Two robots with equal
    /// fingerprints hold the same facts and believe the same.
    pub fn fingerprint(&mut self) -> Fingerprint {
        self.settle();
        let prefixes = self
            .logs
            .iter()
            .filter(|(_, log)| log.held() > 0)
            .flat_map(|(id, log)| [u64::from(id.robot.0), u64::from(id.boot.0), log.held()]);
        Fingerprint::of_words(prefixes.chain(self.joint.words()))
    }
}

//! The ledger: all logs a robot holds, the facts they complete, and the fold kept up to date.
//!
//! The estimate is a function of the set of entries in gap-free prefixes: the order of arrival,
//! duplicates and batches leave no trace in it.

mod acceptance;
mod checkpoint;
mod closure;
mod counts;
mod history;
mod log;
mod naming;
#[cfg(feature = "planted")]
mod planted;
mod reading;
pub mod rules;
mod snapshots;
mod views;

use std::collections::{BTreeMap, BTreeSet};

pub use checkpoint::{Checkpoint, LogBase};
use closure::Closing;
pub use closure::Wish;
pub use counts::FactCounts;
pub use history::SettledPoint;
pub use log::{EarlierEntries, Log, LogDigest};
use naming::Naming;
#[cfg(feature = "planted")]
pub use planted::Planted;
pub use rules::Closure;
use snapshots::Snapshots;
pub use views::{Term, Views};

use crate::fact::{
    Answer, Body, Entry, EntryId, Fingerprint, LogId, Noise, NoiseRef, NominalState, Observation, Quantity,
    VoidReason, read_extension,
};
use crate::fold::{Fact, FactKey, FoldConfig, Relinearization, Residual, fold_among, fold_blocks};
use crate::joint::Joint;
use crate::{BootIndex, RobotId, Timestamp};

/// A fact in the order of the fold, and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactRecord {
    /// The complete fact.
    pub fact: Fact,
    /// What the last fold did with it; `None` until then. Provisional while earlier facts can arrive.
    pub residual: Option<Residual>,
}

/// What became of an entry handed in.
#[derive(Clone, Debug, PartialEq)]
pub enum Insertion {
    /// It extended its log (together with `released` later ones that had waited for it).
    Added {
        /// Buffered entries that became part of the prefix.
        released: usize,
    },
    /// It was held already.
    Duplicate,
    /// Entries before it are missing; it waits for them.
    Waiting,
    /// It can never be used.
    Refused(Refusal),
    /// Another entry with the same identity is held. The one with the smaller fingerprint stays, and the
    /// robot is quarantined: nothing more is taken from it.
    Equivocation,
}

/// Why an entry can never be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A log must begin with a boot entry, and has only one.
    #[error("a boot entry belongs at sequence 0 of a log, and nowhere else")]
    MisplacedBoot,
    /// The log was written under another configuration of the filter.
    #[error(
        "the log was written under another filter configuration; give all robots the same [filter] section"
    )]
    Configuration,
    /// The robot has contradicted itself before.
    #[error("the robot is quarantined: it published two different entries under one identity")]
    Quarantined,
    /// Its log has ended before, or the cut has passed it.
    #[error(
        "beyond what is accepted of its log: it came after the team had closed that time, or was lost by its author"
    )]
    Expired,
    /// Its robot does not belong to the team, or not with this boot.
    #[error("its robot does not belong to the team any more, or not yet")]
    NotAMember,
    /// Too many entries wait for a missing one; it will be asked for again.
    #[error("too far ahead of the first missing entry of its log")]
    TooFarAhead,
}

/// All that is known, and the estimate that follows from it.
#[derive(Clone, Debug)]
pub struct Ledger {
    config: FoldConfig,
    configuration: u64,
    logs: BTreeMap<LogId, Log>,
    quarantined: BTreeSet<RobotId>,
    profiles: BTreeMap<(LogId, u16), Noise>,
    /// Complete facts in the order of the fold.
    facts: BTreeMap<FactKey, FactRecord>,
    /// Observations of robots that have not answered yet.
    pending: BTreeMap<EntryId, Observation>,
    /// Answers by observation and answering robot, with the entry they stand in. Should a robot answer
    /// twice (having lost its journal), the entry with the smaller identity counts, in whatever order the
    /// two arrive.
    answers: BTreeMap<(EntryId, RobotId), (EntryId, Answer)>,
    void: BTreeMap<EntryId, VoidReason>,
    naming: Naming,
    joint: Joint,
    /// The last fact in `joint`.
    folded: Option<FactKey>,
    /// The earliest fact that has arrived since and belongs before `folded`.
    dirty: Option<FactKey>,
    snapshots: Snapshots,
    refolded: u64,
    /// Entries and observations refused because their time was closed.
    expired: usize,
    /// Present if the team closes its past.
    closing: Option<Box<Closing>>,
    /// Entries are held that are not accepted any more.
    truncated: bool,
    #[cfg(feature = "planted")]
    planted: Option<Planted>,
}

impl Ledger {
    /// Empty.
    pub fn new(config: FoldConfig) -> Self {
        Self {
            config,
            configuration: config.hash(),
            logs: BTreeMap::new(),
            quarantined: BTreeSet::new(),
            profiles: BTreeMap::new(),
            facts: BTreeMap::new(),
            pending: BTreeMap::new(),
            answers: BTreeMap::new(),
            void: BTreeMap::new(),
            naming: Naming::default(),
            joint: Joint::new(config.form),
            folded: None,
            dirty: None,
            snapshots: Snapshots::default(),
            refolded: 0,
            expired: 0,
            closing: None,
            truncated: false,
            #[cfg(feature = "planted")]
            planted: None,
        }
    }

    /// Makes a mistake from now on.
    #[cfg(feature = "planted")]
    pub fn plant(&mut self, planted: Planted) {
        self.planted = Some(planted);
    }

    /// Hash of the configuration that decides the bits of the estimate.
    pub fn configuration(&self) -> u64 {
        self.configuration
    }

    /// Takes an entry, from whomever it came. The estimate follows at the next [`Ledger::settle`].
    pub fn insert(&mut self, mut entry: Entry) -> Insertion {
        read_extension(&mut entry);
        let id = entry.id;
        if let Some(refusal) = self.outside(id) {
            // What is over and forgotten comes again and again; it was accounted for.
            if matches!(entry.body, Body::Observation(_)) && !self.is_forgotten(id.log()) {
                self.expired += 1;
            }
            return Insertion::Refused(refusal);
        }
        let fingerprint = Fingerprint::of(&entry);
        let log = self.logs.entry(id.log()).or_default();
        if id.sequence.0 < log.first() {
            return Insertion::Duplicate;
        }
        if let Some(held) = log.fingerprint(id.sequence) {
            if held == fingerprint {
                #[cfg(feature = "planted")]
                self.count_again(&entry);
                return Insertion::Duplicate;
            }
            self.equivocation(&entry, fingerprint < held);
            return Insertion::Equivocation;
        }
        let refusal = if self.quarantined.contains(&id.robot) {
            Some(Refusal::Quarantined)
        } else {
            self.refusal(&entry)
        };
        if let Some(refusal) = refusal {
            self.forget_if_empty(id.log());
            return Insertion::Refused(refusal);
        }
        let log = self.logs.entry(id.log()).or_default();
        if id.sequence.0 != log.held() {
            let fits = log.buffer(entry, fingerprint);
            return if fits { Insertion::Waiting } else { Insertion::Refused(Refusal::TooFarAhead) };
        }
        let mut ready = vec![(entry, fingerprint)];
        let mut released = 0;
        while let Some((entry, fingerprint)) = ready.pop() {
            let log = self.logs.entry(id.log()).or_default();
            log.push(entry.clone(), fingerprint);
            let next = log.take_buffered();
            self.admit(&entry);
            // A buffered entry was checked when it came, except for what the prefix decides.
            if let Some((next, fingerprint)) = next
                && self.refusal(&next).is_none()
                && self.outside(next.id).is_none()
            {
                released += 1;
                ready.push((next, fingerprint));
            }
        }
        self.take_effect();
        Insertion::Added { released }
    }

    /// Changes that are decided and can take effect do.
    fn take_effect(&mut self) {
        self.decide();
        if std::mem::take(&mut self.truncated) {
            self.rebuild(None);
        }
    }

    fn forget_if_empty(&mut self, log: LogId) {
        if self.logs.get(&log).is_some_and(Log::is_empty) {
            self.logs.remove(&log);
        }
    }

    fn refusal(&self, entry: &Entry) -> Option<Refusal> {
        match &entry.body {
            Body::Boot(boot) if entry.id.sequence.0 == 0 => {
                (boot.configuration != self.configuration).then_some(Refusal::Configuration)
            }
            Body::Boot(_) => Some(Refusal::MisplacedBoot),
            _ if entry.id.sequence.0 == 0 => Some(Refusal::MisplacedBoot),
            _ => None,
        }
    }

    /// Files an entry that has become part of a prefix.
    fn admit(&mut self, entry: &Entry) {
        let id = entry.id;
        match &entry.body {
            Body::Boot(boot) if self.cut().is_some_and(|cut| boot.time <= cut) => {}
            Body::Boot(boot) => self.file(FactKey::boot(boot.time, id), &Fact::Boot(*boot)),
            Body::Profile(profile) => {
                self.profiles.entry((id.log(), profile.index)).or_insert(profile.noise);
            }
            Body::ClockMap(_) => {}
            Body::Seal(seal) => self.hear_seal(id, seal),
            Body::Vote(vote) => self.hear_vote(id, vote),
            Body::Observation(observation) => {
                let closed = self.cut().is_some_and(|cut| observation.time <= cut);
                if closed || !self.takes_part(id.robot, id.boot, observation.time) {
                    self.expired += 1;
                    return;
                }
                if let Quantity::Robot { robot, .. } = observation.quantity {
                    self.pending.insert(id, *observation);
                    self.resolve(id, observation, robot);
                    self.ask(id, observation);
                } else {
                    self.complete(id, observation, None);
                }
            }
            Body::Half(half) => {
                if self.is_over(half.observation) {
                    return;
                }
                let slot = self.answers.entry((half.observation, id.robot)).or_insert((id, half.answer));
                if id < slot.0 {
                    *slot = (id, half.answer);
                } else if id > slot.0 {
                    return;
                }
                // Only the robot that was seen can answer, unless names may be wrong.
                if let Some(observation) = self.observation(half.observation) {
                    if Self::names(&observation, id.robot) {
                        self.resolve(half.observation, &observation, id.robot);
                    }
                    self.consider(half.observation, &observation, id.robot);
                }
            }
        }
    }

    fn observation(&self, id: EntryId) -> Option<Observation> {
        let open = self.closing.as_ref().and_then(|closing| closing.base.open.get(&id));
        match open.or_else(|| self.logs.get(&id.log())?.entry(id.sequence.0))?.body {
            Body::Observation(observation) => Some(observation),
            _ => None,
        }
    }

    fn names(observation: &Observation, robot: RobotId) -> bool {
        matches!(observation.quantity, Quantity::Robot { robot: named, .. } if named == robot)
    }

    /// Files an observation of `robot` by the answer held, if any; a former answer's traces go.
    fn resolve(&mut self, id: EntryId, observation: &Observation, robot: RobotId) {
        let Some((by, answer)) = self.answers.get(&(id, robot)).copied() else { return };
        if !self.takes_part(robot, by.boot, observation.time) {
            return;
        }
        #[cfg(feature = "planted")]
        let answer = self.mistaken(robot, observation.time, answer);
        self.pending.remove(&id);
        self.void.remove(&id);
        match answer {
            Answer::State { boot, state } => self.complete(id, observation, Some((boot, state))),
            Answer::Void(reason) => {
                let key = FactKey::observation(observation.time, id);
                if self.facts.remove(&key).is_some() {
                    self.touch(key);
                }
                self.void.insert(id, reason);
            }
        }
    }

    fn complete(&mut self, id: EntryId, observation: &Observation, other: Option<(BootIndex, NominalState)>) {
        let noise = match observation.noise {
            NoiseRef::Explicit(noise) => Some(noise),
            NoiseRef::Profile(index) => self.profiles.get(&(id.log(), index)).copied(),
        };
        let fact = Fact::Observation {
            quantity: observation.quantity,
            noise,
            observer: observation.observer,
            other,
        };
        self.file(FactKey::observation(observation.time, id), &fact);
    }

    fn file(&mut self, key: FactKey, fact: &Fact) {
        self.facts.insert(key, FactRecord { fact: *fact, residual: None });
        self.touch(key);
    }

    /// Something changed at `key`: what was folded from there on is stale.
    fn touch(&mut self, key: FactKey) {
        #[cfg(feature = "planted")]
        if self.planted == Some(Planted::SkipRewind) {
            return;
        }
        if self.folded.is_some_and(|folded| key <= folded) && self.dirty.is_none_or(|dirty| key < dirty) {
            self.dirty = Some(key);
        }
    }

    /// Brings the estimate up to date with all facts held: goes back to the last snapshot before the
    /// earliest new fact and folds from there.
    pub fn settle(&mut self) -> &Joint {
        if let Some(how) = self.config.relinearize {
            self.settle_together(&how);
            return &self.joint;
        }
        if let Some(dirty) = self.dirty.take() {
            let base = self.base_joint();
            let (joint, key) = self.snapshots.rewind(dirty, &base);
            self.joint = joint;
            self.folded = key;
        }
        let after = self.folded.map_or(std::ops::Bound::Unbounded, std::ops::Bound::Excluded);
        for (key, record) in self.facts.range_mut((after, std::ops::Bound::Unbounded)) {
            let others = &self.naming.others;
            let others = |id, robot| others.get(&(id, robot)).copied();
            record.residual = Some(fold_among(&mut self.joint, &self.config, key, &record.fact, &others));
            self.folded = Some(*key);
            self.refolded += 1;
            self.snapshots.offer(*key, &self.joint);
        }
        &self.joint
    }

    /// The same where facts are linearized together: from the last block on that no new fact has part in.
    fn settle_together(&mut self, how: &Relinearization) {
        let after = self.folded.map_or(std::ops::Bound::Unbounded, std::ops::Bound::Excluded);
        let next = self.facts.range((after, std::ops::Bound::Unbounded)).next().map(|(key, _)| *key);
        let Some(first) = self.dirty.take().into_iter().chain(next).min() else { return };
        let base = self.base_joint();
        // A fact moves where those of a block before it are linearized, as far ahead as a block looks.
        let unmoved = Timestamp(first.time.0.saturating_sub(how.ahead_ns));
        let (mut joint, from) = self.snapshots.rewind(FactKey::first_at(unmoved), &base);
        let from = from.map_or(std::ops::Bound::Unbounded, std::ops::Bound::Excluded);
        let facts: Vec<(FactKey, Fact)> = self
            .facts
            .range((from, std::ops::Bound::Unbounded))
            .map(|(key, record)| (*key, record.fact))
            .collect();
        let (snapshots, records) = (&mut self.snapshots, &mut self.facts);
        let mut ended = |end: Timestamp, joint: &Joint| snapshots.keep(FactKey::last_at(end), joint);
        let mut told = |index: usize, residual, _: &dyn Fn() -> Joint| {
            if let Some(record) = records.get_mut(&facts[index].0) {
                record.residual = Some(residual);
            }
        };
        fold_blocks(&mut joint, &self.config, how, &facts, &mut ended, &mut told);
        self.refolded += facts.len() as u64;
        self.folded = facts.last().map(|(key, _)| *key);
        self.joint = joint;
    }
}

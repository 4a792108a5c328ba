//! The snapshot at a cut, and the ledger that rests on it.

use std::collections::{BTreeMap, BTreeSet};

use super::{Closing, Decision};
use crate::fact::{Body, Entry, EntryId, Fingerprint, LogId, SealedLog, WHOLE, length_of};
use crate::fold::{Fact, FactKey, fold_on};
use crate::ledger::checkpoint::{Checkpoint, LogBase};
use crate::ledger::{Ledger, rules};
use crate::{BootIndex, RobotId, Timestamp};

impl Ledger {
    pub(super) fn checkpoint_at(&self, closing: &Closing, cut: Timestamp) -> Checkpoint {
        let base = &closing.base;
        let (positions, limits) = self.positions_at(closing, cut);
        let position = |id: &LogId| positions.get(id).copied().unwrap_or(0);
        let mut joint = base.joint.clone();
        let mut counts = base.counts;
        let closed: Vec<(FactKey, Fact)> = self
            .facts
            .range(..=FactKey::last_at(cut))
            .inspect(|(_, record)| counts.add(record))
            .map(|(key, record)| (*key, record.fact))
            .collect();
        let others = |id, robot| self.other_half(id, robot);
        fold_on(&mut joint, &self.config, &closed, &others, &mut |_, _| {});
        let lost = self.pending.values().filter(|observation| observation.time <= cut).count();
        counts.expired += lost;
        counts.void += self.void.keys().filter(|id| self.time_of(**id).is_some_and(|t| t <= cut)).count();

        let accounted = self.logs.iter().flat_map(|(id, log)| {
            let before = position(id);
            log.entries_from(log.base).iter().take_while(move |entry| entry.id.sequence.0 < before)
        });
        let mut open = BTreeMap::new();
        let (mut profiles, mut clocks) = (base.profiles.clone(), base.clocks.clone());
        let (mut seals, mut views) = (base.seals.clone(), base.views.clone());
        for entry in base.open.values().chain(accounted) {
            match &entry.body {
                Body::Profile(profile) => {
                    profiles.entry((entry.id.log(), profile.index)).or_insert(profile.noise);
                }
                Body::ClockMap(map) => {
                    clocks.insert(entry.id.log(), *map);
                }
                Body::Seal(seal) => {
                    let slot = seals.entry(entry.id.robot).or_insert_with(|| (entry.id, seal.clone()));
                    if entry.id > slot.0 {
                        *slot = (entry.id, seal.clone());
                    }
                }
                Body::Vote(vote) => views.hear(entry.id, vote),
                Body::Boot(boot) if boot.time > cut => {
                    open.insert(entry.id, entry.clone());
                }
                Body::Observation(observation) if observation.time > cut => {
                    open.insert(entry.id, entry.clone());
                }
                Body::Half(half)
                    if self.still_open(half.observation, cut, position(&half.observation.log()), &limits) =>
                {
                    open.insert(entry.id, entry.clone());
                }
                Body::Boot(_) | Body::Observation(_) | Body::Half(_) => {}
            }
        }
        let needed = closing.decisions.iter().rposition(|decision| decision.is_needed(cut));
        for Decision { vote, until } in closing.decisions.iter().take(needed.map_or(0, |last| last + 1)) {
            views.apply(vote, until);
        }
        views.terms.retain(|term| term.until.is_none_or(|until| until >= cut));

        // A log that ended before its first entry counts too: a later cut must know that it is over.
        let mut logs = BTreeMap::new();
        for (id, start) in &positions {
            let limit = limits.get(id).copied();
            if *start == 0 && limit == Some(0) {
                logs.insert(*id, LogBase { start: 0, chain: Fingerprint::default(), limit });
            } else if let Some(log) = self.logs.get(id).filter(|_| *start > 0) {
                logs.insert(*id, LogBase { start: *start, chain: log.chain_before(*start), limit });
            }
        }
        let mut floors = base.floors.clone();
        // An answer to an entry of a forgotten log is over too, and may have been the last to keep a log.
        loop {
            let kept = open.len();
            forget_ended(&mut logs, &mut floors, &open);
            open.retain(|_, entry| match &entry.body {
                Body::Half(half) => {
                    let of = half.observation;
                    floors.get(&of.robot).is_none_or(|floor| of.boot >= *floor)
                }
                _ => true,
            });
            if open.len() == kept {
                break;
            }
        }
        let kept = |id: &LogId| logs.contains_key(id) || open.keys().any(|open| open.log() == *id);
        profiles.retain(|(id, _), _| kept(id));
        clocks.retain(|id, _| kept(id));
        Checkpoint {
            time: cut,
            configuration: self.configuration,
            joint,
            logs,
            floors,
            profiles,
            clocks,
            seals,
            views,
            open,
            counts,
        }
    }

    fn time_of(&self, id: EntryId) -> Option<Timestamp> {
        self.observation(id).map(|observation| observation.time)
    }

    /// Whether an answer can still matter after a cut that accounts for its observation's log up to
    /// `position`: the observation is later, or not accounted for.
    fn still_open(
        &self,
        observation: EntryId,
        cut: Timestamp,
        position: u64,
        limits: &BTreeMap<LogId, u64>,
    ) -> bool {
        if self.is_over(observation) {
            return false;
        }
        if observation.sequence.0 >= position {
            return limits.get(&observation.log()).is_none_or(|limit| observation.sequence.0 < *limit);
        }
        self.time_of(observation).is_some_and(|time| time > cut)
    }

    /// Whether an entry was accounted for by the last cut and does not matter any more.
    pub(in crate::ledger) fn is_over(&self, id: EntryId) -> bool {
        let Some(closing) = &self.closing else { return false };
        if closing.base.open.contains_key(&id) {
            return false;
        }
        closing.base.floors.get(&id.robot).is_some_and(|floor| id.boot < *floor)
            || closing.base.logs.get(&id.log()).is_some_and(|base| id.sequence.0 < base.start)
    }

    /// How far each log is accounted for at a cut, and where logs end: of every member up to its first seal
    /// that reaches the cut; of evicted ones all that is accepted.
    fn positions_at(
        &self,
        closing: &Closing,
        cut: Timestamp,
    ) -> (BTreeMap<LogId, u64>, BTreeMap<LogId, u64>) {
        let base = &closing.base;
        let mut positions: BTreeMap<LogId, u64> =
            base.logs.iter().map(|(id, log)| (*id, log.start)).collect();
        let mut limits: BTreeMap<LogId, u64> =
            base.logs.iter().filter_map(|(id, log)| Some((*id, log.limit?))).collect();
        let forgotten = |id: LogId| base.floors.get(&id.robot).is_some_and(|floor| id.boot < *floor);
        let mut raise = |id: LogId, to: u64| {
            if !forgotten(id) {
                let position = positions.entry(id).or_insert(0);
                *position = (*position).max(to);
            }
        };
        for term in closing.views.terms.iter().filter(|term| term.from < cut) {
            if term.until.is_some_and(|until| until < cut) {
                let known = self.logs.iter().filter(|(id, _)| id.robot == term.robot);
                let whole = known.filter(|(id, _)| length_of(&term.limits, **id) == Some(WHOLE));
                let whole = whole.filter_map(|(id, log)| Some((*id, log.limit?)));
                let stated = term.limits.iter().copied().filter(|(_, held)| *held != WHOLE);
                for (id, held) in stated.chain(whole) {
                    raise(id, held);
                    limits.insert(id, held);
                }
                // An earlier cut may have counted what his accepted seals say of logs that are not accepted.
                let seals = closing.seals.get(&term.robot).into_iter().flatten();
                let accepted = |id: &EntryId| {
                    id.boot >= term.boot
                        && length_of(&term.limits, id.log()).is_some_and(|held| id.sequence.0 < held)
                };
                for (id, seal) in seals.filter(|(id, _)| accepted(id)) {
                    for log in seal.logs.iter().filter(|log| log.last) {
                        let of = LogId { robot: id.robot, boot: log.boot };
                        if length_of(&term.limits, of).is_none() && !forgotten(of) {
                            raise(of, 0);
                            limits.insert(of, 0);
                        }
                    }
                }
                continue;
            }
            let accounted = base.seals.get(&term.robot).filter(|(id, _)| id.boot >= term.boot);
            if accounted.is_some_and(|(_, seal)| seal.observed.min(seal.answered) >= cut) {
                continue;
            }
            let whole: BTreeSet<EntryId> = self.whole_seals(closing, term.robot).map(|(id, _)| *id).collect();
            let seals = closing.seals.get(&term.robot).into_iter().flatten();
            for (id, seal) in seals.filter(|(id, _)| id.boot >= term.boot) {
                let said = |log: &SealedLog| {
                    let of = LogId { robot: id.robot, boot: log.boot };
                    (of, rules::needed(log.length, self.end_of(closing, of)))
                };
                for (of, length) in seal.logs.iter().filter(|log| log.last).map(said) {
                    if !forgotten(of) {
                        limits.insert(of, length);
                        raise(of, length);
                    }
                }
                if seal.observed.min(seal.answered) >= cut && whole.contains(id) {
                    raise(id.log(), id.sequence.0 + 1);
                    seal.logs.iter().map(said).for_each(|(of, length)| raise(of, length));
                    break;
                }
            }
        }
        (positions, limits)
    }

    /// Makes a snapshot of this ledger's own the ground it rests on.
    pub(super) fn rest_on(&mut self, checkpoint: Checkpoint) {
        let cut = checkpoint.time;
        let last = FactKey::last_at(cut);
        self.facts = self.facts.split_off(&last);
        self.pending.retain(|_, observation| observation.time > cut);
        self.snapshots.forget_until(last);
        self.folded = self.folded.filter(|folded| *folded > last);
        if self.folded.is_none() {
            self.joint = checkpoint.joint.clone();
        }
        self.profiles
            .retain(|(log, _), _| checkpoint.floors.get(&log.robot).is_none_or(|floor| log.boot >= *floor));
        let floors = checkpoint.floors.clone();
        self.logs.retain(|id, _| floors.get(&id.robot).is_none_or(|floor| id.boot >= *floor));
        for (id, base) in &checkpoint.logs {
            let log = self.logs.entry(*id).or_default();
            log.base = base.start;
        }
        if let Some(closing) = &mut self.closing {
            for seals in closing.seals.values_mut() {
                let reached = |id: &EntryId| {
                    checkpoint.logs.get(&id.log()).is_some_and(|base| id.sequence.0 < base.start)
                };
                seals.retain(|id, _| {
                    !reached(id) && floors.get(&id.robot).is_none_or(|floor| id.boot >= *floor)
                });
            }
            let epoch = checkpoint.views.epoch;
            closing.decisions.retain(|decision| decision.vote.epoch >= epoch);
            closing.views.terms.retain(|term| term.until.is_none_or(|until| until >= cut));
            let starts = checkpoint.logs.iter().map(|(id, base)| (*id, base.start)).collect();
            closing.cuts.push((cut, starts));
            closing.base = checkpoint;
        }
        let answers = std::mem::take(&mut self.answers);
        self.answers = answers.into_iter().filter(|((id, _), _)| !self.is_over(*id)).collect();
        self.forget_answered(cut);
        let void = std::mem::take(&mut self.void);
        self.void = void.into_iter().filter(|(id, _)| !self.is_over(*id)).collect();
        self.release();
    }

    /// Forgets entries that no member can ask for any more, because all have closed past them.
    pub(super) fn release(&mut self) {
        let Some(closing) = &self.closing else { return };
        let reached = closing
            .views
            .active()
            .map(|term| self.seal_of(term.robot).map_or(Timestamp::MIN, |seal| seal.closed));
        let reached = reached.min().unwrap_or(Timestamp::MIN).min(closing.base.time);
        let Some(closing) = &mut self.closing else { return };
        let over = closing.cuts.partition_point(|(cut, _)| *cut <= reached);
        let Some(last) = over.checked_sub(1) else { return };
        for (id, start) in &closing.cuts[last].1 {
            if let Some(log) = self.logs.get_mut(id) {
                log.forget_before(*start);
            }
        }
        closing.cuts.drain(..last);
    }
}

impl Decision {
    /// Whether a cut rests on it: it is after what someone who went has promised, or someone who came takes
    /// part in it.
    fn is_needed(&self, cut: Timestamp) -> bool {
        self.until.iter().any(|until| *until < cut) || (!self.vote.added.is_empty() && self.vote.from < cut)
    }
}

/// Logs of earlier boots that have ended and are accounted for are forgotten, from the earliest on.
fn forget_ended(
    logs: &mut BTreeMap<LogId, LogBase>,
    floors: &mut BTreeMap<RobotId, BootIndex>,
    open: &BTreeMap<EntryId, Entry>,
) {
    let robots: BTreeSet<RobotId> = logs.keys().map(|id| id.robot).collect();
    for robot in robots {
        let boots: Vec<LogId> = logs.keys().copied().filter(|id| id.robot == robot).collect();
        for pair in boots.windows(2) {
            let [id, next] = [pair[0], pair[1]];
            let ended = logs.get(&id).is_some_and(|base| base.limit == Some(base.start));
            if !ended || open.keys().any(|open| open.log() == id) {
                break;
            }
            logs.remove(&id);
            floors.insert(robot, next.boot);
        }
    }
}

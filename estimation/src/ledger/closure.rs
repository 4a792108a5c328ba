//! Closing the past: which cut the seals held allow, and the ledger after it. `docs/ledger.md` has the rules.

use std::collections::{BTreeMap, BTreeSet};

use super::checkpoint::{Checkpoint, LogBase};
use super::counts::FactCounts;
use super::rules::{self, Closure, Standing};
use super::views::{Term, Views};
use super::{Ledger, Log};
use crate::fact::{Body, Entry, EntryId, Fingerprint, LogId, Seal, Vote};
use crate::fold::{FactKey, FoldConfig, fold};
use crate::joint::Joint;
use crate::{BootIndex, RobotId, Timestamp};

/// What a robot would change about the team.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// To be evicted.
    pub evict: BTreeSet<RobotId>,
    /// Absent for long enough here to agree when others want them evicted.
    pub absent: BTreeSet<RobotId>,
    /// To be admitted, from which boot on.
    pub admit: BTreeMap<RobotId, BootIndex>,
    /// It is an operator's.
    pub operator: bool,
}

/// What closing needs besides the logs.
#[derive(Clone, Debug)]
pub(super) struct Closing {
    pub closure: Closure,
    /// Whose ledger this is.
    pub owner: RobotId,
    pub base: Checkpoint,
    pub views: Views,
    /// Seals after the base, by robot, in the order of their entries.
    pub seals: BTreeMap<RobotId, BTreeMap<EntryId, Seal>>,
    /// The votes of the changes decided after the base, by epoch.
    pub decisions: Vec<Decision>,
    /// Where the logs stood at cuts that some member may not have reached yet.
    pub cuts: Vec<(Timestamp, BTreeMap<LogId, u64>)>,
}

#[derive(Clone, Debug)]
pub(super) struct Decision {
    vote: Vote,
    entries: Vec<EntryId>,
}

impl Ledger {
    /// Empty, of one robot of a team that closes its past.
    pub fn closing(config: FoldConfig, closure: Closure, owner: RobotId) -> Self {
        let terms = closure.members.iter().map(|robot| Term {
            robot: *robot,
            from: Timestamp::MIN,
            boot: BootIndex(0),
            until: None,
            limits: Vec::new(),
        });
        let base = Checkpoint {
            time: Timestamp::MIN,
            configuration: configuration(&config, &closure),
            joint: Joint::new(config.form),
            logs: BTreeMap::new(),
            floors: BTreeMap::new(),
            profiles: BTreeMap::new(),
            clocks: BTreeMap::new(),
            seals: BTreeMap::new(),
            views: Views { epoch: 0, terms: terms.collect(), votes: BTreeMap::new() },
            open: BTreeMap::new(),
            counts: FactCounts::default(),
        };
        Self::from_checkpoint(config, closure, owner, base)
    }

    /// The ledger of a robot that knows nothing but a snapshot. It must have been made under the same
    /// configuration.
    pub fn from_checkpoint(
        config: FoldConfig,
        closure: Closure,
        owner: RobotId,
        checkpoint: Checkpoint,
    ) -> Self {
        let mut ledger = Self::new(config);
        ledger.configuration = configuration(&config, &closure);
        ledger.logs = checkpoint.logs.iter().map(|(id, base)| (*id, Log::from_base(base))).collect();
        ledger.profiles = checkpoint.profiles.clone();
        ledger.joint = checkpoint.joint.clone();
        let open: Vec<Entry> = checkpoint.open.values().cloned().collect();
        let starts = checkpoint.logs.iter().map(|(id, base)| (*id, base.start)).collect();
        ledger.closing = Some(Box::new(Closing {
            closure,
            owner,
            views: checkpoint.views.clone(),
            seals: BTreeMap::new(),
            decisions: Vec::new(),
            cuts: vec![(checkpoint.time, starts)],
            base: checkpoint,
        }));
        for entry in &open {
            ledger.admit(entry);
        }
        ledger
    }

    /// What the team has agreed on to close its past; `None` if it keeps everything.
    pub fn closure(&self) -> Option<&Closure> {
        self.closing.as_ref().map(|closing| &closing.closure)
    }

    /// Everything stamped at or before this is closed.
    pub fn cut(&self) -> Option<Timestamp> {
        let time = self.closing.as_ref().map(|closing| closing.base.time);
        time.filter(|time| *time > Timestamp::MIN)
    }

    /// The snapshot at the last cut.
    pub fn checkpoint(&self) -> Option<&Checkpoint> {
        self.closing.as_ref().map(|closing| &closing.base).filter(|base| base.time > Timestamp::MIN)
    }

    /// What this ledger rests on, the empty one before the first cut.
    pub fn base(&self) -> Option<&Checkpoint> {
        self.closing.as_ref().map(|closing| &closing.base)
    }

    /// Rests on a peer's snapshot from now on; what is held beyond it is kept.
    pub fn take_over(&mut self, checkpoint: Checkpoint) {
        let Some(closing) = &self.closing else { return };
        let (closure, owner) = (closing.closure.clone(), closing.owner);
        let mut fresh = Self::from_checkpoint(self.config, closure, owner, checkpoint);
        for entry in self.logs.values().flat_map(Log::all) {
            fresh.insert(entry.clone());
        }
        fresh.quarantined = std::mem::take(&mut self.quarantined);
        #[cfg(feature = "planted")]
        {
            fresh.planted = self.planted;
        }
        *self = fresh;
    }

    /// Whether a log is over and forgotten.
    pub fn is_forgotten(&self, log: LogId) -> bool {
        let floor = self.closing.as_ref().and_then(|closing| closing.base.floors.get(&log.robot));
        floor.is_some_and(|floor| log.boot < *floor)
    }

    /// Whether a log has ended, and all of it is held or accounted for.
    pub fn is_complete(&self, log: LogId) -> bool {
        let ended = self.logs.get(&log).is_some_and(|log| log.limit.is_some_and(|limit| log.held() >= limit));
        ended || self.is_forgotten(log)
    }

    /// The logs of a robot that have not ended, and their lengths.
    pub fn open_logs(&self, robot: RobotId) -> impl Iterator<Item = (LogId, u64)> + '_ {
        let logs = self.logs.iter().filter(move |(id, log)| id.robot == robot && log.limit.is_none());
        logs.map(|(id, log)| (*id, log.held()))
    }

    /// The membership as far as it is known here.
    pub fn views(&self) -> Option<&Views> {
        self.closing.as_ref().map(|closing| &closing.views)
    }

    pub(super) fn base_joint(&self) -> Joint {
        self.closing
            .as_ref()
            .map_or_else(|| Joint::new(self.config.form), |closing| closing.base.joint.clone())
    }

    /// The last seal held of a robot, whether it counts yet or not.
    pub fn seal_of(&self, robot: RobotId) -> Option<&Seal> {
        let closing = self.closing.as_ref()?;
        let later = closing.seals.get(&robot).and_then(|seals| seals.values().next_back());
        later.or_else(|| closing.base.seals.get(&robot).map(|(_, seal)| seal))
    }

    /// The boot in which a robot has written its last seal held.
    pub fn sealed_in(&self, robot: RobotId) -> Option<BootIndex> {
        let closing = self.closing.as_ref()?;
        let later = closing.seals.get(&robot).and_then(|seals| seals.keys().next_back());
        later.or_else(|| closing.base.seals.get(&robot).map(|(id, _)| id)).map(|id| id.boot)
    }

    /// How far a log is held; what is over and forgotten is held to any length.
    fn holds(&self, log: LogId, length: u64) -> bool {
        let forgotten = self.closing.as_ref().and_then(|closing| closing.base.floors.get(&log.robot));
        forgotten.is_some_and(|floor| log.boot < *floor)
            || self.logs.get(&log).is_some_and(|held| held.held() >= length)
            || length == 0
    }

    /// Whether a seal counts: everything it speaks of is held, and nothing speaks against its author.
    fn counts_here(&self, closing: &Closing, id: EntryId, seal: &Seal) -> bool {
        let logs =
            seal.logs.iter().all(|log| self.holds(LogId { robot: id.robot, boot: log.boot }, log.length));
        // Whoever has voted to evict a robot no longer rests on what came from it later.
        let voted = closing.views.vote(closing.owner);
        let given_up = voted.is_some_and(|vote| {
            vote.removed.contains(&id.robot)
                && vote
                    .held
                    .iter()
                    .find(|(log, _)| *log == id.log())
                    .is_none_or(|(_, held)| id.sequence.0 >= *held)
        });
        logs && !given_up
    }

    fn standing(&self, closing: &Closing, term: &Term) -> Standing {
        let mut standing = Standing { observed: Timestamp::MIN, answered: Timestamp::MIN, from: term.from };
        let base = closing.base.seals.get(&term.robot).map(|(id, seal)| (id, seal));
        let later = closing.seals.get(&term.robot).into_iter().flatten();
        // A log is said to have ended once, so that a later seal rests on what earlier ones speak of.
        let of_term = base.into_iter().chain(later).filter(|(id, _)| id.boot >= term.boot);
        let counting = of_term.take_while(|(id, seal)| self.counts_here(closing, **id, seal));
        if let Some((_, seal)) = counting.last() {
            standing.observed = seal.observed;
            standing.answered = seal.answered;
        }
        standing
    }

    /// Up to when the owner may say that it has answered everything that names it.
    pub fn answerable(&self) -> Timestamp {
        let Some(closing) = &self.closing else { return Timestamp::MIN };
        #[cfg(feature = "planted")]
        if self.planted == Some(super::Planted::AnswerBlindly) {
            return Timestamp::MAX;
        }
        let members: Vec<Standing> =
            closing.views.active().map(|term| self.standing(closing, term)).collect();
        // Looking through what is owed is worth it only if something would follow.
        let sealed = closing.closure.floor(rules::answerable(members.iter().copied(), None));
        let answered = self.seal_of(closing.owner).map_or(Timestamp::MIN, |seal| seal.answered);
        if sealed <= answered {
            return answered;
        }
        let owed = self.unanswered(closing.owner).map(|(_, time)| time).min();
        closing.closure.floor(rules::answerable(members, owed))
    }

    /// The latest cut that the seals held allow, if it is later than the last one.
    pub fn closable(&self) -> Option<Timestamp> {
        let closing = self.closing.as_ref()?;
        let members = closing.views.active().map(|term| self.standing(closing, term));
        let until = rules::final_until(members);
        #[cfg(feature = "planted")]
        let until = if self.planted == Some(super::Planted::CloseByNumbers) {
            self.acknowledged(closing)
        } else {
            until
        };
        let cut = closing.closure.floor(until);
        (cut > closing.base.time && cut < Timestamp::MAX).then_some(cut)
    }

    /// The wrong rule: everything up to the last observation of which all members have said, by a later
    /// entry, that they hold it.
    #[cfg(feature = "planted")]
    fn acknowledged(&self, closing: &Closing) -> Timestamp {
        let last = |robot: RobotId| {
            let logs = self.logs.iter().filter(|(id, _)| id.robot == robot);
            let times = logs.flat_map(|(_, log)| log.entries()).filter_map(|entry| match &entry.body {
                Body::Observation(observation) => Some(observation.time),
                Body::Boot(boot) => Some(boot.time),
                Body::Seal(seal) => Some(seal.observed),
                _ => None,
            });
            times.max().unwrap_or(closing.base.time)
        };
        closing.views.active().map(|term| last(term.robot)).min().unwrap_or(Timestamp::MIN)
    }

    pub(super) fn hear_seal(&mut self, id: EntryId, seal: &Seal) {
        let Some(closing) = &mut self.closing else { return };
        closing.seals.entry(id.robot).or_default().insert(id, seal.clone());
        for log in seal.logs.iter().filter(|log| log.last) {
            let id = LogId { robot: id.robot, boot: log.boot };
            if closing.base.floors.get(&id.robot).is_some_and(|floor| id.boot < *floor) {
                continue;
            }
            self.truncated |= self.logs.entry(id).or_default().end_at(log.length);
        }
        self.release();
    }

    pub(super) fn hear_vote(&mut self, id: EntryId, vote: &Vote) {
        if let Some(closing) = &mut self.closing {
            closing.views.hear(id, vote);
        }
    }

    /// Puts membership changes into effect that everyone who stays has voted for.
    pub(super) fn decide(&mut self) {
        loop {
            let Some(closing) = &self.closing else { return };
            let Some((vote, entries)) = closing.views.decided() else { return };
            if !vote.held.iter().all(|(log, held)| self.holds(*log, *held)) {
                return;
            }
            let vote = vote.clone();
            let sealed: BTreeMap<RobotId, Timestamp> =
                vote.removed.iter().map(|robot| (*robot, sealed_within(closing, *robot, &vote))).collect();
            let gone: Vec<LogId> =
                self.logs.keys().copied().filter(|log| vote.removed.contains(&log.robot)).collect();
            if let Some(closing) = &mut self.closing {
                closing.views.apply(&vote, |robot| sealed.get(&robot).copied().unwrap_or(Timestamp::MIN));
                closing.decisions.push(Decision { vote: vote.clone(), entries });
            }
            for id in gone {
                let limit = vote.held.iter().find(|(log, _)| *log == id).map_or(0, |(_, held)| *held);
                if let Some(log) = self.logs.get_mut(&id) {
                    self.truncated |= log.end_at(limit);
                    // What nobody vouches for was never there.
                    if limit == 0 && log.held() == 0 {
                        self.logs.remove(&id);
                    }
                }
            }
        }
    }

    /// Closes the past up to `cut`, which must be [`Ledger::closable`]. Gives the hash of the snapshot.
    pub fn close(&mut self, cut: Timestamp) -> Option<Fingerprint> {
        self.settle();
        let closing = self.closing.as_ref()?;
        if cut <= closing.base.time {
            return None;
        }
        let checkpoint = self.checkpoint_at(closing, cut);
        let fingerprint = checkpoint.fingerprint();
        self.rest_on(checkpoint);
        Some(fingerprint)
    }

    fn checkpoint_at(&self, closing: &Closing, cut: Timestamp) -> Checkpoint {
        let base = &closing.base;
        let (positions, limits) = Self::positions_at(closing, cut);
        let position = |id: &LogId| positions.get(id).copied().unwrap_or(0);
        let mut joint = base.joint.clone();
        let mut counts = base.counts;
        for (key, record) in self.facts.range(..=FactKey::last_at(cut)) {
            fold(&mut joint, &self.config, key, &record.fact);
            counts.add(record);
        }
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
        while let Some((vote, _)) = views.decided() {
            let vote = vote.clone();
            views.apply(&vote, |robot| sealed_within(closing, robot, &vote));
        }
        views.terms.retain(|term| term.until.is_none_or(|until| until >= cut));

        let mut logs = BTreeMap::new();
        for (id, start) in positions.iter().filter(|(_, start)| **start > 0) {
            if let Some(log) = self.logs.get(id) {
                let limit = limits.get(id).copied();
                logs.insert(*id, LogBase { start: *start, chain: log.chain_before(*start), limit });
            }
        }
        let mut floors = base.floors.clone();
        forget_ended(&mut logs, &mut floors, &open);
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
    pub(super) fn is_over(&self, id: EntryId) -> bool {
        let Some(closing) = &self.closing else { return false };
        if closing.base.open.contains_key(&id) {
            return false;
        }
        closing.base.floors.get(&id.robot).is_some_and(|floor| id.boot < *floor)
            || closing.base.logs.get(&id.log()).is_some_and(|base| id.sequence.0 < base.start)
    }

    /// How far each log is accounted for at a cut, and where logs end: of every member up to its first seal
    /// that reaches the cut; of evicted ones all that is accepted; and the votes that decided who is who.
    fn positions_at(closing: &Closing, cut: Timestamp) -> (BTreeMap<LogId, u64>, BTreeMap<LogId, u64>) {
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
                for (id, held) in &term.limits {
                    raise(*id, *held);
                    limits.insert(*id, *held);
                }
                continue;
            }
            let accounted = base.seals.get(&term.robot).filter(|(id, _)| id.boot >= term.boot);
            if accounted.is_some_and(|(_, seal)| seal.observed.min(seal.answered) >= cut) {
                continue;
            }
            let seals = closing.seals.get(&term.robot).into_iter().flatten();
            for (id, seal) in seals.filter(|(id, _)| id.boot >= term.boot) {
                for log in &seal.logs {
                    let of = LogId { robot: id.robot, boot: log.boot };
                    if log.last && !forgotten(of) {
                        limits.insert(of, log.length);
                        raise(of, log.length);
                    }
                }
                if seal.observed.min(seal.answered) >= cut {
                    raise(id.log(), id.sequence.0 + 1);
                    for log in &seal.logs {
                        raise(LogId { robot: id.robot, boot: log.boot }, log.length);
                    }
                    break;
                }
            }
        }
        let mut needed = false;
        for Decision { vote, entries } in closing.decisions.iter().rev() {
            let ended = |robot: &RobotId| {
                let terms = closing.views.terms.iter().filter(|term| term.robot == *robot);
                terms.filter_map(|term| term.until).any(|until| until < cut)
            };
            needed |= vote.removed.iter().any(ended) || (!vote.added.is_empty() && vote.from < cut);
            if needed {
                for id in entries {
                    raise(id.log(), id.sequence.0 + 1);
                }
            }
        }
        // Votes can lie beyond the first seal that reaches the cut, and more seals before them.
        let accounted = |id: &EntryId| positions.get(&id.log()).is_some_and(|to| id.sequence.0 < *to);
        let seals = closing.seals.values().flatten().filter(|(id, _)| accounted(id));
        let ended = seals.flat_map(|(id, seal)| {
            let last = seal.logs.iter().filter(|log| log.last);
            last.map(|log| (LogId { robot: id.robot, boot: log.boot }, log.length))
        });
        let ended: Vec<(LogId, u64)> = ended.filter(|(log, _)| !forgotten(*log)).collect();
        for (log, length) in ended {
            limits.entry(log).or_insert(length);
            let position = positions.entry(log).or_insert(0);
            *position = (*position).max(length);
        }
        (positions, limits)
    }

    /// Makes a snapshot of this ledger's own the ground it rests on.
    fn rest_on(&mut self, checkpoint: Checkpoint) {
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
        let void = std::mem::take(&mut self.void);
        self.void = void.into_iter().filter(|(id, _)| !self.is_over(*id)).collect();
        self.release();
    }

    /// Forgets entries that no member can ask for any more, because all have closed past them.
    fn release(&mut self) {
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

    /// What the owner has to vote, if it is not what it has voted already: its own wishes joined with the
    /// votes it agrees to. Later votes of a robot only ever contain more.
    pub fn proposal(&self, wish: &Wish) -> Option<Vote> {
        let closing = self.closing.as_ref()?;
        let (views, owner) = (&closing.views, closing.owner);
        if !views.is_active(owner) {
            return None;
        }
        let own = views.vote(owner);
        let mut joined = own.cloned().unwrap_or_default();
        let mut removed: BTreeSet<RobotId> = joined.removed.iter().copied().collect();
        let mut added: BTreeMap<RobotId, BootIndex> = joined.added.iter().copied().collect();
        removed.extend(wish.evict.iter().filter(|robot| **robot != owner && views.is_active(**robot)));
        added.extend(wish.admit.iter().filter(|(robot, _)| !views.is_active(**robot)));
        joined.operator |= wish.operator && !wish.evict.is_empty();
        let mut held: BTreeMap<LogId, u64> = joined.held.iter().copied().collect();
        let mut from = joined.from;
        for term in views.active().filter(|term| term.robot != owner) {
            if removed.contains(&term.robot) {
                continue;
            }
            let Some(vote) = views.vote(term.robot) else { continue };
            let agreed = vote.operator
                || vote.removed.iter().all(|robot| removed.contains(robot) || wish.absent.contains(robot));
            if vote.removed.contains(&owner) || !agreed {
                continue;
            }
            removed.extend(&vote.removed);
            for (robot, boot) in &vote.added {
                let slot = added.entry(*robot).or_insert(*boot);
                *slot = (*slot).max(*boot);
            }
            for (log, length) in vote.held.iter().filter(|(log, length)| self.holds(*log, *length)) {
                let slot = held.entry(*log).or_insert(*length);
                *slot = (*slot).max(*length);
            }
            joined.operator |= vote.operator;
            from = from.max(vote.from);
        }
        if removed.is_empty() && added.is_empty() {
            return None;
        }
        let known = self.logs.iter().filter(|(_, log)| log.held() > 0);
        for (id, log) in known.filter(|(id, _)| removed.contains(&id.robot)) {
            held.entry(*id).or_insert(log.held());
        }
        joined.removed = removed.into_iter().collect();
        joined.added = added.into_iter().collect();
        joined.held = held.into_iter().filter(|(log, _)| joined.removed.contains(&log.robot)).collect();
        joined.epoch = views.epoch;
        joined.from = from;
        if own == Some(&joined) {
            return None;
        }
        joined.from = from.max(self.seal_of(owner).map_or(Timestamp::MIN, |seal| seal.observed));
        (own != Some(&joined)).then_some(joined)
    }

    /// Rough size of what is kept in memory: entries, facts, and answers.
    pub fn kept(&self) -> usize {
        let entries: usize = self.logs.values().map(|log| log.entries().len() + log.waiting()).sum();
        entries + self.facts.len() + self.answers.len() + self.pending.len()
    }

    /// Everything kept beyond the last cut, to be written to a new journal after the snapshot.
    pub fn entries_after_cut(&self) -> impl Iterator<Item = &Entry> {
        self.logs
            .values()
            .flat_map(Log::all)
            .filter(|entry| self.logs.get(&entry.id.log()).is_some_and(|log| entry.id.sequence.0 >= log.base))
    }
}

/// How far an evicted robot's promises reach within what is accepted of its logs.
fn sealed_within(closing: &Closing, robot: RobotId, vote: &Vote) -> Timestamp {
    let accepted =
        |id: &EntryId| vote.held.iter().any(|(log, held)| *log == id.log() && id.sequence.0 < *held);
    let later = closing.seals.get(&robot).into_iter().flatten();
    let seal = later.rev().find(|(id, _)| accepted(id)).map(|(_, seal)| seal);
    let seal = seal.or_else(|| closing.base.seals.get(&robot).map(|(_, seal)| seal));
    seal.map_or(Timestamp::MIN, |seal| closing.closure.floor(seal.observed.min(seal.answered)))
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

fn configuration(config: &FoldConfig, closure: &Closure) -> u64 {
    let members = closure.members.iter().map(|robot| u64::from(robot.0));
    let words = [config.hash(), closure.cell_ns.cast_unsigned()].into_iter().chain(members);
    let Fingerprint(bytes) = Fingerprint::of_words(words);
    bytes[..8].iter().fold(0, |hash, byte| hash << 8 | u64::from(*byte))
}

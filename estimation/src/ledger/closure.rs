//! Closing the past: which cut the seals held allow. `docs/ledger.md` has the rules.

mod cut;
mod decision;
mod proposal;
mod standing;

use std::collections::BTreeMap;

use super::checkpoint::Checkpoint;
use super::counts::FactCounts;
use super::rules::Closure;
use super::views::{Term, Views};
use super::{EarlierEntries, Ledger, Log};
use crate::fact::{Entry, EntryId, Fingerprint, LogId, Seal, Vote, WHOLE};
use crate::fold::FoldConfig;
use crate::joint::Joint;
use crate::{BootIndex, RobotId, Timestamp};

pub use proposal::Wish;

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
    /// The changes decided after the base, by epoch.
    pub decisions: Vec<Decision>,
    /// The base rests on words of someone evicted that were not accepted.
    pub contradicted: bool,
    /// Where the logs stood at cuts that some member may not have reached yet.
    pub cuts: Vec<(Timestamp, BTreeMap<LogId, u64>)>,
}

#[derive(Clone, Debug)]
pub(super) struct Decision {
    vote: Vote,
    /// How far the promises of those who went reach.
    until: Vec<Timestamp>,
}

impl Ledger {
    /// Empty, of one robot of a team that closes its past.
    pub fn closing(config: FoldConfig, closure: Closure, owner: RobotId) -> Self {
        let base = Self::first_base(&config, &closure);
        Self::from_checkpoint(config, closure, owner, base)
    }

    /// What a ledger rests on that knows nothing.
    fn first_base(config: &FoldConfig, closure: &Closure) -> Checkpoint {
        let terms = closure.members.iter().map(|robot| Term {
            robot: *robot,
            from: Timestamp::MIN,
            boot: BootIndex(0),
            until: None,
            limits: Vec::new(),
        });
        Checkpoint {
            time: Timestamp::MIN,
            configuration: configuration(config, closure),
            joint: Joint::new(config.form),
            logs: BTreeMap::new(),
            floors: BTreeMap::new(),
            profiles: BTreeMap::new(),
            clocks: BTreeMap::new(),
            seals: BTreeMap::new(),
            views: Views { epoch: 0, terms: terms.collect(), votes: BTreeMap::new() },
            open: BTreeMap::new(),
            counts: FactCounts::default(),
        }
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
        // Who has gone may still have entries beyond, up to where his logs end.
        let forgotten =
            |log: &LogId| checkpoint.floors.get(&log.robot).is_some_and(|floor| log.boot < *floor);
        for (log, held) in checkpoint.views.terms.iter().flat_map(|term| &term.limits) {
            if !forgotten(log) && *held != WHOLE {
                ledger.logs.entry(*log).or_default().end_at(*held);
            }
        }
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
            contradicted: false,
            cuts: vec![(checkpoint.time, starts)],
            base: checkpoint,
        }));
        for entry in &open {
            ledger.admit(entry);
        }
        ledger.decide();
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

    /// Rests on a peer's snapshot from now on; what is held beyond it is kept. `false` if it is known here that
    /// the snapshot counts words of someone evicted that were not accepted: then nothing changes.
    pub fn take_over(&mut self, checkpoint: Checkpoint) -> bool {
        let Some(closing) = &self.closing else { return false };
        let (closure, owner) = (closing.closure.clone(), closing.owner);
        let mut fresh = Self::from_checkpoint(self.config, closure, owner, checkpoint);
        let bases: Vec<(LogId, u64)> = fresh.logs.iter().map(|(id, log)| (*id, log.base)).collect();
        for (id, base) in bases {
            let held = self.logs.get(&id).into_iter();
            held.flat_map(|log| log.earlier(id, base)).for_each(|earlier| fresh.keep_earlier(earlier));
        }
        for entry in self.by_stay().into_iter().flat_map(|(_, log)| log.all()) {
            fresh.insert(entry.clone());
        }
        if fresh.is_contradicted() {
            return false;
        }
        fresh.quarantined = std::mem::take(&mut self.quarantined);
        #[cfg(feature = "planted")]
        {
            fresh.planted = self.planted;
        }
        *self = fresh;
        true
    }

    /// Whether the snapshot it rests on counts words that are not accepted: of someone evicted, or of someone whose log
    /// ends earlier, since he has lost them with his disk. Only who is out, or has lost his own disk, comes to that:
    /// all others have said what they rely on before either is decided.
    pub fn is_contradicted(&self) -> bool {
        let beyond = |log: &Log| log.limit.is_some_and(|limit| limit < log.base);
        self.closing.as_ref().is_some_and(|closing| closing.contradicted) || self.logs.values().any(beyond)
    }

    /// Rests on nothing; what is held is kept.
    pub fn drop_base(&mut self) {
        if let Some(closing) = &self.closing {
            let base = Self::first_base(&self.config, &closing.closure);
            self.take_over(base);
        }
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

    /// The logs of a robot that have not ended, or that it has lost before their end, and their lengths.
    pub fn open_logs(&self, robot: RobotId) -> impl Iterator<Item = (LogId, u64)> + '_ {
        let open = |log: &Log| log.limit.is_none_or(|limit| log.held() < limit);
        let logs = self.logs.iter().filter(move |(id, log)| id.robot == robot && open(log));
        logs.map(|(id, log)| (*id, log.held()))
    }

    /// Whether a change is decided that cannot take effect here, because entries that it accepts are missing.
    pub fn lacks_accepted(&self) -> bool {
        let decided = self.closing.as_ref().and_then(|closing| closing.views.decided());
        decided
            .is_some_and(|vote| vote.held.iter().any(|(log, held)| !self.holds_accepted(vote, *log, *held)))
    }

    /// Whether all that is accepted of a log is held; its author may have said that it ends earlier.
    fn holds_accepted(&self, vote: &Vote, log: LogId, held: u64) -> bool {
        if held == WHOLE {
            let stay = self.views().into_iter().flat_map(Views::active).find(|term| term.robot == log.robot);
            let known = self.logs.keys().filter(|id| id.robot == log.robot && id.boot <= log.boot).copied();
            let of_stay = stay.map_or(log.boot.0, |term| term.boot.0)..=log.boot.0;
            let of_stay = of_stay.map(|boot| LogId { robot: log.robot, boot: BootIndex(boot) });
            return known.chain(of_stay).all(|id| self.is_complete(id));
        }
        let ends = self.closing.as_ref().map_or(held, |closing| closing.accepted_of(vote, log, held));
        self.holds(log, ends)
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
        // What is closed is held, and a change may have waited for it.
        self.take_effect();
        Some(fingerprint)
    }

    /// Rough size of what is kept in memory: entries, facts, and answers.
    pub fn kept(&self) -> usize {
        let entries: usize = self.logs.values().map(|log| log.entries().len() + log.waiting()).sum();
        let naming = self.naming.owed.len() + self.naming.others.len();
        entries + self.facts.len() + self.answers.len() + self.pending.len() + naming
    }

    /// Everything kept beyond the last cut, to be written to a new journal after the snapshot.
    pub fn entries_after_cut(&self) -> impl Iterator<Item = &Entry> {
        let after = |log: &Log, entry: &Entry| entry.id.sequence.0 >= log.base;
        self.by_stay().into_iter().flat_map(move |(_, log)| log.all().filter(move |entry| after(log, entry)))
    }

    /// What the last cut has accounted for and some member may still ask for, of each log the latest piece first.
    pub fn earlier_entries(&self) -> impl Iterator<Item = EarlierEntries> + '_ {
        self.logs.iter().flat_map(|(id, log)| log.earlier(*id, log.base))
    }

    /// Keeps for peers what the snapshot it rests on accounts for. Entries that are not those are ignored.
    pub fn keep_earlier(&mut self, earlier: EarlierEntries) {
        if let Some(log) = self.logs.get_mut(&earlier.log) {
            log.keep_earlier(earlier);
        }
    }

    /// The logs in an order in which they can be taken: those of who came later after the votes that admitted
    /// him. Two may come from the same time on, so that only the order of the changes tells.
    pub(super) fn by_stay(&self) -> Vec<(LogId, &Log)> {
        let decisions: &[Decision] = self.closing.as_ref().map_or(&[], |closing| &closing.decisions);
        let admits = |decision: &Decision, id: &LogId| {
            decision.vote.added.iter().any(|(robot, boot)| *robot == id.robot && *boot <= id.boot)
        };
        let admitted = |id: &LogId| decisions.iter().rposition(|decision| admits(decision, id));
        let mut logs: Vec<(LogId, &Log)> = self.logs.iter().map(|(id, log)| (*id, log)).collect();
        logs.sort_by_key(|(id, _)| (admitted(id), *id));
        logs
    }
}

fn configuration(config: &FoldConfig, closure: &Closure) -> u64 {
    let members = closure.members.iter().map(|robot| u64::from(robot.0));
    let words = [config.hash(), closure.cell_ns.cast_unsigned()].into_iter().chain(members);
    let Fingerprint(bytes) = Fingerprint::of_words(words);
    bytes[..8].iter().fold(0, |hash, byte| hash << 8 | u64::from(*byte))
}

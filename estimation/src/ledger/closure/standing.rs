//! Which seals count here, and what they allow.

use std::collections::BTreeSet;

use super::Closing;
use crate::fact::{EntryId, LogId, Seal, Vote, WHOLE, length_of};
use crate::ledger::Ledger;
use crate::ledger::rules::{self, Standing};
use crate::ledger::views::Term;
use crate::{BootIndex, RobotId, Timestamp};

impl Ledger {
    /// How far a log is held; what is over and forgotten is held to any length.
    pub(super) fn holds(&self, log: LogId, length: u64) -> bool {
        self.is_forgotten(log) || self.logs.get(&log).is_some_and(|held| held.held() >= length) || length == 0
    }

    /// Whether a seal counts: everything it speaks of is held, and nothing speaks against its author.
    fn counts_here(&self, closing: &Closing, id: EntryId, seal: &Seal) -> bool {
        let of = |boot| LogId { robot: id.robot, boot };
        let mut needed = seal
            .logs
            .iter()
            .map(|log| (of(log.boot), rules::needed(log.length, self.end_of(closing, of(log.boot)))));
        // Whoever has given a robot up relies on nothing of its that it has not said it held then.
        let given_up = closing.views.promises(closing.owner).filter(|vote| vote.removed.contains(&id.robot));
        let reported = |log: LogId, length: u64| {
            let within = |vote: &Vote| length_of(&vote.held, log).is_some_and(|held| length <= held);
            length == 0 || self.is_forgotten(log) || given_up.clone().all(within)
        };
        reported(id.log(), id.sequence.0 + 1)
            && needed.all(|(log, length)| self.holds(log, length) && reported(log, length))
    }

    /// Whether all is held that a robot said before its last seal, so that its votes are known.
    pub(super) fn holds_past(&self, closing: &Closing, robot: RobotId) -> bool {
        let named = closing.seals.get(&robot).into_iter().flatten().flat_map(|(_, seal)| &seal.logs);
        // Where it says that a log ends, nobody holds more, whether its word ends the log here or not.
        let ends = |boot| named.clone().filter(move |log| log.last && log.boot == boot).map(|log| log.length);
        named.clone().all(|log| {
            let id = LogId { robot, boot: log.boot };
            let said = ends(log.boot).chain(self.end_of(closing, id)).min();
            self.holds(id, rules::needed(log.length, said))
        })
    }

    /// Where a log ends, if it does: where its author has said so, and of who has gone, where what is accepted
    /// of it ends. Nothing is accepted of a log that nobody who stayed has heard of.
    pub(super) fn end_of(&self, closing: &Closing, log: LogId) -> Option<u64> {
        let said = self.logs.get(&log).and_then(|log| log.limit);
        let stays =
            closing.views.terms.iter().filter(|term| term.robot == log.robot && term.boot <= log.boot);
        let gone = stays.max_by_key(|term| (term.boot, term.from)).filter(|term| term.until.is_some());
        match gone.map(|term| length_of(&term.limits, log).unwrap_or(0)) {
            Some(accepted) if accepted != WHOLE => Some(rules::needed(accepted, said)),
            _ => said,
        }
    }

    /// A robot's seals after the base that promise something. One that rests on entries lost before anyone
    /// held them all does not, since its answers may be among them; nor do later ones, which rest on what it
    /// has said, until its author says again how much there is.
    pub(super) fn whole_seals<'a>(
        &'a self,
        closing: &'a Closing,
        robot: RobotId,
    ) -> impl Iterator<Item = (&'a EntryId, &'a Seal)> {
        whole(closing.seals.get(&robot).into_iter().flatten(), move |log| {
            if self.is_forgotten(log) { None } else { self.end_of(closing, log) }
        })
    }

    fn standing(&self, closing: &Closing, term: &Term) -> Standing {
        let mut standing = Standing { observed: Timestamp::MIN, answered: Timestamp::MIN, from: term.from };
        let base = closing.base.seals.get(&term.robot).map(|(id, seal)| (id, seal));
        let later = self.whole_seals(closing, term.robot);
        // A log is said to have ended once, so that a later seal rests on what earlier ones speak of.
        let of_term = base.into_iter().chain(later).filter(|(id, _)| id.boot >= term.boot);
        // Nor does it rest on an earlier life before the present one has said how much of that there is.
        let logs = self.logs.iter().filter(|(id, log)| id.robot == term.robot && log.held() > 0);
        let life = logs.map(|(id, _)| id.boot).max().unwrap_or_default();
        let sealed = closing.seals.get(&term.robot).and_then(|seals| seals.keys().next_back());
        let covered = |id: &EntryId| {
            id.boot >= life || sealed.is_some_and(|last| last.boot >= life) || self.is_over(*id)
        };
        let counting = of_term.take_while(|(id, seal)| covered(id) && self.counts_here(closing, **id, seal));
        if let Some((_, seal)) = counting.last() {
            standing.observed = seal.observed;
            standing.answered = seal.answered;
        }
        standing
    }

    /// Up to when the owner has said that it has answered everything that names it, all its answers being
    /// held here. What it has promised on answers that were lost with its disk, it promises no more.
    pub fn answered(&self) -> Timestamp {
        let Some(closing) = &self.closing else { return Timestamp::MIN };
        let base = closing.base.seals.get(&closing.owner).map(|(id, seal)| (id, seal));
        let later = self.whole_seals(closing, closing.owner);
        let held =
            base.into_iter().chain(later).take_while(|(id, seal)| self.counts_here(closing, **id, seal));
        held.last().map_or(Timestamp::MIN, |(_, seal)| seal.answered)
    }

    /// Up to when the owner may say that it has answered everything that names it.
    pub fn answerable(&self) -> Timestamp {
        let Some(closing) = &self.closing else { return Timestamp::MIN };
        #[cfg(feature = "planted")]
        if self.planted == Some(crate::ledger::Planted::AnswerBlindly) {
            return Timestamp::MAX;
        }
        let members: Vec<Standing> =
            closing.views.active().map(|term| self.standing(closing, term)).collect();
        // Looking through what is owed is worth it only if something would follow.
        let sealed = closing.closure.floor(rules::answerable(members.iter().copied(), None));
        let answered = self.answered();
        if sealed <= answered {
            return answered;
        }
        let owed = self.unanswered(closing.owner).map(|(_, time)| time).min();
        closing.closure.floor(rules::answerable(members, owed))
    }

    /// Whether no member has promised less than this robot not to observe any more: then nothing is answered for
    /// good, and so nothing closed, before it does.
    pub fn is_awaited(&self, robot: RobotId) -> bool {
        let standings = self.standings();
        let observed = |standing: &Standing| standing.observed.max(standing.from);
        let own = standings.iter().find(|(of, _)| *of == robot).map(|(_, standing)| observed(standing));
        own.is_none_or(|own| standings.iter().all(|(_, standing)| own <= observed(standing)))
    }

    /// The member whose promises reach least far; `None` where nothing is ever closed.
    pub fn awaited(&self) -> Option<RobotId> {
        let reach = |standing: &Standing| (rules::final_until([*standing]), standing.observed);
        self.standings().into_iter().min_by_key(|(_, standing)| reach(standing)).map(|(robot, _)| robot)
    }

    fn standings(&self) -> Vec<(RobotId, Standing)> {
        let Some(closing) = &self.closing else { return Vec::new() };
        closing.views.active().map(|term| (term.robot, self.standing(closing, term))).collect()
    }

    /// The latest cut that the seals held allow, if it is later than the last one.
    pub fn closable(&self) -> Option<Timestamp> {
        let closing = self.closing.as_ref()?;
        let members = closing.views.active().map(|term| self.standing(closing, term));
        let until = rules::final_until(members);
        #[cfg(feature = "planted")]
        let until = if self.planted == Some(crate::ledger::Planted::CloseByNumbers) {
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
                crate::fact::Body::Observation(observation) => Some(observation.time),
                crate::fact::Body::Boot(boot) => Some(boot.time),
                crate::fact::Body::Seal(seal) => Some(seal.observed),
                _ => None,
            });
            times.max().unwrap_or(closing.base.time)
        };
        closing.views.active().map(|term| last(term.robot)).min().unwrap_or(Timestamp::MIN)
    }
}

/// Of the seals of one robot, in their order, those that rest on nothing lost; `ends` says where its logs end.
pub(super) fn whole<'a>(
    seals: impl Iterator<Item = (&'a EntryId, &'a Seal)>,
    ends: impl Fn(LogId) -> Option<u64>,
) -> impl Iterator<Item = (&'a EntryId, &'a Seal)> {
    let mut lost: BTreeSet<BootIndex> = BTreeSet::new();
    seals.filter(move |(id, seal)| {
        for log in &seal.logs {
            let of = LogId { robot: id.robot, boot: log.boot };
            if rules::needed(log.length, ends(of)) < log.length {
                lost.insert(log.boot);
            } else {
                lost.remove(&log.boot);
            }
        }
        lost.is_empty()
    })
}

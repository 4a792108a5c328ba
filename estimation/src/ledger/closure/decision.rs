//! What seals and votes change when they are heard.

use super::standing::whole;
use super::{Closing, Decision};
use crate::RobotId;
use crate::Timestamp;
use crate::fact::{EntryId, LogId, Seal, Vote, WHOLE, length_of};
use crate::ledger::Ledger;

impl Ledger {
    pub(in crate::ledger) fn hear_seal(&mut self, id: EntryId, seal: &Seal) {
        let Some(closing) = &mut self.closing else { return };
        closing.seals.entry(id.robot).or_default().insert(id, seal.clone());
        self.end_logs(id, seal);
        self.release();
    }

    /// How far an evicted robot's promises of its present stay reach within what is accepted of its logs.
    fn sealed_within(&self, closing: &Closing, robot: RobotId, vote: &Vote) -> Timestamp {
        let Some(term) = closing.views.active().find(|term| term.robot == robot) else {
            return Timestamp::MIN;
        };
        // Nothing is accepted of a log that nobody who stays has heard of.
        let ends = |log: LogId| match length_of(&vote.held, log).unwrap_or(0) {
            WHOLE => self.logs.get(&log).and_then(|log| log.limit),
            held => Some(held),
        };
        let seals = closing.seals.get(&robot).into_iter().flatten().filter(|(id, _)| accepts(vote, **id));
        let later: Vec<(&EntryId, &Seal)> = whole(seals, ends).collect();
        let seals = closing.base.seals.get(&robot).map(|(id, seal)| (id, seal)).into_iter().chain(later);
        let seal = seals.rev().find(|(id, _)| id.boot >= term.boot);
        let until =
            seal.map_or(Timestamp::MIN, |(_, seal)| closing.closure.floor(seal.observed.min(seal.answered)));
        until.max(term.from)
    }

    /// Ends the logs that a seal says have ended; not on the word of one who is given up, nor on one that is not
    /// accepted of who goes.
    fn end_logs(&mut self, id: EntryId, seal: &Seal) {
        let Some(closing) = &self.closing else { return };
        if closing.views.decided().is_some_and(|vote| vote.removed.contains(&id.robot) && !accepts(vote, id))
        {
            return;
        }
        let given_up = closing.views.promises(closing.owner).filter(|vote| vote.removed.contains(&id.robot));
        if !given_up.into_iter().all(|vote| accepts(vote, id)) {
            return;
        }
        for log in seal.logs.iter().filter(|log| log.last) {
            let id = LogId { robot: id.robot, boot: log.boot };
            if !self.is_forgotten(id) {
                self.truncated |= self.logs.entry(id).or_default().end_at(log.length);
            }
        }
    }

    pub(in crate::ledger) fn hear_vote(&mut self, id: EntryId, vote: &Vote) {
        if let Some(closing) = &mut self.closing {
            closing.views.hear(id, vote);
        }
    }

    /// Ends that were not accepted end the logs of who goes no longer. What somebody has forgotten, being whole, has
    /// ended where its author said.
    fn reopen_accepted(&mut self, vote: &Vote) {
        let Some(closing) = &self.closing else { return };
        let stated = vote.held.iter().filter(|(_, held)| *held != WHOLE);
        let ends: Vec<(LogId, u64)> =
            stated.map(|(log, held)| (*log, closing.accepted_of(vote, *log, *held))).collect();
        for (id, ends) in ends {
            if let Some(log) =
                self.logs.get_mut(&id).filter(|log| log.limit.is_some_and(|limit| limit < ends))
            {
                log.limit = Some(ends);
            }
        }
    }

    /// Puts membership changes into effect that everyone who stays has voted for.
    pub(in crate::ledger) fn decide(&mut self) {
        loop {
            let Some(closing) = &self.closing else { return };
            let Some(vote) = closing.views.decided().cloned() else { return };
            self.reopen_accepted(&vote);
            if !vote.held.iter().all(|(log, held)| self.holds_accepted(&vote, *log, *held)) {
                return;
            }
            let Some(closing) = &self.closing else { return };
            let reach = |robot: &RobotId| self.sealed_within(closing, *robot, &vote);
            let until: Vec<Timestamp> = vote.removed.iter().map(reach).collect();
            let gone: Vec<LogId> =
                self.logs.keys().copied().filter(|log| vote.removed.contains(&log.robot)).collect();
            if let Some(closing) = &mut self.closing {
                closing.views.apply(&vote, &until);
                closing.decisions.push(Decision { vote: vote.clone(), until });
            }
            // Whoever was given up and stays after all is listened to again; of who goes, what is accepted.
            let counts = |id: &EntryId| !vote.removed.contains(&id.robot) || accepts(&vote, *id);
            let seals = self.closing.iter().flat_map(|closing| closing.seals.values()).flatten();
            let kept = seals.filter(|(id, _)| counts(id)).map(|(id, seal)| (*id, seal.clone()));
            for (id, seal) in kept.collect::<Vec<_>>() {
                self.end_logs(id, &seal);
            }
            for id in gone {
                let limit = length_of(&vote.held, id).unwrap_or(0);
                if let Some(log) = self.logs.get_mut(&id).filter(|_| limit != WHOLE) {
                    if let Some(closing) = self.closing.as_mut().filter(|_| log.base > limit) {
                        closing.contradicted = true;
                    }
                    self.truncated |= log.end_at(limit);
                    // What nobody vouches for was never there.
                    if limit == 0 && log.held() == 0 {
                        self.logs.remove(&id);
                    }
                }
            }
        }
    }
}

impl Closing {
    /// How much is accepted of a log of one who goes: what the change says, less where his accepted seals end it
    /// earlier, whatever those said that are not accepted.
    pub(super) fn accepted_of(&self, vote: &Vote, log: LogId, held: u64) -> u64 {
        let seals = self.seals.get(&log.robot).into_iter().flatten();
        let accepted = seals.filter(|(seal, _)| accepts(vote, **seal)).flat_map(|(_, seal)| &seal.logs);
        let said = accepted.filter(|named| named.last && named.boot == log.boot).map(|named| named.length);
        let earlier = self.base.logs.get(&log).and_then(|log| log.limit);
        said.chain(earlier).fold(held, u64::min)
    }
}

/// Whether an entry is within what a vote says is held of its log.
fn accepts(vote: &Vote, id: EntryId) -> bool {
    length_of(&vote.held, id.log()).is_some_and(|held| id.sequence.0 < held)
}

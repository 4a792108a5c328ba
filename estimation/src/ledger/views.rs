//! Who belongs to the team, and when: changes are decided by those who stay, all of them.

use std::collections::BTreeMap;

use super::rules::may_decide;
use crate::fact::{EntryId, LogId, Vote};
use crate::{BootIndex, RobotId, Sequence, Timestamp};

/// One stay of a robot in the team.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Who.
    pub robot: RobotId,
    /// It takes part in what is after this.
    pub from: Timestamp,
    /// Its first boot in this stay.
    pub boot: BootIndex,
    /// Once evicted: its promises reach to here, and cuts after this do without it.
    pub until: Option<Timestamp>,
    /// Once evicted: how much of its logs is accepted.
    pub limits: Vec<(LogId, u64)>,
}

/// The membership, and the votes on its next change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Views {
    /// Number of changes so far.
    pub epoch: u32,
    /// The stays that a cut can still depend on, by robot and time.
    pub terms: Vec<Term>,
    /// The votes in each epoch from the current one on.
    pub votes: BTreeMap<(u32, EntryId), Vote>,
}

impl Views {
    /// The robots that belong to the team now.
    pub fn active(&self) -> impl Iterator<Item = &Term> {
        self.terms.iter().filter(|term| term.until.is_none())
    }

    /// Whether a robot belongs to the team now.
    pub fn is_active(&self, robot: RobotId) -> bool {
        self.active().any(|term| term.robot == robot)
    }

    /// A robot's last vote in this epoch.
    pub fn vote(&self, robot: RobotId) -> Option<&Vote> {
        self.votes_of(robot).last().map(|(_, vote)| vote)
    }

    /// A robot's votes in this epoch, in the order in which it gave them.
    fn votes_of(&self, robot: RobotId) -> impl DoubleEndedIterator<Item = (EntryId, &Vote)> {
        let first = EntryId { robot, boot: BootIndex(0), sequence: Sequence(0) };
        let last = EntryId { robot, boot: BootIndex(u32::MAX), sequence: Sequence(u64::MAX) };
        self.votes.range((self.epoch, first)..=(self.epoch, last)).map(|((_, id), vote)| (*id, vote))
    }

    pub(super) fn hear(&mut self, id: EntryId, vote: &Vote) {
        if vote.epoch >= self.epoch {
            self.votes.insert((vote.epoch, id), vote.clone());
        }
    }

    /// The change that everyone who would stay has voted for alike, and the entries they did it in. Whoever
    /// has given more robots up since does not count; whoever has only raised a number does, and the first
    /// such vote is the one.
    pub fn decided(&self) -> Option<(&Vote, Vec<EntryId>)> {
        let members = self.active().count();
        let voters = self.active().map(|term| term.robot);
        for (_, vote) in voters.flat_map(|robot| self.votes_of(robot)) {
            let staying: Vec<RobotId> =
                self.active().map(|term| term.robot).filter(|robot| !vote.removed.contains(robot)).collect();
            if !may_decide(members, staying.len(), vote.operator) {
                continue;
            }
            let given = |robot: &RobotId| {
                self.vote(*robot).filter(|last| last.removed == vote.removed)?;
                self.votes_of(*robot).find(|(_, given)| *given == vote).map(|(id, _)| id)
            };
            if let Some(entries) = staying.iter().map(given).collect() {
                return Some((vote, entries));
            }
        }
        None
    }

    /// Puts a decided change into effect; `sealed` is how far an evicted robot's promises reach within what
    /// is accepted of its logs.
    pub(super) fn apply(&mut self, vote: &Vote, sealed: impl Fn(RobotId) -> Timestamp) {
        for term in &mut self.terms {
            if term.until.is_none() && vote.removed.contains(&term.robot) {
                term.until = Some(sealed(term.robot).max(term.from));
                term.limits = vote.held.iter().copied().filter(|(log, _)| log.robot == term.robot).collect();
            }
        }
        for (robot, boot) in &vote.added {
            let (robot, boot) = (*robot, *boot);
            if !self.is_active(robot) {
                self.terms.push(Term { robot, from: vote.from, boot, until: None, limits: Vec::new() });
            }
        }
        self.terms.sort_by_key(|term| (term.robot, term.from));
        self.epoch += 1;
        let epoch = self.epoch;
        self.votes.retain(|(of, _), _| *of >= epoch);
    }
}

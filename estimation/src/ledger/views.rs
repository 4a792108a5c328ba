//! Who belongs to the team, and when: in each epoch one change is decided, by ballots.

use std::collections::{BTreeMap, BTreeSet};

use super::rules;
use crate::fact::{Ballot, EntryId, LogId, Vote};
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

    /// A robot's votes in this epoch, in the order in which it gave them.
    pub(super) fn votes_of(
        &self,
        robot: RobotId,
    ) -> impl DoubleEndedIterator<Item = (EntryId, &Vote)> + Clone {
        let first = EntryId { robot, boot: BootIndex(0), sequence: Sequence(0) };
        let last = EntryId { robot, boot: BootIndex(u32::MAX), sequence: Sequence(u64::MAX) };
        self.votes.range((self.epoch, first)..=(self.epoch, last)).map(|((_, id), vote)| (*id, vote))
    }

    pub(super) fn hear(&mut self, id: EntryId, vote: &Vote) {
        if vote.epoch >= self.epoch {
            self.votes.insert((vote.epoch, id), vote.clone());
        }
    }

    /// What a robot has promised in this epoch, the last ballot last.
    pub fn promises(&self, robot: RobotId) -> impl DoubleEndedIterator<Item = &Vote> + Clone {
        self.votes_of(robot).map(|(_, vote)| vote).filter(|vote| !vote.accepted)
    }

    /// The latest ballot a robot takes part in.
    pub fn ballot(&self, robot: RobotId) -> Option<Ballot> {
        self.votes_of(robot).map(|(_, vote)| vote.ballot).max()
    }

    /// Beyond this a robot seals nothing before the epoch is decided.
    pub fn held_back(&self, robot: RobotId) -> Option<Timestamp> {
        self.promises(robot).map(|vote| vote.from).min()
    }

    /// Robots that a robot has given up in this epoch.
    pub fn given_up(&self, robot: RobotId) -> BTreeSet<RobotId> {
        self.promises(robot).flat_map(|vote| vote.removed.iter().copied()).collect()
    }

    /// Members that a vote lets stay.
    pub(super) fn staying(&self, vote: &Vote) -> impl Iterator<Item = RobotId> {
        self.active().map(|term| term.robot).filter(|robot| !vote.removed.contains(robot))
    }

    /// The change of this epoch, once enough of those who stay have accepted it in one ballot. There is never
    /// another one, see `docs/ledger.md`.
    pub fn decided(&self) -> Option<&Vote> {
        let members = self.active().count();
        let voters = self.active().map(|term| term.robot);
        let mut accepted = voters.flat_map(|robot| self.votes_of(robot)).map(|(_, vote)| vote);
        accepted.find(|vote| {
            let gives = |robot: &RobotId| self.votes_of(*robot).any(|(_, given)| given == *vote);
            let accepting = self.staying(vote).filter(gives).count();
            vote.accepted && rules::is_decided(members, self.staying(vote).count(), accepting, vote.operator)
        })
    }

    /// Puts a decided change into effect; `until` is how far the promises of those who go reach within what
    /// is accepted of their logs.
    pub(super) fn apply(&mut self, vote: &Vote, until: &[Timestamp]) {
        for term in &mut self.terms {
            let goes = vote.removed.iter().zip(until).find(|(robot, _)| **robot == term.robot);
            if let (None, Some((_, until))) = (term.until, goes) {
                term.until = Some(*until);
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

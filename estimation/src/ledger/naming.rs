//! Where names may be wrong: every robot answers every sighting of a robot, for it may have been the one that was seen.

use std::collections::BTreeMap;

use super::Ledger;
use crate::fact::{Answer, EntryId, NominalState, Observation, Quantity};
use crate::fold::FactKey;
use crate::{BootIndex, RobotId, Timestamp};

/// States of other robots than the one that was named, by sighting.
pub(super) type Others = BTreeMap<(EntryId, RobotId), (BootIndex, NominalState)>;

#[derive(Clone, Debug, Default)]
pub(super) struct Naming {
    /// For whom this ledger is kept.
    owner: Option<RobotId>,
    /// What it has not answered yet.
    pub owed: BTreeMap<EntryId, Timestamp>,
    pub others: Others,
}

impl Ledger {
    /// Kept for a robot, which can ask what it has not answered. One that closes its past is, already.
    #[must_use]
    pub fn kept_for(mut self, owner: RobotId) -> Self {
        self.naming.owner = Some(owner);
        self
    }

    /// Where a robot was that a sighting does not name, and on which boot, if names may be wrong and it has answered.
    pub fn other_half(&self, id: EntryId, robot: RobotId) -> Option<(BootIndex, NominalState)> {
        self.naming.others.get(&(id, robot)).copied()
    }

    pub(super) fn names_may_be_wrong(&self) -> bool {
        self.config.misnamed > 0.0
    }

    /// For whom it is kept, if anyone asked.
    pub(super) fn owner(&self) -> Option<RobotId> {
        self.closing.as_ref().map(|closing| closing.owner).or(self.naming.owner)
    }

    /// A sighting of a robot has come: the owner owes an answer, and others may have answered before.
    pub(super) fn ask(&mut self, id: EntryId, observation: &Observation) {
        if !self.names_may_be_wrong() {
            return;
        }
        if let Some(owner) = self.owner()
            && owner != id.robot
            && !self.answers.contains_key(&(id, owner))
        {
            self.naming.owed.insert(id, observation.time);
        }
        let answered: Vec<RobotId> = self
            .answers
            .range((id, RobotId(0))..=(id, RobotId(u32::MAX)))
            .map(|((_, robot), _)| *robot)
            .collect();
        for robot in answered {
            self.consider(id, observation, robot);
        }
    }

    /// A robot that is not the one named has said where it was.
    pub(super) fn consider(&mut self, id: EntryId, observation: &Observation, robot: RobotId) {
        if self.owner() == Some(robot) {
            self.naming.owed.remove(&id);
        }
        let may_be = matches!(observation.quantity, Quantity::Robot { robot: named, .. } if named != robot);
        let Some((by, answer)) = self.answers.get(&(id, robot)).copied() else { return };
        if !may_be || robot == id.robot || !self.names_may_be_wrong() {
            return;
        }
        if !self.takes_part(robot, by.boot, observation.time) {
            return;
        }
        match answer {
            Answer::State { boot, state } => self.naming.others.insert((id, robot), (boot, state)),
            Answer::Void(_) => self.naming.others.remove(&(id, robot)),
        };
        let key = FactKey::observation(observation.time, id);
        if self.facts.contains_key(&key) {
            self.touch(key);
        }
    }

    /// Sightings that a robot for which this ledger is kept has not answered, if it has to answer all.
    pub(super) fn owed(&self, robot: RobotId) -> Option<&BTreeMap<EntryId, Timestamp>> {
        (self.names_may_be_wrong() && self.owner() == Some(robot)).then_some(&self.naming.owed)
    }

    /// Forgets what is closed.
    pub(super) fn forget_answered(&mut self, cut: Timestamp) {
        self.naming.owed.retain(|_, time| *time > cut);
        let others = std::mem::take(&mut self.naming.others);
        self.naming.others = others.into_iter().filter(|((id, _), _)| !self.is_over(*id)).collect();
    }
}

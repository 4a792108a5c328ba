//! What is accepted, and a ledger filed anew when that has changed.

use super::{Ledger, Refusal};
use crate::fact::{Body, Entry, EntryId, length_of};
use crate::{BootIndex, RobotId, Timestamp};

impl Ledger {
    /// Whether an entry lies where nothing is accepted: a log that has ended, or a robot that is not of the
    /// team.
    pub fn outside(&self, id: EntryId) -> Option<Refusal> {
        let closing = self.closing.as_ref()?;
        if closing.base.floors.get(&id.robot).is_some_and(|floor| id.boot < *floor) {
            return Some(Refusal::Expired);
        }
        let log = self.logs.get(&id.log());
        if log.and_then(|log| log.limit).is_some_and(|limit| id.sequence.0 >= limit) {
            return Some(Refusal::Expired);
        }
        // A log may be known by name alone, because a seal speaks of it.
        let stays = closing.views.terms.iter().filter(|term| term.robot == id.robot && term.boot <= id.boot);
        let accepted = match stays.max_by_key(|term| term.boot) {
            Some(term) if term.until.is_some() => length_of(&term.limits, id.log()).is_some(),
            Some(_) => true,
            None => log.is_some_and(|log| log.held() > 0),
        };
        (!accepted).then_some(Refusal::NotAMember)
    }

    /// Whether what a robot says of itself at `time`, in one of its boots, is taken: within the stay in the
    /// team to which the boot belongs.
    pub(super) fn takes_part(&self, robot: RobotId, boot: BootIndex, time: Timestamp) -> bool {
        let Some(closing) = &self.closing else { return true };
        let stays = closing.views.terms.iter().filter(|term| term.robot == robot && term.boot <= boot);
        stays.max_by_key(|term| term.boot).is_none_or(|term| time > term.from)
    }

    /// A fork: rebuilt from the entries that stay, which is rare enough to be done the plain way.
    pub(super) fn equivocation(&mut self, other: &Entry, replaces: bool) {
        let robot = other.id.robot;
        if replaces {
            self.rebuild(Some(other));
        }
        self.quarantined.insert(robot);
    }

    /// Everything that is accepted is filed again, with `other` in the place of the entry of its identity.
    pub(super) fn rebuild(&mut self, other: Option<&Entry>) {
        let mut rebuilt = match &self.closing {
            None => {
                let rebuilt = Self::new(self.config);
                match self.owner() {
                    Some(owner) => rebuilt.kept_for(owner),
                    None => rebuilt,
                }
            }
            Some(closing) => {
                let (closure, base) = (closing.closure.clone(), closing.base.clone());
                let mut rebuilt = Self::from_checkpoint(self.config, closure, closing.owner, base);
                if let (Some(fresh), Some(closing)) = (&mut rebuilt.closing, &self.closing) {
                    fresh.cuts.clone_from(&closing.cuts);
                }
                rebuilt
            }
        };
        // Nobody is quarantined while what is held already is filed again. What a cut has accounted for is
        // kept for peers that have not come as far.
        for (id, log) in self.logs.iter().filter(|(_, log)| log.limit != Some(0)) {
            rebuilt.logs.insert(*id, log.before_base());
        }
        for (_, log) in self.by_stay() {
            let limit = log.limit.unwrap_or(u64::MAX);
            for entry in log.all().filter(|entry| (log.base..limit).contains(&entry.id.sequence.0)) {
                let entry = other.filter(|other| other.id == entry.id).unwrap_or(entry);
                rebuilt.insert(entry.clone());
            }
            let lost = log.all().filter(|entry| entry.id.sequence.0 >= limit);
            let lost = lost.filter(|entry| matches!(entry.body, Body::Observation(_)));
            rebuilt.expired += lost.count();
        }
        rebuilt.quarantined = std::mem::take(&mut self.quarantined);
        rebuilt.expired += self.expired;
        #[cfg(feature = "planted")]
        {
            rebuilt.planted = self.planted;
        }
        *self = rebuilt;
    }
}

//! What a robot has to vote.

use std::collections::{BTreeMap, BTreeSet};

use crate::fact::{LogId, Vote};
use crate::ledger::Ledger;
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

impl Ledger {
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
}

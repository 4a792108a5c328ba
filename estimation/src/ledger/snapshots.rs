//! Copies of the joint at earlier facts, so that a late fact does not cost a fold from the beginning.

use crate::fold::FactKey;
use crate::joint::Joint;

/// Facts between two fresh snapshots.
const SPACING: u64 = 16;

/// Snapshots whose distances grow with their age: a fact late by n positions costs at most about n/2
/// folds more than those n, at a number of copies that grows with the logarithm of the history.
#[derive(Clone, Debug, Default)]
pub(super) struct Snapshots {
    folded: u64,
    kept: Vec<Snapshot>,
}

#[derive(Clone, Debug)]
struct Snapshot {
    key: FactKey,
    /// How many facts were folded into it.
    count: u64,
    joint: Joint,
}

impl Snapshots {
    /// Called after every fold; keeps a copy now and then.
    pub(super) fn offer(&mut self, key: FactKey, joint: &Joint) {
        self.folded += 1;
        if !self.folded.is_multiple_of(SPACING) {
            return;
        }
        self.kept.push(Snapshot { key, count: self.folded, joint: joint.clone() });
        self.thin();
    }

    /// Called at the end of every block, where facts are linearized together.
    pub(super) fn keep(&mut self, key: FactKey, joint: &Joint) {
        self.folded += 1;
        self.kept.push(Snapshot { key, count: self.folded, joint: joint.clone() });
        self.thin();
    }

    /// Drops a snapshot if its neighbours are closer together than half its age.
    fn thin(&mut self) {
        let now = self.folded;
        let mut index = 1;
        while index + 1 < self.kept.len() {
            let gap = self.kept[index + 1].count - self.kept[index - 1].count;
            if gap <= (now - self.kept[index].count) / 2 {
                self.kept.remove(index);
            } else {
                index += 1;
            }
        }
    }

    /// The joint before the first fact at or after `dirty`, as far as a copy reaches, else `base`; later
    /// copies are dropped.
    pub(super) fn rewind(&mut self, dirty: FactKey, base: &Joint) -> (Joint, Option<FactKey>) {
        self.kept.retain(|snapshot| snapshot.key < dirty);
        if let Some(snapshot) = self.kept.last() {
            self.folded = snapshot.count;
            (snapshot.joint.clone(), Some(snapshot.key))
        } else {
            self.folded = 0;
            (base.clone(), None)
        }
    }

    /// Copies at or before a cut are not needed: nothing goes back behind it.
    pub(super) fn forget_until(&mut self, cut: FactKey) {
        self.kept.retain(|snapshot| snapshot.key > cut);
    }
}

//! How many facts there are of which kind, and what became of them.

use super::{FactRecord, Ledger};
use crate::fact::{Absolute, Quantity};
use crate::fold::{Fact, Outcome};

/// Counts of facts by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FactCounts {
    /// Complete observations of robots by robots.
    pub relative: usize,
    /// Observations against the map: GPS, heading, landmarks, poses.
    pub absolute: usize,
    /// Updated the joint.
    pub used: usize,
    /// Refused by the gate.
    pub rejected: usize,
    /// Complete, but could not be folded.
    pub skipped: usize,
    /// Wait for their other half.
    pub pending: usize,
    /// Answered with a reason why there is no other half.
    pub void: usize,
    /// Came, or stayed without an answer, beyond a cut; lost for good.
    pub expired: usize,
}

impl FactCounts {
    /// As numbers in the order of the fields.
    pub fn numbers(&self) -> [usize; 8] {
        let Self { relative, absolute, used, rejected, skipped, pending, void, expired } = *self;
        [relative, absolute, used, rejected, skipped, pending, void, expired]
    }

    /// From numbers in the order of the fields.
    pub fn from_numbers(numbers: [usize; 8]) -> Self {
        let [relative, absolute, used, rejected, skipped, pending, void, expired] = numbers;
        Self { relative, absolute, used, rejected, skipped, pending, void, expired }
    }

    /// Counts a fact.
    pub(super) fn add(&mut self, record: &FactRecord) {
        let Fact::Observation { quantity, .. } = &record.fact else { return };
        match quantity {
            Quantity::Robot { .. } | Quantity::Feature { .. } => self.relative += 1,
            Quantity::Landmark { .. } | Quantity::Absolute(Absolute::Position(_) | Absolute::Heading(_)) => {
                self.absolute += 1;
            }
            Quantity::Absolute(Absolute::Pose(_)) => {
                // A prior is not an observation of the run.
                if record.residual.is_some_and(|residual| residual.outcome == Outcome::Placed) {
                    return;
                }
                self.absolute += 1;
            }
        }
        match record.residual.map(|residual| residual.outcome) {
            Some(Outcome::Used | Outcome::UsedAs(_) | Outcome::Joined { .. }) => self.used += 1,
            Some(Outcome::Rejected { .. }) => self.rejected += 1,
            // Of what waits between two frames some is used when they join.
            Some(Outcome::Skipped(_) | Outcome::Tied) => self.skipped += 1,
            Some(Outcome::Booted | Outcome::Placed) | None => {}
        }
    }
}

impl Ledger {
    /// Counts by what became of the facts at the last [`Ledger::settle`], those before the cut included.
    pub fn counts(&self) -> FactCounts {
        let mut counts = self.checkpoint().map_or_else(FactCounts::default, |base| base.counts);
        counts.pending = self.pending.len();
        counts.void += self.void.len();
        counts.expired += self.expired;
        self.facts.values().for_each(|record| counts.add(record));
        counts
    }
}

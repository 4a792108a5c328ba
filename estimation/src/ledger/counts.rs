//! How many facts there are of which kind, and what became of them.

use super::Ledger;
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
}

impl Ledger {
    /// Counts by what became of the facts at the last [`Ledger::settle`].
    pub fn counts(&self) -> FactCounts {
        let mut counts =
            FactCounts { pending: self.pending.len(), void: self.void.len(), ..FactCounts::default() };
        for record in self.facts.values() {
            let Fact::Observation { quantity, .. } = &record.fact else { continue };
            match quantity {
                Quantity::Robot { .. } => counts.relative += 1,
                Quantity::Landmark { .. }
                | Quantity::Absolute(Absolute::Position(_) | Absolute::Heading(_)) => {
                    counts.absolute += 1;
                }
                Quantity::Absolute(Absolute::Pose(_)) => {
                    // A prior is not an observation of the run.
                    if record.residual.is_some_and(|residual| residual.outcome == Outcome::Placed) {
                        continue;
                    }
                    counts.absolute += 1;
                }
            }
            match record.residual.map(|residual| residual.outcome) {
                Some(Outcome::Used) => counts.used += 1,
                Some(Outcome::Rejected { .. }) => counts.rejected += 1,
                Some(Outcome::Skipped(_)) => counts.skipped += 1,
                Some(Outcome::Booted | Outcome::Placed) | None => {}
            }
        }
        counts
    }
}

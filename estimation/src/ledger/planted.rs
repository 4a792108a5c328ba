//! Wrong rules, to be put into a ledger by tests that show that such a mistake is found. Only with the
//! feature `planted`, and only through [`super::Ledger::plant`].

/// A mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planted {
    /// An observation that comes again counts again.
    CountDuplicates,
    /// A late fact does not take back what was folded after it.
    SkipRewind,
    /// The noise sum of a half that comes late is left out.
    ForgetLateNoise,
    /// A half is taken to be of the robot's last boot.
    MixBoots,
    /// The past is closed by what has been acknowledged.
    CloseByNumbers,
    /// A robot says it has answered everything, without waiting for what the others have still to say.
    AnswerBlindly,
    /// Entries go out before they are in the journal. Of the node, not of the ledger.
    PublishFirst,
}

use super::Ledger;
use crate::fact::{Answer, Body, Entry, NominalState};
use crate::fold::FactKey;
use crate::symmetric::Symmetric3;
use crate::{RobotId, Timestamp};

impl Ledger {
    pub(super) fn count_again(&mut self, entry: &Entry) {
        let Body::Observation(observation) = &entry.body else { return };
        let key = FactKey::observation(observation.time, entry.id);
        if self.planted == Some(Planted::CountDuplicates)
            && let Some(record) = self.facts.get(&key).copied()
        {
            self.file(FactKey::again(observation.time, entry.id), &record.fact);
        }
    }

    pub(super) fn mistaken(&self, robot: RobotId, time: Timestamp, answer: Answer) -> Answer {
        let Answer::State { boot, state } = answer else { return answer };
        match self.planted {
            Some(Planted::ForgetLateNoise) if self.folded.is_some_and(|folded| time <= folded.time) => {
                let state = NominalState { noise_sum: Symmetric3::zero(), ..state };
                Answer::State { boot, state }
            }
            Some(Planted::MixBoots) => {
                let last = self.logs.keys().filter(|id| id.robot == robot).map(|id| id.boot).max();
                Answer::State { boot: last.unwrap_or(boot), state }
            }
            _ => answer,
        }
    }
}

//! Facts as the reference filters take them: every observation together with its half and its noise.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::fact::{
    Answer, Body, Boot, Entry, EntryId, Fingerprint, Noise, NoiseRef, NominalState, Quantity, read_extension,
};
use crate::{BootIndex, RobotId, Timestamp};

/// Something the filter folds.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceFact {
    /// The observer's (or the booting robot's) entry.
    pub id: EntryId,
    /// When it takes its place.
    pub time: Timestamp,
    /// What it says.
    pub content: FactContent,
}

/// What a fact says.
#[derive(Clone, Debug, PartialEq)]
pub enum FactContent {
    /// A robot's agent starts.
    Boot(Boot),
    /// A measurement with all that is needed to use it.
    Measurement(Measurement),
}

/// A measurement with all that is needed to use it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// What was measured.
    pub quantity: Quantity,
    /// Its covariance, as stated.
    pub noise: Noise,
    /// The observer's nominal state.
    pub observer: State,
    /// The observed robot's, for a relative measurement between robots.
    pub observed: Option<State>,
}

/// A robot's nominal state on the trajectory of one boot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Whose.
    pub robot: RobotId,
    /// On the trajectory of which boot.
    pub boot: BootIndex,
    /// The state.
    pub nominal: NominalState,
}

impl ReferenceFact {
    /// The fold order: time, boots before measurements, then robot, boot, sequence.
    pub fn order(&self) -> (Timestamp, bool, EntryId) {
        (self.time, !matches!(self.content, FactContent::Boot(_)), self.id)
    }
}

/// The covariance matrix a [`Noise`] states; `None` if its dimension is not 1, 2 or 3.
pub(super) fn noise_matrix(noise: &Noise) -> Option<DMatrix<f64>> {
    let [xx, yx, yy, zx, zy, zz] = noise.lower;
    match noise.dimension {
        1 => Some(DMatrix::from_row_slice(1, 1, &[xx])),
        2 => Some(DMatrix::from_row_slice(2, 2, &[xx, yx, yx, yy])),
        3 => Some(DMatrix::from_row_slice(3, 3, &[xx, yx, zx, yx, yy, zy, zx, zy, zz])),
        _ => None,
    }
}

/// The facts that a set of entries holds, in fold order.
///
/// Entries may come in any order and repeatedly. Two different entries of one identity are an
/// equivocation, of which the one with the smaller fingerprint counts. Of several answers to one
/// observation the first in `(boot, sequence)` counts. Left out are observations of a robot that
/// Entries by identity; of two with one identity the one with the smaller fingerprint.
fn unique(entries: &[Entry]) -> BTreeMap<EntryId, Entry> {
    let mut unique: BTreeMap<EntryId, Entry> = BTreeMap::new();
    for entry in entries {
        let mut entry = entry.clone();
        read_extension(&mut entry);
        let kept = unique.entry(entry.id).or_insert_with(|| entry.clone());
        if *kept != entry && Fingerprint::of(&entry) < Fingerprint::of(kept) {
            *kept = entry;
        }
    }
    unique
}

/// Where each robot that answered a sighting was, whether it was named or not: the entry with the smallest identity counts.
pub fn halves_from_entries(entries: &[Entry]) -> BTreeMap<(EntryId, RobotId), (BootIndex, NominalState)> {
    let mut answers = BTreeMap::new();
    for (id, entry) in unique(entries) {
        if let Body::Half(half) = entry.body {
            answers.entry((half.observation, id.robot)).or_insert(half.answer);
        }
    }
    let state = |(of, answer)| match answer {
        Answer::State { boot, state } => Some((of, (boot, state))),
        Answer::Void(_) => None,
    };
    answers.into_iter().filter_map(state).collect()
}

/// has not answered or answered void, and observations whose noise profile is not among the entries.
pub fn facts_from_entries(entries: &[Entry]) -> Vec<ReferenceFact> {
    let unique = unique(entries);
    let mut profiles = BTreeMap::new();
    let mut answers = BTreeMap::new();
    for (id, entry) in &unique {
        match &entry.body {
            Body::Profile(profile) => {
                profiles.entry((id.log(), profile.index)).or_insert(profile.noise);
            }
            Body::Half(half) => {
                answers.entry((half.observation, id.robot)).or_insert(half.answer);
            }
            Body::Boot(_) | Body::ClockMap(_) | Body::Observation(_) | Body::Seal(_) | Body::Vote(_) => {}
        }
    }

    let mut facts = Vec::new();
    for (id, entry) in &unique {
        match &entry.body {
            Body::Boot(boot) => {
                let content = FactContent::Boot(*boot);
                facts.push(ReferenceFact { id: *id, time: boot.time, content });
            }
            Body::Observation(observation) => {
                let noise = match observation.noise {
                    NoiseRef::Explicit(noise) => noise,
                    NoiseRef::Profile(index) => match profiles.get(&(id.log(), index)) {
                        Some(noise) => *noise,
                        None => continue,
                    },
                };
                let observed = match observation.quantity {
                    Quantity::Robot { robot, .. } => match answers.get(&(*id, robot)) {
                        Some(Answer::State { boot, state }) => {
                            Some(State { robot, boot: *boot, nominal: *state })
                        }
                        Some(Answer::Void(_)) | None => continue,
                    },
                    Quantity::Landmark { .. } | Quantity::Feature { .. } | Quantity::Absolute(_) => None,
                };
                facts.push(ReferenceFact {
                    id: *id,
                    time: observation.time,
                    content: FactContent::Measurement(Measurement {
                        quantity: observation.quantity,
                        noise,
                        observer: State { robot: id.robot, boot: id.boot, nominal: observation.observer },
                        observed,
                    }),
                });
            }
            Body::Profile(_) | Body::ClockMap(_) | Body::Half(_) | Body::Seal(_) | Body::Vote(_) => {}
        }
    }
    facts.sort_by_key(ReferenceFact::order);
    facts
}

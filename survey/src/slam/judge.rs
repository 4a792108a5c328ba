//! Which sightings found their landmarks, by the names that the filter does not see.

use std::collections::BTreeMap;

use pleiad_estimation::slam::{MapEntry, MapId, Outcome, ScanOutcome, Slam};
use pleiad_estimation::{LandmarkId, Timestamp};
use pleiad_recording::RobotRecording;

use super::run::Moment;

/// Truth is interpolated across holes up to this long, seconds.
const TRUTH_GAP_S: f64 = 0.3;

/// How often sightings found their landmarks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Associated {
    /// Used for the landmark they were of.
    pub right: usize,
    /// Used for another.
    pub wrong: usize,
    /// Founded a landmark although it was in the map.
    pub again: usize,
    /// Not used because several would explain them, or none well.
    pub ambiguous: usize,
    /// Turned away by the gate of their name.
    pub rejected: usize,
    /// Bearings that wait for others to cross.
    pub waiting: usize,
}

impl Associated {
    /// Decisions: right, wrong and twice founded.
    pub fn decided(&self) -> usize {
        self.right + self.wrong + self.again
    }

    /// The sum of two.
    pub fn plus(self, other: Self) -> Self {
        Self {
            right: self.right + other.right,
            wrong: self.wrong + other.wrong,
            again: self.again + other.again,
            ambiguous: self.ambiguous + other.ambiguous,
            rejected: self.rejected + other.rejected,
            waiting: self.waiting + other.waiting,
        }
    }
}

/// What is counted along a run.
#[derive(Default)]
pub(super) struct Judge {
    pub births: BTreeMap<MapId, LandmarkId>,
    pub moments: Vec<Moment>,
    pub associated: Associated,
    pub nis: Vec<f64>,
    pub most_waiting_poses: usize,
    pub refused: usize,
    /// Of all sightings so far, where what they are taken for can still change.
    pub names: Vec<LandmarkId>,
}

impl Judge {
    /// Judges what the sightings of a scan were taken for.
    pub fn scan(&mut self, slam: &Slam, scan: &ScanOutcome) {
        for (name, outcome) in &scan.sightings {
            let known = |entry: &MapEntry| entry.confirmed && self.births.get(&entry.id) == Some(name);
            let again = match outcome {
                Outcome::Founded { landmark } => {
                    slam.map().iter().any(|entry| entry.id != *landmark && known(entry))
                }
                _ => false,
            };
            self.count(*name, outcome, again);
        }
        self.most_waiting_poses = self.most_waiting_poses.max(slam.waiting_poses());
    }

    /// Judges what all sightings are taken for at the end.
    pub fn settled(&mut self, outcomes: &[Outcome], confirm_sightings: u32) {
        let mut seen: BTreeMap<MapId, u32> = BTreeMap::new();
        for (name, outcome) in std::mem::take(&mut self.names).into_iter().zip(outcomes) {
            let known = |(id, count): (&MapId, &u32)| {
                *count >= confirm_sightings && self.births.get(id) == Some(&name)
            };
            let again = matches!(outcome, Outcome::Founded { .. }) && seen.iter().any(known);
            self.count(name, outcome, again);
            if let Outcome::Used { landmark, .. } | Outcome::Founded { landmark } = outcome {
                *seen.entry(*landmark).or_default() += 1;
            }
        }
    }

    /// Counts one sighting; `again`: it founded a landmark that was in the map.
    fn count(&mut self, name: LandmarkId, outcome: &Outcome, again: bool) {
        let count = &mut self.associated;
        match outcome {
            Outcome::Used { landmark, nis, dimension } => {
                let right = self.births.get(landmark) == Some(&name);
                *(if right { &mut count.right } else { &mut count.wrong }) += 1;
                self.nis.push(nis / *dimension as f64);
            }
            Outcome::Founded { landmark } => {
                count.again += usize::from(again);
                self.births.insert(*landmark, name);
            }
            Outcome::Rejected { nis, dimension, .. } => {
                count.rejected += 1;
                self.nis.push(nis / *dimension as f64);
            }
            Outcome::Ambiguous => count.ambiguous += 1,
            Outcome::Waiting => count.waiting += 1,
            Outcome::Unusable => {}
        }
    }

    /// Keeps the filter as it is after a scan.
    pub fn moment(&mut self, slam: &Slam, time: Timestamp, recorded: &RobotRecording) {
        let sigma = |entry: &MapEntry| {
            let p = slam.state().position_covariance(entry.block, entry.block);
            (entry.id, (0.5 * (p[(0, 0)] + p[(1, 1)])).sqrt())
        };
        self.moments.push(Moment {
            time,
            pose: slam.state().vehicle(),
            truth: recorded.truth_at(time, TRUTH_GAP_S),
            covariance: slam.state().vehicle_covariance(),
            sigma_m: slam.map().iter().map(sigma).collect(),
        });
    }
}

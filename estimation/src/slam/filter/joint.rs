//! Scans whose sightings carry no names, when one scan does not say which landmarks they are of: several maps side by
//! side, each with other answers, until later sightings tell which of them was right.

use super::{MapId, Open, Outcome, Slam, SlamSettings};
use crate::geometry::{Vector2, Vector3};
use crate::sample::{Relative, SampleRefusal};
use crate::slam::state::SlamState;
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, Timestamp};

/// `ln(2 pi)`, for each dimension of an innovation.
const LN_TWO_PI: f64 = 1.837_877_066_409_345_5;
/// Two maps are one if their vehicles are so near in metres and radians, and each landmark of the one to one of the other:
/// what they differ in then is one sighting, used or not.
const SAME_POSE: (f64, f64) = (0.05, 0.03);
const SAME_LANDMARK_M: f64 = 0.1;

/// How many answers are kept, and what else than a landmark of the map a sighting may be of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRules {
    /// At most so many maps side by side.
    pub most: usize,
    /// A map is given up when it explains what was seen worse than the best by this (minus twice the logarithm of
    /// the likelihood).
    pub within: f64,
    /// Density of a landmark that is not in the map where one is seen, per square metre.
    pub new_per_m2: f64,
    /// Density of a sighting that is of nothing, per unit of what is measured: 1/(m rad), or 1/m^2.
    pub ghost_density: f64,
}

impl Default for JointRules {
    // Chosen on MRCLAM dataset 2 (docs/survey/slam.md).
    fn default() -> Self {
        Self { most: 30, within: 25.0, new_per_m2: 1e-4, ghost_density: 1e-4 }
    }
}

/// SLAM whose decisions are taken jointly over time (multiple hypotheses, `reid1979`): each map is a [`Slam`] with its
/// own answers, so that the correlation of all sightings through the common pose is in its covariance, and its
/// score is the likelihood of everything seen so far. Nearest neighbour is this with one map.
///
/// A sighting costs `most` updates. What was decided is kept for every map, some tens of bytes each.
#[derive(Clone, Debug)]
pub struct JointSlam {
    rules: JointRules,
    // The best first; never empty.
    first: Branch,
    others: Vec<Branch>,
    decisions: Vec<Decision>,
}

/// One map.
#[derive(Clone, Debug)]
struct Branch {
    slam: Slam,
    score: f64,
    /// Landmarks of the scan that is being taken; none is seen twice in it.
    taken: Vec<MapId>,
    last: Option<usize>,
}

/// What one map took a sighting for, and the decision before it.
#[derive(Clone, Copy, Debug)]
struct Decision {
    outcome: Outcome,
    before: Option<usize>,
}

#[derive(Clone, Copy, Debug)]
enum Answer {
    Known(usize),
    New,
    Ghost,
}

/// A map that could go on with this answer.
struct Child {
    score: f64,
    parent: usize,
    answer: Answer,
}

impl JointSlam {
    /// A vehicle at `pose`, known as well as `noise` says in the body frame, and an empty map.
    pub fn new(settings: SlamSettings, rules: JointRules, pose: Pose2, noise: Symmetric3) -> Self {
        let slam = Slam::new(settings, pose, noise);
        let first = Branch { slam, score: 0.0, taken: Vec::new(), last: None };
        Self { rules, first, others: Vec::new(), decisions: Vec::new() }
    }

    /// The map that explains best what was seen.
    pub fn best(&self) -> &Slam {
        &self.first.slam
    }

    /// How many maps there are.
    pub fn maps(&self) -> usize {
        1 + self.others.len()
    }

    /// What the best map takes every sighting for, from the first on. Other than what [`JointSlam::scan`] said at the
    /// time where a later sighting has changed it.
    pub fn outcomes(&self) -> Vec<Outcome> {
        let mut outcomes = self.latest(self.decisions.len());
        outcomes.reverse();
        outcomes
    }

    /// The vehicle moves; see [`SlamState::propagate`].
    pub fn propagate(&mut self, motion: &Vector3, noise: Symmetric3) {
        for branch in self.branches_mut() {
            branch.slam.propagate(motion, noise);
        }
    }

    /// Takes what was seen at one instant, whatever names it carries; the outcomes are those of the map that is the best
    /// afterwards, in the order of the sightings. Bearings and ranges alone are not usable here.
    ///
    /// # Errors
    /// [`SampleRefusal::NoNoise`] if a sighting's kind has no noise in the settings; nothing is then changed.
    pub fn scan(
        &mut self,
        time: Timestamp,
        sightings: &[(LandmarkId, Relative)],
    ) -> Result<Vec<Outcome>, SampleRefusal> {
        let open = Open::all(&self.first.slam.settings.noises, sightings)?;
        for branch in self.branches_mut() {
            branch.taken.clear();
        }
        for sighting in &open {
            self.take(time, sighting);
        }
        for branch in self.branches_mut() {
            branch.slam.forget(time);
        }
        let mut outcomes = self.latest(open.len());
        outcomes.reverse();
        Ok(outcomes)
    }

    /// The last so many outcomes of the best map, the latest first.
    fn latest(&self, count: usize) -> Vec<Outcome> {
        let at = |index: usize| self.decisions.get(index);
        let chain = std::iter::successors(self.first.last.and_then(at), |one| one.before.and_then(at));
        chain.take(count).map(|decision| decision.outcome).collect()
    }

    fn branches_mut(&mut self) -> impl Iterator<Item = &mut Branch> {
        std::iter::once(&mut self.first).chain(&mut self.others)
    }

    fn branch(&self, index: usize) -> &Branch {
        if index == 0 { &self.first } else { &self.others[index - 1] }
    }

    fn take(&mut self, time: Timestamp, seen: &Open) {
        let mut children = self.children(seen);
        children.sort_by(|a, b| a.score.total_cmp(&b.score));
        let Some(best) = children.first().map(|child| child.score) else { return };
        let mut next: Vec<Branch> = Vec::new();
        for child in children {
            if child.score > best + self.rules.within || next.len() >= self.rules.most.max(1) {
                break;
            }
            let mut branch = self.branch(child.parent).clone();
            branch.score = child.score - best;
            let outcome = match child.answer {
                Answer::Known(known) => branch.slam.use_for(known, seen),
                Answer::New => branch.slam.found(time, None, seen),
                Answer::Ghost if places(seen).is_none() => Outcome::Unusable,
                Answer::Ghost => Outcome::Ambiguous,
            };
            if let Outcome::Used { landmark, .. } | Outcome::Founded { landmark } = outcome {
                branch.taken.push(landmark);
            }
            if next.iter().any(|other| same(other, &branch)) {
                continue;
            }
            self.decisions.push(Decision { outcome, before: branch.last });
            branch.last = Some(self.decisions.len() - 1);
            next.push(branch);
        }
        let mut next = next.into_iter();
        if let Some(first) = next.next() {
            self.first = first;
            self.others = next.collect();
        }
    }

    /// Every map with every answer to what was seen, and how well everything is then explained.
    fn children(&self, seen: &Open) -> Vec<Child> {
        let mut children = Vec::new();
        for parent in 0..self.maps() {
            let Branch { slam, score, taken, .. } = self.branch(parent);
            let mut child = |cost: f64, answer: Answer| {
                children.push(Child { score: score + cost, parent, answer });
            };
            child(-2.0 * libm::log(self.rules.ghost_density), Answer::Ghost);
            let Some(area_m2) = places(seen) else { continue };
            let mut fits = Vec::new();
            for (known, entry) in slam.map.iter().enumerate() {
                let innovation =
                    slam.state.innovation(SlamState::VEHICLE, entry.block, &seen.relative, &seen.noise);
                let Ok(innovation) = innovation else { continue };
                if innovation.nis <= slam.settings.gate[innovation.dimension - 1] {
                    let constant = innovation.dimension as f64 * LN_TWO_PI;
                    fits.push((known, innovation.nis + innovation.log_determinant + constant));
                }
            }
            // None is more likely to be seen than another. Without this share two landmarks in one place would explain
            // their sightings better than one does, by taking the nearer one each time.
            let share = 2.0 * libm::log(fits.len().max(1) as f64);
            for (known, cost) in &fits {
                if !taken.contains(&slam.map[*known].id) {
                    child(cost + share, Answer::Known(*known));
                }
            }
            child(-2.0 * libm::log(self.rules.new_per_m2 * area_m2), Answer::New);
        }
        children
    }
}

/// Square metres to a unit of what is measured, there where it was seen; `None` if it does not fix a place.
fn places(seen: &Open) -> Option<f64> {
    match seen.relative {
        Relative::RangeBearing { range_m, .. } => Some(range_m),
        Relative::Position { .. } => Some(1.0),
        Relative::Pose(_) | Relative::Range { .. } | Relative::Bearing { .. } => None,
    }
}

/// Whether two maps are the same for all that follows.
fn same(a: &Branch, b: &Branch) -> bool {
    let (a, b) = (&a.slam, &b.slam);
    let between = a.state.vehicle().between(&b.state.vehicle());
    let near = |one: Vector2, other: Vector2| (one - other).norm() < SAME_LANDMARK_M;
    a.map.len() == b.map.len()
        && between.position().norm() < SAME_POSE.0
        && between.yaw_rad().abs() < SAME_POSE.1
        && a.map.iter().all(|one| {
            let at = a.position(one);
            b.map.iter().any(|other| near(at, b.position(other)))
        })
}

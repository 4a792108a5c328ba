//! The hypotheses and what a sighting does to them.

use std::f64::consts::TAU;

use super::birth::{BOOT, ROBOT, Seen, around, seen};
use super::map::{KindOfLandmark, KindedMap, MappedLandmark};
use super::reduction;
use crate::fact::{Noise, NominalState};
use crate::geometry::Matrix3;
use crate::joint::{Block, ErrorForm, Joint, JointParts, Member, Participant, Update};
use crate::measurement::{Linearization, dimension, noise_matrix, of_point};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, Timestamp};

/// How many hypotheses there may be, and when one is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Largest normalized innovation squared with which a hypothesis still explains a sighting. Weights decide long
    /// before; it keeps what nothing explains from being used.
    pub gate: f64,
    /// Pairs of less weight, as a share of all, are dropped.
    pub least_weight: f64,
    /// Two hypotheses whose difference has a squared Mahalanobis distance below this, by the mean of their
    /// covariances, are merged.
    pub merge_below: f64,
    /// Never more than this many are kept.
    pub most: usize,
    /// Poses tried around a landmark where nothing is known.
    pub headings: usize,
    /// Rate at which robots like this one are carried off, 1/s: the share of all weight that goes back to the
    /// reserve. Zero: a robot that cannot be.
    pub carried_off_hz: f64,
    /// A hypothesis with this weight is believed.
    pub believed: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            gate: 40.0,
            least_weight: 1e-5,
            merge_below: 0.5,
            most: 512,
            headings: 32,
            carried_off_hz: 1e-3,
            believed: 0.99,
        }
    }
}

/// One sighting of some landmark.
#[derive(Clone, Copy, Debug)]
pub struct Sighting<'a> {
    /// When.
    pub time: Timestamp,
    /// The robot's nominal state then.
    pub observer: NominalState,
    /// Where it was seen: a position, or range and bearing.
    pub relative: Relative,
    /// How well.
    pub noise: Noise,
    /// What recognition said, as a likelihood by kind: how probable it was to say this of a landmark of each kind.
    pub recognition: &'a [f64],
}

/// Why a sighting could not be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HypothesisError {
    /// It does not say where the landmark is.
    #[error("a sighting at {time} gives no position: hypotheses need range and bearing, or a position")]
    NoPosition {
        /// Its time.
        time: Timestamp,
    },
    /// Its noise is of another dimension, or not positive definite.
    #[error("the noise of a sighting at {time} is not a covariance of its dimension")]
    Noise {
        /// Its time.
        time: Timestamp,
    },
    /// Recognition says nothing of a kind that is in the map.
    #[error("recognition at {time} gives {found} likelihoods, but the map has kind {kind}")]
    Kinds {
        /// Its time.
        time: Timestamp,
        /// How many there are.
        found: usize,
        /// The kind that is missing.
        kind: usize,
    },
}

/// What the weights say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Belief {
    /// Nothing has been seen yet.
    Anywhere,
    /// One hypothesis has nearly all weight.
    One(Standing),
    /// Several are possible; the heaviest of `count` is given.
    Several {
        /// How many there are.
        count: usize,
        /// The heaviest.
        heaviest: Standing,
    },
}

/// A hypothesis as it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// `map_from_robot`.
    pub pose: Pose2,
    /// Covariance of position in the map and yaw.
    pub covariance: Symmetric3,
    /// Probability that it is the right one.
    pub weight: f64,
}

/// A pose of the robot with a weight.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    pub joint: Joint,
    pub weight: f64,
}

/// Hypotheses of where the robot is.
#[derive(Clone, Debug)]
pub struct Localizer {
    map: KindedMap,
    settings: Settings,
    hypotheses: Vec<Hypothesis>,
    /// Probability that the robot is anywhere.
    reserve: f64,
    time: Option<Timestamp>,
    most_so_far: usize,
}

/// What may come of a sighting, before it is known which is worth computing.
enum Branch {
    Explained { hypothesis: usize, linearization: Linearization },
    Born { landmark: usize, heading: usize },
}

impl Localizer {
    /// A robot that may be anywhere in the map.
    pub fn anywhere(map: KindedMap, settings: Settings) -> Self {
        Self { map, settings, hypotheses: Vec::new(), reserve: 1.0, time: None, most_so_far: 0 }
    }

    /// A robot that is told its pose at a nominal state; `noise` is the covariance of `n` in `X exp(n)`.
    pub fn told(
        map: KindedMap,
        settings: Settings,
        pose: &Pose2,
        noise: &Matrix3,
        at: &NominalState,
    ) -> Self {
        let mut joint = Joint::new(ErrorForm::Invariant);
        joint.place(ROBOT, BOOT, pose, noise, at);
        let hypotheses = vec![Hypothesis { joint, weight: 1.0 }];
        Self { map, settings, hypotheses, reserve: 0.0, time: None, most_so_far: 1 }
    }

    /// Probability that the robot is somewhere else than any hypothesis says.
    pub fn reserve(&self) -> f64 {
        self.reserve
    }

    /// The largest number of hypotheses kept after any sighting.
    pub fn most_so_far(&self) -> usize {
        self.most_so_far
    }

    /// All hypotheses at a nominal state, the heaviest first.
    pub fn standings(&self, at: &NominalState) -> Vec<Standing> {
        let standing = |hypothesis: &Hypothesis| {
            let (pose, covariance) = hypothesis.joint.estimate(ROBOT, Timestamp(0), at)?;
            Some(Standing { pose, covariance, weight: hypothesis.weight })
        };
        self.hypotheses.iter().filter_map(standing).collect()
    }

    /// What they come to.
    pub fn belief(&self, at: &NominalState) -> Belief {
        match self.standings(at).first() {
            None => Belief::Anywhere,
            Some(first) if first.weight >= self.settings.believed => Belief::One(*first),
            Some(first) => Belief::Several { count: self.hypotheses.len(), heaviest: *first },
        }
    }

    /// Takes a sighting; later ones have later or equal times. One that nothing explains is left out.
    ///
    /// # Errors
    /// [`HypothesisError`]; the sighting then leaves no trace.
    pub fn sighted(&mut self, sighting: &Sighting<'_>) -> Result<(), HypothesisError> {
        let time = sighting.time;
        let seen = seen(&sighting.relative, &sighting.noise).ok_or(HypothesisError::NoPosition { time })?;
        let noise = noise_matrix(&sighting.noise);
        let definite = noise[(0, 0)] > 0.0 && noise[(0, 0)] * noise[(1, 1)] > noise[(1, 0)] * noise[(1, 0)];
        if usize::from(sighting.noise.dimension) != dimension(&sighting.relative) || !definite {
            return Err(HypothesisError::Noise { time });
        }
        let found = sighting.recognition.len();
        if let Some(KindOfLandmark(kind)) =
            self.map.landmarks.iter().map(|landmark| landmark.kind).find(|kind| kind.0 >= found)
        {
            return Err(HypothesisError::Kinds { time, found, kind });
        }
        self.wait_until(time);
        for hypothesis in &mut self.hypotheses {
            hypothesis.joint.propagate(0, &sighting.observer);
        }
        let branches = self.branches(sighting, &seen, &noise);
        let most = branches.iter().map(|(log_weight, _)| *log_weight).fold(f64::NEG_INFINITY, f64::max);
        if most == f64::NEG_INFINITY {
            return Ok(());
        }
        let total: f64 = branches.iter().map(|(log_weight, _)| libm::exp(log_weight - most)).sum();
        let mut next = Vec::new();
        for (log_weight, branch) in &branches {
            let weight = libm::exp(log_weight - most) / total;
            if weight >= self.settings.least_weight {
                next.extend(self.grown(branch, weight, sighting, &seen, &noise));
            }
        }
        reduction::reduce(&mut next, &self.settings);
        if !next.is_empty() {
            self.most_so_far = self.most_so_far.max(next.len());
            self.hypotheses = next;
            self.reserve = 0.0;
        }
        Ok(())
    }

    /// Lets time pass in which the robot may have been carried off.
    fn wait_until(&mut self, time: Timestamp) {
        let waited_s = self.time.map_or(0.0, |last| time.seconds_since(last).max(0.0));
        self.time = Some(time);
        let stayed = libm::exp(-self.settings.carried_off_hz * waited_s);
        for hypothesis in &mut self.hypotheses {
            hypothesis.weight *= stayed;
        }
        self.reserve = 1.0 - (1.0 - self.reserve) * stayed;
    }

    /// Every pair of hypothesis and landmark within the gate, and every pose around a landmark, each with the
    /// logarithm of its weight.
    fn branches(&self, sighting: &Sighting<'_>, seen: &Seen, noise: &Matrix3) -> Vec<(f64, Branch)> {
        let mut branches = Vec::new();
        let said = |landmark: &MappedLandmark| sighting.recognition[landmark.kind.0];
        let possible = || self.map.landmarks.iter().enumerate().filter(|(_, landmark)| said(landmark) > 0.0);
        for (index, hypothesis) in self.hypotheses.iter().enumerate() {
            let Some((pose, _)) = hypothesis.joint.estimate(ROBOT, Timestamp(0), &sighting.observer) else {
                continue;
            };
            let covariance = hypothesis.joint.covariance().block(0, 0);
            for (_, of) in possible() {
                let Ok(linearization) = of_point(&sighting.relative, &pose, of.position_m) else { continue };
                let (nis, log_density) = density(&linearization, &covariance, noise);
                if nis <= self.settings.gate && hypothesis.weight > 0.0 {
                    let log_weight = libm::log(hypothesis.weight) + libm::log(said(of)) + log_density;
                    branches.push((log_weight, Branch::Explained { hypothesis: index, linearization }));
                }
            }
        }
        if self.reserve > 0.0 {
            let share =
                self.reserve * seen.area_per_unit / self.map.area_m2() / self.settings.headings as f64;
            for (landmark, of) in possible() {
                let log_weight = libm::log(share * said(of));
                let born = (0..self.settings.headings).map(|heading| Branch::Born { landmark, heading });
                branches.extend(born.map(|branch| (log_weight, branch)));
            }
        }
        branches
    }

    /// The hypothesis that comes of a branch.
    fn grown(
        &self,
        branch: &Branch,
        weight: f64,
        sighting: &Sighting<'_>,
        seen: &Seen,
        noise: &Matrix3,
    ) -> Option<Hypothesis> {
        match branch {
            Branch::Explained { hypothesis, linearization } => {
                let mut joint = self.hypotheses[*hypothesis].joint.clone();
                let mut observer = [Participant { index: 0, jacobian: -linearization.jacobian }];
                let update = joint.update(
                    linearization.dimension,
                    &linearization.innovation,
                    noise,
                    &mut observer,
                    f64::INFINITY,
                    None,
                );
                matches!(update, Update::Used { .. }).then_some(Hypothesis { joint, weight })
            }
            Branch::Born { landmark, heading } => {
                let (pose, covariance) =
                    around(&self.map.landmarks[*landmark], seen, *heading, self.settings.headings);
                self.map.contains(pose.position()).then(|| Hypothesis {
                    joint: joint_at(&pose, &covariance, &sighting.observer, 0),
                    weight,
                })
            }
        }
    }
}

/// A joint of this robot alone, at a pose with a covariance of the invariant error.
pub(super) fn joint_at(pose: &Pose2, covariance: &Matrix3, at: &NominalState, updates: u64) -> Joint {
    let correction = pose.compose(&at.nominal.inverse());
    let member = Member::new(ROBOT, BOOT, correction, at.nominal, at.noise_sum);
    let Symmetric3(lower) = Symmetric3::from_lower(covariance);
    let parts = JointParts {
        blocks: vec![(Block::Robot(member), true)],
        lower: lower.to_vec(),
        ties: Vec::new(),
        contradictions: Vec::new(),
        stated: Vec::new(),
        updates,
    };
    // A robot's block has six entries: there is nothing that could not fit.
    Joint::from_parts(ErrorForm::Invariant, parts).unwrap_or_else(|| Joint::new(ErrorForm::Invariant))
}

/// Normalized innovation squared, and the logarithm of the Gaussian density of an innovation of dimension 2.
fn density(linearization: &Linearization, covariance: &Matrix3, noise: &Matrix3) -> (f64, f64) {
    let h = &linearization.jacobian;
    let s = h * covariance * h.transpose() + noise;
    let (a, b) = (linearization.innovation[0], linearization.innovation[1]);
    let determinant = s[(0, 0)] * s[(1, 1)] - s[(1, 0)] * s[(1, 0)];
    if determinant.is_nan() || determinant <= 0.0 {
        return (f64::INFINITY, f64::NEG_INFINITY);
    }
    let nis = (a * a * s[(1, 1)] - 2.0 * a * b * s[(1, 0)] + b * b * s[(0, 0)]) / determinant;
    (nis, -0.5 * nis - 0.5 * libm::log(determinant) - libm::log(TAU))
}

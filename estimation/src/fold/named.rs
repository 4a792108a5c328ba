//! Sightings whose name may be another's: each robot and landmark is held against what was seen, with its probability.

use super::reading::{Influence, dimension, linearize, participants, seen_poses};
use super::{Others, Outcome, Residual, SkipReason, Taken};
use crate::fact::Quantity;
use crate::fold::{Clutter, FactKey, FoldConfig};
use crate::geometry::{Matrix3, Vector3};
use crate::joint::{Joint, Party, Prepared};
use crate::{Pose2, RobotId};

/// What was seen, of one that it may have been.
pub(super) struct Reading {
    pub quantity: Quantity,
    pub taken: Vec<Taken>,
    pub poses: Vec<Pose2>,
    pub influences: Vec<Influence>,
}

/// What became of it.
pub(super) struct Folded {
    /// Of the likeliest.
    pub residual: Residual,
    /// Probability that it was of something.
    pub weight: f64,
    /// The likeliest.
    pub of: Reading,
}

/// One that it may have been, within the gate.
struct Candidate {
    of: Reading,
    innovation: Vector3,
    prepared: Prepared,
    /// Logarithm of its share before anything is known times the density of the reading.
    log_weight: f64,
}

/// Whether a measurement names what it is of.
pub(super) fn is_named(quantity: &Quantity) -> bool {
    !matches!(quantity, Quantity::Absolute(_))
}

/// Folds a sighting that may be of another than it names, or of nothing: the mixture over all that it may be, with its mean and
/// covariance (`barshalom1975`, of several origins).
pub(super) fn fold_named(
    joint: &mut Joint,
    (config, clutter, others): (&FoldConfig, &Clutter, &Others<'_>),
    key: &FactKey,
    own: Reading,
    noise: &Matrix3,
) -> Result<Folded, SkipReason> {
    let named = Party::of(&own.quantity);
    let nothing = libm::log(clutter.share) - clutter.log_volume(&own.quantity);
    let misnamed = named_otherwise(joint, key, &own, others);
    let share_of_each = config.misnamed / misnamed.len().max(1) as f64;
    let mut refused = None;
    let mut candidates: Vec<Candidate> = Vec::new();
    for of in std::iter::once(own).chain(misnamed) {
        let is_own = Party::of(&of.quantity) == named;
        let at = match linearize(&of.quantity, &of.poses) {
            Ok(at) => at,
            Err(reason) if is_own => return Err(reason),
            // What is where the robot stands was not seen by it.
            Err(_) => continue,
        };
        let participants = participants(&of.quantity, &of.taken, &of.influences, &at);
        let prepared = joint.covariance().prepare(at.dimension, &at.innovation, noise, &participants);
        let prepared = prepared.ok_or(SkipReason::Noise)?;
        let (nis, threshold) = (prepared.nis(), config.gate[at.dimension - 1]);
        let innovation = at.innovation;
        if nis <= threshold {
            let share = if is_own { 1.0 - clutter.share - config.misnamed } else { share_of_each };
            let log_weight = libm::log(share) + prepared.log_density();
            candidates.push(Candidate { of, innovation, prepared, log_weight });
        } else if is_own {
            let outcome = Outcome::Rejected { threshold };
            let residual = Residual { outcome, dimension: at.dimension, innovation, nis };
            refused = Some(Folded { residual, weight: 0.0, of });
        }
    }
    let likeliest =
        (0..candidates.len()).max_by(|a, b| candidates[*a].log_weight.total_cmp(&candidates[*b].log_weight));
    let Some(likeliest) = likeliest else { return refused.ok_or(SkipReason::Noise) };
    let most = candidates[likeliest].log_weight.max(nothing);
    let mut sum = libm::exp(nothing - most);
    for candidate in &candidates {
        sum += libm::exp(candidate.log_weight - most);
    }
    let best = &candidates[likeliest];
    let party = Party::of(&best.of.quantity);
    let residual = Residual {
        outcome: if party == named { Outcome::Used } else { Outcome::UsedAs(party) },
        dimension: dimension(&best.of.quantity),
        innovation: best.innovation,
        nis: best.prepared.nis(),
    };
    let (mut weighted, mut readings) = (Vec::with_capacity(candidates.len()), Vec::new());
    for candidate in candidates {
        weighted.push((candidate.prepared, libm::exp(candidate.log_weight - most) / sum));
        readings.push(candidate.of);
    }
    let weight = weighted.iter().fold(0.0, |sum, (_, weight)| sum + weight);
    joint.update_mixed(&weighted);
    Ok(Folded { residual, weight, of: readings.swap_remove(likeliest) })
}

/// The same sighting of everyone else it may have been: robots of the same frame that have said where they were, landmarks whose
/// places are stated, as far as anyone has seen one, and those of the team's map in the same frame.
fn named_otherwise(joint: &mut Joint, key: &FactKey, own: &Reading, others: &Others<'_>) -> Vec<Reading> {
    let observer = own.taken[0];
    match own.quantity {
        Quantity::Robot { robot: named, relative } => {
            let frame = joint.component(observer.0);
            let robots: Vec<RobotId> = joint.members().map(|member| member.robot).collect();
            let mut readings = Vec::new();
            for robot in robots.into_iter().filter(|robot| *robot != named && *robot != key.id.robot) {
                let (Some((boot, state)), Some(index)) = (others(key.id, robot), joint.index(robot)) else {
                    continue;
                };
                let member = joint.part(index);
                let believed = member.reputation.distrust.is_none_or(|distrust| !distrust.whole);
                if member.boot != boot || !believed || joint.component(index) != frame {
                    continue;
                }
                joint.propagate(index, &state);
                let (quantity, taken) =
                    (Quantity::Robot { robot, relative }, vec![observer, (index, Some(state))]);
                let (poses, influences) = seen_poses(joint, key.time, &quantity, &taken);
                readings.push(Reading { quantity, taken, poses, influences });
            }
            readings
        }
        Quantity::Landmark { landmark, relative, .. } => {
            let stated = joint.stated().iter().filter(|(other, _)| *other != landmark);
            let reading = |(other, position_m): &(_, [f64; 2])| Reading {
                quantity: Quantity::Landmark { landmark: *other, position_m: *position_m, relative },
                taken: own.taken.clone(),
                poses: own.poses.clone(),
                influences: own.influences.clone(),
            };
            stated.map(reading).collect()
        }
        Quantity::Feature { landmark, relative } => {
            let frame = joint.component(observer.0);
            let of_frame = joint
                .landmarks()
                .filter(|(index, other)| other.landmark != landmark && joint.component(*index) == frame);
            let reading = |(index, other): (usize, &crate::joint::MappedLandmark)| Reading {
                quantity: Quantity::Feature { landmark: other.landmark, relative },
                taken: vec![observer, (index, None)],
                poses: vec![own.poses[0], other.pose],
                influences: own.influences.clone(),
            };
            of_frame.map(reading).collect()
        }
        Quantity::Absolute(_) => Vec::new(),
    }
}

/// Keeps where a landmark is said to be.
pub(super) fn keep_stated(joint: &mut Joint, quantity: &Quantity) {
    if let Quantity::Landmark { landmark, position_m, .. } = quantity {
        joint.state_landmark(*landmark, *position_m);
    }
}

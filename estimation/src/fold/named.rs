//! Sightings whose name may be another's: each landmark is held against what was seen, with its probability.

use super::{Influence, Outcome, Residual, SkipReason, Taken, linearize, participants};
use crate::LandmarkId;
use crate::Pose2;
use crate::fact::Quantity;
use crate::fold::{Clutter, FoldConfig};
use crate::geometry::{Matrix3, Vector3};
use crate::joint::{Joint, Prepared};

/// A landmark that a sighting may be of.
struct Candidate {
    landmark: LandmarkId,
    innovation: Vector3,
    prepared: Prepared,
    /// Logarithm of its share before anything is known times the density of the sighting.
    log_weight: f64,
}

/// Which landmark a sighting names, if it names one.
pub(super) fn claimed(quantity: &Quantity) -> Option<LandmarkId> {
    match quantity {
        Quantity::Landmark { landmark, .. } | Quantity::Feature { landmark, .. } => Some(*landmark),
        Quantity::Robot { .. } | Quantity::Absolute(_) => None,
    }
}

/// Folds the sighting of a landmark that may be another than it says, or nothing: the mixture over all that it may be, with its
/// mean and covariance (`barshalom1975`, of several origins). Gives the residual of the likeliest, and the probability that it
/// is of something.
pub(super) fn fold_named(
    joint: &mut Joint,
    (config, clutter): (&FoldConfig, &Clutter),
    quantity: &Quantity,
    noise: &Matrix3,
    (taken, poses, influences): (&[Taken], &[Pose2], &[Influence]),
) -> Result<(Residual, f64), SkipReason> {
    let claimed = claimed(quantity);
    let others = named_otherwise(joint, quantity, taken, poses);
    let misnamed = config.misnamed / others.len().max(1) as f64;
    let mut refused = None;
    let mut candidates: Vec<Candidate> = Vec::new();
    let own = (*quantity, taken.to_vec(), poses.to_vec());
    for (which, (quantity, taken, poses)) in std::iter::once(own).chain(others).enumerate() {
        let at = match linearize(&quantity, &poses) {
            Ok(at) => at,
            Err(reason) if which == 0 => return Err(reason),
            // What is where the robot stands was not seen by it.
            Err(_) => continue,
        };
        let participants = participants(&quantity, &taken, influences, &at);
        let Some(prepared) = joint.covariance().prepare(at.dimension, &at.innovation, noise, &participants)
        else {
            return Err(SkipReason::Noise);
        };
        let (nis, threshold) = (prepared.nis(), config.gate[at.dimension - 1]);
        if which == 0 && nis > threshold {
            let outcome = Outcome::Rejected { threshold };
            refused = Some(Residual { outcome, dimension: at.dimension, innovation: at.innovation, nis });
        }
        if nis <= threshold {
            let share = if which == 0 { 1.0 - clutter.share - config.misnamed } else { misnamed };
            let log_weight = libm::log(share) + prepared.log_density();
            let landmark = self::claimed(&quantity).or(claimed).unwrap_or(LandmarkId(0));
            candidates.push(Candidate { landmark, innovation: at.innovation, prepared, log_weight });
        }
    }
    let nothing = libm::log(clutter.share) - clutter.log_volume(quantity);
    let Some(likeliest) = candidates.iter().max_by(|a, b| a.log_weight.total_cmp(&b.log_weight)) else {
        return refused.map(|residual| (residual, 0.0)).ok_or(SkipReason::Noise);
    };
    let most = likeliest.log_weight.max(nothing);
    let mut sum = libm::exp(nothing - most);
    for candidate in &candidates {
        sum += libm::exp(candidate.log_weight - most);
    }
    let outcome =
        if Some(likeliest.landmark) == claimed { Outcome::Used } else { Outcome::UsedAs(likeliest.landmark) };
    let residual = Residual {
        outcome,
        dimension: super::dimension(quantity),
        innovation: likeliest.innovation,
        nis: likeliest.prepared.nis(),
    };
    let weighted: Vec<(Prepared, f64)> =
        candidates.into_iter().map(|of| (of.prepared, libm::exp(of.log_weight - most) / sum)).collect();
    let of_something = weighted.iter().fold(0.0, |sum, (_, weight)| sum + weight);
    joint.update_mixed(&weighted);
    Ok((residual, of_something))
}

/// The same sighting of every other landmark that is known: of those whose places are stated as far as anyone has seen one, and of
/// those of the team's map in the same frame.
fn named_otherwise(
    joint: &Joint,
    quantity: &Quantity,
    taken: &[Taken],
    poses: &[Pose2],
) -> Vec<(Quantity, Vec<Taken>, Vec<Pose2>)> {
    match *quantity {
        Quantity::Landmark { landmark, relative, .. } => {
            let others = joint.stated().iter().filter(|(other, _)| *other != landmark);
            others
                .map(|(other, position_m)| {
                    let named = Quantity::Landmark { landmark: *other, position_m: *position_m, relative };
                    (named, taken.to_vec(), poses.to_vec())
                })
                .collect()
        }
        Quantity::Feature { landmark, relative } => {
            let frame = joint.component(taken[0].0);
            let others = joint
                .landmarks()
                .filter(|(index, other)| other.landmark != landmark && joint.component(*index) == frame);
            others
                .map(|(index, other)| {
                    let named = Quantity::Feature { landmark: other.landmark, relative };
                    (named, vec![taken[0], (index, None)], vec![poses[0], other.pose])
                })
                .collect()
        }
        Quantity::Robot { .. } | Quantity::Absolute(_) => Vec::new(),
    }
}

/// Keeps where a landmark is said to be.
pub(super) fn keep_stated(joint: &mut Joint, config: &FoldConfig, quantity: &Quantity) {
    if let (true, Quantity::Landmark { landmark, position_m, .. }) = (config.misnamed > 0.0, quantity) {
        joint.state_landmark(*landmark, *position_m);
    }
}

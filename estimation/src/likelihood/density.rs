//! The density of each measurement under what the fold predicts of it.

use super::{Levels, TunableFact};
use crate::fact::{NominalState, Quantity};
use crate::fold::{Fact, FactKey, FoldConfig, Outcome, fold};
use crate::geometry::{Matrix3, Vector2};
use crate::joint::{Block, Joint};
use crate::measurement::{self, Linearization};
use crate::{BootIndex, Pose2, RobotId};

/// What a measurement says of the noise levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactScore {
    /// Logarithm of its density, in the units of its components: Gaussian and outlier mixed by their shares.
    pub log_density: f64,
    /// Probability that it is no outlier; 1 without outliers.
    pub weight: f64,
    /// Normalized innovation squared.
    pub nis: f64,
    /// Its dimension.
    pub dimension: usize,
    /// Whether the fold used it, so that the gate let it pass.
    pub used: bool,
}

/// Folds facts under noise levels and gives the score of each, `None` where there was no measurement: boots, the first pose
/// of a robot, what takes part in nothing.
///
/// Facts are linearized one by one; with [`FoldConfig::clutter`] the density is the mixture. Parameters that are calibrated in
/// the fold are not in it.
pub fn scores(facts: &[TunableFact], levels: &Levels, config: &FoldConfig) -> Vec<Option<FactScore>> {
    let mut joint = Joint::new(config.form);
    facts.iter().map(|fact| score(&mut joint, config, fact.key(), &fact.under(levels))).collect()
}

fn score(joint: &mut Joint, config: &FoldConfig, key: &FactKey, fact: &Fact) -> Option<FactScore> {
    let predicted = match fact {
        Fact::Boot(_) => None,
        Fact::Observation { quantity, noise, observer, other } => noise.as_ref().and_then(|noise| {
            let noise = measurement::noise_matrix(noise);
            let of = predict(joint, key, quantity, &noise, observer, other.as_ref());
            of.map(|predicted| (predicted, quantity))
        }),
    };
    let residual = fold(joint, config, key, fact);
    let ((nis, log_normal), quantity) = predicted?;
    let used = match residual.outcome {
        Outcome::Used | Outcome::UsedAs(_) => true,
        Outcome::Rejected { .. } => false,
        // What waits between two frames is predicted by nothing.
        Outcome::Booted | Outcome::Placed | Outcome::Tied | Outcome::Joined { .. } | Outcome::Skipped(_) => {
            return None;
        }
    };
    let (log_density, weight) = match &config.clutter {
        None => (log_normal, 1.0),
        Some(clutter) => {
            let normal = libm::log(1.0 - clutter.share) + log_normal;
            let nothing = libm::log(clutter.share) - clutter.log_volume(quantity);
            let (more, less) = if normal > nothing { (normal, nothing) } else { (nothing, normal) };
            let together = more + libm::log1p(libm::exp(less - more));
            (together, libm::exp(normal - together))
        }
    };
    Some(FactScore { log_density, weight, nis, dimension: residual.dimension, used })
}

/// NIS and log-density of a measurement as the joint predicts it, noise accumulated since the last events included.
fn predict(
    joint: &Joint,
    key: &FactKey,
    quantity: &Quantity,
    noise: &Matrix3,
    observer: &NominalState,
    other: Option<&(BootIndex, NominalState)>,
) -> Option<(f64, f64)> {
    let a = part(joint, key.id.robot, key.id.boot, observer)?;
    let mut parts = vec![a];
    let at: Linearization = match quantity {
        Quantity::Robot { robot, relative } => {
            let (boot, state) = other?;
            let b = part(joint, *robot, *boot, state)?;
            parts[0].sign = -1.0;
            parts.push(b);
            measurement::of_robot(relative, &parts[0].pose, &parts[1].pose).ok()?
        }
        Quantity::Landmark { position_m: [x, y], relative, .. } => {
            parts[0].sign = -1.0;
            measurement::of_point(relative, &parts[0].pose, Vector2::new(*x, *y)).ok()?
        }
        Quantity::Feature { landmark, relative } => {
            let index = joint.landmark_index(*landmark)?;
            let Block::Landmark(mapped) = &joint.blocks()[index] else { return None };
            parts[0].sign = -1.0;
            parts.push(Part { index, pose: mapped.pose, added: Matrix3::zeros(), sign: 1.0 });
            measurement::of_point(relative, &parts[0].pose, mapped.pose.position()).ok()?
        }
        Quantity::Absolute(absolute) => measurement::of_map(absolute, &parts[0].pose),
    };
    let mut state = Matrix3::zeros();
    for one in &parts {
        state += one.added;
        for another in &parts {
            state += joint.covariance().block(one.index, another.index) * (one.sign * another.sign);
        }
    }
    let innovation_covariance = at.jacobian * state * at.jacobian.transpose() + noise;
    normal(at.dimension, &innovation_covariance, &at)
}

/// One who takes part in a measurement.
struct Part {
    index: usize,
    pose: Pose2,
    /// Process noise that is not folded yet.
    added: Matrix3,
    sign: f64,
}

fn part(joint: &Joint, robot: RobotId, boot: BootIndex, state: &NominalState) -> Option<Part> {
    let member = joint.member(robot).filter(|member| member.boot == boot)?;
    let added = state.noise_sum.minus(member.folded_noise).congruence(&member.correction.adjoint());
    let pose = member.correction.compose(&state.nominal);
    Some(Part { index: joint.index(robot)?, pose, added: added.to_matrix(), sign: 1.0 })
}

/// NIS and log-density of a centred Gaussian, by elimination of the leading `dimension` rows.
fn normal(dimension: usize, covariance: &Matrix3, at: &Linearization) -> Option<(f64, f64)> {
    let mut factor = Matrix3::zeros();
    let mut whitened = at.innovation;
    let (mut nis, mut half_log_determinant) = (0.0, 0.0);
    for row in 0..dimension {
        for column in 0..=row {
            let mut sum = covariance[(row, column)];
            for k in 0..column {
                sum -= factor[(row, k)] * factor[(column, k)];
            }
            if row > column {
                factor[(row, column)] = sum / factor[(column, column)];
            } else if sum > 0.0 {
                factor[(row, row)] = sum.sqrt();
            } else {
                return None;
            }
        }
        let mut sum = at.innovation[row];
        for k in 0..row {
            sum -= factor[(row, k)] * whitened[k];
        }
        whitened[row] = sum / factor[(row, row)];
        nis += whitened[row] * whitened[row];
        half_log_determinant += libm::log(factor[(row, row)]);
    }
    let log_two_pi = libm::log(std::f64::consts::TAU);
    Some((nis, -0.5 * nis - half_log_determinant - 0.5 * dimension as f64 * log_two_pi))
}

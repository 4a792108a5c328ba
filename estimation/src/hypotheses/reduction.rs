//! Fewer hypotheses: close ones become one with the same first two moments, and of the rest the heaviest stay.

use super::birth::ROBOT;
use super::mixture::{Hypothesis, Settings, joint_at};
use crate::fact::NominalState;
use crate::geometry::{Matrix3, Vector3};
use crate::joint::Member;
use crate::{Pose2, geometry::wrap_angle};

/// A hypothesis opened up for comparison.
struct Open {
    pose: Pose2,
    covariance: Matrix3,
    weight: f64,
    at: NominalState,
    updates: u64,
    /// Whether it has taken another in.
    changed: bool,
}

/// Merges and caps, the heaviest first; the weights sum to 1 afterwards. All hypotheses are of one time.
pub(super) fn reduce(hypotheses: &mut Vec<Hypothesis>, settings: &Settings) {
    // Stable: equal weights stay in the order of their landmarks.
    hypotheses.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let mut kept: Vec<(Option<Hypothesis>, Open)> = Vec::new();
    for hypothesis in hypotheses.drain(..) {
        let Some(open) = opened(&hypothesis) else { continue };
        match kept.iter_mut().find(|(_, other)| close(other, &open, settings.merge_below)) {
            Some((_, other)) => other.absorb(&open),
            None => kept.push((Some(hypothesis), open)),
        }
    }
    kept.sort_by(|(_, a), (_, b)| b.weight.total_cmp(&a.weight));
    kept.truncate(settings.most);
    let total: f64 = kept.iter().map(|(_, open)| open.weight).sum();
    hypotheses.extend(kept.into_iter().filter_map(|(own, open)| {
        let weight = open.weight / total;
        // One that stands alone keeps its bits.
        if open.changed {
            let joint = joint_at(&open.pose, &open.covariance, &open.at, open.updates);
            return Some(Hypothesis { joint, weight });
        }
        own.map(|own| Hypothesis { weight, ..own })
    }));
}

fn opened(hypothesis: &Hypothesis) -> Option<Open> {
    let Member { correction, nominal, folded_noise, .. } = *hypothesis.joint.member(ROBOT)?;
    Some(Open {
        pose: correction.compose(&nominal),
        covariance: hypothesis.joint.covariance().block(0, 0),
        weight: hypothesis.weight,
        at: NominalState::new(nominal, folded_noise),
        updates: hypothesis.joint.updates(),
        changed: false,
    })
}

/// `log(X_b X_a^-1)`: the motion of the map that takes one pose to the other.
fn difference(a: &Open, b: &Open) -> Vector3 {
    b.pose.compose(&a.pose.inverse()).log()
}

fn close(a: &Open, b: &Open, below: f64) -> bool {
    // Cheap, and all that most pairs need: nobody merges across half a turn.
    if wrap_angle(a.pose.yaw_rad() - b.pose.yaw_rad()).abs() > 1.0 {
        return false;
    }
    let mean = (a.covariance + b.covariance) * 0.5;
    let offset = difference(a, b);
    nalgebra::Cholesky::new(mean).is_some_and(|factor| offset.dot(&factor.solve(&offset)) < below)
}

impl Open {
    /// Takes another in, moment by moment.
    fn absorb(&mut self, other: &Self) {
        let total = self.weight + other.weight;
        let share = other.weight / total;
        let offset = difference(self, other);
        let spread = offset * offset.transpose() * (share * (1.0 - share));
        self.covariance = self.covariance * (1.0 - share) + other.covariance * share + spread;
        self.pose = Pose2::exp(offset * share).compose(&self.pose);
        self.weight = total;
        self.changed = true;
    }
}

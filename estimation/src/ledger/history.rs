//! The settled history of a robot: its part of the joint after every fact, in the order of the fold.

use super::Ledger;
use crate::fact::NominalState;
use crate::fold::{Fact, FactKey, fold, fold_blocks};
use crate::geometry::Matrix3;
use crate::joint::{ErrorForm, Joint, extrapolate};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId, Timestamp};

/// A robot's part of the joint after one fact: a point of its settled history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettledPoint {
    /// Time of the fact.
    pub time: Timestamp,
    /// On the trajectory of which boot the correction applies.
    pub boot: BootIndex,
    /// A copy of the joint's view of the robot, enough to give its estimate until the next fact.
    view: SettledView,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct SettledView {
    correction: Pose2,
    block: Matrix3,
    folded_noise: Symmetric3,
    nominal: Pose2,
    form: ErrorForm,
}

impl Ledger {
    /// Folds all facts once more from the beginning, or from the last cut, and gives, for one robot, its part of the joint after
    /// each: the *settled* history, in which the estimate at t rests on all facts up to t. Where facts are linearized together,
    /// later ones of the block may have moved the points of linearization.
    pub fn settled_history(&self, robot: RobotId) -> Vec<SettledPoint> {
        let mut joint = self.base_joint();
        let mut points = Vec::new();
        let mut add = |joint: &Joint, time| {
            let Some((member, index)) = joint.member(robot).zip(joint.index(robot)) else { return };
            let view = SettledView {
                correction: member.correction,
                block: joint.covariance().block(index, index),
                folded_noise: member.folded_noise,
                nominal: member.nominal,
                form: self.config.form,
            };
            points.push(SettledPoint { time, boot: member.boot, view });
        };
        if let Some(cut) = self.cut() {
            add(&joint, cut);
        }
        if let Some(how) = &self.config.relinearize {
            let facts: Vec<(FactKey, Fact)> =
                self.facts.iter().map(|(key, record)| (*key, record.fact)).collect();
            let mut told = |index: usize, _, now: &dyn Fn() -> Joint| add(&now(), facts[index].0.time);
            fold_blocks(&mut joint, &self.config, how, &facts, &mut |_, _| {}, &mut told);
            return points;
        }
        for (key, record) in &self.facts {
            fold(&mut joint, &self.config, key, &record.fact);
            add(&joint, key.time);
        }
        points
    }
}

impl SettledPoint {
    /// The estimate and its covariance (position in the map, yaw) at `state` of the nominal trajectory,
    /// until the next fact.
    pub fn estimate(&self, state: &NominalState) -> (Pose2, Symmetric3) {
        let view = &self.view;
        extrapolate(view.form, &view.correction, &view.nominal, view.folded_noise, &view.block, state)
    }
}

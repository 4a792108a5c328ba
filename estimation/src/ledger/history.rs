//! The settled history of a robot: its part of the joint after every fact, in the order of the fold.

use super::Ledger;
use crate::fact::NominalState;
use crate::fold::{Fact, FactKey, fold_among, fold_blocks};
use crate::joint::{Joint, RobotView};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId, Timestamp};

/// A robot's part of the joint after one fact: a point of its settled history.
#[derive(Clone, Debug, PartialEq)]
pub struct SettledPoint {
    /// Time of the fact.
    pub time: Timestamp,
    /// On the trajectory of which boot the correction applies.
    pub boot: BootIndex,
    view: RobotView,
}

impl Ledger {
    /// Folds all facts once more from the beginning, or from the last cut, and gives, for one robot, its part of the joint after
    /// each: the *settled* history, in which the estimate at t rests on all facts up to t. Where facts are linearized together,
    /// later ones of the block may have moved the points of linearization.
    pub fn settled_history(&self, robot: RobotId) -> Vec<SettledPoint> {
        let mut joint = self.base_joint();
        let mut points = Vec::new();
        let mut add = |joint: &Joint, time| {
            let Some((member, view)) = joint.member(robot).zip(joint.view(robot)) else { return };
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
            let others = |id, robot| self.other_half(id, robot);
            fold_among(&mut joint, &self.config, key, &record.fact, &others);
            add(&joint, key.time);
        }
        points
    }
}

impl SettledPoint {
    /// The estimate and its covariance (position in the map, yaw) at `state` of the nominal trajectory, when the robot's clock
    /// shows `time`, until the next fact.
    pub fn estimate(&self, time: Timestamp, state: &NominalState) -> (Pose2, Symmetric3) {
        self.view.estimate(time, state)
    }
}

//! What strategies are compared by: each robot's estimate, and the joint covariance they hold between them.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::MeetingId;
use crate::geometry::Matrix3;
use crate::joint::ErrorForm;
use crate::{Pose2, RobotId, Timestamp};

/// A robot's estimate of itself at its last odometry.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// When.
    pub time: Timestamp,
    /// `map_from_robot`.
    pub pose: Pose2,
    /// Which error the covariance and the factors speak of.
    pub form: ErrorForm,
    /// Its covariance.
    pub covariance: Matrix3,
    /// Its factors of the correlations with others, where the strategy keeps any: `P_ij = s_ij s_ji^T`.
    pub row: BTreeMap<RobotId, Factor>,
}

/// One robot's factor of a correlation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor {
    /// The meeting at which it was agreed on; factors of different versions must not be multiplied.
    /// `None` where the strategy has no versions.
    pub version: Option<MeetingId>,
    /// `s_ij`.
    pub matrix: Matrix3,
}

impl View {
    /// The covariance of position in the map and yaw.
    pub fn published(&self) -> Matrix3 {
        match self.form {
            ErrorForm::Additive => self.covariance,
            ErrorForm::Invariant => {
                let m = self.pose.additive_from_invariant();
                m * self.covariance * m.transpose()
            }
        }
    }
}

/// The joint covariance that a team holds between its members.
#[derive(Clone, Debug, PartialEq)]
pub struct JointView {
    /// The robots, in the order of their blocks.
    pub robots: Vec<RobotId>,
    /// 3 rows each.
    pub covariance: DMatrix<f64>,
    /// Pairs whose factors are of different versions: their cross term is unknown, and zero here.
    pub disagreeing: usize,
}

/// Puts the rows of all robots together. The result need not be positive definite: only a strategy that
/// is exact guarantees that.
pub fn joint_view(views: &BTreeMap<RobotId, View>) -> JointView {
    let robots: Vec<RobotId> = views.keys().copied().collect();
    let mut covariance = DMatrix::zeros(3 * robots.len(), 3 * robots.len());
    let mut disagreeing = 0;
    for (i, (robot, view)) in views.iter().enumerate() {
        covariance.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(&view.covariance);
        for (j, (other, theirs)) in views.iter().enumerate().skip(i + 1) {
            let cross = match (view.row.get(other), theirs.row.get(robot)) {
                (Some(own), Some(other)) if own.version == other.version => {
                    own.matrix * other.matrix.transpose()
                }
                (None, None) => continue,
                _ => {
                    disagreeing += 1;
                    continue;
                }
            };
            covariance.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&cross);
            covariance.fixed_view_mut::<3, 3>(3 * j, 3 * i).copy_from(&cross.transpose());
        }
    }
    JointView { robots, covariance, disagreeing }
}

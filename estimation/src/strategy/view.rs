//! What strategies are compared by: each robot's estimate, the joint covariance they hold between them, and
//! the errors of both.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::MeetingId;
use crate::fact::NominalState;
use crate::geometry::{Matrix3, Vector3, wrap_angle};
use crate::joint::{ErrorForm, Joint};
use crate::{Pose2, RobotId, Timestamp};

/// Steps to what the errors of a team have in common; it changes by less than a thousandth of itself after three.
const COMMON_STEPS: usize = 8;

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

/// An error and the covariance that was stated for it, as [`crate::statistics::NeesSummary`] takes them.
pub type Deviation = (DVector<f64>, DMatrix<f64>);

/// The true pose less the estimated one: `log(X Xhat^-1)`, or the differences of the coordinates.
pub fn error(form: ErrorForm, truth: &Pose2, estimate: &Pose2) -> Vector3 {
    match form {
        ErrorForm::Invariant => truth.compose(&estimate.inverse()).log(),
        ErrorForm::Additive => {
            let offset = truth.position() - estimate.position();
            Vector3::new(offset.x, offset.y, wrap_angle(truth.yaw_rad() - estimate.yaw_rad()))
        }
    }
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

    /// The error, with the covariance stated for it.
    pub fn deviation(&self, truth: &Pose2) -> Deviation {
        let error = error(self.form, truth, &self.pose);
        let covariance = DMatrix::from_column_slice(3, 3, self.covariance.as_slice());
        (DVector::from_column_slice(error.as_slice()), covariance)
    }
}

/// The joint estimate that a team holds between its members.
#[derive(Clone, Debug, PartialEq)]
pub struct JointView {
    /// Which error the covariance speaks of.
    pub form: ErrorForm,
    /// The robots and their poses, in the order of their blocks.
    pub robots: Vec<(RobotId, Pose2)>,
    /// 3 rows each.
    pub covariance: DMatrix<f64>,
    /// Pairs whose factors are of different versions: their cross term is unknown, and zero here.
    pub disagreeing: usize,
}

impl JointView {
    /// The error of the whole team, with the covariance stated for it. `None` if a robot has no truth.
    pub fn deviation(&self, truth: &BTreeMap<RobotId, Pose2>) -> Option<Deviation> {
        let mut errors = DVector::zeros(3 * self.robots.len());
        for (index, (robot, pose)) in self.robots.iter().enumerate() {
            let error = error(self.form, truth.get(robot)?, pose);
            errors.fixed_rows_mut::<3>(3 * index).copy_from(&error);
        }
        Some((errors, self.covariance.clone()))
    }

    /// The same with the motion that is common to the team taken apart from that of each robot: `X = exp(c) exp(e) X_hat`,
    /// where [`JointView::deviation`] has `X = exp(x) X_hat` and the covariance stands for `c + e` as for `x`. The two agree
    /// to first order. Where a robot's own heading is uncertain by tenths of a radian, its `e` has a long lever, and the
    /// product of both is no longer small beside the relative positions that the team knows well.
    ///
    /// `c` is the generalized least-squares estimate of what the errors have in common. The additive form is taken to the
    /// invariant coordinates first. `None` if a robot has no truth, or the covariance cannot be inverted.
    pub fn deviation_apart(&self, truth: &BTreeMap<RobotId, Pose2>) -> Option<Deviation> {
        let size = 3 * self.robots.len();
        let mut covariance = self.covariance.clone();
        if self.form == ErrorForm::Additive {
            let mut turn = DMatrix::zeros(size, size);
            for (index, (_, pose)) in self.robots.iter().enumerate() {
                turn.fixed_view_mut::<3, 3>(3 * index, 3 * index).copy_from(&pose.invariant_from_additive());
            }
            covariance = &turn * covariance * turn.transpose();
        }
        let factor = covariance.clone().cholesky()?;
        let every = DMatrix::from_fn(size, 3, |row, column| if row % 3 == column { 1.0 } else { 0.0 });
        let weighted = factor.solve(&every);
        let information = (every.transpose() * &weighted).cholesky()?;
        let mut common = Vector3::zeros();
        let mut errors = DVector::zeros(size);
        for _ in 0..COMMON_STEPS {
            for (index, (robot, pose)) in self.robots.iter().enumerate() {
                let moved = truth.get(robot)?.compose(&pose.inverse());
                let own = Pose2::exp(-common).compose(&moved).log();
                errors.fixed_rows_mut::<3>(3 * index).copy_from(&own);
            }
            let step = information.solve(&(weighted.transpose() * &errors));
            common += Vector3::new(step[0], step[1], step[2]);
        }
        for (row, error) in errors.iter_mut().enumerate() {
            *error += common[row % 3];
        }
        Some((errors, covariance))
    }

    /// The least eigenvalue of the covariance over the largest: negative if it is indefinite.
    pub fn definiteness(&self) -> f64 {
        let eigenvalues = self.covariance.clone().symmetric_eigenvalues();
        eigenvalues.min() / eigenvalues.max()
    }
}

/// Puts the rows of all robots together. The result need not be positive definite: only a strategy that
/// is exact guarantees that. `None` without a robot.
pub fn joint_view(views: &BTreeMap<RobotId, View>) -> Option<JointView> {
    let form = views.values().next()?.form;
    let robots = views.iter().map(|(robot, view)| (*robot, view.pose)).collect();
    let mut covariance = DMatrix::zeros(3 * views.len(), 3 * views.len());
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
    Some(JointView { form, robots, covariance, disagreeing })
}

/// The joint estimate of one replica of the exact strategy, each robot carried on to its nominal state. `None` if a robot has
/// no place in the map.
pub fn joint_of_replica(joint: &Joint, states: &BTreeMap<RobotId, NominalState>) -> Option<JointView> {
    let mut joint = joint.clone();
    for (robot, state) in states {
        joint.carry_to(*robot, state);
    }
    let mut covariance = DMatrix::zeros(3 * states.len(), 3 * states.len());
    let mut robots = Vec::with_capacity(states.len());
    for (i, (robot, state)) in states.iter().enumerate() {
        let row = joint.index(*robot)?;
        for (j, other) in states.keys().enumerate() {
            let block = joint.covariance().block(row, joint.index(*other)?);
            covariance.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
        }
        robots.push((*robot, joint.member(*robot)?.correction.compose(&state.nominal)));
    }
    Some(JointView { form: joint.form(), robots, covariance, disagreeing: 0 })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::statistics::nees;

    /// A team 8 m from the origin, whose common drift is known to 0.15 rad and 0.5 m, headings of its robots to 0.2 rad beside
    /// it, and places in its formation to 5 cm.
    fn view() -> JointView {
        let poses =
            [(8.0, 0.0, 0.3), (8.5, 1.0, -2.0), (6.0, -2.0, 1.0)].map(|(x, y, yaw)| Pose2::new(x, y, yaw));
        let common = DMatrix::from_diagonal(&DVector::from_vec(vec![0.25, 0.25, 0.0225]));
        let mut covariance = DMatrix::zeros(9, 9);
        for (i, pose) in poses.iter().enumerate() {
            for j in 0..3 {
                covariance.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&common);
            }
            let own = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0025, 0.0025, 0.04]));
            let turn = DMatrix::from_column_slice(3, 3, pose.adjoint().as_slice());
            let mut block = covariance.view_mut((3 * i, 3 * i), (3, 3));
            block += &turn * own * turn.transpose();
        }
        let robots = [1, 2, 3].map(RobotId).into_iter().zip(poses).collect();
        JointView { form: ErrorForm::Invariant, robots, covariance, disagreeing: 0 }
    }

    /// NEES per dimension over many draws of `X = exp(c) X_hat exp(w)`, whose errors are those the covariance was made of;
    /// stacked, and with the common motion apart.
    fn drawn(view: &JointView) -> (f64, f64) {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut draw = |sigmas: [f64; 3]| -> Vector3 {
            Vector3::from(
                sigmas.map(|sigma| sigma * Distribution::<f64>::sample(&StandardNormal, &mut random)),
            )
        };
        let (mut stacked, mut apart) = (0.0, 0.0);
        for _ in 0..400 {
            let common = Pose2::exp(draw([0.5, 0.5, 0.15]));
            let truth = view.robots.iter().map(|(robot, pose)| {
                (*robot, common.compose(pose).compose(&Pose2::exp(draw([0.05, 0.05, 0.2]))))
            });
            let truth: BTreeMap<RobotId, Pose2> = truth.collect();
            let of = |deviation: Option<Deviation>| {
                let (error, covariance) = deviation.unwrap();
                nees(&error, &covariance).unwrap() / 9.0 / 400.0
            };
            stacked += of(view.deviation(&truth));
            apart += of(view.deviation_apart(&truth));
        }
        (stacked, apart)
    }

    #[test]
    fn a_team_that_is_as_good_as_it_says_is_found_so_with_the_common_motion_apart() {
        // 3600 degrees of freedom: a standard deviation of 0.024.
        let (stacked, apart) = drawn(&view());
        assert!((apart - 1.0).abs() < 0.1, "{apart}");
        assert!(stacked > 2.0, "{stacked}: stacked errors do not show it");
    }

    #[test]
    fn a_team_that_says_half_its_variance_is_found_out() {
        let mut view = view();
        view.covariance *= 0.5;
        let (_, apart) = drawn(&view);
        assert!((apart - 2.0).abs() < 0.2, "{apart}");
    }

    #[test]
    fn a_motion_of_the_whole_team_alone_is_the_error_of_each() {
        let view = view();
        let common = Vector3::new(0.4, -0.2, 0.1);
        let truth =
            view.robots.iter().map(|(robot, pose)| (*robot, Pose2::exp(common).compose(pose))).collect();
        let (error, _) = view.deviation_apart(&truth).unwrap();
        for robot in 0..3 {
            assert!((error.fixed_rows::<3>(3 * robot) - common).amax() < 1e-9, "{error}");
        }
        let (stacked, _) = view.deviation(&truth).unwrap();
        assert!((error - stacked).amax() < 1e-9);
    }

    #[test]
    fn without_the_truth_of_a_robot_there_is_no_error() {
        assert!(view().deviation_apart(&BTreeMap::new()).is_none());
    }
}

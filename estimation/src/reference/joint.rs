//! The joint covariance of a team, dense.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::models::{Linearized, Outcome, SkipReason};
use crate::RobotId;
use crate::geometry::{Matrix3, Vector3};

/// Covariance of the errors of all placed robots, 3 rows each, in ascending order of robots.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCovariance {
    robots: Vec<RobotId>,
    matrix: DMatrix<f64>,
}

impl Default for JointCovariance {
    fn default() -> Self {
        Self { robots: Vec::new(), matrix: DMatrix::zeros(0, 0) }
    }
}

impl JointCovariance {
    /// The robots, in the order of their blocks.
    pub fn robots(&self) -> &[RobotId] {
        &self.robots
    }

    /// The whole matrix, 3N x 3N.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// The block of robots `i` and `j`; `None` if one of them has none.
    pub fn block(&self, i: RobotId, j: RobotId) -> Option<Matrix3> {
        let (row, column) = (self.offset(i)?, self.offset(j)?);
        Some(self.matrix.fixed_view::<3, 3>(row, column).into_owned())
    }

    fn offset(&self, robot: RobotId) -> Option<usize> {
        self.robots.binary_search(&robot).ok().map(|index| 3 * index)
    }

    /// Gives a robot a block without correlations, in place of the one it had.
    pub(super) fn insert(&mut self, robot: RobotId, block: &Matrix3) {
        self.remove(robot);
        let index = self.robots.partition_point(|other| *other < robot);
        self.robots.insert(index, robot);
        let offset = 3 * index;
        self.matrix =
            std::mem::take(&mut self.matrix).insert_rows(offset, 3, 0.0).insert_columns(offset, 3, 0.0);
        self.matrix.fixed_view_mut::<3, 3>(offset, offset).copy_from(block);
    }

    /// Marginalizes a robot, if it is there.
    pub(super) fn remove(&mut self, robot: RobotId) {
        if let Some(offset) = self.offset(robot) {
            self.robots.remove(offset / 3);
            self.matrix = std::mem::take(&mut self.matrix).remove_rows(offset, 3).remove_columns(offset, 3);
        }
    }

    /// `P_ii += noise`.
    pub(super) fn add(&mut self, robot: RobotId, noise: &Matrix3) {
        if let Some(offset) = self.offset(robot) {
            let mut block = self.matrix.fixed_view_mut::<3, 3>(offset, offset);
            block += noise;
            self.symmetrize();
        }
    }

    /// `P_ii <- T P_ii T^T` and `P_ij <- T P_ij` for every other robot.
    pub(super) fn transform(&mut self, robot: RobotId, transition: &Matrix3) {
        if let Some(offset) = self.offset(robot) {
            let size = self.matrix.nrows();
            let mut whole = DMatrix::identity(size, size);
            whole.fixed_view_mut::<3, 3>(offset, offset).copy_from(transition);
            self.matrix = &whole * &self.matrix * whole.transpose();
            self.symmetrize();
        }
    }

    /// A gated Kalman update in the full Joseph form. Returns what became of the measurement and, if
    /// it was used, the correction of every robot's error.
    pub(super) fn update(
        &mut self,
        linearized: &Linearized,
        observer: RobotId,
        observed: Option<RobotId>,
        noise: &DMatrix<f64>,
        gate: &[f64; 3],
    ) -> (Outcome, Vec<(RobotId, Vector3)>) {
        let rows = linearized.residual.len();
        let skipped = |reason| (Outcome::Skipped(reason), Vec::new());
        let Some(threshold) = rows.checked_sub(1).and_then(|index| gate.get(index)).copied() else {
            return skipped(SkipReason::Malformed);
        };
        if noise.nrows() != rows {
            return skipped(SkipReason::NoiseDimension);
        }
        let size = self.matrix.nrows();
        let mut h = DMatrix::zeros(rows, size);
        let blocks = [
            Some((observer, &linearized.d_measurement_d_observer)),
            observed.zip(linearized.d_measurement_d_observed.as_ref()),
        ];
        for (robot, block) in blocks.into_iter().flatten() {
            let Some(offset) = self.offset(robot) else { return skipped(SkipReason::Unplaced) };
            h.view_mut((0, offset), (rows, 3)).copy_from(block);
        }
        let innovation = &h * &self.matrix * h.transpose() + noise;
        let Some(cholesky) = Cholesky::new(innovation) else { return skipped(SkipReason::Indefinite) };
        let nis = linearized.residual.dot(&cholesky.solve(&linearized.residual));
        if nis > threshold {
            return (Outcome::Rejected { nis, dimension: rows, threshold }, Vec::new());
        }
        // K = P H^T S^-1, from S K^T = H P.
        let gain = cholesky.solve(&(&h * &self.matrix)).transpose();
        let correction: DVector<f64> = &gain * &linearized.residual;
        let keep = DMatrix::identity(size, size) - &gain * &h;
        self.matrix = &keep * &self.matrix * keep.transpose() + &gain * noise * gain.transpose();
        self.symmetrize();
        let corrections = self.robots.iter().enumerate().map(|(index, robot)| {
            (
                *robot,
                Vector3::new(correction[3 * index], correction[3 * index + 1], correction[3 * index + 2]),
            )
        });
        (Outcome::Used { nis, dimension: rows }, corrections.collect())
    }

    fn symmetrize(&mut self) {
        self.matrix = 0.5 * (&self.matrix + self.matrix.transpose());
    }
}

//! The update of two robots, with a cross-covariance that is known or is not.

use nalgebra::{SMatrix, SVector};

use crate::geometry::{Matrix3, Vector3};
use crate::measurement::Linearization;
use crate::strategy::fusion::least;

pub(in crate::strategy) type Matrix6 = SMatrix<f64, 6, 6>;

/// The update of a pair: both corrections, both blocks, and the cross-covariance.
pub(in crate::strategy) struct PairUpdate {
    pub corrections: [Vector3; 2],
    pub joint: Matrix6,
    pub nis: f64,
}

/// The Kalman update of a pair with `innovation = -H xi_a + H xi_b + n`; `None` if the innovation has no
/// positive definite covariance.
pub(in crate::strategy) fn update_pair(
    joint: &Matrix6,
    at: &Linearization,
    noise: &Matrix3,
) -> Option<PairUpdate> {
    let mut h = SMatrix::<f64, 3, 6>::zeros();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&-at.jacobian);
    h.fixed_view_mut::<3, 3>(0, 3).copy_from(&at.jacobian);
    let mut noise = *noise;
    for row in at.dimension..3 {
        noise[(row, row)] = 1.0;
    }
    let cholesky = (h * joint * h.transpose() + noise).cholesky()?;
    let gain = cholesky.solve(&(h * joint)).transpose();
    let correction: SVector<f64, 6> = gain * at.innovation;
    let keep = Matrix6::identity() - gain * h;
    let updated = keep * joint * keep.transpose() + gain * noise * gain.transpose();
    Some(PairUpdate {
        corrections: [correction.fixed_rows::<3>(0).into(), correction.fixed_rows::<3>(3).into()],
        joint: 0.5 * (updated + updated.transpose()),
        nis: at.innovation.dot(&cholesky.solve(&at.innovation)),
    })
}

/// The covariance of a pair from its blocks and cross term.
pub(in crate::strategy) fn pair(own: &Matrix3, other: &Matrix3, cross: &Matrix3) -> Matrix6 {
    let mut joint = Matrix6::zeros();
    joint.fixed_view_mut::<3, 3>(0, 0).copy_from(own);
    joint.fixed_view_mut::<3, 3>(3, 3).copy_from(other);
    joint.fixed_view_mut::<3, 3>(0, 3).copy_from(cross);
    joint.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross.transpose());
    joint
}

pub(super) fn block_of(joint: &Matrix6, row: usize, column: usize) -> Matrix3 {
    joint.fixed_view::<3, 3>(3 * row, 3 * column).into()
}

/// The update of a pair whose cross-covariance is unknown, with the weight that makes the product of the
/// determinants of both blocks least; `None` if that is no less than before.
pub(super) fn update_unknown(
    own: &Matrix3,
    other: &Matrix3,
    at: &Linearization,
    noise: &Matrix3,
) -> Option<PairUpdate> {
    let update = |weight: f64| {
        update_pair(&pair(&(own / weight), &(other / (1.0 - weight)), &Matrix3::zeros()), at, noise)
    };
    let size = |update: &PairUpdate| {
        block_of(&update.joint, 0, 0).determinant() * block_of(&update.joint, 1, 1).determinant()
    };
    let weight = least(|weight| update(weight).map_or(f64::INFINITY, |update| size(&update)));
    update(weight).filter(|update| size(update) < own.determinant() * other.determinant())
}

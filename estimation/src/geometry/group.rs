//! What a robot's pose must offer for the filter of a team: a Lie group (`sola2018micro`).

use std::fmt::Debug;

use nalgebra::{SMatrix, SVector};

use super::{Pose2, Pose3};

/// A tangent vector, translation first: metres, then radians.
pub type Tangent<const DOF: usize> = SVector<f64, DOF>;
/// A square matrix that acts on tangent vectors.
pub type Square<const DOF: usize> = SMatrix<f64, DOF, DOF>;

/// A Lie group of rigid motions with `DOF` degrees of freedom. Its laws are tested by one suite for every group.
///
/// Implementations take transcendental functions from `libm` and write products out in a fixed order: the same operands
/// give the same bits on every processor.
pub trait LieGroup<const DOF: usize>: Copy + Debug + PartialEq {
    /// The neutral element.
    fn identity() -> Self;

    /// The group product: `a_from_b.compose(b_from_c)` is `a_from_c`.
    fn compose(&self, other: &Self) -> Self;

    /// The inverse: `map_from_robot` becomes `robot_from_map`.
    fn inverse(&self) -> Self;

    /// `self^-1 * other`: the other pose seen from this one.
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// The exponential map.
    fn exp(tangent: &Tangent<DOF>) -> Self;

    /// The logarithm whose angle is at most pi.
    fn log(&self) -> Tangent<DOF>;

    /// The adjoint: `X exp(w) X^-1 = exp(Ad_X w)`.
    fn adjoint(&self) -> Square<DOF>;

    /// Whether every component is finite.
    fn is_finite(&self) -> bool;

    /// The bits of the components: equal words, equal estimate.
    fn words(&self) -> impl Iterator<Item = u64>;
}

impl LieGroup<3> for Pose2 {
    fn identity() -> Self {
        Self::identity()
    }

    fn compose(&self, other: &Self) -> Self {
        self.compose(other)
    }

    fn inverse(&self) -> Self {
        self.inverse()
    }

    fn between(&self, other: &Self) -> Self {
        self.between(other)
    }

    fn exp(tangent: &Tangent<3>) -> Self {
        Self::exp(*tangent)
    }

    fn log(&self) -> Tangent<3> {
        self.log()
    }

    fn adjoint(&self) -> Square<3> {
        self.adjoint()
    }

    fn is_finite(&self) -> bool {
        self.is_finite()
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        [self.x_m(), self.y_m(), self.yaw_rad()].map(f64::to_bits).into_iter()
    }
}

impl LieGroup<6> for Pose3 {
    fn identity() -> Self {
        Self::identity()
    }

    fn compose(&self, other: &Self) -> Self {
        self.compose(other)
    }

    fn inverse(&self) -> Self {
        self.inverse()
    }

    fn between(&self, other: &Self) -> Self {
        self.between(other)
    }

    fn exp(tangent: &Tangent<6>) -> Self {
        Self::exp(tangent)
    }

    fn log(&self) -> Tangent<6> {
        self.log()
    }

    fn adjoint(&self) -> Square<6> {
        self.adjoint()
    }

    fn is_finite(&self) -> bool {
        self.is_finite()
    }

    fn words(&self) -> impl Iterator<Item = u64> {
        self.components().map(f64::to_bits).into_iter()
    }
}

//! Symmetric 3x3 matrices as their six lower entries: what travels and what is accumulated.

use crate::geometry::Matrix3;

/// The lower triangle `[xx, yx, yy, zx, zy, zz]` of a symmetric 3x3 matrix in tangent order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Symmetric3(pub [f64; 6]);

impl Symmetric3 {
    /// The zero matrix.
    pub const fn zero() -> Self {
        Self([0.0; 6])
    }

    /// A diagonal matrix.
    pub const fn diagonal(x: f64, y: f64, z: f64) -> Self {
        Self([x, 0.0, y, 0.0, 0.0, z])
    }

    /// The lower triangle of `m`; what is above the diagonal is not read.
    pub fn from_lower(m: &Matrix3) -> Self {
        Self([m[(0, 0)], m[(1, 0)], m[(1, 1)], m[(2, 0)], m[(2, 1)], m[(2, 2)]])
    }

    /// The full matrix, exactly symmetric.
    pub fn to_matrix(self) -> Matrix3 {
        let [xx, yx, yy, zx, zy, zz] = self.0;
        Matrix3::new(xx, yx, zx, yx, yy, zy, zx, zy, zz)
    }

    /// `A self A^T`.
    pub fn congruence(self, a: &Matrix3) -> Self {
        Self::from_lower(&(a * self.to_matrix() * a.transpose()))
    }

    /// Entry-wise sum.
    pub fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    /// Entry-wise difference.
    pub fn minus(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }

    /// Entry-wise product with a number.
    pub fn scaled(self, factor: f64) -> Self {
        Self(self.0.map(|entry| entry * factor))
    }

    /// Whether every entry is finite.
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|entry| entry.is_finite())
    }

    /// The smallest and the largest eigenvalue.
    pub fn eigenvalue_range(self) -> (f64, f64) {
        let values = nalgebra::SymmetricEigen::new(self.to_matrix()).eigenvalues;
        (values.min(), values.max())
    }

    /// Whether the matrix is positive semidefinite up to rounding:
    /// `eig_min >= -1e-12 eig_max`, the invariant of every covariance in this crate.
    pub fn is_positive_semidefinite(self) -> bool {
        let (least, greatest) = self.eigenvalue_range();
        least >= -1e-12 * greatest.abs()
    }
}

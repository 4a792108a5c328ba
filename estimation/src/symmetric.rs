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

    /// Whether the matrix is positive semidefinite up to rounding, that is, positive definite once
    /// `1e-12` of its trace is added to the diagonal: the invariant of every covariance in this crate.
    ///
    /// Decided by elimination in a fixed order, because it decides whether an entry is admitted: every
    /// machine must decide alike.
    pub fn is_positive_semidefinite(self) -> bool {
        let [xx, yx, yy, zx, zy, zz] = self.0;
        let trace = xx + yy + zz;
        if trace == 0.0 {
            return self.0.iter().all(|entry| *entry == 0.0);
        }
        let shift = 1e-12 * trace;
        let d0 = xx + shift;
        let l10 = yx / d0;
        let d1 = yy + shift - l10 * yx;
        let l20 = zx / d0;
        let reduced = zy - l20 * yx;
        let d2 = zz + shift - l20 * zx - reduced * reduced / d1;
        d0 > 0.0 && d1 > 0.0 && d2 > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definiteness_agrees_with_the_eigenvalues() {
        // The independent route: eigenvalues by nalgebra.
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut definite, mut indefinite) = (0, 0);
        for _ in 0..2000 {
            let diagonal = [random() + 0.7, random() + 0.7, random() + 0.7];
            let matrix = Symmetric3([diagonal[0], random(), diagonal[1], random(), random(), diagonal[2]]);
            let least = nalgebra::SymmetricEigen::new(matrix.to_matrix()).eigenvalues.min();
            if least.abs() < 1e-9 {
                continue;
            }
            assert_eq!(matrix.is_positive_semidefinite(), least > 0.0, "{matrix:?}");
            if least > 0.0 { definite += 1 } else { indefinite += 1 }
        }
        assert!(definite > 100 && indefinite > 100);
    }

    #[test]
    fn singular_matrices_of_rounding_quality_pass_and_negative_ones_fail() {
        assert!(Symmetric3::zero().is_positive_semidefinite());
        assert!(Symmetric3::diagonal(1.0, 0.0, 0.0).is_positive_semidefinite());
        assert!(Symmetric3([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]).is_positive_semidefinite());
        assert!(!Symmetric3::diagonal(1.0, -1e-6, 0.0).is_positive_semidefinite());
        assert!(!Symmetric3([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]).is_positive_semidefinite());
        assert!(!Symmetric3::diagonal(f64::NAN, 1.0, 1.0).is_positive_semidefinite());
    }
}

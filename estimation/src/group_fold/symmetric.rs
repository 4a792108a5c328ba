//! Symmetric matrices of a group's size: what travels and what is accumulated.

use crate::geometry::{Square, ordered};

/// A symmetric matrix given by its lower triangle, in tangent order: m^2, m rad, rad^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetric<const D: usize> {
    // Row by row; what is above the diagonal is zero and never read.
    rows: [[f64; D]; D],
}

impl<const D: usize> Default for Symmetric<D> {
    fn default() -> Self {
        Self::zero()
    }
}

impl<const D: usize> Symmetric<D> {
    /// How many numbers the packed triangle has: 6 for SE(2), 21 for SE(3).
    pub const PACKED: usize = D * (D + 1) / 2;

    /// The zero matrix.
    pub const fn zero() -> Self {
        Self { rows: [[0.0; D]; D] }
    }

    /// A diagonal matrix.
    pub fn diagonal(entries: [f64; D]) -> Self {
        Self::from_fn(|row, column| if row == column { entries[row] } else { 0.0 })
    }

    /// Independent components from their standard deviations.
    pub fn from_sigmas(sigmas: [f64; D]) -> Self {
        Self::diagonal(sigmas.map(|sigma| sigma * sigma))
    }

    /// The lower triangle of `m`; what is above the diagonal is not read.
    pub fn from_lower(m: &Square<D>) -> Self {
        Self::from_fn(|row, column| m[(row, column)])
    }

    /// From [`Symmetric::packed`]; `None` if the length does not fit.
    pub fn from_packed(packed: &[f64]) -> Option<Self> {
        let at = |row: usize, column: usize| packed[row * (row + 1) / 2 + column];
        (packed.len() == Self::PACKED).then(|| Self::from_fn(at))
    }

    fn from_fn(entry: impl Fn(usize, usize) -> f64) -> Self {
        Self {
            rows: std::array::from_fn(|row| {
                std::array::from_fn(|column| if column <= row { entry(row, column) } else { 0.0 })
            }),
        }
    }

    /// The packed lower triangle, row after row.
    pub fn packed(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows.iter().enumerate().flat_map(|(row, entries)| entries[..=row].iter().copied())
    }

    /// One entry.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        self.rows[row.max(column)][row.min(column)]
    }

    /// The full matrix, exactly symmetric.
    pub fn to_matrix(&self) -> Square<D> {
        Square::<D>::from_fn(|row, column| self.entry(row, column))
    }

    /// `A self A^T`, summed in a fixed order.
    pub fn congruence(&self, a: &Square<D>) -> Self {
        let half = ordered::product(a, &self.to_matrix());
        Self::from_fn(|row, column| {
            let mut sum = 0.0;
            for k in 0..D {
                sum += half[(row, k)] * a[(column, k)];
            }
            sum
        })
    }

    /// Entry-wise sum.
    pub fn plus(&self, other: &Self) -> Self {
        Self::from_fn(|row, column| self.rows[row][column] + other.rows[row][column])
    }

    /// Entry-wise difference.
    pub fn minus(&self, other: &Self) -> Self {
        Self::from_fn(|row, column| self.rows[row][column] - other.rows[row][column])
    }

    /// Entry-wise product with a number.
    pub fn scaled(&self, factor: f64) -> Self {
        Self::from_fn(|row, column| self.rows[row][column] * factor)
    }

    /// Whether every entry is finite.
    pub fn is_finite(&self) -> bool {
        self.packed().all(f64::is_finite)
    }

    /// Whether the matrix is positive semidefinite up to rounding: positive definite once `1e-12` of its trace is added to
    /// the diagonal. Decided by elimination in a fixed order, so that every machine decides alike.
    pub fn is_positive_semidefinite(&self) -> bool {
        let trace = (0..D).fold(0.0, |sum, k| sum + self.rows[k][k]);
        if trace == 0.0 {
            return self.packed().all(|entry| entry == 0.0);
        }
        let shift = 1e-12 * trace;
        let shifted = Square::<D>::from_fn(|row, column| {
            self.entry(row, column) + if row == column { shift } else { 0.0 }
        });
        ordered::cholesky(D, &shifted).is_some()
    }
}

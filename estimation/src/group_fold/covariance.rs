//! The joint covariance of a team in a group of any size: packed lower triangle, one form of update (`docs/theory.md`,
//! section 4).
//!
//! Every loop is written out in a fixed order without reductions that a compiler or a run-time dispatch could reorder: the
//! same numbers come out of every processor.

use super::Symmetric;
use crate::geometry::{Square, Tangent, ordered};

/// A symmetric positive semidefinite matrix of `D` x `D` blocks, lower triangle by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TeamCovariance<const D: usize> {
    size: usize,
    lower: Vec<f64>,
}

/// A robot taking part in an update: its block and the derivative of the prediction with respect to its error.
pub(crate) struct Participant<const D: usize> {
    pub index: usize,
    pub jacobian: Square<D>,
}

/// An update made ready: `V = P H^T L^-T` and `u = L^-1 r` with `S = L L^T`.
pub(crate) struct Prepared<const D: usize> {
    // One column of V per row of the measurement, each as long as the state.
    columns: Vec<Vec<f64>>,
    whitened: Tangent<D>,
}

impl<const D: usize> Prepared<D> {
    /// Normalized innovation squared, `|L^-1 r|^2`.
    pub(crate) fn nis(&self) -> f64 {
        let mut sum = 0.0;
        for k in 0..self.columns.len() {
            sum += self.whitened[k] * self.whitened[k];
        }
        sum
    }

    /// `K r` for one robot.
    pub(crate) fn correction(&self, index: usize) -> Tangent<D> {
        let mut delta = Tangent::<D>::zeros();
        for (k, column) in self.columns.iter().enumerate() {
            for axis in 0..D {
                delta[axis] += column[D * index + axis] * self.whitened[k];
            }
        }
        delta
    }
}

impl<const D: usize> TeamCovariance<D> {
    /// Number of rows: `D` times the number of blocks.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The packed lower triangle, row after row.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// One entry.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let (row, column) = (row.max(column), row.min(column));
        self.lower[row * (row + 1) / 2 + column]
    }

    /// The block of robots `i` and `j`.
    pub fn block(&self, i: usize, j: usize) -> Square<D> {
        Square::<D>::from_fn(|row, column| self.entry(D * i + row, D * j + column))
    }

    /// The own block of a robot.
    pub fn diagonal(&self, index: usize) -> Symmetric<D> {
        Symmetric::from_lower(&self.block(index, index))
    }

    /// The whole matrix.
    pub fn to_dense(&self) -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(self.size, self.size, |row, column| self.entry(row, column))
    }

    pub(crate) fn grow(&mut self) {
        self.size += D;
        self.lower.resize(self.size * (self.size + 1) / 2, 0.0);
    }

    /// Marginalizes a robot: its rows and columns become zero.
    pub(crate) fn clear(&mut self, index: usize) {
        for row in 0..self.size {
            for column in 0..=row {
                if row / D == index || column / D == index {
                    self.lower[row * (row + 1) / 2 + column] = 0.0;
                }
            }
        }
    }

    pub(crate) fn add_diagonal(&mut self, index: usize, block: &Symmetric<D>) {
        for row in 0..D {
            for column in 0..=row {
                let at = D * index + row;
                self.lower[at * (at + 1) / 2 + D * index + column] += block.entry(row, column);
            }
        }
    }

    /// Prepares an update; `None` if the innovation covariance is not positive definite.
    pub(crate) fn prepare(
        &self,
        dimension: usize,
        innovation: &Tangent<D>,
        noise: &Symmetric<D>,
        participants: &[Participant<D>],
    ) -> Option<Prepared<D>> {
        let mut columns = vec![vec![0.0; self.size]; dimension];
        for (k, column) in columns.iter_mut().enumerate() {
            for Participant { index, jacobian } in participants {
                for axis in 0..D {
                    self.accumulate_column(D * index + axis, jacobian[(k, axis)], column);
                }
            }
        }
        // S = H P H^T + R from the participants' rows of P H^T, its lower triangle only.
        let mut s = Square::<D>::zeros();
        for row in 0..dimension {
            for column in 0..=row {
                let mut sum = noise.entry(row, column);
                for Participant { index, jacobian } in participants {
                    for axis in 0..D {
                        sum += jacobian[(row, axis)] * columns[column][D * index + axis];
                    }
                }
                s[(row, column)] = sum;
            }
        }
        let l = ordered::cholesky(dimension, &s)?;
        for row in 0..dimension {
            let (done, rest) = columns.split_at_mut(row);
            let column = &mut rest[0];
            for (k, earlier) in done.iter().enumerate() {
                let factor = l[(row, k)];
                for (entry, other) in column.iter_mut().zip(earlier) {
                    *entry -= factor * other;
                }
            }
            let pivot = l[(row, row)];
            for entry in column.iter_mut() {
                *entry /= pivot;
            }
        }
        Some(Prepared { columns, whitened: ordered::forward(dimension, &l, innovation) })
    }

    /// `column += factor * P[:, j]`.
    fn accumulate_column(&self, j: usize, factor: f64, column: &mut [f64]) {
        let row_start = j * (j + 1) / 2;
        for (entry, value) in column.iter_mut().zip(&self.lower[row_start..=row_start + j]) {
            *entry += factor * value;
        }
        for (row, entry) in column.iter_mut().enumerate().skip(j + 1) {
            *entry += factor * self.lower[row * (row + 1) / 2 + j];
        }
    }

    /// `P <- P - V V^T`, lower triangle, row by row, one column of `V` after the other.
    pub(crate) fn downdate(&mut self, prepared: &Prepared<D>) {
        let mut start = 0;
        for row in 0..self.size {
            let entries = &mut self.lower[start..=start + row];
            start += row + 1;
            for column in &prepared.columns {
                let along = column[row];
                for (entry, other) in entries.iter_mut().zip(column) {
                    *entry -= along * other;
                }
            }
        }
    }

    /// `P <- P + d d^T`.
    #[cfg(test)]
    pub(crate) fn add_outer_for_tests(&mut self, d: &[f64]) {
        for row in 0..self.size {
            for column in 0..=row {
                self.lower[row * (row + 1) / 2 + column] += d[row] * d[column];
            }
        }
    }
}

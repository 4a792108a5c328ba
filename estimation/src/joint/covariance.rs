//! The joint covariance: a packed lower triangle, and the one form of update it ever undergoes.
//!
//! Every loop is written out in a fixed order without reductions that a compiler or a run-time dispatch
//! could reorder: the same numbers come out of every processor.

use super::Participant;
use crate::geometry::ordered::{cholesky, forward};
use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;

/// A symmetric positive semidefinite matrix of 3x3 blocks, lower triangle by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointCovariance {
    size: usize,
    lower: Vec<f64>,
}

/// An update made ready: `V = P H^T L^-T` and `u = L^-1 r` with `S = L L^T`.
pub(crate) struct Prepared {
    dimension: usize,
    // One column of V per row of the measurement, each as long as the state.
    columns: [Vec<f64>; 3],
    whitened: Vector3,
    factor: Matrix3,
}

impl Prepared {
    /// Normalized innovation squared, `|L^-1 r|^2`.
    pub(crate) fn nis(&self) -> f64 {
        let mut sum = 0.0;
        for k in 0..self.dimension {
            sum += self.whitened[k] * self.whitened[k];
        }
        sum
    }

    /// Logarithm of the density of the innovation, `-(NIS + log det(2 pi S)) / 2`.
    pub(crate) fn log_density(&self) -> f64 {
        let mut half_log_determinant = 0.0;
        for k in 0..self.dimension {
            half_log_determinant += libm::log(self.factor[(k, k)]);
        }
        #[allow(clippy::cast_precision_loss, reason = "1, 2 or 3")]
        let dimension = self.dimension as f64;
        -0.5 * self.nis() - half_log_determinant - 0.5 * dimension * libm::log(std::f64::consts::TAU)
    }

    /// Probability that the measurement is not of nothing, by the logarithm of the odds that it is.
    pub(crate) fn weight_in_clutter(&self, odds: f64) -> f64 {
        1.0 / (1.0 + libm::exp(odds - self.log_density()))
    }

    /// With `V` multiplied by a factor.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let columns =
            self.columns.each_ref().map(|column| column.iter().map(|entry| entry * factor).collect());
        Self { columns, ..*self }
    }

    /// `K r` for one robot.
    pub(crate) fn correction(&self, index: usize) -> Vector3 {
        let mut delta = Vector3::zeros();
        for k in 0..self.dimension {
            for axis in 0..3 {
                delta[axis] += self.columns[k][3 * index + axis] * self.whitened[k];
            }
        }
        delta
    }

    /// The backward pass of the smoother over this update: `y <- y - H^T L^-T (V^T y + u)`, where the state before the
    /// update is corrected by `-P y` (`bierman1973`).
    pub(crate) fn take_back(&self, participants: &[Participant], adjoint: &mut [f64]) {
        let mut along = Vector3::zeros();
        for k in 0..self.dimension {
            let mut sum = self.whitened[k];
            for (a, b) in self.columns[k].iter().zip(adjoint.iter()) {
                sum += a * b;
            }
            along[k] = sum;
        }
        for row in (0..self.dimension).rev() {
            let mut sum = along[row];
            for k in row + 1..self.dimension {
                sum -= self.factor[(k, row)] * along[k];
            }
            along[row] = sum / self.factor[(row, row)];
        }
        for Participant { index, jacobian } in participants {
            for axis in 0..3 {
                for k in 0..self.dimension {
                    adjoint[3 * index + axis] -= jacobian[(k, axis)] * along[k];
                }
            }
        }
    }
}

impl JointCovariance {
    /// From a packed lower triangle; `None` if its length does not fit.
    pub(crate) fn from_lower(size: usize, lower: Vec<f64>) -> Option<Self> {
        (lower.len() == size * (size + 1) / 2).then_some(Self { size, lower })
    }

    /// Number of rows: three times the number of robots.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The packed lower triangle, row after row.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// One entry.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let (row, column) = if row >= column { (row, column) } else { (column, row) };
        self.lower[row * (row + 1) / 2 + column]
    }

    /// The 3x3 block of robots `i` and `j`.
    pub fn block(&self, i: usize, j: usize) -> Matrix3 {
        Matrix3::from_fn(|row, column| self.entry(3 * i + row, 3 * j + column))
    }

    /// The whole matrix, row-major.
    pub fn to_dense(&self) -> Vec<Vec<f64>> {
        (0..self.size).map(|row| (0..self.size).map(|column| self.entry(row, column)).collect()).collect()
    }

    /// One row, all columns.
    pub(crate) fn row(&self, row: usize) -> Vec<f64> {
        (0..self.size).map(|column| self.entry(row, column)).collect()
    }

    pub(crate) fn grow(&mut self) {
        self.size += 3;
        self.lower.resize(self.size * (self.size + 1) / 2, 0.0);
    }

    /// Marginalizes a robot: its rows and columns become zero.
    pub(crate) fn clear(&mut self, index: usize) {
        for row in 0..self.size {
            for column in 0..=row {
                if row / 3 == index || column / 3 == index {
                    self.lower[row * (row + 1) / 2 + column] = 0.0;
                }
            }
        }
    }

    pub(crate) fn set_diagonal(&mut self, index: usize, block: Symmetric3) {
        self.for_diagonal(index, |entry, value| *entry = value, block);
    }

    pub(crate) fn add_diagonal(&mut self, index: usize, block: Symmetric3) {
        self.for_diagonal(index, |entry, value| *entry += value, block);
    }

    /// Sets the 3x3 block of two different robots, and its mirror image with it.
    pub(crate) fn set_cross(&mut self, i: usize, j: usize, block: &Matrix3) {
        for row in 0..3 {
            for column in 0..3 {
                let (a, b) = (3 * i + row, 3 * j + column);
                let (a, b) = if a >= b { (a, b) } else { (b, a) };
                self.lower[a * (a + 1) / 2 + b] = block[(row, column)];
            }
        }
    }

    fn for_diagonal(&mut self, index: usize, change: impl Fn(&mut f64, f64), block: Symmetric3) {
        let mut values = block.0.into_iter();
        for row in 3 * index..3 * index + 3 {
            for column in 3 * index..=row {
                if let Some(value) = values.next() {
                    change(&mut self.lower[row * (row + 1) / 2 + column], value);
                }
            }
        }
    }

    /// `P_ii <- F P_ii F^T`, `P_ij <- F P_ij` for one robot.
    pub(crate) fn transform(&mut self, index: usize, f: &Matrix3) {
        for other in (0..self.size / 3).filter(|other| *other != index) {
            let block = f * self.block(index, other);
            self.set_cross(index, other, &block);
        }
        let own = Symmetric3::from_lower(&self.block(index, index)).congruence(f);
        self.set_diagonal(index, own);
    }

    /// The error of block `i` moves with that of block `m`: `x_i <- x_i + A x_m`.
    pub(crate) fn couple(&mut self, i: usize, m: usize, a: &Matrix3) {
        let with_m = self.block(m, i);
        let own = a * with_m;
        let grown = Symmetric3::from_lower(&(own + own.transpose()))
            .plus(Symmetric3::from_lower(&self.block(m, m)).congruence(a));
        for other in (0..self.size / 3).filter(|other| *other != i) {
            let block = self.block(i, other) + a * self.block(m, other);
            self.set_cross(i, other, &block);
        }
        self.add_diagonal(i, grown);
    }

    /// `P <- P - V V^T`, by the columns of `V`.
    pub(crate) fn downdate_by(&mut self, columns: &[Vec<f64>]) {
        for column in columns {
            self.add_outer(column, -1.0);
        }
    }

    /// `P <- P + U S U^T`, by the rows of `U`.
    pub(crate) fn add_through(&mut self, rows: &[Vector3], s: &Matrix3) {
        let mut start = 0;
        for (row, u) in rows.iter().enumerate() {
            let along = s * u;
            for (entry, other) in self.lower[start..=start + row].iter_mut().zip(rows) {
                *entry += along.x * other.x + along.y * other.y + along.z * other.z;
            }
            start += row + 1;
        }
    }

    /// The errors of the `moved` blocks become `tau + A x`, with the covariance `spread` of `tau` and `cross` of `tau` with
    /// every row before.
    pub(crate) fn move_blocks(&mut self, moved: &[bool], a: &Matrix3, spread: &Matrix3, cross: &[Vector3]) {
        let with_tau = |block: usize| {
            Matrix3::from_columns(&[cross[3 * block], cross[3 * block + 1], cross[3 * block + 2]])
        };
        for i in 0..moved.len() {
            for j in 0..i {
                let block = self.block(i, j);
                let changed = match (moved[i], moved[j]) {
                    (false, false) => continue,
                    (true, false) => with_tau(j) + a * block,
                    (false, true) => with_tau(i).transpose() + block * a.transpose(),
                    (true, true) => {
                        spread
                            + with_tau(j) * a.transpose()
                            + a * with_tau(i).transpose()
                            + a * block * a.transpose()
                    }
                };
                self.set_cross(i, j, &changed);
            }
            if moved[i] {
                let own = a * with_tau(i).transpose();
                let block = Symmetric3::from_lower(&self.block(i, i)).congruence(a);
                let grown = Symmetric3::from_lower(&(own + own.transpose() + spread));
                self.set_diagonal(i, block.plus(grown));
            }
        }
    }

    /// `P <- P + factor d d^T`.
    pub(crate) fn add_outer(&mut self, d: &[f64], factor: f64) {
        let mut start = 0;
        for row in 0..self.size {
            let along = d[row] * factor;
            for (entry, other) in self.lower[start..=start + row].iter_mut().zip(d) {
                *entry += along * other;
            }
            start += row + 1;
        }
    }

    /// Prepares an update; `None` if the innovation covariance is not positive definite.
    pub(crate) fn prepare(
        &self,
        dimension: usize,
        innovation: &Vector3,
        noise: &Matrix3,
        participants: &[Participant],
    ) -> Option<Prepared> {
        let mut columns: [Vec<f64>; 3] = Default::default();
        for (k, column) in columns.iter_mut().enumerate().take(dimension) {
            *column = vec![0.0; self.size];
            for Participant { index, jacobian } in participants {
                for axis in 0..3 {
                    self.accumulate_column(3 * index + axis, jacobian[(k, axis)], column);
                }
            }
        }
        // S = H P H^T + R from the participants' rows of P H^T, its lower triangle only.
        let mut s = Matrix3::zeros();
        for row in 0..dimension {
            for column in 0..=row {
                let mut sum = noise[(row, column)];
                for Participant { index, jacobian } in participants {
                    for axis in 0..3 {
                        sum += jacobian[(row, axis)] * columns[column][3 * index + axis];
                    }
                }
                s[(row, column)] = sum;
            }
        }
        let l = cholesky(dimension, &s)?;
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
        let whitened = forward(dimension, &l, innovation);
        Some(Prepared { dimension, columns, whitened, factor: l })
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

    /// `P <- P - V V^T`, lower triangle, row by row.
    pub(crate) fn downdate(&mut self, prepared: &Prepared) {
        let [a, b, c] = &prepared.columns;
        let mut start = 0;
        for row in 0..self.size {
            let entries = &mut self.lower[start..=start + row];
            start += row + 1;
            match prepared.dimension {
                1 => {
                    let ar = a[row];
                    for (entry, x) in entries.iter_mut().zip(a) {
                        *entry -= ar * x;
                    }
                }
                2 => {
                    let (ar, br) = (a[row], b[row]);
                    for ((entry, x), y) in entries.iter_mut().zip(a).zip(b) {
                        *entry = *entry - ar * x - br * y;
                    }
                }
                _ => {
                    let (ar, br, cr) = (a[row], b[row], c[row]);
                    for (((entry, x), y), z) in entries.iter_mut().zip(a).zip(b).zip(c) {
                        *entry = *entry - ar * x - br * y - cr * z;
                    }
                }
            }
        }
    }
}

/// `r^T S^-1 r` of the leading `dimension` rows; infinite if `S`, given by its lower triangle, is not positive definite.
pub(crate) fn squared(dimension: usize, r: &Vector3, s: &Matrix3) -> f64 {
    let Some(l) = cholesky(dimension, s) else { return f64::INFINITY };
    let whitened = forward(dimension, &l, r);
    let mut square = 0.0;
    for k in 0..dimension {
        square += whitened[k] * whitened[k];
    }
    square
}

//! Small dense matrices, with every loop in one order.

use crate::geometry::{Matrix3, Vector3};

/// A lower Cholesky factor.
pub(super) struct Factor(Vec<Vec<f64>>);

impl Factor {
    /// Of a symmetric matrix given by its lower triangle; `None` if it is not positive definite.
    pub(super) fn new(mut w: Vec<Vec<f64>>) -> Option<Self> {
        for row in 0..w.len() {
            for column in 0..=row {
                let mut sum = w[row][column];
                for (a, b) in w[row].iter().zip(&w[column]).take(column) {
                    sum -= a * b;
                }
                if row == column {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    w[row][row] = sum.sqrt();
                } else {
                    w[row][column] = sum / w[column][column];
                }
            }
        }
        Some(Self(w))
    }

    /// `L^-1 b`.
    pub(super) fn forward(&self, b: &[f64]) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(b.len());
        for (row, value) in b.iter().enumerate() {
            let mut sum = *value;
            for (k, earlier) in solved.iter().enumerate() {
                sum -= self.0[row][k] * earlier;
            }
            solved.push(sum / self.0[row][row]);
        }
        solved
    }

    /// `A L^-T`, both by columns.
    pub(super) fn right(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut solved: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
        for (row, column) in columns.iter().enumerate() {
            let mut next = column.clone();
            for (k, earlier) in solved.iter().enumerate() {
                let factor = self.0[row][k];
                for (entry, value) in next.iter_mut().zip(earlier) {
                    *entry -= factor * value;
                }
            }
            for entry in &mut next {
                *entry /= self.0[row][row];
            }
            solved.push(next);
        }
        solved
    }
}

pub(super) fn spread(dimension: usize, m: &Matrix3) -> Vec<Vec<f64>> {
    (0..dimension).map(|row| (0..dimension).map(|column| m[(row, column)]).collect()).collect()
}

pub(super) fn entries(dimension: usize, v: &Vector3) -> Vec<f64> {
    (0..dimension).map(|k| v[k]).collect()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in a.iter().zip(b) {
        sum += x * y;
    }
    sum
}

/// Whether an information matrix has all three directions, beyond rounding.
fn factor3(information: &Matrix3) -> Option<Factor> {
    let scale = information[(0, 0)].max(information[(1, 1)]).max(information[(2, 2)]);
    let factor = Factor::new(spread(3, information))?;
    let weakest = factor.0.iter().enumerate().map(|(k, row)| row[k]).fold(f64::INFINITY, f64::min);
    (weakest * weakest > 1e-9 * scale).then_some(factor)
}

pub(super) fn solve3(information: &Matrix3, along: &Vector3) -> Option<Vector3> {
    let inverse = inverse3(information)?;
    Some(inverse * along)
}

pub(super) fn inverse3(information: &Matrix3) -> Option<Matrix3> {
    let factor = factor3(information)?;
    let columns = [0, 1, 2].map(|axis| {
        let mut unit = vec![0.0; 3];
        unit[axis] = 1.0;
        factor.forward(&unit)
    });
    Some(Matrix3::from_fn(|a, b| dot(&columns[a], &columns[b])))
}

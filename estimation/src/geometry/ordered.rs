//! Products of small matrices, summed in one order.
//!
//! The general product of `nalgebra` picks a kernel for the processor at run time once all sizes exceed 5, and a kernel
//! may fuse multiplication and addition (`docs/decisions/0003-arithmetic-with-equal-bits.md`). Blocks of 6 x 6 are such.

use nalgebra::{SMatrix, SVector};

/// `A B`; each entry is summed in ascending order of the inner index.
pub fn product<const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<f64, R, K>,
    b: &SMatrix<f64, K, C>,
) -> SMatrix<f64, R, C> {
    let mut result = SMatrix::<f64, R, C>::zeros();
    for row in 0..R {
        for column in 0..C {
            let mut sum = 0.0;
            for k in 0..K {
                sum += a[(row, k)] * b[(k, column)];
            }
            result[(row, column)] = sum;
        }
    }
    result
}

/// `A v`; each entry is summed in ascending order.
pub fn times<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, v: &SVector<f64, C>) -> SVector<f64, R> {
    let mut result = SVector::<f64, R>::zeros();
    for row in 0..R {
        let mut sum = 0.0;
        for column in 0..C {
            sum += a[(row, column)] * v[column];
        }
        result[row] = sum;
    }
    result
}

/// Lower Cholesky factor of the leading `dimension` rows of a symmetric matrix given by its lower triangle; `None` if they
/// are not positive definite. The rest of the factor is zero.
pub fn cholesky<const N: usize>(dimension: usize, s: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    let mut l = SMatrix::<f64, N, N>::zeros();
    for row in 0..dimension.min(N) {
        for column in 0..=row {
            let mut sum = s[(row, column)];
            for k in 0..column {
                sum -= l[(row, k)] * l[(column, k)];
            }
            if row == column {
                if !(sum > 0.0 && sum.is_finite()) {
                    return None;
                }
                l[(row, row)] = sum.sqrt();
            } else {
                l[(row, column)] = sum / l[(column, column)];
            }
        }
    }
    Some(l)
}

/// `L^-1 v` of the leading `dimension` rows of a lower triangular `L` without zeros on its diagonal; zero beyond.
pub fn forward<const N: usize>(
    dimension: usize,
    l: &SMatrix<f64, N, N>,
    v: &SVector<f64, N>,
) -> SVector<f64, N> {
    let mut solved = SVector::<f64, N>::zeros();
    for row in 0..dimension.min(N) {
        let mut sum = v[row];
        for k in 0..row {
            sum -= l[(row, k)] * solved[k];
        }
        solved[row] = sum / l[(row, row)];
    }
    solved
}

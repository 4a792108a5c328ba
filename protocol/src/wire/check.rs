//! Checks shared by all messages.

use std::f64::consts::PI;

use pleiad_estimation::Pose2;
use pleiad_estimation::fact::Noise;
use pleiad_estimation::symmetric::Symmetric3;

use crate::error::ProtocolError;
use crate::limits;

/// A pose on the wire: x, y in metres, yaw in radians.
pub type WirePose = [f64; 3];
/// A symmetric matrix on the wire: its lower triangle by rows.
pub type WireSymmetric = [f64; 6];

/// Relative tolerance of definiteness, as in the invariant of the estimator's covariances.
const TOLERANCE: f64 = 1e-12;

/// A finite number of sane size.
pub fn number(field: &str, found: f64) -> Result<f64, ProtocolError> {
    if found.abs() <= limits::MAGNITUDE {
        Ok(found)
    } else {
        Err(ProtocolError::Number { field: field.into(), found, expected: "a finite number within +-1e15" })
    }
}

/// Two numbers.
pub fn pair(field: &str, found: [f64; 2]) -> Result<[f64; 2], ProtocolError> {
    Ok([number(field, found[0])?, number(field, found[1])?])
}

/// The parts of a pose.
pub fn wire_pose(pose: &Pose2) -> WirePose {
    [pose.x_m(), pose.y_m(), pose.yaw_rad()]
}

/// A pose whose yaw needs no wrapping: wrapping here would change the bits that were hashed.
pub fn pose(field: &str, [x_m, y_m, yaw_rad]: WirePose) -> Result<Pose2, ProtocolError> {
    let inside = |part: ProtocolError| part.within(field);
    number("x_m", x_m).map_err(inside)?;
    number("y_m", y_m).map_err(inside)?;
    if yaw_rad > -PI && yaw_rad <= PI {
        Ok(Pose2::new(x_m, y_m, yaw_rad))
    } else {
        Err(inside(ProtocolError::Number {
            field: "yaw_rad".into(),
            found: yaw_rad,
            expected: "an angle in (-pi, pi]",
        }))
    }
}

/// A positive semidefinite matrix (up to rounding: `eig_min >= -1e-12 trace`).
pub fn covariance(field: &str, found: WireSymmetric) -> Result<Symmetric3, ProtocolError> {
    found.iter().try_for_each(|entry| number(field, *entry).map(drop))?;
    if found.iter().all(|entry| *entry == 0.0) || has_cholesky(found, 3, TOLERANCE, 0.0) {
        Ok(Symmetric3(found))
    } else {
        Err(ProtocolError::Covariance { field: field.into(), found, expected: "positive semidefinite" })
    }
}

/// A positive definite noise of dimension 1 to 3 with nothing beyond its dimension. Components that
/// determine one another to within rounding (correlation within about 1e-12 of 1) count as singular.
pub fn noise(field: &str, dimension: u8, lower: [f64; 6]) -> Result<Noise, ProtocolError> {
    if !(1..=3).contains(&dimension) {
        let expected = "1, 2 or 3";
        return Err(ProtocolError::Dimension { field: field.into(), found: dimension, expected });
    }
    lower.iter().try_for_each(|entry| number(field, *entry).map(drop))?;
    let inside = usize::from(dimension) * (usize::from(dimension) + 1) / 2;
    let expected = if lower[inside..].iter().any(|entry| *entry != 0.0) {
        "zero beyond its dimension"
    } else if has_cholesky(lower, usize::from(dimension), 0.0, TOLERANCE) {
        return Ok(Noise { dimension, lower });
    } else {
        "positive definite"
    };
    Err(ProtocolError::Covariance { field: field.into(), found: lower, expected })
}

/// Whether `A / trace(A) + shift I` has a Cholesky factor whose squared pivots exceed `margin` times the
/// diagonal. Unlike an eigenvalue iteration it ends after the same few steps whatever the input.
fn has_cholesky(lower: [f64; 6], dimension: usize, shift: f64, margin: f64) -> bool {
    let at = |row: usize, column: usize| lower[row * (row + 1) / 2 + column];
    let trace: f64 = (0..dimension).map(|i| at(i, i)).sum();
    let mut factor = [[0.0; 3]; 3];
    for row in 0..dimension {
        for column in 0..=row {
            let dot: f64 = (0..column).map(|k| factor[row][k] * factor[column][k]).sum();
            let rest = at(row, column) / trace - dot;
            if row > column {
                factor[row][column] = rest / factor[column][column];
            } else if trace > 0.0 && rest + shift > margin * (at(row, row) / trace) {
                factor[row][row] = (rest + shift).sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

/// A text that fits, cut at a character where it does not.
pub fn cut(text: &str) -> &str {
    &text[..text.floor_char_boundary(limits::TEXT_BYTES)]
}

/// A text that fits.
pub fn text(field: &str, found: String) -> Result<String, ProtocolError> {
    if found.len() > limits::TEXT_BYTES {
        let (found, limit) = (found.len() as u64, limits::TEXT_BYTES as u64);
        return Err(ProtocolError::TooMany { field: field.into(), found, limit });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn semidefiniteness_agrees_with_known_spectra() {
        // Eigenvalues by construction: diagonals; the rank-one v v^T; and [[1, r], [r, 1]] with 1 +- r.
        let accepted = [
            [0.0; 6],
            [1.0, 0.0, 2.0, 0.0, 0.0, 3.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 3.0],
            [1.0, 2.0, 4.0, -3.0, -6.0, 9.0],
            [1e-12, 1e-6, 1.0, 0.0, 0.0, 0.0],
            [1e-300, 0.0, 1e-300, 0.0, 0.0, 1e-300],
            [1e15, 0.0, 1e-15, 0.0, 0.0, 1.0],
            [1.0, 1.0 + 1e-13, 1.0, 0.0, 0.0, 0.0],
            [-1e-14, 0.0, 1.0, 0.0, 0.0, 1.0],
        ];
        for found in accepted {
            assert_eq!(covariance("c", found), Ok(Symmetric3(found)), "{found:?}");
        }
        let refused = [
            [1.0, 0.0, 2.0, 0.0, 0.0, -1e-6],
            [-1.0, 0.0, -1.0, 0.0, 0.0, -1.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, -1e-20],
            [0.0, 1e-30, 0.0, 0.0, 0.0, 0.0],
            [1.0, 1.0 + 1e-9, 1.0, 0.0, 0.0, 0.0],
            [1.0, 2.0, 4.0, -3.0, 6.0, 9.0],
            [0.0, 1e-3, 1.0, 0.0, 0.0, 1.0],
        ];
        for found in refused {
            let expected = "positive semidefinite";
            let error = ProtocolError::Covariance { field: "c".into(), found, expected };
            assert_eq!(covariance("c", found), Err(error), "{found:?}");
        }
    }

    #[test]
    fn noise_must_be_definite_in_its_dimension_and_zero_beyond() {
        assert!(noise("n", 1, [0.01, 0.0, 0.0, 0.0, 0.0, 0.0]).is_ok());
        assert!(noise("n", 2, [1e-8, 0.0, 1e4, 0.0, 0.0, 0.0]).is_ok());
        assert!(noise("n", 3, [1.0, 0.9, 1.0, 0.9, 0.9, 1.0]).is_ok());
        let covariance = |dimension, found, expected| {
            let error = ProtocolError::Covariance { field: "n".into(), found, expected };
            assert_eq!(noise("n", dimension, found), Err(error));
        };
        covariance(1, [0.0; 6], "positive definite");
        covariance(2, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "positive definite");
        covariance(2, [1.0, 0.0, -1.0, 0.0, 0.0, 0.0], "positive definite");
        covariance(3, [1.0, 0.0, 1.0, 0.0, 0.0, 0.0], "positive definite");
        covariance(1, [1.0, 0.0, 1.0, 0.0, 0.0, 0.0], "zero beyond its dimension");
        for found in [0, 4, 255] {
            let error = ProtocolError::Dimension { field: "n".into(), found, expected: "1, 2 or 3" };
            assert_eq!(noise("n", found, [1.0, 0.0, 1.0, 0.0, 0.0, 1.0]), Err(error));
        }
    }

    #[test]
    fn numbers_beyond_any_robot_are_refused() {
        for found in [f64::INFINITY, f64::NEG_INFINITY, 1.1e15, f64::MAX] {
            let expected = "a finite number within +-1e15";
            assert_eq!(number("x", found), Err(ProtocolError::Number { field: "x".into(), found, expected }));
        }
        assert!(matches!(number("x", f64::NAN), Err(ProtocolError::Number { found, .. }) if found.is_nan()));
        assert_eq!(number("x", -0.0).map(f64::to_bits), Ok((-0.0_f64).to_bits()));
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        let long = "é".repeat(limits::TEXT_BYTES);
        assert_eq!(cut(&long).len(), limits::TEXT_BYTES);
        assert_eq!(cut(&format!("a{long}")).len(), limits::TEXT_BYTES - 1);
        assert_eq!(cut("short"), "short");
        let error = ProtocolError::TooMany { field: "t".into(), found: 513, limit: 512 };
        assert_eq!(text("t", "x".repeat(513)), Err(error));
    }
}

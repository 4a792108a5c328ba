//! Measurement models of the reference filters: residuals and Jacobians, each written out for both
//! error forms.
//!
//! The error is `X = exp(xi) X_hat` (invariant) or `(p, yaw) = (p_hat, yaw_hat) + e` (additive), and
//! every residual obeys `r = H error + n` to first order. Formulas: `docs/theory.md`, measurements.

use nalgebra::{DMatrix, DVector, Matrix2};

use crate::Pose2;
pub use crate::joint::ErrorForm;

use crate::fact::{Absolute, Quantity};
use crate::geometry::{Matrix3, Vector2};
use crate::sample::Relative;

/// What became of a fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// A boot entry, obeyed.
    Boot,
    /// The prior that placed a robot.
    Placed,
    /// Used, with this normalized innovation squared.
    Used {
        /// `r^T S^-1 r`.
        nis: f64,
        /// Length of `r`.
        dimension: usize,
    },
    /// Turned away by the gate.
    Rejected {
        /// `r^T S^-1 r`.
        nis: f64,
        /// Length of `r`.
        dimension: usize,
        /// What it exceeded.
        threshold: f64,
    },
    /// Without effect on the estimate, or on nothing but the noise of its participants.
    Skipped(SkipReason),
}

impl Outcome {
    /// NIS and dimension, of a fact that came before the gate.
    pub fn nis(&self) -> Option<(f64, usize)> {
        match self {
            Self::Used { nis, dimension } | Self::Rejected { nis, dimension, .. } => Some((*nis, *dimension)),
            Self::Boot | Self::Placed | Self::Skipped(_) => None,
        }
    }
}

/// Why a fact was skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkipReason {
    /// A participant has no place in the map yet.
    Unplaced,
    /// A participant's state lies on the trajectory of a boot that is not its current one.
    OtherBoot,
    /// A full pose relative to a landmark, which has no heading.
    LandmarkHasNoHeading,
    /// The predicted distance is under 1 mm: range and bearing have no derivative there.
    TooClose,
    /// The stated noise has another dimension than the measurement.
    NoiseDimension,
    /// The innovation covariance is not positive definite.
    Indefinite,
    /// A robot that observes itself, or a relative measurement without its second half.
    Malformed,
}

/// A measurement linearized at an estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearized {
    /// Measured less predicted; angles wrapped.
    pub residual: DVector<f64>,
    /// Derivative of the measurement by the observer's error, m x 3.
    pub d_measurement_d_observer: DMatrix<f64>,
    /// Derivative of the measurement by the observed robot's error, m x 3; `None` against the map.
    pub d_measurement_d_observed: Option<DMatrix<f64>>,
}

/// Below this predicted distance range and bearing are not linearized.
const LEAST_DISTANCE_M: f64 = 1e-3;

/// `J = [0 -1; 1 0]`.
pub(super) fn quarter_turn() -> Matrix2<f64> {
    Matrix2::new(0.0, -1.0, 1.0, 0.0)
}

/// The rotation matrix of a pose.
pub(super) fn rotation(pose: &Pose2) -> Matrix2<f64> {
    let (sin, cos) = pose.yaw_rad().sin_cos();
    Matrix2::new(cos, -sin, sin, cos)
}

/// `Ad_X = [R, -J p; 0, 1]`.
pub(super) fn adjoint(pose: &Pose2) -> Matrix3 {
    blocks(&rotation(pose), &(-quarter_turn() * pose.position()))
}

/// `M = [I, J p; 0, 1]`, which takes `xi` to the additive error.
pub(super) fn additive_from_invariant(pose: &Pose2) -> Matrix3 {
    blocks(&Matrix2::identity(), &(quarter_turn() * pose.position()))
}

/// What takes a perturbation `w` in the body frame (`X exp(w)`) to the error at `X`: `Ad_X` or
/// `diag(R, 1)`.
pub(super) fn error_from_body(form: ErrorForm, pose: &Pose2) -> Matrix3 {
    match form {
        ErrorForm::Invariant => adjoint(pose),
        ErrorForm::Additive => blocks(&rotation(pose), &Vector2::zeros()),
    }
}

/// `[a, b; 0, 1]`.
pub(super) fn blocks(a: &Matrix2<f64>, b: &Vector2) -> Matrix3 {
    Matrix3::new(a[(0, 0)], a[(0, 1)], b.x, a[(1, 0)], a[(1, 1)], b.y, 0.0, 0.0, 1.0)
}

/// An angle in `(-pi, pi]`, by the standard library.
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    let (sin, cos) = angle_rad.sin_cos();
    sin.atan2(cos)
}

/// Linearizes a measurement at the poses of its participants.
///
/// # Errors
/// Why the measurement cannot be linearized there.
pub fn linearize(
    form: ErrorForm,
    quantity: &Quantity,
    observer: &Pose2,
    observed: Option<&Pose2>,
) -> Result<Linearized, SkipReason> {
    match (quantity, observed) {
        (Quantity::Robot { relative: Relative::Pose(measured), .. }, Some(observed)) => {
            Ok(relative_pose(form, measured, observer, observed))
        }
        (Quantity::Robot { relative, .. }, Some(observed)) => {
            let (residual, d_z) = point_in_body(relative, observer, &observed.position())?;
            let turn_back = rotation(observer).transpose();
            let lever = match form {
                ErrorForm::Invariant => quarter_turn() * observed.position(),
                ErrorForm::Additive => Vector2::zeros(),
            };
            Ok(Linearized {
                residual,
                d_measurement_d_observer: &d_z * d_point_d_observer(form, observer, &observed.position()),
                d_measurement_d_observed: Some(&d_z * two_by_three(&turn_back, &(turn_back * lever))),
            })
        }
        (Quantity::Robot { .. }, None) | (Quantity::Feature { .. }, _) => Err(SkipReason::Malformed),
        (Quantity::Landmark { relative: Relative::Pose(_), .. }, _) => Err(SkipReason::LandmarkHasNoHeading),
        (Quantity::Landmark { relative, position_m: [x, y], .. }, _) => {
            let place = Vector2::new(*x, *y);
            let (residual, d_z) = point_in_body(relative, observer, &place)?;
            Ok(Linearized {
                residual,
                d_measurement_d_observer: d_z * d_point_d_observer(form, observer, &place),
                d_measurement_d_observed: None,
            })
        }
        (Quantity::Absolute(absolute), _) => Ok(against_map(form, absolute, observer)),
    }
}

/// `r = log(Z_hat^-1 z)` with `Z_hat = X_a^-1 X_b`; the noise is in that right frame. Invariant:
/// `H_b = Ad_{X_b^-1} = -H_a`; additive: those times `M^-1`, multiplied out.
fn relative_pose(form: ErrorForm, measured: &Pose2, observer: &Pose2, observed: &Pose2) -> Linearized {
    let predicted = observer.inverse().compose(observed);
    let residual = predicted.inverse().compose(measured).log();
    let (by_observer, by_observed) = match form {
        ErrorForm::Invariant => {
            let h = adjoint(&observed.inverse());
            (-h, h)
        }
        ErrorForm::Additive => {
            let turn_back = rotation(observed).transpose();
            let baseline = observed.position() - observer.position();
            (
                -blocks(&turn_back, &(turn_back * quarter_turn() * baseline)),
                blocks(&turn_back, &Vector2::zeros()),
            )
        }
    };
    Linearized {
        residual: DVector::from_column_slice(residual.as_slice()),
        d_measurement_d_observer: dynamic(&by_observer),
        d_measurement_d_observed: Some(dynamic(&by_observed)),
    }
}

/// Residual of a measurement of the point `p` seen from `observer`, and its derivative by
/// `z = R_a^T (p - p_a)`, m x 2.
fn point_in_body(
    relative: &Relative,
    observer: &Pose2,
    point: &Vector2,
) -> Result<(DVector<f64>, DMatrix<f64>), SkipReason> {
    let z = rotation(observer).transpose() * (point - observer.position());
    let distance = z.norm();
    let bearing = z.y.atan2(z.x);
    let d_range = [z.x / distance, z.y / distance];
    let d_bearing = [-z.y / (distance * distance), z.x / (distance * distance)];
    let close = distance < LEAST_DISTANCE_M;
    match relative {
        Relative::Pose(_) => Err(SkipReason::Malformed),
        Relative::Position { x_m, y_m } => {
            Ok((DVector::from_vec(vec![x_m - z.x, y_m - z.y]), DMatrix::identity(2, 2)))
        }
        _ if close => Err(SkipReason::TooClose),
        Relative::Range { range_m } => {
            Ok((DVector::from_vec(vec![range_m - distance]), DMatrix::from_row_slice(1, 2, &d_range)))
        }
        Relative::Bearing { bearing_rad } => Ok((
            DVector::from_vec(vec![wrapped(bearing_rad - bearing)]),
            DMatrix::from_row_slice(1, 2, &d_bearing),
        )),
        Relative::RangeBearing { range_m, bearing_rad } => Ok((
            DVector::from_vec(vec![range_m - distance, wrapped(bearing_rad - bearing)]),
            DMatrix::from_row_slice(2, 2, &[d_range[0], d_range[1], d_bearing[0], d_bearing[1]]),
        )),
    }
}

/// Derivative of `z = R_a^T (p - p_a)` by the observer's error: `-R_a^T [I, J p]` (invariant) or
/// `-R_a^T [I, J (p - p_a)]` (additive).
fn d_point_d_observer(form: ErrorForm, observer: &Pose2, point: &Vector2) -> DMatrix<f64> {
    let turn_back = rotation(observer).transpose();
    let lever = match form {
        ErrorForm::Invariant => *point,
        ErrorForm::Additive => point - observer.position(),
    };
    -two_by_three(&turn_back, &(turn_back * quarter_turn() * lever))
}

/// Measurements of the observer against the map.
fn against_map(form: ErrorForm, absolute: &Absolute, observer: &Pose2) -> Linearized {
    let (residual, jacobian) = match absolute {
        Absolute::Pose(measured) => {
            let residual = observer.inverse().compose(measured).log();
            let jacobian = match form {
                ErrorForm::Invariant => adjoint(&observer.inverse()),
                ErrorForm::Additive => blocks(&rotation(observer).transpose(), &Vector2::zeros()),
            };
            (residual.as_slice().to_vec(), dynamic(&jacobian))
        }
        Absolute::Position([x, y]) => {
            let lever = match form {
                ErrorForm::Invariant => quarter_turn() * observer.position(),
                ErrorForm::Additive => Vector2::zeros(),
            };
            (vec![x - observer.x_m(), y - observer.y_m()], two_by_three(&Matrix2::identity(), &lever))
        }
        Absolute::Heading(heading) => {
            (vec![wrapped(heading - observer.yaw_rad())], DMatrix::from_row_slice(1, 3, &[0.0, 0.0, 1.0]))
        }
    };
    Linearized {
        residual: DVector::from_vec(residual),
        d_measurement_d_observer: jacobian,
        d_measurement_d_observed: None,
    }
}

/// `[a, b]` as 2 x 3.
fn two_by_three(a: &Matrix2<f64>, b: &Vector2) -> DMatrix<f64> {
    DMatrix::from_row_slice(2, 3, &[a[(0, 0)], a[(0, 1)], b.x, a[(1, 0)], a[(1, 1)], b.y])
}

/// A fixed-size block as a dynamic matrix.
pub(super) fn dynamic(m: &Matrix3) -> DMatrix<f64> {
    DMatrix::from_column_slice(3, 3, m.as_slice())
}

#[cfg(test)]
mod tests;

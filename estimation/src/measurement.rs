//! Measurement models in right-invariant coordinates (`docs/notation.md`).
//!
//! Relative kinds have `H_a = -H_b` exactly, so only `H_b` is formed: an error common to both robots is
//! in the null space at any linearization point, and no spurious information enters.

use crate::Pose2;
use crate::fact::{Absolute, Noise};
use crate::geometry::{Matrix3, Vector2, Vector3, wrap_angle};
use crate::sample::Relative;

/// Below this distance direction and distance have no usable derivative, metres.
const LEAST_DISTANCE_M: f64 = 1e-3;

/// A measurement linearized at an estimate. Rows and entries beyond `dimension` are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearization {
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Measured minus predicted; angles wrapped.
    pub innovation: Vector3,
    /// Derivative of the prediction with respect to the error `xi` of the robot that was seen
    /// (the observer's own for absolute kinds).
    pub jacobian: Matrix3,
}

/// Why a measurement has no linearization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unusable {
    /// The target is predicted so close that the kind of measurement has no derivative.
    TooClose {
        /// Predicted distance, m.
        distance_m: f64,
    },
    /// A full pose was measured of a point, which has no heading.
    PointHasNoHeading,
}

/// Dimension of a relative measurement.
pub fn dimension(relative: &Relative) -> usize {
    match relative {
        Relative::Pose(_) => 3,
        Relative::Position { .. } | Relative::RangeBearing { .. } => 2,
        Relative::Range { .. } | Relative::Bearing { .. } => 1,
    }
}

/// Dimension of an absolute measurement.
pub fn absolute_dimension(absolute: &Absolute) -> usize {
    match absolute {
        Absolute::Pose(_) => 3,
        Absolute::Position(_) => 2,
        Absolute::Heading(_) => 1,
    }
}

/// The part of a noise covariance that a measurement of `dimension` uses.
pub fn noise_matrix(noise: &Noise) -> Matrix3 {
    let [a, b, c, d, e, f] = noise.lower;
    Matrix3::new(a, b, d, b, c, e, d, e, f)
}

/// One robot seen by another; `observer` and `target` are `map_from_robot`. The observer's Jacobian is
/// minus the one returned.
///
/// # Errors
/// [`Unusable::TooClose`] if the predicted distance is under a millimetre and the kind needs it.
pub fn of_robot(relative: &Relative, observer: &Pose2, target: &Pose2) -> Result<Linearization, Unusable> {
    if let Relative::Pose(measured) = relative {
        let predicted = observer.between(target);
        // r = log(Zhat^-1 z) with noise in the frame of z: H_b = Ad(X_b^-1).
        return Ok(Linearization {
            dimension: 3,
            innovation: predicted.between(measured).log(),
            jacobian: target.inverse().adjoint(),
        });
    }
    of_point(relative, observer, target.position())
}

/// A point of the map seen by a robot. For a landmark the observer's Jacobian is minus the one returned,
/// as if the landmark were a robot without error.
///
/// # Errors
/// [`Unusable::TooClose`] as for [`of_robot`]; [`Unusable::PointHasNoHeading`] for a relative pose.
pub fn of_point(relative: &Relative, observer: &Pose2, point: Vector2) -> Result<Linearization, Unusable> {
    let seen = observer.rotate_back(point - observer.position());
    // d seen / d xi = R_a^T [I, J p]
    let jp = observer.rotate_back(Vector2::new(-point.y, point.x));
    let (c, s) = (observer.rotate_back(Vector2::x()), observer.rotate_back(Vector2::y()));
    let row_x = Vector3::new(c.x, s.x, jp.x);
    let row_y = Vector3::new(c.y, s.y, jp.y);
    let square = seen.x * seen.x + seen.y * seen.y;
    let distance = square.sqrt();
    let range_row = || row_x * (seen.x / distance) + row_y * (seen.y / distance);
    let bearing_row = || row_y * (seen.x / square) - row_x * (seen.y / square);
    let bearing = || libm::atan2(seen.y, seen.x);
    if distance < LEAST_DISTANCE_M && !matches!(relative, Relative::Position { .. }) {
        return Err(Unusable::TooClose { distance_m: distance });
    }
    Ok(match *relative {
        Relative::Position { x_m, y_m } => rows(&[(x_m - seen.x, row_x), (y_m - seen.y, row_y)]),
        Relative::Range { range_m } => rows(&[(range_m - distance, range_row())]),
        Relative::Bearing { bearing_rad } => rows(&[(wrap_angle(bearing_rad - bearing()), bearing_row())]),
        Relative::RangeBearing { range_m, bearing_rad } => {
            rows(&[(range_m - distance, range_row()), (wrap_angle(bearing_rad - bearing()), bearing_row())])
        }
        Relative::Pose(_) => return Err(Unusable::PointHasNoHeading),
    })
}

/// The point that a robot saw, in the frame it sees from, and the covariance of that; `None` if the kind does not give a point.
pub fn point_of(relative: &Relative, noise: &Matrix3) -> Option<(Vector2, Matrix3)> {
    match *relative {
        Relative::Position { x_m, y_m } => Some((Vector2::new(x_m, y_m), *noise)),
        Relative::RangeBearing { range_m, bearing_rad } => {
            let (s, c) = (libm::sin(bearing_rad), libm::cos(bearing_rad));
            let by = Matrix3::new(c, -range_m * s, 0.0, s, range_m * c, 0.0, 0.0, 0.0, 0.0);
            Some((Vector2::new(range_m * c, range_m * s), by * noise * by.transpose()))
        }
        Relative::Pose(_) | Relative::Range { .. } | Relative::Bearing { .. } => None,
    }
}

/// The robot itself against the map.
pub fn of_map(absolute: &Absolute, robot: &Pose2) -> Linearization {
    match *absolute {
        Absolute::Pose(measured) => Linearization {
            dimension: 3,
            innovation: robot.between(&measured).log(),
            jacobian: robot.inverse().adjoint(),
        },
        Absolute::Position([x, y]) => rows(&[
            (x - robot.x_m(), Vector3::new(1.0, 0.0, -robot.y_m())),
            (y - robot.y_m(), Vector3::new(0.0, 1.0, robot.x_m())),
        ]),
        Absolute::Heading(heading) => rows(&[(wrap_angle(heading - robot.yaw_rad()), Vector3::z())]),
    }
}

fn rows(rows: &[(f64, Vector3)]) -> Linearization {
    let mut linearization =
        Linearization { dimension: rows.len(), innovation: Vector3::zeros(), jacobian: Matrix3::zeros() };
    for (k, (innovation, row)) in rows.iter().enumerate() {
        linearization.innovation[k] = *innovation;
        linearization.jacobian.set_row(k, &row.transpose());
    }
    linearization
}

#[cfg(test)]
mod tests;

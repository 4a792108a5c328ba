//! Where a landmark is that is seen for the first time, and what its error is made of.

use crate::Pose2;
use crate::geometry::{Vector2, Vector3};
use crate::measurement::{Unusable, noise_matrix, of_point};
use crate::sample::Relative;
use crate::{fact::Noise, geometry::wrap_angle};

/// A 2x2 matrix.
pub type Matrix2 = nalgebra::Matrix2<f64>;
/// A 2x3 matrix.
pub type Matrix2x3 = nalgebra::Matrix2x3<f64>;

/// Bearings that cross under a smaller angle than this meet nowhere, as a sine.
const LEAST_SINE: f64 = 1e-6;

/// One sighting and where it was taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// `map_from_robot` of the observer.
    pub observer: Pose2,
    /// What was seen.
    pub relative: Relative,
    /// How well.
    pub noise: Noise,
}

/// A new landmark: `e = sum_k T_k xi_k + n`, with `e` the error of the point in the map (m), `xi_k` the right-invariant
/// error of the `k`-th observer, `n` the noise of the sightings.
///
/// The `T_k` add up to `[I, J point]` exactly: a common error of the observers moves the point with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Initialized {
    /// The landmark, m.
    pub point: Vector2,
    /// `T_k`, one for each observer; the second is zero where there is one.
    pub d_point_d_observer: [Matrix2x3; 2],
    /// Covariance of `n`, m^2.
    pub covariance: Matrix2,
}

/// A landmark from one sighting that fixes it: range and bearing, or a position.
///
/// # Errors
/// [`Unusable`] if it is nearer than a millimetre, or the kind of sighting does not fix a point.
pub fn from_one(sight: &Sight) -> Result<Initialized, Unusable> {
    let seen = match sight.relative {
        Relative::RangeBearing { range_m, bearing_rad } => {
            let (sin, cos) = libm::sincos(bearing_rad);
            Vector2::new(range_m * cos, range_m * sin)
        }
        Relative::Position { x_m, y_m } => Vector2::new(x_m, y_m),
        Relative::Pose(_) | Relative::Range { .. } | Relative::Bearing { .. } => {
            return Err(Unusable::PointHasNoHeading);
        }
    };
    let point = sight.observer.act(seen);
    let linear = of_point(&sight.relative, &sight.observer, point)?;
    let rows = [0, 1].map(|k| linear.jacobian.row(k).transpose());
    let noise = noise_matrix(&sight.noise);
    let noise = Matrix2::new(noise[(0, 0)], noise[(0, 1)], noise[(1, 0)], noise[(1, 1)]);
    solved(point, rows, [0, 0], &noise).ok_or(Unusable::TooClose { distance_m: seen.norm() })
}

/// A landmark where two bearings from different places cross.
///
/// # Errors
/// [`Unusable::TooClose`] if the bearings are parallel, meet behind an observer, or within a millimetre of one.
pub fn from_bearings(sights: [&Sight; 2]) -> Result<Initialized, Unusable> {
    let parallel = Unusable::TooClose { distance_m: 0.0 };
    let [Some(first), Some(second)] = sights.map(direction) else { return Err(Unusable::PointHasNoHeading) };
    let between = sights[1].observer.position() - sights[0].observer.position();
    let cross = |a: Vector2, b: Vector2| a.x * b.y - a.y * b.x;
    let sine = cross(first, second);
    if sine.abs() < LEAST_SINE {
        return Err(parallel);
    }
    // p_1 + s_1 d_1 = p_2 + s_2 d_2
    let (along_first, along_second) = (cross(between, second) / sine, cross(between, first) / sine);
    if along_first <= 0.0 || along_second <= 0.0 {
        return Err(parallel);
    }
    let point = sights[0].observer.position() + first * along_first;
    let mut rows = [Vector3::zeros(); 2];
    for (row, sight) in rows.iter_mut().zip(sights) {
        *row = of_point(&sight.relative, &sight.observer, point)?.jacobian.row(0).transpose();
    }
    let noise = Matrix2::from_diagonal(&Vector2::new(sights[0].noise.lower[0], sights[1].noise.lower[0]));
    solved(point, rows, [0, 1], &noise).ok_or(parallel)
}

/// The angle under which two directions of sight cross, radians, from 0 to pi.
pub(super) fn parallax_rad(sights: [&Sight; 2]) -> Option<f64> {
    let [bearing, other] = sights.map(|sight| match sight.relative {
        Relative::Bearing { bearing_rad } => Some(sight.observer.yaw_rad() + bearing_rad),
        _ => None,
    });
    Some(wrap_angle(wrap_angle(bearing?) - wrap_angle(other?)).abs())
}

/// The direction of a bearing in the map.
fn direction(sight: &Sight) -> Option<Vector2> {
    let Relative::Bearing { bearing_rad } = sight.relative else { return None };
    let (sin, cos) = libm::sincos(bearing_rad);
    Some(sight.observer.rotate(Vector2::new(cos, sin)))
}

/// From two rows `A [I, J p]` of derivatives and whose they are: `e = A^-1 (rows of the observers) xi - A^-1 n`.
fn solved(point: Vector2, rows: [Vector3; 2], owner: [usize; 2], noise: &Matrix2) -> Option<Initialized> {
    let a = Matrix2::new(rows[0].x, rows[0].y, rows[1].x, rows[1].y);
    let determinant = a[(0, 0)] * a[(1, 1)] - a[(0, 1)] * a[(1, 0)];
    if !determinant.is_finite() || determinant.abs() <= 1e-12 * a.norm_squared() {
        return None;
    }
    let inverse = Matrix2::new(a[(1, 1)], -a[(0, 1)], -a[(1, 0)], a[(0, 0)]) / determinant;
    let mut by_observer = [Matrix2x3::zeros(); 2];
    for (k, row) in rows.iter().enumerate() {
        by_observer[owner[k]] += inverse.column(k) * row.transpose();
    }
    Some(Initialized {
        point,
        d_point_d_observer: by_observer,
        covariance: inverse * noise * inverse.transpose(),
    })
}

//! Poses from one sighting alone: all around a landmark.

use std::f64::consts::TAU;

use super::map::MappedLandmark;
use crate::fact::Noise;
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::measurement::noise_matrix;
use crate::sample::Relative;
use crate::{BootIndex, Pose2, RobotId};

/// The hypotheses are about one robot, which has no number of its own here.
pub(super) const ROBOT: RobotId = RobotId(1);
/// Nor has it boots.
pub(super) const BOOT: BootIndex = BootIndex(0);

/// What a sighting says of the landmark's place, seen from the body.
pub(super) struct Seen {
    /// Place of the landmark in the body frame, metres.
    pub place_m: Vector2,
    /// Covariance of that place, m^2, as a block of position.
    covariance: Matrix3,
    /// Area of the body frame per unit of the measurement's own coordinates: turns a density per m^2 into
    /// one of the measurement.
    pub area_per_unit: f64,
}

/// `None` for kinds that do not say where the landmark is: range, bearing, and the pose of what has no heading.
pub(super) fn seen(relative: &Relative, noise: &Noise) -> Option<Seen> {
    let r = noise_matrix(noise);
    match *relative {
        Relative::Position { x_m, y_m } => {
            Some(Seen { place_m: Vector2::new(x_m, y_m), covariance: r, area_per_unit: 1.0 })
        }
        Relative::RangeBearing { range_m, bearing_rad } => {
            let (sin, cos) = libm::sincos(bearing_rad);
            let b = Matrix3::new(cos, -range_m * sin, 0.0, sin, range_m * cos, 0.0, 0.0, 0.0, 0.0);
            Some(Seen {
                place_m: Vector2::new(range_m * cos, range_m * sin),
                covariance: b * r * b.transpose(),
                area_per_unit: range_m,
            })
        }
        Relative::Pose(_) | Relative::Range { .. } | Relative::Bearing { .. } => None,
    }
}

/// One of `headings` poses around a landmark from which it is seen like that, and its covariance in the invariant
/// error. A turn about the landmark by `a` is the motion `a (l_y, -l_x, 1)` of the map, whatever its size, so that one
/// Gaussian follows the circle; its spread of half the spacing makes the sum of all nearly flat.
pub(super) fn around(
    landmark: &MappedLandmark,
    seen: &Seen,
    index: usize,
    headings: usize,
) -> (Pose2, Matrix3) {
    let spacing_rad = TAU / headings as f64;
    let turn = Pose2::new(0.0, 0.0, (index as f64 + 0.5) * spacing_rad);
    let position = landmark.position_m - turn.rotate(seen.place_m);
    let pose = Pose2::new(position.x, position.y, turn.yaw_rad());
    let about = Vector3::new(landmark.position_m.y, -landmark.position_m.x, 1.0);
    let spread_rad = 0.5 * spacing_rad;
    let mut adjoint = turn.adjoint();
    // A turn of the frame alone: the lever arms of a pose at the origin are zero.
    adjoint[(2, 2)] = 0.0;
    let covariance = about * about.transpose() * (spread_rad * spread_rad)
        + adjoint * seen.covariance * adjoint.transpose();
    (pose, covariance)
}

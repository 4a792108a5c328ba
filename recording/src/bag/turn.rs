//! From rotations in space to headings in the plane.

use pleiad_ros::messages::geometry_msgs::Quaternion;

use crate::tum;

/// How far the norm of a quaternion may be from 1.
const NORM_TOLERANCE: f64 = 1e-2;

/// The yaw of a rotation that is level within `max_tilt_rad`.
///
/// # Errors
/// What was found and expected: no rotation, or a robot that tilts further.
pub(super) fn yaw(rotation: &Quaternion, max_tilt_rad: f64) -> Result<f64, (String, String)> {
    let Quaternion { x, y, z, w } = *rotation;
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    if !norm.is_finite() || (norm - 1.0).abs() > NORM_TOLERANCE {
        return Err((
            format!("the quaternion ({x}, {y}, {z}, {w}) of norm {norm}"),
            "a rotation: a quaternion of norm 1".to_owned(),
        ));
    }
    // The angle between the vertical and the body's own: its cosine is 1 - 2 (x^2 + y^2).
    let tilt_rad = 2.0 * libm::asin((libm::hypot(x, y) / norm).min(1.0));
    if tilt_rad > max_tilt_rad {
        return Err((
            format!("a robot that tilts by {tilt_rad:.3} rad in roll and pitch"),
            format!(
                "at most {max_tilt_rad} rad (key `max_tilt_rad`), beyond which a yaw is no heading in the plane"
            ),
        ));
    }
    Ok(tum::yaw(x / norm, y / norm, z / norm, w / norm))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    /// Roll, pitch and yaw about fixed axes (REP 103), multiplied out.
    fn quaternion(roll: f64, pitch: f64, yaw: f64) -> Quaternion {
        let ([sr, cr], [sp, cp], [sy, cy]) =
            ([roll, pitch, yaw].map(|angle| [(0.5 * angle).sin(), (0.5 * angle).cos()])).into();
        Quaternion {
            x: sr * cp * cy - cr * sp * sy,
            y: cr * sp * cy + sr * cp * sy,
            z: cr * cp * sy - sr * sp * cy,
            w: cr * cp * cy + sr * sp * sy,
        }
    }

    #[test]
    fn the_yaw_is_that_of_roll_pitch_and_yaw() {
        for yaw_rad in [-3.0, -FRAC_PI_2, 0.0, 0.7, 3.1] {
            for (roll, pitch) in [(0.0, 0.0), (0.1, 0.0), (0.0, -0.2), (0.15, 0.1)] {
                let found = yaw(&quaternion(roll, pitch, yaw_rad), 0.35).unwrap();
                assert!((found - yaw_rad).abs() < 1e-12, "{found} {yaw_rad}");
            }
        }
    }

    #[test]
    fn a_robot_that_tilts_is_refused_at_the_limit() {
        assert!(yaw(&quaternion(0.349, 0.0, 1.0), 0.35).is_ok());
        let (found, expected) = yaw(&quaternion(0.0, 0.351, 1.0), 0.35).unwrap_err();
        assert!(found.contains("0.351 rad") && expected.contains("at most 0.35 rad"), "{found} {expected}");
        assert!(yaw(&quaternion(PI, 0.0, 0.0), 0.35).is_err(), "upside down");
        assert!(yaw(&quaternion(0.0, 0.351, 1.0), PI).is_ok());
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        for bad in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 2.0]] {
            let [x, y, z, w] = bad;
            assert!(yaw(&Quaternion { x, y, z, w }, PI).unwrap_err().0.contains("norm"));
        }
    }
}

//! Confidence ellipses of a position.

use std::f64::consts::TAU;

use pleiad_estimation::symmetric::Symmetric3;

/// The outline of the ellipse `d^T P^-1 d = mahalanobis_squared` around `centre`, with `P` the position
/// block of `covariance` (metres squared): `corners + 1` points, the first again at the end.
///
/// The points are `centre + sqrt(mahalanobis_squared) L u` with `L` the Cholesky factor of `P` and `u` on
/// the unit circle. `None` if `P` is not finite or not positive semidefinite.
pub fn ellipse_points(
    centre: [f64; 2],
    covariance: Symmetric3,
    mahalanobis_squared: f64,
    corners: usize,
) -> Option<Vec<[f64; 2]>> {
    let [xx, yx, yy, ..] = covariance.0;
    if ![centre[0], centre[1], xx, yx, yy].iter().all(|value| value.is_finite()) || xx < 0.0 || yy < 0.0 {
        return None;
    }
    let l_xx = xx.sqrt();
    let l_yx = if l_xx > 0.0 { yx / l_xx } else { 0.0 };
    let rest = yy - l_yx * l_yx;
    // A singular block may come out negative by rounding; a truly indefinite one is no covariance.
    if rest < -1e-9 * yy {
        return None;
    }
    let l_yy = rest.max(0.0).sqrt();
    let radius = mahalanobis_squared.sqrt();
    let outline = (0..=corners).map(|corner| {
        let (sin, cos) = (TAU * (corner % corners.max(1)) as f64 / corners.max(1) as f64).sin_cos();
        [centre[0] + radius * l_xx * cos, centre[1] + radius * (l_yx * cos + l_yy * sin)]
    });
    Some(outline.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_uncorrelated_ellipse_has_the_closed_form_half_axes() {
        // sigma_x = 2, sigma_y = 0.5, 95 %: half axes 2 * 2.4477 and 0.5 * 2.4477.
        let points = ellipse_points([10.0, -3.0], Symmetric3::diagonal(4.0, 0.25, 1.0), 5.991, 36).unwrap();
        assert_eq!(points.len(), 37);
        assert_eq!(points[0].map(f64::to_bits), points[36].map(f64::to_bits), "closed");
        assert!((points[0][0] - (10.0 + 4.895_3)).abs() < 1e-3 && (points[0][1] + 3.0).abs() < 1e-12);
        assert!((points[9][1] - (-3.0 + 1.223_8)).abs() < 1e-3 && (points[9][0] - 10.0).abs() < 1e-12);
    }

    #[test]
    fn every_point_lies_at_the_asked_mahalanobis_distance() {
        let (xx, yx, yy) = (0.9, -0.5, 0.4);
        let determinant = xx * yy - yx * yx;
        let covariance = Symmetric3([xx, yx, yy, 0.1, 0.2, 0.3]);
        for [x, y] in ellipse_points([1.0, 2.0], covariance, 5.991, 24).unwrap() {
            let (dx, dy) = (x - 1.0, y - 2.0);
            let squared = (yy * dx * dx - 2.0 * yx * dx * dy + xx * dy * dy) / determinant;
            assert!((squared - 5.991).abs() < 1e-9, "{squared}");
        }
    }

    #[test]
    fn what_is_no_covariance_has_no_ellipse() {
        assert!(ellipse_points([0.0, 0.0], Symmetric3([1.0, 2.0, 1.0, 0.0, 0.0, 1.0]), 5.991, 8).is_none());
        assert!(ellipse_points([0.0, 0.0], Symmetric3::diagonal(f64::NAN, 1.0, 1.0), 5.991, 8).is_none());
        assert!(ellipse_points([0.0, 0.0], Symmetric3::diagonal(-1.0, 1.0, 1.0), 5.991, 8).is_none());
    }
}

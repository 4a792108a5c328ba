//! How far estimates were from the truth.

use pleiad_estimation::geometry::wrap_angle;

/// Root mean square errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Of the distance between estimated and true position, metres.
    pub position_rmse_m: f64,
    /// Of the heading, radians.
    pub heading_rmse_rad: f64,
}

impl Accuracy {
    /// From errors `[x m, y m, yaw rad]`; those that are not finite are left out. `None` if none is left.
    pub fn of_errors(errors: &[[f64; 3]]) -> Option<Self> {
        let (mut count, mut position, mut heading) = (0_u32, 0.0, 0.0);
        for [x, y, yaw] in errors.iter().filter(|error| error.iter().all(|part| part.is_finite())) {
            count += 1;
            position += x * x + y * y;
            heading += wrap_angle(*yaw).powi(2);
        }
        let mean_root = |sum: f64| (sum / f64::from(count)).sqrt();
        (count > 0)
            .then(|| Self { position_rmse_m: mean_root(position), heading_rmse_rad: mean_root(heading) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rmse_of_a_known_triangle() {
        // Distances 5 and 0: sqrt(25/2); headings 0.1 and -0.1.
        let accuracy = Accuracy::of_errors(&[[3.0, 4.0, 0.1], [f64::NAN; 3], [0.0, 0.0, -0.1]]).unwrap();
        assert!((accuracy.position_rmse_m - 12.5_f64.sqrt()).abs() < 1e-12);
        assert!((accuracy.heading_rmse_rad - 0.1).abs() < 1e-12);
        assert!(Accuracy::of_errors(&[[f64::NAN; 3]]).is_none());
    }
}

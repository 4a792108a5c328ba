//! From latitude and longitude to metres on the plane that touches the ellipsoid at an origin.

use super::mapping::Origin;

/// WGS 84: the equatorial radius, metres, and the flattening (NGA.STND.0036, 2014).
const EQUATORIAL_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// A tangent plane with x to the east and y to the north.
#[derive(Clone, Copy, Debug)]
pub(super) struct TangentPlane {
    origin: [f64; 3],
    east: [f64; 3],
    north: [f64; 3],
}

impl TangentPlane {
    /// The plane that touches at `origin`.
    pub(super) fn at(origin: Origin) -> Self {
        let (sin_lat, cos_lat) = libm::sincos(origin.latitude_deg.to_radians());
        let (sin_lon, cos_lon) = libm::sincos(origin.longitude_deg.to_radians());
        Self {
            origin: cartesian(origin.latitude_deg, origin.longitude_deg, origin.altitude_m),
            east: [-sin_lon, cos_lon, 0.0],
            north: [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
        }
    }

    /// Metres east and north of the origin.
    pub(super) fn place(&self, latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> [f64; 2] {
        let at = cartesian(latitude_deg, longitude_deg, altitude_m);
        let away = [at[0] - self.origin[0], at[1] - self.origin[1], at[2] - self.origin[2]];
        let along = |axis: [f64; 3]| away[0] * axis[0] + away[1] * axis[1] + away[2] * axis[2];
        [along(self.east), along(self.north)]
    }
}

/// Earth-centred, earth-fixed coordinates, metres.
fn cartesian(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> [f64; 3] {
    let (sin_lat, cos_lat) = libm::sincos(latitude_deg.to_radians());
    let (sin_lon, cos_lon) = libm::sincos(longitude_deg.to_radians());
    let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
    let normal_m = EQUATORIAL_M / (1.0 - eccentricity_squared * sin_lat * sin_lat).sqrt();
    [
        (normal_m + altitude_m) * cos_lat * cos_lon,
        (normal_m + altitude_m) * cos_lat * sin_lon,
        (normal_m * (1.0 - eccentricity_squared) + altitude_m) * sin_lat,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_and_equator_are_at_the_radii_of_the_ellipsoid() {
        assert!((cartesian(0.0, 90.0, 0.0)[1] - 6_378_137.0).abs() < 1e-6);
        // The polar radius of WGS 84.
        assert!((cartesian(90.0, 0.0, 10.0)[2] - (6_356_752.314_245 + 10.0)).abs() < 1e-6);
    }

    #[test]
    fn a_second_of_arc_has_the_length_of_the_radii_of_curvature() {
        // At 45 degrees: M = a (1 - e^2) / W^3 = 6367381.816 m and N = a / W = 6388838.290 m with
        // W^2 = 1 - e^2 / 2 and e^2 = 0.00669437999014 (Torge, Geodesy, 4.1.2).
        let origin = Origin { latitude_deg: 45.0, longitude_deg: 7.0, altitude_m: 0.0 };
        let plane = TangentPlane::at(origin);
        let second: f64 = 1.0 / 3600.0;
        let arc = second.to_radians();
        let [x, y] = plane.place(45.0 + second, 7.0, 0.0);
        assert!((y - 6_367_381.816 * arc).abs() < 1e-4 && x.abs() < 1e-6, "{x} {y}");
        let [x, y] = plane.place(45.0, 7.0 + second, 0.0);
        assert!((x - 6_388_838.290 * arc * 0.5_f64.sqrt()).abs() < 1e-4, "{x}");
        // Parallels curve northwards: half the square of the distance over N / tan 45.
        assert!((y - x * x / (2.0 * 6_388_838.0)).abs() < 1e-6, "{y}");
        assert_eq!(plane.place(45.0, 7.0, 0.0).map(f64::to_bits), [0, 0]);
        let up = plane.place(45.0, 7.0, 500.0);
        assert!(up[0].abs() < 1e-6 && up[1].abs() < 1e-6, "height moves nothing: {up:?}");
    }
}

//! Ratios of diameters and track, and the factors that correct them.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

/// What is wrong with a nominal differential drive, by the ratios of `borenstein1996`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WheelErrors {
    /// `E_d`: right over left wheel diameter.
    pub e_d: f64,
    /// `E_b`: actual over nominal track.
    pub e_b: f64,
    /// `E_s`: actual mean over nominal wheel diameter.
    pub e_s: f64,
}

/// By what nominal radii and track are multiplied to be those of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WheelFactors {
    /// `c_L`, of the left radius.
    pub left: f64,
    /// `c_R`, of the right radius.
    pub right: f64,
    /// `E_b`, of the track.
    pub track: f64,
}

impl WheelErrors {
    /// A robot that is as its nominal model says.
    pub const NONE: Self = Self { e_d: 1.0, e_b: 1.0, e_s: 1.0 };

    /// From the angles of `borenstein1996`, radians: every corner is turned short by `alpha_rad`, every side of length
    /// `side_m` bends left by `beta_rad`. The track is that of the robot; `E_s` is 1.
    ///
    /// `R = (L/2) / sin(beta/2)`, `E_b = 90 deg / (90 deg - alpha)`, `E_d = (R + b/2) / (R - b/2)`; here
    /// `b = E_b b_nominal`, because it is the actual track on which the wheels run at `R -+ b/2`.
    pub fn from_angles(alpha_rad: f64, beta_rad: f64, side_m: f64, nominal_track_m: f64) -> Self {
        let e_b = FRAC_PI_2 / (FRAC_PI_2 - alpha_rad);
        // With the curvature in place of R, a side that does not bend is no special case.
        let half_track_by_radius = 0.5 * e_b * nominal_track_m * (0.5 * beta_rad).sin() / (0.5 * side_m);
        let e_d = (1.0 + half_track_by_radius) / (1.0 - half_track_by_radius);
        Self { e_d, e_b, e_s: 1.0 }
    }

    /// The factors of radii and track. The mean diameter changes by `E_s` alone, and
    /// `D_R / D_L = E_d`: `c_L = 2 / (E_d + 1)`, `c_R = 2 / (1/E_d + 1)`.
    pub fn factors(self) -> WheelFactors {
        let Self { e_d, e_b, e_s } = self;
        WheelFactors { left: e_s * 2.0 / (e_d + 1.0), right: e_s * 2.0 / (1.0 / e_d + 1.0), track: e_b }
    }

    /// With another scale and the same ratio of turning: squares and turns on the spot measure `E_b / E_s`.
    pub fn with_scale(self, e_s: f64) -> Self {
        Self { e_b: self.e_b / self.e_s * e_s, e_s, ..self }
    }
}

impl WheelFactors {
    /// Nothing is corrected.
    pub const NONE: Self = Self { left: 1.0, right: 1.0, track: 1.0 };

    /// The ratios that these factors correct.
    pub fn errors(self) -> WheelErrors {
        WheelErrors {
            e_d: self.right / self.left,
            e_b: self.track,
            e_s: f64::midpoint(self.left, self.right),
        }
    }

    /// These factors upon others.
    pub fn upon(self, before: Self) -> Self {
        Self {
            left: self.left * before.left,
            right: self.right * before.right,
            track: self.track * before.track,
        }
    }

    /// With the labels of the wheels exchanged: what happens if `E_d` is read as left over right.
    pub fn swapped(self) -> Self {
        Self { left: self.right, right: self.left, track: self.track }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correction_factors_keep_the_mean_and_give_the_ratio_right_over_left() {
        let factors = WheelErrors { e_d: 1.004, e_b: 1.03, e_s: 1.0 }.factors();
        assert!((factors.right / factors.left - 1.004).abs() < 1e-15);
        assert!((factors.right + factors.left - 2.0).abs() < 1e-15);
        // D_L = 2 / (E_d + 1) D_a
        assert!((factors.left - 2.0 / 2.004).abs() < 1e-15 && factors.left < 1.0);
        let back = factors.errors();
        assert!((back.e_d - 1.004).abs() < 1e-14 && (back.e_b - 1.03).abs() < 1e-14);
        assert!((factors.swapped().errors().e_d - 1.0 / 1.004).abs() < 1e-14);
    }

    #[test]
    fn the_radius_of_a_bent_side_gives_the_ratio_of_its_wheels() {
        // Wheels of a track of 0.5 m that run on circles of 9.75 and 10.25 m: the arc of 4 m bends by 0.4 rad. The
        // formula takes the side for a chord, so it is given the chord.
        let beta: f64 = 0.4;
        let chord = 2.0 * 10.0 * (0.5 * beta).sin();
        let errors = WheelErrors::from_angles(0.0, beta, chord, 0.5);
        assert!((errors.e_d - 10.25 / 9.75).abs() < 1e-12, "{}", errors.e_d);
        // 90 / (90 - 1) degrees
        assert!((WheelErrors::from_angles(1f64.to_radians(), 0.0, 4.0, 0.5).e_b - 90.0 / 89.0).abs() < 1e-14);
    }
}

//! Noises of sensors, as written in a configuration.

use pleiad_estimation::fact::Noise;
use pleiad_estimation::sample::Relative;
use serde::{Deserialize, Serialize};

use super::SensorsSection;

/// Noise of a pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseNoise {
    /// Per axis, m.
    pub sigma_position_m: f64,
    /// Yaw, rad.
    pub sigma_yaw_rad: f64,
}

/// Noise of a length or of each axis of a position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LengthNoise {
    /// m.
    pub sigma_m: f64,
}

/// Noise of a range: of variance `sigma_m^2 + (sigma_per_m * range)^2`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeNoise {
    /// At no distance, m.
    pub sigma_m: f64,
    /// What grows with the distance read, m per m.
    #[serde(default)]
    pub sigma_per_m: f64,
}

/// Noise of an angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleNoise {
    /// rad.
    pub sigma_rad: f64,
}

/// Noise of range and bearing; the variance of the range is `sigma_range_m^2 + (sigma_range_per_m * range)^2`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeBearingNoise {
    /// At no distance, m.
    pub sigma_range_m: f64,
    /// What grows with the distance read, m per m.
    #[serde(default)]
    pub sigma_range_per_m: f64,
    /// rad.
    pub sigma_bearing_rad: f64,
}

impl SensorsSection {
    /// The noise of a sighting where it varies from one to the next, because it grows with the distance read; `None`
    /// where the profile of its kind says it all.
    pub fn varying_noise(&self, relative: &Relative) -> Option<Noise> {
        match (relative, &self.range, &self.range_bearing) {
            (Relative::Range { range_m }, Some(noise), _) if noise.sigma_per_m > 0.0 => {
                Some(Noise::from_sigmas(&[root_of_squares(noise.sigma_m, noise.sigma_per_m * range_m)]))
            }
            (Relative::RangeBearing { range_m, .. }, _, Some(noise)) if noise.sigma_range_per_m > 0.0 => {
                let sigma_m = root_of_squares(noise.sigma_range_m, noise.sigma_range_per_m * range_m);
                Some(Noise::from_sigmas(&[sigma_m, noise.sigma_bearing_rad]))
            }
            _ => None,
        }
    }

    /// The key of a noise that grows with the distance, if there is one.
    pub fn growing(&self) -> Option<&'static str> {
        let range = self.range.as_ref().is_some_and(|noise| noise.sigma_per_m > 0.0);
        let polar = self.range_bearing.as_ref().is_some_and(|noise| noise.sigma_range_per_m > 0.0);
        match (range, polar) {
            (true, _) => Some("sensors.range.sigma_per_m"),
            (_, true) => Some("sensors.range_bearing.sigma_range_per_m"),
            _ => None,
        }
    }
}

/// `hypot` of the platform would give other bits elsewhere.
fn root_of_squares(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

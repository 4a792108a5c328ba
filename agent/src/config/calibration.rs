//! `[calibration]`, `[filter.clutter]`, `[filter.inflation]` and `[filter.quarantine]`: what the filter is to find out besides poses,
//! and what is not to be believed.

use pleiad_estimation::Timestamp;
use pleiad_estimation::fact::Calibration;
use pleiad_estimation::fold::{Clutter, Inflation, Quarantine};
use pleiad_estimation::strategy::StrategyKind;
use serde::{Deserialize, Serialize};

use super::checks::{not_negative, positive, value};
use super::sections::ErrorName;
use super::{AgentConfig, ConfigError};

/// `[calibration]`: standard deviations of what is not sure about a robot. What is zero is sure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationSection {
    /// True over reported distance, less 1.
    pub sigma_forward_scale: f64,
    /// True over reported angle, less 1.
    pub sigma_yaw_scale: f64,
    /// Yaw rate shown at standstill, rad/s.
    pub sigma_yaw_rate_bias_rad_s: f64,
    /// Where the sensor of others sits, per axis, m.
    pub sigma_mount_m: f64,
    /// How it is turned, rad.
    pub sigma_mount_rad: f64,
    /// Local clock minus team time, s.
    pub sigma_clock_offset_s: f64,
    /// Rate of the clock, parts per million.
    pub sigma_clock_drift_ppm: f64,
}

impl CalibrationSection {
    fn checked(&self) -> Result<Calibration, ConfigError> {
        let named = [
            ("sigma_forward_scale", self.sigma_forward_scale),
            ("sigma_yaw_scale", self.sigma_yaw_scale),
            ("sigma_yaw_rate_bias_rad_s", self.sigma_yaw_rate_bias_rad_s),
            ("sigma_mount_m", self.sigma_mount_m),
            ("sigma_mount_rad", self.sigma_mount_rad),
            ("sigma_clock_offset_s", self.sigma_clock_offset_s),
            ("sigma_clock_drift_ppm", self.sigma_clock_drift_ppm),
        ];
        for (key, sigma) in named {
            not_negative(&format!("calibration.{key}"), sigma)?;
        }
        Ok(Calibration {
            motion: [self.sigma_forward_scale, self.sigma_yaw_scale, self.sigma_yaw_rate_bias_rad_s],
            mount: [self.sigma_mount_m, self.sigma_mount_m, self.sigma_mount_rad],
            clock: [self.sigma_clock_offset_s, 1e-6 * self.sigma_clock_drift_ppm],
        })
    }
}

/// `[filter.clutter]`: some observations are of nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClutterSection {
    /// Share of observations that are of nothing.
    pub share: f64,
    /// How far sensors see, and how far from the origin position fixes may be, m.
    pub reach_m: f64,
    /// Share of sightings that are of another than they name.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub misnamed: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands out references")]
fn is_zero(share: &f64) -> bool {
    *share <= 0.0
}

impl From<ClutterSection> for Clutter {
    fn from(of: ClutterSection) -> Self {
        Self { share: of.share, reach_m: of.reach_m }
    }
}

/// `[filter.inflation]`: levels of noise follow what is read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InflationSection {
    /// Over how many readings of a robot.
    pub readings: f64,
    /// Largest factor on its variances.
    pub most: f64,
}

impl Default for InflationSection {
    fn default() -> Self {
        Self { readings: 20.0, most: 10.0 }
    }
}

impl From<InflationSection> for Inflation {
    fn from(of: InflationSection) -> Self {
        Self { readings: of.readings, most: of.most }
    }
}

/// `[filter.quarantine]`: a robot that contradicts the others is not believed any more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct QuarantineSection {
    /// Logarithm of the odds that it takes, nats.
    pub level: f64,
    /// Robots that have not measured one another for so long are not compared, s.
    pub window_s: f64,
}

impl Default for QuarantineSection {
    fn default() -> Self {
        Self { level: 15.0, window_s: 30.0 }
    }
}

impl From<QuarantineSection> for Quarantine {
    fn from(of: QuarantineSection) -> Self {
        Self { level: of.level, window_ns: Timestamp::from_seconds(of.window_s).0 }
    }
}

impl AgentConfig {
    /// What is to be calibrated; only facts can tell, and only in the invariant form.
    pub(super) fn calibration(&self) -> Result<Option<Calibration>, ConfigError> {
        let Some(section) = &self.calibration else { return Ok(None) };
        self.needs_facts("calibration")?;
        section.checked().map(Some)
    }

    pub(super) fn check_clutter(&self) -> Result<(), ConfigError> {
        let Some(clutter) = &self.filter.clutter else { return Ok(()) };
        if !(clutter.share > 0.0 && clutter.share < 1.0) {
            return Err(value(
                "filter.clutter.share",
                clutter.share,
                "between 0 and 1; without garbage remove the table",
            ));
        }
        positive("filter.clutter.reach_m", clutter.reach_m)?;
        if !(clutter.misnamed >= 0.0 && clutter.share + clutter.misnamed < 1.0) {
            let expected = "zero or a share that leaves something beside filter.clutter.share";
            return Err(value("filter.clutter.misnamed", clutter.misnamed, expected));
        }
        if clutter.misnamed > 0.0 && self.filter.relinearize.is_some() {
            let expected = "0: with [filter.relinearize] names are taken for right";
            return Err(value("filter.clutter.misnamed", clutter.misnamed, expected));
        }
        if clutter.misnamed > 0.0 {
            self.needs_facts("filter.clutter.misnamed")?;
        }
        self.needs_exact("filter.clutter")
    }

    pub(super) fn check_standing(&self) -> Result<(), ConfigError> {
        if let Some(inflation) = &self.filter.inflation {
            self.needs_exact("filter.inflation")?;
            let readings = inflation.readings;
            if !(readings >= 1.0 && readings.is_finite()) {
                return Err(value("filter.inflation.readings", readings, "1 or more"));
            }
            if !(inflation.most > 1.0 && inflation.most.is_finite()) {
                let expected = "more than 1; without inflation remove the table";
                return Err(value("filter.inflation.most", inflation.most, expected));
            }
        }
        if let Some(quarantine) = &self.filter.quarantine {
            self.needs_exact("filter.quarantine")?;
            positive("filter.quarantine.level", quarantine.level)?;
            positive("filter.quarantine.window_s", quarantine.window_s)?;
        }
        Ok(())
    }

    fn needs_exact(&self, beside: &'static str) -> Result<(), ConfigError> {
        if self.strategy == StrategyKind::Exact { Ok(()) } else { self.needs_facts(beside) }
    }

    /// What only the exact strategy with the invariant error has.
    pub(super) fn needs_facts(&self, beside: &'static str) -> Result<(), ConfigError> {
        let wrong = |key: &str, found: String, expected| {
            Err(ConfigError::Value { key: format!("{key} (beside {beside})"), found, expected })
        };
        if self.strategy != StrategyKind::Exact {
            return wrong(
                "strategy",
                format!("\"{}\"", self.strategy),
                "\"exact\": no other strategy keeps facts",
            );
        }
        if self.filter.error == ErrorName::Additive {
            let expected = "\"invariant\": the additive form has neither parameters nor landmarks of its own";
            return wrong("filter.error", "\"additive\"".to_owned(), expected);
        }
        Ok(())
    }
}

//! From what a file says to what a node can rely on: every number in its range.

use std::collections::BTreeSet;

use pleiad_estimation::fact::{ClockMap, Noise};
use pleiad_estimation::ledger::Closure;
use pleiad_estimation::motion::{DifferentialDrive, MotionModel, MotionNoise, YawSource};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{Pose2, RobotId, Timestamp};

use super::sections::{
    ClockSection, ErrorName, LedgerSection, MotionSection, PriorSection, SensorsSection, YawName,
};
use super::{AgentConfig, AngleNoise, ClosingConfig, ConfigError, LengthNoise, Prior};

impl AgentConfig {
    /// What only the exact strategy knows of must not be asked of another one.
    pub(super) fn check_strategy(&self) -> Result<(), ConfigError> {
        let alone = "its default: exact alone has it; remove it, or set strategy = \"exact\"";
        let refused = |key: &str, found: String| {
            Err(ConfigError::Value {
                key: format!("{key} (strategy = \"{}\")", self.strategy),
                found,
                expected: alone,
            })
        };
        match self.strategy {
            StrategyKind::Exact => Ok(()),
            StrategyKind::Factored => Err(ConfigError::Value {
                key: "strategy".to_owned(),
                found: "\"factored\"".to_owned(),
                expected: "exact, pairwise, intersection, split_intersection, naive or independent: factored needs \
                           every message to reach everyone in one order, which no network gives; `pleiad faults` \
                           runs it in memory",
            }),
            _ => match (&self.model, self.filter.error) {
                (Some(model), _) => refused("model", format!("\"{}\"", model.display())),
                (None, ErrorName::Additive) => refused("filter.error", "\"additive\"".to_owned()),
                (None, ErrorName::Invariant) if !self.ledger.members.is_empty() => {
                    refused("ledger.members", format!("{:?}", self.ledger.members))
                }
                (None, ErrorName::Invariant) => Ok(()),
            },
        }
    }
}

/// More passes than this change nothing that is not wrong.
const MOST_PASSES: u32 = 50;

impl AgentConfig {
    /// Facts can be linearized together over times that make sense, in the invariant form.
    pub(super) fn check_relinearization(&self) -> Result<(), ConfigError> {
        let Some(how) = self.filter.relinearize else { return Ok(()) };
        positive("filter.relinearize.block_s", how.block_s)?;
        not_negative("filter.relinearize.ahead_s", how.ahead_s)?;
        if !(1..=MOST_PASSES).contains(&how.passes) {
            return Err(value("filter.relinearize.passes", f64::from(how.passes), "1 to 50"));
        }
        let wrong = |key: &str, found: String, expected| {
            Err(ConfigError::Value { key: key.to_owned(), found, expected })
        };
        if self.filter.error == ErrorName::Additive {
            let expected = "\"invariant\" beside filter.relinearize: in the additive form an error is another one at another time";
            return wrong("filter.error", "\"additive\"".to_owned(), expected);
        }
        if self.strategy != StrategyKind::Exact {
            let expected = "\"exact\" beside filter.relinearize: no other strategy keeps facts";
            return wrong("strategy", format!("\"{}\"", self.strategy), expected);
        }
        let [cell_ns, block_ns] =
            [self.ledger.cell_s, how.block_s].map(|seconds| Timestamp::from_seconds(seconds).0.max(1));
        if !self.ledger.members.is_empty() && cell_ns % block_ns != 0 {
            let expected = "a multiple of filter.relinearize.block_s";
            return Err(value("ledger.cell_s", self.ledger.cell_s, expected));
        }
        Ok(())
    }
}

impl PriorSection {
    pub(super) fn checked(&self) -> Result<Prior, ConfigError> {
        for (key, number) in [("x_m", self.x_m), ("y_m", self.y_m), ("heading_rad", self.heading_rad)] {
            finite(&format!("prior.{key}"), number)?;
        }
        positive("prior.sigma_position_m", self.sigma_position_m)?;
        positive("prior.sigma_heading_rad", self.sigma_heading_rad)?;
        Ok(Prior {
            pose: Pose2::new(self.x_m, self.y_m, self.heading_rad),
            noise: Noise::from_sigmas(&[
                self.sigma_position_m,
                self.sigma_position_m,
                self.sigma_heading_rad,
            ]),
            for_boot: self.for_boot,
        })
    }
}

impl MotionSection {
    pub(super) fn checked(&self) -> Result<MotionModel, ConfigError> {
        let drive = match (self.wheel_radius_m, self.track_width_m) {
            (Some(wheel_radius_m), Some(track_width_m)) => {
                positive("motion.wheel_radius_m", wheel_radius_m)?;
                positive("motion.track_width_m", track_width_m)?;
                Some(DifferentialDrive { wheel_radius_m, track_width_m })
            }
            (None, None) => None,
            _ => {
                return Err(ConfigError::Value {
                    key: "motion".to_owned(),
                    found: "one of wheel_radius_m and track_width_m".to_owned(),
                    expected: "both or neither",
                });
            }
        };
        let noise = MotionNoise {
            forward_m_per_sqrt_s: self.forward_m_per_sqrt_s,
            lateral_m_per_sqrt_s: self.lateral_m_per_sqrt_s,
            yaw_rad_per_sqrt_s: self.yaw_rad_per_sqrt_s,
            forward_m_per_sqrt_m: self.forward_m_per_sqrt_m,
            yaw_rad_per_sqrt_m: self.yaw_rad_per_sqrt_m,
            yaw_rad_per_sqrt_rad: self.yaw_rad_per_sqrt_rad,
            quiet_at_standstill: self.quiet_at_standstill,
        };
        let named = [
            ("forward_m_per_sqrt_s", self.forward_m_per_sqrt_s),
            ("lateral_m_per_sqrt_s", self.lateral_m_per_sqrt_s),
            ("yaw_rad_per_sqrt_s", self.yaw_rad_per_sqrt_s),
            ("forward_m_per_sqrt_m", self.forward_m_per_sqrt_m),
            ("yaw_rad_per_sqrt_m", self.yaw_rad_per_sqrt_m),
            ("yaw_rad_per_sqrt_rad", self.yaw_rad_per_sqrt_rad),
        ];
        for (key, number) in named {
            not_negative(&format!("motion.{key}"), number)?;
        }
        finite("motion.gyro_bias_rad_s", self.gyro_bias_rad_s)?;
        let yaw = match self.yaw_source {
            YawName::Odometry => YawSource::Odometry,
            YawName::Gyro => YawSource::Gyro,
        };
        Ok(MotionModel { drive, noise, yaw, gyro_bias_rad_s: self.gyro_bias_rad_s })
    }
}

impl ClockSection {
    pub(super) fn checked(&self) -> Result<ClockMap, ConfigError> {
        finite("clock.reference_s", self.reference_s)?;
        finite("clock.offset_s", self.offset_s)?;
        Ok(ClockMap {
            reference: Timestamp::from_seconds(self.reference_s),
            offset_ns: Timestamp::from_seconds(self.offset_s).0,
            rate_ppb: self.rate_ppb,
        })
    }
}

impl LedgerSection {
    pub(super) fn checked(&self) -> Result<ClosingConfig, ConfigError> {
        for (key, number) in [
            ("ledger.cell_s", self.cell_s),
            ("ledger.rebase_m", self.rebase_m),
            ("ledger.rebase_s", self.rebase_s),
            ("ledger.evict_after_s", self.evict_after_s.unwrap_or(1.0)),
        ] {
            positive(key, number)?;
        }
        not_negative("ledger.late_s", self.late_s)?;
        let members: BTreeSet<RobotId> = self.members.iter().copied().map(RobotId).collect();
        if members.len() < self.members.len() {
            return Err(ConfigError::Value {
                key: "ledger.members".to_owned(),
                found: format!("{:?}", self.members),
                expected: "every robot once",
            });
        }
        if self.most_items == 0 {
            return Err(ConfigError::Value {
                key: "ledger.most_items".to_owned(),
                found: self.most_items.to_string(),
                expected: "a number above 0",
            });
        }
        let cell_ns = Timestamp::from_seconds(self.cell_s).0.max(1);
        Ok(ClosingConfig {
            closure: (!members.is_empty()).then_some(Closure { members, cell_ns }),
            late_s: self.late_s,
            evict_after_s: self.evict_after_s,
            most_items: self.most_items,
            rebase_m: self.rebase_m,
            rebase_s: self.rebase_s,
        })
    }
}

impl SensorsSection {
    /// The noise of each profile, in the order of [`SensorsSection::relative_profile`] and the absolute
    /// kinds after it; `None` where the kind is not configured.
    pub fn profiles(&self) -> [Option<Noise>; 7] {
        let pose = self.relative_pose.as_ref();
        let length = |noise: &Option<LengthNoise>, axes: usize| {
            noise.as_ref().map(|noise| Noise::from_sigmas(&vec![noise.sigma_m; axes]))
        };
        let angle =
            |noise: &Option<AngleNoise>| noise.as_ref().map(|noise| Noise::from_sigmas(&[noise.sigma_rad]));
        [
            pose.map(|n| Noise::from_sigmas(&[n.sigma_position_m, n.sigma_position_m, n.sigma_yaw_rad])),
            length(&self.relative_position, 2),
            self.range.as_ref().map(|noise| Noise::from_sigmas(&[noise.sigma_m])),
            angle(&self.bearing),
            self.range_bearing.as_ref().map(|n| Noise::from_sigmas(&[n.sigma_range_m, n.sigma_bearing_rad])),
            length(&self.gps, 2),
            angle(&self.heading),
        ]
    }

    /// Profile index of a relative kind.
    pub fn relative_profile(relative: &Relative) -> u16 {
        match relative {
            Relative::Pose(_) => 0,
            Relative::Position { .. } => 1,
            Relative::Range { .. } => 2,
            Relative::Bearing { .. } => 3,
            Relative::RangeBearing { .. } => 4,
        }
    }

    /// Profile index of GPS positions.
    pub const GPS_PROFILE: u16 = 5;
    /// Profile index of headings.
    pub const HEADING_PROFILE: u16 = 6;

    /// The configuration's name of a profile.
    pub fn profile_name(profile: u16) -> &'static str {
        ["relative_pose", "relative_position", "range", "bearing", "range_bearing", "gps", "heading"]
            .get(usize::from(profile))
            .copied()
            .unwrap_or("unknown")
    }

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        finite("sensors.range_bias_m", self.range_bias_m)?;
        let length = |noise: &Option<LengthNoise>| noise.as_ref().map(|noise| noise.sigma_m);
        let angle = |noise: &Option<AngleNoise>| noise.as_ref().map(|noise| noise.sigma_rad);
        let (pose, polar) = (self.relative_pose.as_ref(), self.range_bearing.as_ref());
        let sigmas = [
            ("relative_pose.sigma_position_m", pose.map(|noise| noise.sigma_position_m)),
            ("relative_pose.sigma_yaw_rad", pose.map(|noise| noise.sigma_yaw_rad)),
            ("relative_position.sigma_m", length(&self.relative_position)),
            ("range.sigma_m", self.range.as_ref().map(|noise| noise.sigma_m)),
            ("bearing.sigma_rad", angle(&self.bearing)),
            ("range_bearing.sigma_range_m", polar.map(|noise| noise.sigma_range_m)),
            ("range_bearing.sigma_bearing_rad", polar.map(|noise| noise.sigma_bearing_rad)),
            ("gps.sigma_m", length(&self.gps)),
            ("heading.sigma_rad", angle(&self.heading)),
        ];
        for (key, sigma) in sigmas {
            if let Some(sigma) = sigma {
                positive(&format!("sensors.{key}"), sigma)?;
            }
        }
        let growing = [
            ("range.sigma_per_m", self.range.as_ref().map(|noise| noise.sigma_per_m)),
            ("range_bearing.sigma_range_per_m", polar.map(|noise| noise.sigma_range_per_m)),
        ];
        for (key, sigma) in growing {
            if let Some(sigma) = sigma {
                not_negative(&format!("sensors.{key}"), sigma)?;
            }
        }
        Ok(())
    }
}

pub(super) fn value(key: &str, found: f64, expected: &'static str) -> ConfigError {
    ConfigError::Value { key: key.to_owned(), found: found.to_string(), expected }
}

pub(super) fn finite(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() { Ok(()) } else { Err(value(key, number, "a finite number")) }
}

pub(super) fn positive(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() && number > 0.0 { Ok(()) } else { Err(value(key, number, "a positive number")) }
}

pub(super) fn not_negative(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() && number >= 0.0 {
        Ok(())
    } else {
        Err(value(key, number, "zero or a positive number"))
    }
}

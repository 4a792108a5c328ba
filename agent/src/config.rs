//! Configuration of an agent: what `pleiad agent --config FILE` reads. `docs/agent.md` lists every key.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pleiad_estimation::fact::{ClockMap, Noise};
use pleiad_estimation::fold::{DEFAULT_GATE, FoldConfig};
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::motion::{DifferentialDrive, MotionModel, MotionNoise, YawSource};
use pleiad_estimation::sample::Relative;
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_protocol::TeamName;
use serde::{Deserialize, Serialize};

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {path}: {cause}")]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// Not the TOML expected: a syntax error, an unknown key, a wrong type.
    #[error("{path}: {cause}docs/agent.md lists the keys")]
    Parse {
        /// Which file.
        path: PathBuf,
        /// Line, column and what was expected there.
        cause: Box<toml::de::Error>,
    },
    /// A value of a file out of its range.
    #[error("{path}: {cause}")]
    In {
        /// Which file.
        path: PathBuf,
        /// What is wrong in it.
        cause: Box<ConfigError>,
    },
    /// A value out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Value {
        /// The key, with its table.
        key: String,
        /// Its value.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
}

/// How the robots of a team share what they see.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Every robot folds all facts: the joint filter, exactly.
    #[default]
    Exact,
    /// Observations of other robots are ignored: the baseline.
    Independent,
}

/// The error of a pose, as written in a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorName {
    /// Right-invariant.
    #[default]
    Invariant,
    /// Additive: the textbook filter.
    Additive,
}

/// The whole configuration of an agent process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentConfig {
    /// Team name: `a-z 0-9 _ -`, at most 32.
    pub team: String,
    /// The robot's number.
    pub robot: u32,
    /// How observations of other robots are used.
    #[serde(default)]
    pub strategy: Strategy,
    /// What decides the bits of the estimate; the same for all robots of a team.
    #[serde(default)]
    pub filter: FilterSection,
    /// Where the robot starts; without it the robot has no place in the map.
    pub prior: Option<PriorSection>,
    /// Odometry.
    #[serde(default)]
    pub motion: MotionSection,
    /// Sensor noises; readings of a kind that is not listed are refused.
    #[serde(default)]
    pub sensors: SensorsSection,
    /// Local clock to team time.
    #[serde(default)]
    pub clock: ClockSection,
    /// The map.
    #[serde(default)]
    pub landmarks: Vec<LandmarkRow>,
    /// The network.
    #[serde(default)]
    pub bus: BusSection,
    /// What is kept on disk.
    #[serde(default)]
    pub output: OutputSection,
}

/// `[filter]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSection {
    /// Coordinates of the error.
    pub error: ErrorName,
    /// Gate on the normalized innovation squared for measurements of dimension 1, 2, 3.
    pub gate: [f64; 3],
}

impl Default for FilterSection {
    fn default() -> Self {
        Self { error: ErrorName::Invariant, gate: DEFAULT_GATE }
    }
}

impl FilterSection {
    /// The filter's configuration.
    pub fn fold(&self) -> FoldConfig {
        let form = match self.error {
            ErrorName::Invariant => ErrorForm::Invariant,
            ErrorName::Additive => ErrorForm::Additive,
        };
        FoldConfig { form, gate: self.gate }
    }
}

/// `[prior]`: where the robot is at its first odometry, in the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorSection {
    /// Position, m.
    pub x_m: f64,
    /// Position, m.
    pub y_m: f64,
    /// Heading, rad.
    pub heading_rad: f64,
    /// Standard deviation of the position per axis, m.
    pub sigma_position_m: f64,
    /// Standard deviation of the heading, rad.
    pub sigma_heading_rad: f64,
    /// The boot this prior is meant for. A robot that lost its journal has moved since its first boot:
    /// it needs a new prior, for the boot index that its agent then prints.
    #[serde(default)]
    pub for_boot: u32,
}

/// `[motion]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSection {
    /// Wheel radius, m; needed for wheel angles.
    pub wheel_radius_m: Option<f64>,
    /// Track width, m; needed for wheel angles.
    pub track_width_m: Option<f64>,
    /// `odometry` or `gyro`.
    pub yaw_source: YawName,
    /// Subtracted from the gyro, rad/s.
    pub gyro_bias_rad_s: f64,
    /// Forward noise, m per root second.
    pub forward_m_per_sqrt_s: f64,
    /// Sideways noise, m per root second.
    pub lateral_m_per_sqrt_s: f64,
    /// Yaw noise, rad per root second.
    pub yaw_rad_per_sqrt_s: f64,
    /// Forward noise, m per root metre.
    pub forward_m_per_sqrt_m: f64,
    /// Yaw noise, rad per root metre.
    pub yaw_rad_per_sqrt_m: f64,
    /// Yaw noise, rad per root radian.
    pub yaw_rad_per_sqrt_rad: f64,
    /// No noise while odometry reports no motion.
    pub quiet_at_standstill: bool,
    /// A longer silence of the odometry ends the trajectory; the motion in it counts as unknown.
    pub longest_gap_s: f64,
    /// Fastest the robot can drive, m/s: bounds what it did in a gap.
    pub speed_limit_m_s: f64,
    /// Fastest it can turn, rad/s.
    pub yaw_rate_limit_rad_s: f64,
    /// Odometry samples kept to look back into.
    pub history_samples: usize,
}

impl Default for MotionSection {
    fn default() -> Self {
        Self {
            wheel_radius_m: None,
            track_width_m: None,
            yaw_source: YawName::Odometry,
            gyro_bias_rad_s: 0.0,
            forward_m_per_sqrt_s: 0.02,
            lateral_m_per_sqrt_s: 0.0,
            yaw_rad_per_sqrt_s: 0.01,
            forward_m_per_sqrt_m: 0.0,
            yaw_rad_per_sqrt_m: 0.0,
            yaw_rad_per_sqrt_rad: 0.0,
            quiet_at_standstill: false,
            longest_gap_s: 2.0,
            speed_limit_m_s: 1.0,
            yaw_rate_limit_rad_s: 1.5,
            history_samples: 150_000,
        }
    }
}

/// Where the yaw of dead reckoning comes from, as written in a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum YawName {
    /// The odometry.
    #[default]
    Odometry,
    /// The gyro.
    Gyro,
}

/// `[sensors]`: one standard deviation per component, and what is known to be off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorsSection {
    /// Known bias of every range reading, subtracted, m.
    pub range_bias_m: f64,
    /// Full relative pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_pose: Option<PoseNoise>,
    /// Relative position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_position: Option<LengthNoise>,
    /// Range alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<LengthNoise>,
    /// Bearing alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bearing: Option<AngleNoise>,
    /// Range and bearing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_bearing: Option<RangeBearingNoise>,
    /// Absolute position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gps: Option<LengthNoise>,
    /// Absolute heading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<AngleNoise>,
}

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

/// Noise of an angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleNoise {
    /// rad.
    pub sigma_rad: f64,
}

/// Noise of range and bearing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeBearingNoise {
    /// m.
    pub sigma_range_m: f64,
    /// rad.
    pub sigma_bearing_rad: f64,
}

/// `[clock]`: team time = local + offset + rate (local - reference).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClockSection {
    /// Local seconds at which the offset holds.
    pub reference_s: f64,
    /// s.
    pub offset_s: f64,
    /// Parts per billion.
    pub rate_ppb: i32,
}

/// One of `[[landmarks]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandmarkRow {
    /// Number.
    pub id: u32,
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
}

/// `[bus]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BusSection {
    /// Zenoh endpoints to listen on.
    pub listen: Vec<String>,
    /// Zenoh endpoints of peers or routers to dial.
    pub connect: Vec<String>,
    /// `peer` or `client` (of a router).
    pub mode: BusMode,
    /// Find peers by UDP multicast.
    pub multicast: bool,
    /// Between two statuses, s: how fast a missed message is noticed.
    pub status_period_s: f64,
}

impl Default for BusSection {
    fn default() -> Self {
        Self {
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            connect: Vec::new(),
            mode: BusMode::Peer,
            multicast: false,
            status_period_s: 0.5,
        }
    }
}

/// How an agent takes part in the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BusMode {
    /// Linked with the other agents directly.
    #[default]
    Peer,
    /// Through a zenoh router.
    Client,
}

/// `[output]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputSection {
    /// Journal and results go here; without it the agent forgets everything when it ends.
    pub directory: Option<PathBuf>,
    /// Estimates per second of team time, published and written.
    pub estimate_rate_hz: f64,
    /// Longest time between two fsyncs of the journal, s; every entry is written before it is published
    /// in any case, so that only a loss of power can cost what is younger than this.
    pub fsync_period_s: f64,
}

impl Default for OutputSection {
    fn default() -> Self {
        Self { directory: None, estimate_rate_hz: 10.0, fsync_period_s: 0.2 }
    }
}

/// A robot's prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Where.
    pub pose: Pose2,
    /// How well, in the frame of the pose.
    pub noise: Noise,
    /// For which boot.
    pub for_boot: u32,
}

/// What the [`Node`](crate::Node) needs to know: an [`AgentConfig`] checked, without network and disk.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeConfig {
    /// Who.
    pub robot: RobotId,
    /// How observations of other robots are used.
    pub strategy: Strategy,
    /// What decides bits.
    pub fold: FoldConfig,
    /// Where the robot starts.
    pub prior: Option<Prior>,
    /// Dead reckoning.
    pub motion: MotionModel,
    /// A longer silence of the odometry is a new boot.
    pub longest_gap_s: f64,
    /// Fastest possible motion: m/s, m/s, rad/s.
    pub motion_limits: [f64; 3],
    /// Odometry samples kept.
    pub history_samples: usize,
    /// Noise by kind of measurement.
    pub sensors: SensorsSection,
    /// Clock map.
    pub clock: ClockMap,
    /// The map.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Estimates per second of team time.
    pub estimate_rate_hz: f64,
}

impl AgentConfig {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`ConfigError`], naming file, line or key, what was found and what would be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| ConfigError::Read { path: path.to_owned(), cause })?;
        let config: Self = toml::from_str(&text)
            .map_err(|cause| ConfigError::Parse { path: path.to_owned(), cause: Box::new(cause) })?;
        match config.node() {
            Ok(_) => Ok(config),
            Err(cause) => Err(ConfigError::In { path: path.to_owned(), cause: Box::new(cause) }),
        }
    }

    /// The team's name.
    ///
    /// # Errors
    /// [`ConfigError::Value`] if it is not one.
    pub fn team(&self) -> Result<TeamName, ConfigError> {
        TeamName::new(&self.team).map_err(|_| ConfigError::Value {
            key: "team".to_owned(),
            found: format!("{:?}", self.team),
            expected: "1 to 32 of a-z, 0-9, _ and -",
        })
    }

    /// The checked part that the node needs.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for the first value out of range.
    pub fn node(&self) -> Result<NodeConfig, ConfigError> {
        self.team()?;
        let motion = &self.motion;
        for (index, gate) in self.filter.gate.iter().enumerate() {
            // Infinite is allowed: it switches the gate off.
            if gate.is_nan() || *gate <= 0.0 {
                return Err(value(&format!("filter.gate[{index}]"), *gate, "a positive number or inf"));
            }
        }
        positive("motion.longest_gap_s", motion.longest_gap_s)?;
        positive("motion.speed_limit_m_s", motion.speed_limit_m_s)?;
        positive("motion.yaw_rate_limit_rad_s", motion.yaw_rate_limit_rad_s)?;
        positive("output.estimate_rate_hz", self.output.estimate_rate_hz)?;
        positive("bus.status_period_s", self.bus.status_period_s)?;
        not_negative("output.fsync_period_s", self.output.fsync_period_s)?;
        self.sensors.check()?;
        Ok(NodeConfig {
            robot: RobotId(self.robot),
            strategy: self.strategy,
            fold: self.filter.fold(),
            prior: self.prior.as_ref().map(PriorSection::checked).transpose()?,
            motion: motion.checked()?,
            longest_gap_s: motion.longest_gap_s,
            motion_limits: [motion.speed_limit_m_s, motion.speed_limit_m_s, motion.yaw_rate_limit_rad_s],
            history_samples: motion.history_samples,
            sensors: self.sensors.clone(),
            clock: self.clock.checked()?,
            landmarks: self.map()?,
            estimate_rate_hz: self.output.estimate_rate_hz,
        })
    }

    fn map(&self) -> Result<BTreeMap<LandmarkId, [f64; 2]>, ConfigError> {
        let mut map = BTreeMap::new();
        for (index, row) in self.landmarks.iter().enumerate() {
            let key = |name: &str| format!("landmarks[{index}].{name}");
            finite(&key("x_m"), row.x_m)?;
            finite(&key("y_m"), row.y_m)?;
            if map.insert(LandmarkId(row.id), [row.x_m, row.y_m]).is_some() {
                return Err(value(&key("id"), f64::from(row.id), "another number: this one is taken"));
            }
        }
        Ok(map)
    }
}

impl PriorSection {
    fn checked(&self) -> Result<Prior, ConfigError> {
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
    fn checked(&self) -> Result<MotionModel, ConfigError> {
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
    fn checked(&self) -> Result<ClockMap, ConfigError> {
        finite("clock.reference_s", self.reference_s)?;
        finite("clock.offset_s", self.offset_s)?;
        Ok(ClockMap {
            reference: Timestamp::from_seconds(self.reference_s),
            offset_ns: Timestamp::from_seconds(self.offset_s).0,
            rate_ppb: self.rate_ppb,
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
            length(&self.range, 1),
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

    fn check(&self) -> Result<(), ConfigError> {
        finite("sensors.range_bias_m", self.range_bias_m)?;
        let length = |noise: &Option<LengthNoise>| noise.as_ref().map(|noise| noise.sigma_m);
        let angle = |noise: &Option<AngleNoise>| noise.as_ref().map(|noise| noise.sigma_rad);
        let (pose, polar) = (self.relative_pose.as_ref(), self.range_bearing.as_ref());
        let sigmas = [
            ("relative_pose.sigma_position_m", pose.map(|noise| noise.sigma_position_m)),
            ("relative_pose.sigma_yaw_rad", pose.map(|noise| noise.sigma_yaw_rad)),
            ("relative_position.sigma_m", length(&self.relative_position)),
            ("range.sigma_m", length(&self.range)),
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
        Ok(())
    }
}

fn value(key: &str, found: f64, expected: &'static str) -> ConfigError {
    ConfigError::Value { key: key.to_owned(), found: found.to_string(), expected }
}

fn finite(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() { Ok(()) } else { Err(value(key, number, "a finite number")) }
}

fn positive(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() && number > 0.0 { Ok(()) } else { Err(value(key, number, "a positive number")) }
}

fn not_negative(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() && number >= 0.0 {
        Ok(())
    } else {
        Err(value(key, number, "zero or a positive number"))
    }
}

//! Configuration of an agent: what `pleiad agent --config FILE` reads. `docs/agent.md` lists every key.

mod calibration;
mod checks;
mod model;
mod noises;
mod sections;
mod strategy_name;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pleiad_bus::{FaultPlan, FaultsError};
use pleiad_estimation::fact::{Calibration, ClockMap, Noise};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::ledger::Closure;
use pleiad_estimation::motion::MotionModel;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_protocol::TeamName;
use pleiad_recording::RecordingError;
use serde::{Deserialize, Serialize};

pub use calibration::{CalibrationSection, ClutterSection, InflationSection, QuarantineSection};
use checks::{finite, not_negative, positive, value};
pub use model::RobotCorrection;
pub use noises::{AngleNoise, LengthNoise, PoseNoise, RangeBearingNoise, RangeNoise};
pub use sections::{
    BusMode, BusSection, ClockSection, ErrorName, FaultsSection, FilterSection, LandmarkRow, LedgerSection,
    MotionSection, OutputSection, PriorSection, RelinearizeSection, SensorsSection, UnknownLandmarks,
    VelocityName, YawName,
};

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
    /// The faults cannot be read.
    #[error("faults: {0}")]
    Faults(Box<FaultsError>),
    /// The model of the robot cannot be read.
    #[error("model: {0}")]
    Model(Box<RecordingError>),
    /// The model is not of this robot.
    #[error("model = \"{}\": found no section [robots.r{robot}]; add it, or name the model of this team", path.display())]
    NotInModel {
        /// The model file.
        path: PathBuf,
        /// The robot.
        robot: u32,
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

/// The whole configuration of an agent process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentConfig {
    /// Team name: `a-z 0-9 _ -`, at most 32.
    pub team: String,
    /// The robot's number.
    pub robot: u32,
    /// How the robots of a team share what they see; all but `factored`.
    #[serde(default, with = "strategy_name")]
    pub strategy: StrategyKind,
    /// A model of the team's robots, such as a `corrected.toml`; what it says beyond `[motion]` and
    /// `[sensors]` is taken out of every reading. Relative to the file it is read from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
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
    /// What is not sure about the robot and is to be found out; without it nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationSection>,
    /// Local clock to team time.
    #[serde(default)]
    pub clock: ClockSection,
    /// The map.
    #[serde(default)]
    pub landmarks: Vec<LandmarkRow>,
    /// The network.
    #[serde(default)]
    pub bus: BusSection,
    /// How long facts are kept.
    #[serde(default)]
    pub ledger: LedgerSection,
    /// What is kept on disk.
    #[serde(default)]
    pub output: OutputSection,
    /// What is to go wrong between the robots, for trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faults: Option<FaultsSection>,
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
    /// How the robots of a team share what they see.
    pub strategy: StrategyKind,
    /// What decides bits.
    pub fold: FoldConfig,
    /// Where the robot starts.
    pub prior: Option<Prior>,
    /// Dead reckoning.
    pub motion: MotionModel,
    /// What is taken out of readings before they are used; nothing if absent.
    pub correction: Option<RobotCorrection>,
    /// A longer silence of the odometry is a new boot.
    pub longest_gap_s: f64,
    /// Fastest possible motion: m/s, m/s, rad/s.
    pub motion_limits: [f64; 3],
    /// Odometry samples kept.
    pub history_samples: usize,
    /// Noise by kind of measurement.
    pub sensors: SensorsSection,
    /// What is not sure about the robot; some even if all of it is sure, where the team calibrates clocks.
    pub calibration: Option<Calibration>,
    /// Clock map.
    pub clock: ClockMap,
    /// The map.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Estimates per second of team time.
    pub estimate_rate_hz: f64,
    /// How the past is closed.
    pub closing: ClosingConfig,
}

/// How a team closes its past, and a robot rebases its trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosingConfig {
    /// What the team agrees on; `None` to keep everything.
    pub closure: Option<Closure>,
    /// How late this robot's own sensors may deliver.
    pub late_s: f64,
    /// A robot silent for longer is evicted by the majority; `None` to leave that to operators.
    pub evict_after_s: Option<f64>,
    /// With so many items in memory this robot observes nothing more, and seals only where it holds back the others.
    pub most_items: usize,
    /// The nominal trajectory begins anew that far from its origin, m,
    pub rebase_m: f64,
    /// and after that time, s.
    pub rebase_s: f64,
}

impl AgentConfig {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`ConfigError`], naming file, line or key, what was found and what would be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| ConfigError::Read { path: path.to_owned(), cause })?;
        let mut config: Self = toml::from_str(&text)
            .map_err(|cause| ConfigError::Parse { path: path.to_owned(), cause: Box::new(cause) })?;
        if let (Some(model), Some(folder)) = (&mut config.model, path.parent()) {
            *model = folder.join(&*model);
        }
        if let (Some(faults), Some(folder)) = (&mut config.faults, path.parent()) {
            faults.plan = folder.join(&faults.plan);
        }
        match config.node().and_then(|_| config.fault_plan()) {
            Ok(_) => Ok(config),
            Err(cause) => Err(ConfigError::In { path: path.to_owned(), cause: Box::new(cause) }),
        }
    }

    /// Reads the plan of faults, if there is one.
    ///
    /// # Errors
    /// [`ConfigError::Faults`].
    pub fn fault_plan(&self) -> Result<Option<FaultPlan>, ConfigError> {
        let Some(faults) = &self.faults else { return Ok(None) };
        if let Some(origin_s) = faults.origin_s {
            finite("faults.origin_s", origin_s)?;
        }
        let plan = FaultPlan::load(&faults.plan).map_err(|error| ConfigError::Faults(Box::new(error)))?;
        if plan.is_random() {
            let expected = "a plan without every_s, such as the one that pleiad run leaves in its folder";
            let found = format!("{:?}", faults.plan.display().to_string());
            return Err(ConfigError::Value { key: "faults.plan".to_owned(), found, expected });
        }
        Ok(Some(plan))
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

    /// The checked part that the node needs. Reads the model, if there is one.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for the first value out of range; [`ConfigError::Model`] and
    /// [`ConfigError::NotInModel`] for a model that cannot be used.
    pub fn node(&self) -> Result<NodeConfig, ConfigError> {
        self.team()?;
        let motion = &self.motion;
        for (index, gate) in self.filter.gate.iter().enumerate() {
            // Infinite is allowed: it switches the gate off.
            if gate.is_nan() || *gate <= 0.0 {
                return Err(value(&format!("filter.gate[{index}]"), *gate, "a positive number or inf"));
            }
        }
        self.check_relinearization()?;
        self.check_clutter()?;
        self.check_standing()?;
        if self.filter.join {
            self.needs_facts("filter.join")?;
        }
        if self.sensors.unknown_landmarks == UnknownLandmarks::Map {
            self.needs_facts("sensors.unknown_landmarks = \"map\"")?;
        }
        positive("motion.longest_gap_s", motion.longest_gap_s)?;
        positive("motion.speed_limit_m_s", motion.speed_limit_m_s)?;
        positive("motion.yaw_rate_limit_rad_s", motion.yaw_rate_limit_rad_s)?;
        positive("output.estimate_rate_hz", self.output.estimate_rate_hz)?;
        positive("bus.status_period_s", self.bus.status_period_s)?;
        not_negative("output.fsync_period_s", self.output.fsync_period_s)?;
        self.sensors.check()?;
        if let Some(key) = self.sensors.growing().filter(|_| self.strategy != StrategyKind::Exact) {
            self.needs_facts(key)?;
        }
        self.check_strategy()?;
        let correction = self.correction()?;
        let mut sensors = self.sensors.clone();
        let mut model = motion.checked()?;
        if correction.is_some() {
            // The model has its own biases, and takes them out.
            sensors.range_bias_m = 0.0;
            model.gyro_bias_rad_s = 0.0;
        }
        Ok(NodeConfig {
            robot: RobotId(self.robot),
            strategy: self.strategy,
            fold: self.filter.fold((!self.ledger.members.is_empty()).then_some(self.ledger.cell_s)),
            prior: self.prior.as_ref().map(PriorSection::checked).transpose()?,
            motion: model,
            correction,
            longest_gap_s: motion.longest_gap_s,
            motion_limits: [motion.speed_limit_m_s, motion.speed_limit_m_s, motion.yaw_rate_limit_rad_s],
            history_samples: motion.history_samples,
            sensors,
            calibration: self.calibration()?,
            clock: self.clock.checked()?,
            landmarks: self.map()?,
            estimate_rate_hz: self.output.estimate_rate_hz,
            closing: self.ledger.checked()?,
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

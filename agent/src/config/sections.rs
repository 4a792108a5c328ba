//! The tables of an agent's configuration file.

use std::path::PathBuf;

use pleiad_estimation::Timestamp;
use pleiad_estimation::fold::{DEFAULT_GATE, FoldConfig, Relinearization};
use pleiad_estimation::joint::ErrorForm;
use serde::{Deserialize, Serialize};

use super::calibration::{ClutterSection, InflationSection, QuarantineSection};
use super::noises::{AngleNoise, LengthNoise, PoseNoise, RangeBearingNoise, RangeNoise};

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

/// `[filter]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSection {
    /// Coordinates of the error.
    pub error: ErrorName,
    /// Gate on the normalized innovation squared for measurements of dimension 1, 2, 3.
    pub gate: [f64; 3],
    /// Robots without a prior find out where they are from what is seen.
    pub join: bool,
    /// Some observations are of nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clutter: Option<ClutterSection>,
    /// Levels of noise follow what is read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inflation: Option<InflationSection>,
    /// A robot that contradicts the others is not believed any more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quarantine: Option<QuarantineSection>,
    /// Facts are linearized together, not each where those before it put the robots.
    pub relinearize: Option<RelinearizeSection>,
}

/// `[filter.relinearize]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelinearizeSection {
    /// Length of the blocks that are folded once, s.
    pub block_s: f64,
    /// How far beyond a block its facts are smoothed, s.
    pub ahead_s: f64,
    /// Passes over the facts of a block, the last of them included.
    pub passes: u32,
}

impl Default for RelinearizeSection {
    fn default() -> Self {
        Self { block_s: 5.0, ahead_s: 5.0, passes: 4 }
    }
}

impl Default for FilterSection {
    fn default() -> Self {
        Self {
            error: ErrorName::Invariant,
            gate: DEFAULT_GATE,
            clutter: None,
            inflation: None,
            quarantine: None,
            join: false,
            relinearize: None,
        }
    }
}

impl FilterSection {
    /// The filter's configuration; `cell_s` is the distance of the times at which the team closes its past, if it does.
    pub fn fold(&self, cell_s: Option<f64>) -> FoldConfig {
        let form = match self.error {
            ErrorName::Invariant => ErrorForm::Invariant,
            ErrorName::Additive => ErrorForm::Additive,
        };
        let ns = |seconds| Timestamp::from_seconds(seconds).0;
        let relinearize = self.relinearize.map(|how| Relinearization {
            block_ns: ns(how.block_s).max(1),
            ahead_ns: ns(how.ahead_s),
            passes: how.passes,
            cell_ns: cell_s.map_or(0, ns),
        });
        FoldConfig {
            form,
            gate: self.gate,
            clutter: self.clutter.map(Into::into),
            misnamed: self.clutter.map_or(0.0, |clutter| clutter.misnamed),
            inflation: self.inflation.map(Into::into),
            quarantine: self.quarantine.map(Into::into),
            join: self.join,
            relinearize,
        }
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
    /// What velocity odometry is, for a model: `measured` or `commanded`.
    pub velocity: VelocityName,
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
            velocity: VelocityName::Measured,
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

/// What velocity odometry is. Only a model makes a difference of it: measured velocity is what the wheels
/// did, a command is what they were told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VelocityName {
    /// A measurement.
    #[default]
    Measured,
    /// The command, taken as motion for want of a measurement.
    Commanded,
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
    pub range: Option<RangeNoise>,
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
    /// What becomes of sightings of landmarks that `[[landmarks]]` does not list.
    pub unknown_landmarks: UnknownLandmarks,
}

/// What becomes of sightings of landmarks whose place the robot does not know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnknownLandmarks {
    /// They are refused, and counted.
    #[default]
    Refuse,
    /// The team finds out their places.
    Map,
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

/// `[faults]`: what is to go wrong between the robots, for trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultsSection {
    /// A file with `[[fault]]` tables, a scenario for instance. Relative to the file it is read from.
    pub plan: PathBuf,
    /// Seed of the links' luck; the same for all robots.
    #[serde(default)]
    pub seed: u64,
    /// Team time of second 0 of the plan, s; the robot's first sample if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin_s: Option<f64>,
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

/// `[ledger]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LedgerSection {
    /// The robots of the team from the start, the same for all; empty to keep all facts for ever.
    pub members: Vec<u32>,
    /// Distance of the times at which the past may be closed, s; the same for all.
    pub cell_s: f64,
    /// How late this robot's own sensors may deliver, s: later observations are refused.
    pub late_s: f64,
    /// A robot from which nothing was heard for longer is evicted by the majority of the others, s;
    /// without it only an operator evicts.
    pub evict_after_s: Option<f64>,
    /// With so many items in memory (entries, facts, answers; 0.5 kB each) the robot observes nothing more until
    /// some are closed.
    pub most_items: usize,
    /// The nominal trajectory begins anew that far from its origin, m.
    pub rebase_m: f64,
    /// And after that time, s.
    pub rebase_s: f64,
}

impl Default for LedgerSection {
    fn default() -> Self {
        Self {
            members: Vec::new(),
            cell_s: 5.0,
            late_s: 2.0,
            evict_after_s: None,
            most_items: 1_000_000,
            rebase_m: 300.0,
            rebase_s: 3600.0,
        }
    }
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

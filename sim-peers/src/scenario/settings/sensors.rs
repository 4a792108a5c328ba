//! The sensors of one robot.

use serde::{Deserialize, Serialize};

/// A gyro.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gyro {
    /// Rate, Hz; 0 means none.
    pub rate_hz: f64,
    /// White noise of a sample, rad/s.
    pub sigma_rad_s: f64,
    /// Constant bias, rad/s.
    pub bias_rad_s: f64,
}

impl Default for Gyro {
    fn default() -> Self {
        Self { rate_hz: 0.0, sigma_rad_s: 0.005, bias_rad_s: 0.0 }
    }
}

/// A GPS receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gps {
    /// Rate, Hz; 0 means none.
    pub rate_hz: f64,
    /// Noise per axis, metres.
    pub sigma_m: f64,
    /// `[from, until)` in seconds during which there is reception; empty means always.
    pub windows_s: Vec<[f64; 2]>,
}

impl Default for Gps {
    fn default() -> Self {
        Self { rate_hz: 0.0, sigma_m: 0.5, windows_s: Vec::new() }
    }
}

/// An absolute heading sensor (sun sensor, compass).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Heading {
    /// Rate, Hz; 0 means none.
    pub rate_hz: f64,
    /// Noise, radians.
    pub sigma_rad: f64,
}

impl Default for Heading {
    fn default() -> Self {
        Self { rate_hz: 0.0, sigma_rad: 0.02 }
    }
}

/// A sensor of other robots and landmarks, at the body's origin, looking forward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelativeSensor {
    /// Rate of scans, Hz; 0 means none.
    pub rate_hz: f64,
    /// What is measured.
    pub kind: RelativeKind,
    /// Whom it can see.
    pub see: See,
    /// Targets nearer than this are not seen, metres.
    pub min_range_m: f64,
    /// Targets farther than this are not seen, metres.
    pub max_range_m: f64,
    /// Half the field of view, radians; pi means all around.
    pub half_fov_rad: f64,
    /// Noise of a range, metres.
    pub sigma_range_m: f64,
    /// Noise of a bearing, radians.
    pub sigma_bearing_rad: f64,
    /// Noise of a position or of the position of a pose, per axis, metres.
    pub sigma_position_m: f64,
    /// Noise of the yaw of a pose, radians.
    pub sigma_yaw_rad: f64,
    /// Probability that a visible target is missed.
    pub drop_out: f64,
}

impl Default for RelativeSensor {
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            kind: RelativeKind::RangeBearing,
            see: See::Robots,
            min_range_m: 0.3,
            max_range_m: 12.0,
            half_fov_rad: std::f64::consts::PI,
            sigma_range_m: 0.1,
            sigma_bearing_rad: 0.03,
            sigma_position_m: 0.1,
            sigma_yaw_rad: 0.03,
            drop_out: 0.0,
        }
    }
}

/// A ring of range beams at the body's origin: a lidar, or sonars around a robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RangeScan {
    /// Rate of scans, Hz; 0 means none.
    pub rate_hz: f64,
    /// Beams of a scan, evenly over the field of view.
    pub beams: u32,
    /// Half the field of view, radians; pi means all around.
    pub half_fov_rad: f64,
    /// Walls farther than this are not met, metres.
    pub max_range_m: f64,
    /// Noise of a range, metres.
    pub sigma_m: f64,
}

impl Default for RangeScan {
    fn default() -> Self {
        Self { rate_hz: 0.0, beams: 72, half_fov_rad: std::f64::consts::PI, max_range_m: 8.0, sigma_m: 0.02 }
    }
}

/// What a relative sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RelativeKind {
    /// Distance and direction.
    RangeBearing,
    /// Position and yaw of a robot; position alone of a landmark, which has no yaw.
    Pose,
    /// Position.
    Position,
    /// Distance.
    Range,
    /// Direction.
    Bearing,
}

/// Whom a relative sensor can see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum See {
    /// Robots of the team.
    Robots,
    /// Landmarks of the map.
    Landmarks,
    /// Both.
    Both,
}

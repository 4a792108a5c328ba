//! What a robot of an approximate strategy has to know of itself.

use std::collections::BTreeMap;

use crate::fact::Noise;
use crate::motion::MotionModel;
use crate::sample::{Relative, SampleRefusal};
use crate::{LandmarkId, Pose2, RobotId};

/// The noise of each kind of measurement; readings of a kind without are refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noises {
    /// Full relative pose.
    pub relative_pose: Option<Noise>,
    /// Relative position.
    pub relative_position: Option<Noise>,
    /// Range alone.
    pub range: Option<Noise>,
    /// Bearing alone.
    pub bearing: Option<Noise>,
    /// Range and bearing.
    pub range_bearing: Option<Noise>,
    /// Absolute position.
    pub position: Option<Noise>,
    /// Absolute heading.
    pub heading: Option<Noise>,
}

impl Noises {
    pub(crate) fn of(&self, relative: &Relative) -> Result<Noise, SampleRefusal> {
        let (kind, noise) = match relative {
            Relative::Pose(_) => ("relative_pose", self.relative_pose),
            Relative::Position { .. } => ("relative_position", self.relative_position),
            Relative::Range { .. } => ("range", self.range),
            Relative::Bearing { .. } => ("bearing", self.bearing),
            Relative::RangeBearing { .. } => ("range_bearing", self.range_bearing),
        };
        noise.ok_or(SampleRefusal::NoNoise { kind })
    }
}

/// What a robot has to know of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Who.
    pub robot: RobotId,
    /// Dead reckoning.
    pub motion: MotionModel,
    /// Where it starts, with noise in the frame of the pose; without it the robot has no place in the map.
    pub prior: Option<(Pose2, Noise)>,
    /// How well it measures.
    pub noises: Noises,
    /// Known bias of every range reading, subtracted, m.
    pub range_bias_m: f64,
    /// The map, m.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Gate on the normalized innovation squared by dimension, 1 to 3.
    pub gate: [f64; 3],
    /// Odometry samples kept.
    pub history_samples: usize,
    /// A longer silence of the odometry counts as unknown motion, s.
    pub longest_gap_s: f64,
    /// Fastest possible motion: m/s, m/s, rad/s.
    pub motion_limits: [f64; 3],
}

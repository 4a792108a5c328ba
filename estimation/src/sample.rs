//! What a robot's own sensors deliver: the input of an agent, of a recording and of a simulation.

mod refusal;

pub use refusal::{SampleRefusal, Tally};

use crate::{LandmarkId, Pose2, RobotId, Timestamp};

/// One reading of one sensor of one robot, stamped by that robot's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When it was taken.
    pub time: Timestamp,
    /// What was read.
    pub reading: Reading,
}

impl Sample {
    /// The sample with a known bias taken out of a range, m.
    #[must_use]
    pub fn without_range_bias(mut self, bias_m: f64) -> Self {
        if let Reading::Sighting { relative, .. } = &mut self.reading
            && let Relative::Range { range_m } | Relative::RangeBearing { range_m, .. } = relative
        {
            *range_m -= bias_m;
        }
        self
    }

    /// Numbers finite, ranges positive. Odometry is checked where it is used, against what came before.
    ///
    /// # Errors
    /// [`SampleRefusal::BadValue`].
    pub fn check(&self) -> Result<(), SampleRefusal> {
        let range = |range_m: f64| range_m.is_finite() && range_m > 0.0;
        let sound = match self.reading {
            Reading::Gyro { yaw_rate_rad_s } => yaw_rate_rad_s.is_finite(),
            Reading::Gps { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
            Reading::Heading { heading_rad } => heading_rad.is_finite(),
            Reading::Sighting { relative, .. } => match relative {
                Relative::Pose(pose) => pose.is_finite(),
                Relative::Position { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
                Relative::Range { range_m } => range(range_m),
                Relative::Bearing { bearing_rad } => bearing_rad.is_finite(),
                Relative::RangeBearing { range_m, bearing_rad } => range(range_m) && bearing_rad.is_finite(),
            },
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => true,
        };
        if sound { Ok(()) } else { Err(SampleRefusal::BadValue { time: self.time }) }
    }
}

/// The kinds of reading an agent accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// Body velocity that holds from this stamp to the next: forward m/s, yaw rate rad/s
    /// (commands taken as motion, or a velocity estimate).
    Velocity {
        /// Forward velocity, m/s.
        forward_m_s: f64,
        /// Yaw rate, rad/s, counter-clockwise positive.
        yaw_rate_rad_s: f64,
    },
    /// Cumulative wheel angles of a differential drive, radians, forward positive.
    Wheels {
        /// Left wheel, rad.
        left_rad: f64,
        /// Right wheel, rad.
        right_rad: f64,
    },
    /// Motion since the previous odometry sample, in the body frame of that sample.
    Increment(Pose2),
    /// Yaw rate from a gyro, rad/s.
    Gyro {
        /// Yaw rate, rad/s.
        yaw_rate_rad_s: f64,
    },
    /// Absolute position in the map frame, metres.
    Gps {
        /// East, m.
        x_m: f64,
        /// North, m.
        y_m: f64,
    },
    /// Absolute heading in the map frame, radians.
    Heading {
        /// Heading, rad.
        heading_rad: f64,
    },
    /// Another robot or a landmark seen by this robot.
    Sighting {
        /// Who or what was seen.
        target: Target,
        /// Where, in this robot's body frame.
        relative: Relative,
    },
}

/// Who or what was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// A robot of the team.
    Robot(RobotId),
    /// A landmark of the map.
    Landmark(LandmarkId),
}

/// Where the target is, seen from the observer's body frame (x forward, y left).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relative {
    /// Full pose of the target.
    Pose(Pose2),
    /// Position of the target, metres.
    Position {
        /// Forward, m.
        x_m: f64,
        /// Left, m.
        y_m: f64,
    },
    /// Distance, metres.
    Range {
        /// Distance, m.
        range_m: f64,
    },
    /// Direction, radians from the forward axis, counter-clockwise positive.
    Bearing {
        /// Direction, rad.
        bearing_rad: f64,
    },
    /// Distance and direction.
    RangeBearing {
        /// Distance, m.
        range_m: f64,
        /// Direction, rad.
        bearing_rad: f64,
    },
}

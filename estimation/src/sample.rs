//! What a robot's own sensors deliver: the input of an agent, of a recording and of a simulation.

use crate::{LandmarkId, Pose2, RobotId, Timestamp};

/// One reading of one sensor of one robot, stamped by that robot's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When it was taken.
    pub time: Timestamp,
    /// What was read.
    pub reading: Reading,
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

//! Samples, and what was seen in them.

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::check::{self, WirePose};
use crate::error::ProtocolError;

/// A sample.
#[derive(Serialize, Deserialize)]
pub struct WireSample {
    time_ns: i64,
    reading: WireReading,
}

#[derive(Serialize, Deserialize)]
enum WireReading {
    Velocity([f64; 2]),
    Wheels([f64; 2]),
    Increment(WirePose),
    Gyro(f64),
    Gps([f64; 2]),
    Heading(f64),
    Robot(u32, WireRelative),
    Landmark(u32, WireRelative),
}

/// Where a target is, seen from the observer.
#[derive(Serialize, Deserialize)]
pub enum WireRelative {
    Pose(WirePose),
    Position([f64; 2]),
    Range(f64),
    Bearing(f64),
    RangeBearing([f64; 2]),
}

impl From<&Relative> for WireRelative {
    fn from(relative: &Relative) -> Self {
        match *relative {
            Relative::Pose(ref pose) => Self::Pose(check::wire_pose(pose)),
            Relative::Position { x_m, y_m } => Self::Position([x_m, y_m]),
            Relative::Range { range_m } => Self::Range(range_m),
            Relative::Bearing { bearing_rad } => Self::Bearing(bearing_rad),
            Relative::RangeBearing { range_m, bearing_rad } => Self::RangeBearing([range_m, bearing_rad]),
        }
    }
}

impl TryFrom<WireRelative> for Relative {
    type Error = ProtocolError;

    fn try_from(wire: WireRelative) -> Result<Self, ProtocolError> {
        Ok(match wire {
            WireRelative::Pose(pose) => Self::Pose(check::pose("relative", pose)?),
            WireRelative::Position([x_m, y_m]) => Self::Position {
                x_m: check::number("relative.x_m", x_m)?,
                y_m: check::number("relative.y_m", y_m)?,
            },
            WireRelative::Range(range_m) => {
                Self::Range { range_m: check::number("relative.range_m", range_m)? }
            }
            WireRelative::Bearing(bearing_rad) => {
                Self::Bearing { bearing_rad: check::number("relative.bearing_rad", bearing_rad)? }
            }
            WireRelative::RangeBearing([range_m, bearing_rad]) => Self::RangeBearing {
                range_m: check::number("relative.range_m", range_m)?,
                bearing_rad: check::number("relative.bearing_rad", bearing_rad)?,
            },
        })
    }
}

impl From<&Sample> for WireSample {
    fn from(sample: &Sample) -> Self {
        let reading = match sample.reading {
            Reading::Velocity { forward_m_s, yaw_rate_rad_s } => {
                WireReading::Velocity([forward_m_s, yaw_rate_rad_s])
            }
            Reading::Wheels { left_rad, right_rad } => WireReading::Wheels([left_rad, right_rad]),
            Reading::Increment(ref pose) => WireReading::Increment(check::wire_pose(pose)),
            Reading::Gyro { yaw_rate_rad_s } => WireReading::Gyro(yaw_rate_rad_s),
            Reading::Gps { x_m, y_m } => WireReading::Gps([x_m, y_m]),
            Reading::Heading { heading_rad } => WireReading::Heading(heading_rad),
            Reading::Sighting { target: Target::Robot(robot), ref relative } => {
                WireReading::Robot(robot.0, relative.into())
            }
            Reading::Sighting { target: Target::Landmark(landmark), ref relative } => {
                WireReading::Landmark(landmark.0, relative.into())
            }
        };
        Self { time_ns: sample.time.0, reading }
    }
}

impl TryFrom<WireSample> for Sample {
    type Error = ProtocolError;

    fn try_from(wire: WireSample) -> Result<Self, ProtocolError> {
        let sighting = |target, relative: WireRelative| {
            let relative = relative.try_into().map_err(|cause: ProtocolError| cause.within("sighting"))?;
            Ok(Reading::Sighting { target, relative })
        };
        let reading = match wire.reading {
            WireReading::Velocity([forward, yaw_rate]) => Reading::Velocity {
                forward_m_s: check::number("velocity.forward_m_s", forward)?,
                yaw_rate_rad_s: check::number("velocity.yaw_rate_rad_s", yaw_rate)?,
            },
            WireReading::Wheels([left, right]) => Reading::Wheels {
                left_rad: check::number("wheels.left_rad", left)?,
                right_rad: check::number("wheels.right_rad", right)?,
            },
            WireReading::Increment(pose) => Reading::Increment(check::pose("increment", pose)?),
            WireReading::Gyro(rate) => {
                Reading::Gyro { yaw_rate_rad_s: check::number("gyro.yaw_rate_rad_s", rate)? }
            }
            WireReading::Gps([x_m, y_m]) => {
                Reading::Gps { x_m: check::number("gps.x_m", x_m)?, y_m: check::number("gps.y_m", y_m)? }
            }
            WireReading::Heading(heading) => {
                Reading::Heading { heading_rad: check::number("heading.heading_rad", heading)? }
            }
            WireReading::Robot(robot, relative) => sighting(Target::Robot(RobotId(robot)), relative)?,
            WireReading::Landmark(landmark, relative) => {
                sighting(Target::Landmark(LandmarkId(landmark)), relative)?
            }
        };
        Ok(Self { time: Timestamp(wire.time_ns), reading })
    }
}

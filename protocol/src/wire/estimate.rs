//! A robot's estimate of itself.

use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use serde::{Deserialize, Serialize};

use super::check::{self, WirePose, WireSymmetric};
use crate::error::ProtocolError;
use crate::messages::Estimate;

/// An estimate.
#[derive(Serialize, Deserialize)]
pub struct WireEstimate {
    robot: u32,
    boot: u32,
    time_ns: i64,
    map_from_odom: WirePose,
    odom_from_robot: WirePose,
    map_from_robot: WirePose,
    covariance: WireSymmetric,
    sigma: [f64; 3],
    facts_used: u64,
}

impl From<&Estimate> for WireEstimate {
    fn from(estimate: &Estimate) -> Self {
        Self {
            robot: estimate.robot.0,
            boot: estimate.boot.0,
            time_ns: estimate.time.0,
            map_from_odom: check::wire_pose(&estimate.map_from_odom),
            odom_from_robot: check::wire_pose(&estimate.odom_from_robot),
            map_from_robot: check::wire_pose(&estimate.map_from_robot),
            covariance: estimate.covariance.0,
            sigma: estimate.sigma,
            facts_used: estimate.facts_used,
        }
    }
}

impl TryFrom<WireEstimate> for Estimate {
    type Error = ProtocolError;

    fn try_from(wire: WireEstimate) -> Result<Self, ProtocolError> {
        for sigma in wire.sigma {
            if check::number("estimate.sigma", sigma)? < 0.0 {
                let (field, expected) = ("estimate.sigma".into(), "a standard deviation, not negative");
                return Err(ProtocolError::Number { field, found: sigma, expected });
            }
        }
        Ok(Self {
            robot: RobotId(wire.robot),
            boot: BootIndex(wire.boot),
            time: Timestamp(wire.time_ns),
            map_from_odom: check::pose("estimate.map_from_odom", wire.map_from_odom)?,
            odom_from_robot: check::pose("estimate.odom_from_robot", wire.odom_from_robot)?,
            map_from_robot: check::pose("estimate.map_from_robot", wire.map_from_robot)?,
            covariance: check::covariance("estimate.covariance", wire.covariance)?,
            sigma: wire.sigma,
            facts_used: wire.facts_used,
        })
    }
}

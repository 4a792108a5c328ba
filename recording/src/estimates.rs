//! Estimated trajectories as csv, and out of an MCAP file.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_ros::Message as _;
use pleiad_ros::from_cdr;
use pleiad_ros::messages::nav_msgs::Odometry;

use crate::error::RecordingError;
use crate::folder::write_whole;
use crate::mcap::Estimate;
use crate::mcap::stream::{Item, scan};
use crate::number::{push_number, push_time, time_text};
use crate::tum;

/// The columns of a trajectory: stamp, pose, and the covariance of position and heading.
const HEADER: &str = "t,x,y,heading,cov_xx,cov_xy,cov_yy,cov_x_heading,cov_y_heading,cov_heading_heading\n";

/// The last part of the topics with estimates.
const TOPIC: &str = "estimate_odometry";

/// Writes a trajectory as csv: SI units, radians, a stamp with nine decimals, numbers by their shortest exact digits.
///
/// # Errors
/// A number is not finite; the file system refuses.
pub fn write_estimates(path: &Path, estimates: &[Estimate]) -> Result<(), RecordingError> {
    let mut text = HEADER.to_owned();
    for Estimate { time, pose, covariance } in estimates {
        push_time(&mut text, *time);
        for value in [pose.x_m(), pose.y_m(), pose.yaw_rad()].iter().chain(&covariance.0) {
            if !value.is_finite() {
                let reason = format!("the estimate at {} s has the number {value}", time_text(*time));
                return Err(RecordingError::Unwritable { reason });
            }
            text.push(',');
            push_number(&mut text, *value);
        }
        text.push('\n');
    }
    write_whole(path, &text)
}

/// The estimates in an MCAP file that [`crate::write_mcap`] wrote, per robot: its `nav_msgs/msg/Odometry`. Headings
/// went through a quaternion, which may cost the last digit.
///
/// # Errors
/// The file is damaged, or an estimate in it is.
pub fn read_estimates(path: &Path) -> Result<BTreeMap<RobotId, Vec<Estimate>>, RecordingError> {
    let mut all: BTreeMap<RobotId, Vec<Estimate>> = BTreeMap::new();
    scan(path, |item| {
        if let Item::Message { channel, number, data, .. } = item
            && channel.schema == Odometry::NAME
            && let Some(robot) = robot_of(&channel.topic)
        {
            let estimate = estimate(data).map_err(|(found, expected)| RecordingError::BadMessage {
                file: path.to_path_buf(),
                topic: channel.topic.clone(),
                number,
                found,
                expected,
                remedy: "write the file again",
            })?;
            all.entry(robot).or_default().push(estimate);
        }
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(all)
}

/// The robot of a topic such as `/robot2/estimate_odometry`.
fn robot_of(topic: &str) -> Option<RobotId> {
    let (robot, name) = topic.strip_prefix("/robot")?.split_once('/')?;
    if name == TOPIC { robot.parse().ok().map(RobotId) } else { None }
}

fn estimate(data: &[u8]) -> Result<Estimate, (String, String)> {
    let message: Odometry = from_cdr(data).map_err(|error| (error.to_string(), "an estimate".to_owned()))?;
    let stamp = message.header.stamp;
    let Some(nanos) = stamp.nanos() else {
        return Err((format!("a stamp with {} nanoseconds", stamp.nanosec), "less than a second".to_owned()));
    };
    let (at, turned) = (message.pose.pose.position, message.pose.pose.orientation);
    let pose = Pose2::new(at.x, at.y, tum::yaw(turned.x, turned.y, turned.z, turned.w));
    if !pose.is_finite() {
        return Err(("a pose that is not finite".to_owned(), "finite numbers".to_owned()));
    }
    // Rows and columns of x, y and yaw among six.
    let covariance = Symmetric3([0, 6, 7, 30, 31, 35].map(|place: usize| message.pose.covariance[place]));
    Ok(Estimate { time: Timestamp(nanos), pose, covariance })
}

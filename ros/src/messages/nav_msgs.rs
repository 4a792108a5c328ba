//! `nav_msgs`.

use super::geometry_msgs::{PoseWithCovariance, TwistWithCovariance};
use super::message;
use super::std_msgs::Header;

message! {
    /// Pose and velocity of a robot: the pose in the frame of the header, the velocity in that of the robot.
    Odometry = "nav_msgs/msg/Odometry" {
        /// When, and in which frame the pose is.
        header: Header,
        /// The robot's frame.
        child_frame_id: String,
        /// The pose.
        pose: PoseWithCovariance,
        /// The velocity, in the robot's frame.
        twist: TwistWithCovariance,
    }
}

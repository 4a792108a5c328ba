//! `tf2_msgs`.

use super::geometry_msgs::TransformStamped;
use super::message;

message! {
    /// Where frames are in one another.
    TFMessage = "tf2_msgs/msg/TFMessage" {
        /// One for each frame that is told.
        transforms: Vec<TransformStamped>,
    }
}

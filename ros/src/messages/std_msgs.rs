//! `std_msgs`.

use super::builtin_interfaces::Time;
use super::message;

message! {
    /// When and in which frame something was measured.
    Header = "std_msgs/msg/Header" {
        /// When.
        stamp: Time,
        /// The frame.
        frame_id: String,
    }
}

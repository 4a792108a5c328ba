//! MCAP files: what a run writes for Foxglove and Lichtblick, and reads back as a recording.
//!
//! A file holds the recording itself, a topic per robot and channel with the numbers to the bit, and beside it views
//! in the well-known schemas of Foxglove and as `nav_msgs/msg/Odometry`. Only the former is read back.

mod messages;
mod read;
mod scene;
mod schemas;
pub(crate) mod stream;
mod views;
mod write;

pub(crate) use read::{is_own, read_own};
pub use write::{Estimate, LogLevel, LogLine, McapContents, write_mcap};

/// Name of the metadata record that says that Pleiad wrote a file.
const METADATA: &str = "pleiad";
/// Version of what the topics of the recording hold; that of the recording folder, whose columns they have.
const FORMAT_KEY: &str = "format_version";
/// The recording's name, and its robots.
const NAME_KEY: &str = "name";
const ROBOTS_KEY: &str = "robots";
/// What the nominal simulation believes, as an attachment.
const NOMINAL: &str = crate::folder::NOMINAL;
/// Topic of landmarks and walls.
const MAP_TOPIC: &str = "/map";

/// The topic of a robot's channel.
fn topic(robot: pleiad_estimation::RobotId, channel: &str) -> String {
    format!("/{}/{channel}", frame(robot))
}

/// The frame of a robot, which is also the first part of its topics.
fn frame(robot: pleiad_estimation::RobotId) -> String {
    format!("robot{robot}")
}

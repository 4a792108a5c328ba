//! The recording folder: `recording.toml`, `nominal.toml`, `landmarks.csv` and per robot a folder `r<N>`
//! with one `.csv` file per channel.

mod manifest;
mod read;
pub(crate) mod rows;
pub(crate) mod sightings;
mod write;

use std::path::Path;

use pleiad_estimation::RobotId;

use crate::error::RecordingError;
use crate::open::entries;

pub use manifest::FORMAT_VERSION;
pub(crate) use manifest::load_toml;
pub use read::read_folder;
pub use write::{Overwrite, write_folder};
pub(crate) use write::{duration_s, write_whole};

/// The map.
const LANDMARKS: &str = "landmarks.csv";
const LANDMARK_COLUMNS: [&str; 3] = ["id", "x", "y"];

/// Walls of the map.
const WALLS: &str = "walls.csv";
const WALL_COLUMNS: [&str; 4] = ["x0", "y0", "x1", "y1"];

/// What the nominal simulation believes.
pub(crate) const NOMINAL: &str = "nominal.toml";

/// A channel of a robot: its file without the ending, and the columns that it must have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channel {
    pub(crate) name: &'static str,
    pub(crate) columns: &'static [&'static str],
}

pub(crate) const COMMAND: Channel = Channel { name: "command", columns: &["t", "v_cmd", "w_cmd"] };
pub(crate) const WHEELS: Channel =
    Channel { name: "wheel_odometry", columns: &["t", "left_angle_rad", "right_angle_rad"] };
pub(crate) const VELOCITY: Channel = Channel { name: "velocity", columns: &["t", "v", "w"] };
pub(crate) const INCREMENT: Channel = Channel { name: "increment", columns: &["t", "dx", "dy", "dyaw"] };
pub(crate) const GYRO: Channel = Channel { name: "gyro", columns: &["t", "yaw_rate"] };
pub(crate) const GPS: Channel = Channel { name: "gps", columns: &["t", "x", "y"] };
pub(crate) const HEADING: Channel = Channel { name: "heading", columns: &["t", "heading"] };
pub(crate) const RELATIVE: Channel =
    Channel { name: "relative", columns: &["t", "target_kind", "target_id"] };
pub(crate) const STEER: Channel = Channel { name: "steer", columns: &["t", "steer_rad"] };
pub(crate) const SCAN: Channel = Channel { name: "scan", columns: &["t", "bearing", "range"] };
pub(crate) const TRUTH: Channel = Channel { name: "truth", columns: &["t", "x", "y", "heading"] };

pub(crate) const CHANNELS: [Channel; 11] =
    [COMMAND, WHEELS, VELOCITY, INCREMENT, GYRO, GPS, HEADING, RELATIVE, STEER, SCAN, TRUTH];
/// A robot has odometry of one kind.
const ODOMETRY: [Channel; 3] = [WHEELS, VELOCITY, INCREMENT];

impl Channel {
    /// The file of this channel of `robot`, from the recording's folder.
    fn file(self, robot: RobotId) -> String {
        format!("{}/{}.csv", robot_folder(robot), self.name)
    }
}

/// The folder of `robot`, which is also its section in `nominal.toml`.
pub(crate) fn robot_folder(robot: RobotId) -> String {
    format!("r{robot}")
}

/// The robot whose folder or section is called `name`: `r` and its number, without leading zeros.
pub(crate) fn robot_of(name: &str) -> Option<RobotId> {
    let robot = name.strip_prefix('r')?.parse().ok().map(RobotId)?;
    (robot_folder(robot) == name).then_some(robot)
}

/// The robots that have a folder in `folder`.
fn robots_of(folder: &Path) -> Result<Vec<RobotId>, RecordingError> {
    let mut robots: Vec<RobotId> = entries(folder)?
        .iter()
        .filter(|(_, is_folder)| *is_folder)
        .filter_map(|(name, _)| robot_of(name))
        .collect();
    robots.sort_unstable();
    Ok(robots)
}

/// Whether `folder` holds files of this form.
pub(crate) fn is_recording_folder(folder: &Path) -> Result<bool, RecordingError> {
    if folder.join(manifest::FILE).is_file() {
        return Ok(true);
    }
    let robots = robots_of(folder)?;
    Ok(robots.iter().any(|&robot| CHANNELS.iter().any(|channel| folder.join(channel.file(robot)).is_file())))
}

//! `pleiad calibrate`: odometry from squares, and from a map.

mod map;
mod umbmark;

use anyhow::bail;
use pleiad_estimation::RobotId;
use pleiad_recording::Recording;

use crate::cli::Calibrate;

pub fn run(command: &Calibrate) -> anyhow::Result<()> {
    match command {
        Calibrate::Umbmark(args) => umbmark::run(args),
        Calibrate::Map(args) => map::run(args),
    }
}

/// The robot that is calibrated: the one named, or the only one.
fn robot(asked: Option<u32>, recordings: &[Recording]) -> anyhow::Result<RobotId> {
    if let Some(robot) = asked {
        return Ok(RobotId(robot));
    }
    let mut robots: Vec<RobotId> =
        recordings.iter().flat_map(|recording| recording.robots.keys().copied()).collect();
    robots.sort_unstable();
    robots.dedup();
    match robots.as_slice() {
        [only] => Ok(*only),
        [] => bail!("the recordings hold no robot"),
        several => {
            let names: Vec<String> = several.iter().map(ToString::to_string).collect();
            bail!("the recordings hold robots {}: name the one to calibrate with --robot", names.join(", "))
        }
    }
}

//! `run.mcap`: what a run recorded, estimated and noted, for viewers and to be replayed.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_agent::SettledEstimate;
use pleiad_estimation::Timestamp;
use pleiad_recording::{Estimate, LogLevel, LogLine, McapContents, ReadOptions, Recording, write_mcap};

use crate::commands::with_samples;
use crate::evaluation::RunResult;
use crate::setup::{self, Team};

/// The file in a run folder.
pub const RUN: &str = "run.mcap";

/// Writes `run.mcap` into the run folder.
pub fn write(
    team: &Team,
    result: &RunResult,
    out: &Path,
    command: &str,
    start: Timestamp,
) -> anyhow::Result<()> {
    // What the agents received where they were processes, else what they were fed.
    let received = out.join("recording");
    let recording: Recording = if received.is_dir() {
        pleiad_recording::open(&received, &ReadOptions::default())?.0
    } else {
        let mut fed = with_samples(&team.recording, &team.samples);
        for (robot, channels) in &mut fed.robots {
            if let Some(own) = team.recording.robots.get(robot) {
                channels.steer.clone_from(&own.steer);
                channels.scans.clone_from(&own.scans);
            }
        }
        fed
    };
    let settled =
        result.robots.iter().map(|(robot, own)| (*robot, own.settled.iter().map(estimate).collect()));
    let log = |level, message: &str| LogLine {
        time: start,
        level,
        name: "pleiad".to_owned(),
        message: message.to_owned(),
    };
    let notes = result.notes.iter().map(|note| log(LogLevel::Warning, note));
    let contents = McapContents {
        estimates: settled.collect::<BTreeMap<_, _>>(),
        logs: std::iter::once(log(LogLevel::Info, command)).chain(notes).collect(),
        attachments: setup::beside_texts(&team.agents)?,
        recording: Some(&recording),
    };
    Ok(write_mcap(&out.join(RUN), &contents)?)
}

fn estimate(of: &SettledEstimate) -> Estimate {
    Estimate { time: of.time, pose: of.pose, covariance: of.covariance }
}

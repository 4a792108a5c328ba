//! What an agent leaves behind: its trajectories, online and settled, and a summary.

mod found;
mod trajectories;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, Timestamp};
use pleiad_protocol::{Estimate, Status};
use serde::{Deserialize, Serialize};

use crate::approximate::Approximate;
use crate::node::{Node, SettledEstimate};

pub use found::{Found, FoundLandmark, FoundParameter, FoundRobot};
pub(crate) use trajectories::Trajectories;

/// First line of the files of estimates.
pub const COLUMNS: &str =
    "t_ns,boot,x_m,y_m,yaw_rad,xx,yx,yy,yawx,yawy,yawyaw,odom_x_m,odom_y_m,odom_yaw_rad";

/// Name of the file of settled estimates.
pub const SETTLED: &str = "settled.csv";
/// Name of the file of online estimates.
pub const ONLINE: &str = "online.csv";
/// Name of the file of estimates that were settled when the past was closed.
pub const CLOSED: &str = "closed.csv";
/// Name of the summary.
pub const SUMMARY: &str = "agent.json";

/// Why results could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The file system refused.
    #[error("{path}: {cause}")]
    Io {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A line is not what this version writes.
    #[error("{path}:{line}: found {found:?}, expected {COLUMNS}")]
    Line {
        /// Which file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// The line.
        found: String,
    },
    /// The summary is not what this version writes.
    #[error("{path}: {cause}")]
    Summary {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        cause: serde_json::Error,
    },
}

/// What an agent did, in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentSummary {
    /// Who.
    pub robot: u32,
    /// Hash of the bits of its final estimate of the whole team; of itself where the strategy is approximate.
    pub estimate: String,
    /// Complete relative observations known.
    pub facts_relative: u64,
    /// Absolute ones.
    pub facts_absolute: u64,
    /// Used in the estimate.
    pub facts_used: u64,
    /// Rejected by the gate.
    pub facts_rejected: u64,
    /// Waiting for a half.
    pub facts_pending: u64,
    /// Answered with a reason.
    pub facts_void: u64,
    /// Samples taken.
    pub samples_accepted: u64,
    /// Samples refused, by reason.
    pub samples_refused: std::collections::BTreeMap<String, u64>,
    /// Messages published or answered.
    pub messages: u64,
    /// Their bytes: entries, digests, estimates, resends.
    pub bytes: u64,
    /// Path length by dead reckoning, m.
    pub distance_m: f64,
    /// Boots of this robot known at the end.
    pub boots: u32,
    /// What was found out besides poses.
    #[serde(default)]
    pub found: Found,
}

/// The online view of an estimate in the form of a settled one.
pub fn online(estimate: &Estimate) -> SettledEstimate {
    SettledEstimate {
        time: estimate.time,
        boot: estimate.boot,
        pose: estimate.map_from_robot,
        covariance: estimate.covariance,
        nominal: estimate.odom_from_robot,
    }
}

/// Fills a summary from a node; messages and bytes are the driver's to know.
pub fn summary(node: &mut Node, messages: u64, bytes: u64) -> AgentSummary {
    let status = node.status();
    let refused = node.refusals().map(|(reason, count)| (reason.to_owned(), count)).collect();
    let found = node.found();
    let distance_m = node.distance_m();
    AgentSummary { distance_m, samples_refused: refused, messages, bytes, found, ..of(&status) }
}

/// The same from a robot of an approximate strategy; the estimate is its own alone.
pub fn approximate_summary(robot: &mut Approximate, messages: u64, bytes: u64) -> AgentSummary {
    let status = robot.status();
    AgentSummary {
        estimate: robot.fingerprint().to_string(),
        distance_m: robot.peer().distance_m(),
        samples_refused: robot.peer().samples().reasons.clone(),
        messages,
        bytes,
        ..of(&status)
    }
}

fn of(status: &Status) -> AgentSummary {
    AgentSummary {
        robot: status.robot.0,
        estimate: status.estimate.to_string(),
        facts_relative: status.facts.relative,
        facts_absolute: status.facts.absolute,
        facts_used: status.facts.used,
        facts_rejected: status.facts.rejected,
        facts_pending: status.facts.pending,
        facts_void: status.facts.void,
        samples_accepted: status.samples.accepted,
        boots: status.boot.0 + 1,
        ..AgentSummary::default()
    }
}

/// Writes the summary into a folder.
///
/// # Errors
/// [`ResultsError`].
pub fn write_summary(folder: &Path, summary: &AgentSummary) -> Result<(), ResultsError> {
    let path = folder.join(SUMMARY);
    let text = serde_json::to_string_pretty(summary)
        .map_err(|cause| ResultsError::Summary { path: path.clone(), cause })?;
    write_file(&path, &text)
}

/// Beside it first, then in its place: a reader never sees half a file.
fn write_file(path: &Path, text: &str) -> Result<(), ResultsError> {
    let io = |cause| ResultsError::Io { path: path.to_owned(), cause };
    let part = path.with_extension("part");
    std::fs::write(&part, text).map_err(io)?;
    std::fs::rename(&part, path).map_err(io)
}

/// Numbers by their shortest exact digits, so that equal bits give equal files.
fn rows(estimates: &[SettledEstimate]) -> String {
    let mut text = String::with_capacity(estimates.len() * 220);
    for estimate in estimates {
        let (p, n) = (&estimate.pose, &estimate.nominal);
        let numbers = [p.x_m(), p.y_m(), p.yaw_rad()].into_iter().chain(estimate.covariance.0).chain([
            n.x_m(),
            n.y_m(),
            n.yaw_rad(),
        ]);
        let _ = write!(text, "{},{}", estimate.time.0, estimate.boot);
        for number in numbers {
            let _ = write!(text, ",{number:?}");
        }
        text.push('\n');
    }
    text
}

/// Reads a file of estimates.
///
/// # Errors
/// [`ResultsError`], with file and line.
pub fn read_estimates(path: &Path) -> Result<Vec<SettledEstimate>, ResultsError> {
    let text =
        std::fs::read_to_string(path).map_err(|cause| ResultsError::Io { path: path.to_owned(), cause })?;
    let bad = |line: usize, found: &str| ResultsError::Line {
        path: path.to_owned(),
        line: line + 1,
        found: found.to_owned(),
    };
    let mut lines = text.lines().enumerate();
    match lines.next() {
        Some((_, COLUMNS)) => {}
        other => return Err(bad(0, other.map_or("", |(_, line)| line))),
    }
    lines.map(|(number, line)| parse(line).ok_or_else(|| bad(number, line))).collect()
}

fn parse(line: &str) -> Option<SettledEstimate> {
    let mut fields = line.split(',');
    let time = Timestamp(fields.next()?.parse().ok()?);
    let boot = BootIndex(fields.next()?.parse().ok()?);
    let numbers: Vec<f64> = fields.map(|field| field.parse().ok()).collect::<Option<_>>()?;
    let [x, y, yaw, c @ .., nx, ny, nyaw] = numbers.as_slice() else { return None };
    Some(SettledEstimate {
        time,
        boot,
        pose: Pose2::new(*x, *y, *yaw),
        covariance: Symmetric3(c.try_into().ok()?),
        nominal: Pose2::new(*nx, *ny, *nyaw),
    })
}

/// Reads an agent's summary.
///
/// # Errors
/// [`ResultsError`].
pub fn read_summary(folder: &Path) -> Result<AgentSummary, ResultsError> {
    let path = folder.join(SUMMARY);
    let text =
        std::fs::read_to_string(&path).map_err(|cause| ResultsError::Io { path: path.clone(), cause })?;
    serde_json::from_str(&text).map_err(|cause| ResultsError::Summary { path, cause })
}

#[cfg(test)]
mod tests;

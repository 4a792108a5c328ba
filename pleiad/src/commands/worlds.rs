//! Realizations on which a command judges: teams with their samples and their truth.

use std::collections::BTreeMap;

use anyhow::Context;
use pleiad_agent::NodeConfig;
use pleiad_agent::config::AgentConfig;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::Recording;
use pleiad_sim_peers::world::Track;

use crate::setup::{TRUTH_GAP_S, Team};

/// A team, its samples and its truth: one realization.
pub struct World {
    pub seed: u64,
    pub configs: BTreeMap<RobotId, NodeConfig>,
    pub samples: BTreeMap<RobotId, Vec<Sample>>,
    pub truth: Truth,
    pub seconds: f64,
}

/// Where the robots really were.
pub enum Truth {
    /// Of a simulation, at any time.
    Tracks(BTreeMap<RobotId, Track>),
    /// Of a recording.
    Recorded(Box<Recording>),
}

impl Truth {
    pub fn at(&self, robot: RobotId, time: Timestamp) -> Option<Pose2> {
        match self {
            Self::Tracks(tracks) => tracks.get(&robot).map(|track| track.pose_at(time)),
            Self::Recorded(recording) => recording.truth_at(robot, time, TRUTH_GAP_S),
        }
    }
}

impl World {
    /// Of a team that is configured for the exact strategy.
    pub fn new(team: Team, truth: Truth, seed: u64) -> anyhow::Result<Self> {
        let (first, last) = team.span().context("there is not a single sample to run on")?;
        let configs: Result<BTreeMap<_, _>, _> =
            team.agents.iter().map(|(robot, agent)| Ok((*robot, node(agent)?))).collect();
        Ok(Self {
            seed,
            configs: configs.map_err(|error: pleiad_agent::ConfigError| error)?,
            samples: team.samples,
            truth,
            seconds: last.seconds_since(first),
        })
    }
}

/// The estimates are asked for when looked at; those that an agent publishes are not needed.
fn node(agent: &AgentConfig) -> Result<NodeConfig, pleiad_agent::ConfigError> {
    Ok(NodeConfig { estimate_rate_hz: 0.01, ..agent.node()? })
}

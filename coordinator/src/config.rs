//! Configuration of a coordinator: what `pleiad coordinator --config FILE` reads. `docs/coordinator.md`
//! lists every key.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use pleiad_bus::{ZenohConfig, ZenohMode};
use pleiad_protocol::{RobotId, TeamName};
use serde::{Deserialize, Serialize};

use crate::restart::{Backoff, Restart, RestartPolicy};

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {path}: {cause}")]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// Not the TOML expected: a syntax error, an unknown key, a wrong type.
    #[error("{path}: {cause}docs/coordinator.md lists the keys")]
    Parse {
        /// Which file.
        path: PathBuf,
        /// Line, column and what was expected there.
        cause: Box<toml::de::Error>,
    },
    /// A value out of its range.
    #[error("{}{key} = {found}: expected {expected}", file(path.as_deref()))]
    Value {
        /// The file, if it came from one.
        path: Option<PathBuf>,
        /// The key, with its table.
        key: String,
        /// Its value.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
}

fn file(path: Option<&Path>) -> String {
    path.map_or_else(String::new, |path| format!("{}: ", path.display()))
}

/// The whole configuration of a coordinator. Paths are relative to the working directory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoordinatorConfig {
    /// Team name: `a-z 0-9 _ -`, at most 32.
    pub team: String,
    /// The program that is started as `EXECUTABLE agent --config FILE`. A caller that is that program
    /// itself fills it in where it is missing.
    pub executable: Option<PathBuf>,
    /// When an agent that ended is started again.
    #[serde(default)]
    pub restart: Restart,
    /// Whether the agents go on when the coordinator ends without having ended them.
    #[serde(default)]
    pub detached: bool,
    /// Between two looks at the statuses, s.
    #[serde(default = "status_period_s")]
    pub status_period_s: f64,
    /// How long an agent may take to end when asked, before it is made to, s.
    #[serde(default = "shutdown_timeout_s")]
    pub shutdown_timeout_s: f64,
    /// Folder in which what the team publishes is recorded; without it nothing is.
    pub record: Option<PathBuf>,
    /// Waits between restarts.
    #[serde(default)]
    pub backoff: Backoff,
    /// The network.
    #[serde(default)]
    pub bus: BusSection,
    /// The agents.
    pub agents: Vec<AgentEntry>,
}

const fn status_period_s() -> f64 {
    0.5
}

const fn shutdown_timeout_s() -> f64 {
    30.0
}

/// One of `[[agents]]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentEntry {
    /// The robot's number, the same as in its configuration.
    pub robot: u32,
    /// The agent's configuration.
    pub config: PathBuf,
    /// Where its output goes; beside its configuration, with the extension `log`, if not given.
    pub log: Option<PathBuf>,
}

impl AgentEntry {
    /// The robot.
    pub fn id(&self) -> RobotId {
        RobotId(self.robot)
    }

    /// Where its output goes.
    pub fn log(&self) -> PathBuf {
        self.log.clone().unwrap_or_else(|| self.config.with_extension("log"))
    }
}

/// How the coordinator takes part in the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BusMode {
    /// Linked with the agents directly.
    #[default]
    Peer,
    /// Through a zenoh router.
    Client,
}

/// `[bus]`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BusSection {
    /// Zenoh endpoints to listen on; none is loopback at a free port.
    pub listen: Vec<String>,
    /// Zenoh endpoints of agents or routers to dial.
    pub connect: Vec<String>,
    /// `peer` or `client` (of a router).
    pub mode: BusMode,
    /// Find agents by UDP multicast.
    pub multicast: bool,
}

impl BusSection {
    /// As the bus takes it.
    pub fn zenoh(&self) -> ZenohConfig {
        let mode = match self.mode {
            BusMode::Peer => ZenohMode::Peer,
            BusMode::Client => ZenohMode::Client,
        };
        let (listen, connect) = (self.listen.clone(), self.connect.clone());
        ZenohConfig { mode, listen, connect, multicast: self.multicast }
    }
}

impl CoordinatorConfig {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`ConfigError`], naming file, line or key, what was found and what would be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| ConfigError::Read { path: path.to_owned(), cause })?;
        let config: Self = toml::from_str(&text)
            .map_err(|cause| ConfigError::Parse { path: path.to_owned(), cause: Box::new(cause) })?;
        config.check().map_err(|error| match error {
            ConfigError::Value { key, found, expected, .. } => {
                ConfigError::Value { path: Some(path.to_owned()), key, found, expected }
            }
            other => other,
        })?;
        Ok(config)
    }

    /// Checks what the types do not say.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for the first value out of range.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.team()?;
        positive("status_period_s", self.status_period_s)?;
        positive("shutdown_timeout_s", self.shutdown_timeout_s)?;
        positive("backoff.first_s", self.backoff.first_s)?;
        positive("backoff.longest_s", self.backoff.longest_s)?;
        positive("backoff.stable_s", self.backoff.stable_s)?;
        if self.bus.listen.is_empty() && self.bus.connect.is_empty() && !self.bus.multicast {
            return Err(value("bus.connect", &"[]", "the endpoint of at least one agent or router"));
        }
        if self.agents.is_empty() {
            return Err(value("agents", &"[]", "at least one [[agents]] with robot and config"));
        }
        let (mut robots, mut logs) = (BTreeSet::new(), BTreeSet::new());
        for (index, agent) in self.agents.iter().enumerate() {
            if !robots.insert(agent.robot) {
                let expected = "a robot that no other agent has";
                return Err(value(&format!("agents[{index}].robot"), &agent.robot, expected));
            }
            if !logs.insert(agent.log()) {
                let expected = "a log that no other agent writes";
                return Err(value(&format!("agents[{index}].log"), &agent.log().display(), expected));
            }
        }
        Ok(())
    }

    /// The team's name.
    ///
    /// # Errors
    /// [`ConfigError::Value`] if it is not one.
    pub fn team(&self) -> Result<TeamName, ConfigError> {
        TeamName::new(&self.team)
            .map_err(|_| value("team", &format_args!("{:?}", self.team), "1 to 32 of a-z, 0-9, _ and -"))
    }

    /// The robots, in the order of their numbers.
    pub fn robots(&self) -> BTreeSet<RobotId> {
        self.agents.iter().map(AgentEntry::id).collect()
    }

    pub(crate) fn policy(&self) -> RestartPolicy {
        RestartPolicy { when: self.restart, backoff: self.backoff.clone() }
    }
}

pub(crate) fn value(key: &str, found: &dyn fmt::Display, expected: &'static str) -> ConfigError {
    ConfigError::Value { path: None, key: key.to_owned(), found: found.to_string(), expected }
}

fn positive(key: &str, number: f64) -> Result<(), ConfigError> {
    if number.is_finite() && number > 0.0 { Ok(()) } else { Err(value(key, &number, "a positive number")) }
}

#[cfg(test)]
mod tests;

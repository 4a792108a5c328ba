//! What can go wrong.

use std::fmt;
use std::path::PathBuf;

use pleiad_bus::BusError;
use pleiad_protocol::{ProtocolError, RobotId};

use crate::config::ConfigError;
use crate::membership::Member;
use crate::settled::Difference;

/// What can go wrong in coordinating a team.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CoordinatorError {
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// No free port.
    #[error("no loopback port for robot {robot}: {cause}")]
    NoPort {
        /// For whom.
        robot: RobotId,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The team runs already.
    #[error(
        "agents of {} already run in team {team}: end them, or use another team name or network",
        list(robots)
    )]
    AlreadyRunning {
        /// The team.
        team: String,
        /// Whose agents answered before any was started.
        robots: Vec<RobotId>,
    },
    /// An agent's log cannot be written.
    #[error("log of robot {robot} {path}: {cause}")]
    Log {
        /// Whose.
        robot: RobotId,
        /// Which file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// An agent's process could not be started.
    #[error("cannot start {executable} for robot {robot}: {cause}")]
    Spawn {
        /// For whom.
        robot: RobotId,
        /// What was started.
        executable: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// Agents did not appear on the bus.
    #[error("{} not up after {seconds:.1} s{}", list(&robots(missing)), lines(missing))]
    NotAlive {
        /// How long was waited.
        seconds: f64,
        /// Who is missing, and why as far as is known.
        missing: Vec<Trouble>,
    },
    /// Agents ended that are needed.
    #[error("{} ended{}", list(&robots(ended)), lines(ended))]
    Ended {
        /// Who, and why as far as is known.
        ended: Vec<Trouble>,
    },
    /// The team did not settle.
    #[error("the team has not settled after {seconds:.1} s{}", lines(differences))]
    NotSettled {
        /// How long was waited.
        seconds: f64,
        /// Who still differed in what.
        differences: Vec<Difference>,
    },
    /// The team cannot settle.
    #[error("the team will never settle{}", lines(differences))]
    NeverSettles {
        /// Who differs in what; at least one is permanent.
        differences: Vec<Difference>,
    },
    /// An agent's answer is not understood.
    #[error("answer of robot {robot}: {cause}")]
    Protocol {
        /// Whose.
        robot: RobotId,
        /// What is wrong with it.
        cause: ProtocolError,
    },
    /// An agent answered something else.
    #[error("robot {robot} answered {found}, expected {expected}")]
    Reply {
        /// Who.
        robot: RobotId,
        /// What it answered.
        found: String,
        /// What was asked for.
        expected: &'static str,
    },
    /// Not a robot of the team.
    #[error("robot {robot} is not of this team: it has no [[agents]]")]
    UnknownRobot {
        /// Who.
        robot: RobotId,
    },
    /// A process could not be signalled or limited.
    #[error("cannot give {treatment} to the process of robot {robot}: {cause}")]
    Treatment {
        /// Whose.
        robot: RobotId,
        /// What it was to get.
        treatment: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A process is still there after it was killed.
    #[error("process {pid} of robot {robot} does not end, even killed; the system holds it (disk, network?)")]
    StillRunning {
        /// Whose.
        robot: RobotId,
        /// Which.
        pid: u32,
    },
    /// Agents that nobody here launched have not ended.
    #[error(
        "{} of team {team} did not end when asked; end their processes (pleiad agent) by hand",
        list(robots)
    )]
    StillThere {
        /// The team.
        team: String,
        /// Whose agents.
        robots: Vec<RobotId>,
    },
    /// The supervision of the processes ended before its time.
    #[error("the supervision of the team has ended")]
    Unsupervised,
    /// The recorder failed.
    #[error(transparent)]
    Recorder(#[from] crate::recorder::RecorderError),
}

/// An agent in trouble, and what its log says last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trouble {
    /// Whose.
    pub robot: RobotId,
    /// What is known of it.
    pub member: Member,
    /// Its log.
    pub log: PathBuf,
    /// The last lines of it since it was started last.
    pub tail: Vec<String>,
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "robot {} is {}; {}", self.robot, self.member.process, self.log.display())?;
        if self.tail.is_empty() {
            return f.write_str(" is empty");
        }
        f.write_str(" ends with:")?;
        self.tail.iter().try_for_each(|line| write!(f, "\n    {line}"))
    }
}

fn robots(troubles: &[Trouble]) -> Vec<RobotId> {
    troubles.iter().map(|trouble| trouble.robot).collect()
}

fn list(robots: &[RobotId]) -> String {
    let numbers: Vec<_> = robots.iter().map(ToString::to_string).collect();
    format!("{} {}", if robots.len() == 1 { "robot" } else { "robots" }, numbers.join(", "))
}

fn lines<T: fmt::Display>(items: &[T]) -> String {
    items.iter().fold(String::new(), |text, item| text + "\n  " + &item.to_string())
}

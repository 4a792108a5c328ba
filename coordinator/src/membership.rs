//! What is known of a team's processes and their liveliness: a state machine without I/O. Inputs say what
//! happened or was asked; actions say what is to be done and told.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use pleiad_protocol::RobotId;

use crate::restart::{Exit, RestartPolicy, Verdict};

/// Something happened in the team.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TeamEvent {
    /// An agent's liveliness token appeared.
    AgentUp {
        /// Whose.
        robot: RobotId,
    },
    /// It disappeared: the agent ended, or cannot be reached.
    AgentDown {
        /// Whose.
        robot: RobotId,
    },
    /// An agent's process ended.
    Exited {
        /// Whose.
        robot: RobotId,
        /// How.
        exit: Exit,
    },
    /// An agent's process was started again.
    Restarted {
        /// Whose.
        robot: RobotId,
        /// How often now, since the launch.
        restarts: u32,
    },
    /// An agent's process failed too often in a row and stays ended.
    GaveUp {
        /// Whose.
        robot: RobotId,
        /// Restarts in a row that did not help.
        attempts: u32,
    },
}

/// An agent's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessState {
    /// Running.
    Running {
        /// Its process id.
        pid: u32,
    },
    /// Ended, and about to be started again.
    Restarting {
        /// How it ended.
        exit: Exit,
    },
    /// Ended, and not started again by itself.
    Ended {
        /// How.
        exit: Exit,
    },
}

impl fmt::Display for ProcessState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Running { pid } => write!(f, "running as process {pid}"),
            Self::Restarting { exit } => write!(f, "about to be restarted after {exit}"),
            Self::Ended { exit } => write!(f, "ended: {exit}"),
        }
    }
}

/// What is known of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its process.
    pub process: ProcessState,
    /// Whether its liveliness token is seen.
    pub alive: bool,
    /// How often it was started again since the launch.
    pub restarts: u32,
}

impl Member {
    /// How it ended, if it has and stays so.
    pub fn ended(&self) -> Option<Exit> {
        match self.process {
            ProcessState::Ended { exit } => Some(exit),
            _ => None,
        }
    }

    /// The id of its process, if it runs.
    pub fn pid(&self) -> Option<u32> {
        match self.process {
            ProcessState::Running { pid } => Some(pid),
            _ => None,
        }
    }
}

/// What happened, or was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    /// A process asked for by [`Action::Spawn`] runs.
    Spawned { robot: RobotId, pid: u32 },
    /// It could not be started.
    NotSpawned { robot: RobotId },
    /// A process ended after it ran for a time.
    Exited { robot: RobotId, exit: Exit, ran: Duration },
    /// A liveliness token appeared or disappeared.
    Liveliness { robot: RobotId, alive: bool },
    /// The wait before a restart is over.
    Due { robot: RobotId, restarts: u32 },
    /// The end of this process is wanted: it is not started again.
    Hold { robot: RobotId },
    /// An ended process is wanted again.
    Start { robot: RobotId },
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Tell everyone.
    Tell(TeamEvent),
    /// Start the process now.
    Spawn(RobotId),
    /// Hand in [`Input::Due`] after a time.
    Wait { robot: RobotId, restarts: u32, delay: Duration },
}

/// What is known of a team.
#[derive(Debug)]
pub(crate) struct Membership {
    policy: RestartPolicy,
    slots: BTreeMap<RobotId, Slot>,
}

#[derive(Debug)]
struct Slot {
    member: Member,
    /// Whether its end is a failure, rather than what was asked for.
    wanted: bool,
    /// Restarts without a healthy run between them.
    attempts: u32,
}

impl Membership {
    /// A team that has just been started.
    pub(crate) fn new(policy: RestartPolicy, pids: &BTreeMap<RobotId, u32>) -> Self {
        let slot = |pid| Slot {
            member: Member { process: ProcessState::Running { pid }, alive: false, restarts: 0 },
            wanted: true,
            attempts: 0,
        };
        Self { policy, slots: pids.iter().map(|(robot, pid)| (*robot, slot(*pid))).collect() }
    }

    /// What is known of everyone.
    pub(crate) fn members(&self) -> BTreeMap<RobotId, Member> {
        self.slots.iter().map(|(robot, slot)| (*robot, slot.member)).collect()
    }

    /// Takes an input; robots that are not of the team are ignored.
    pub(crate) fn handle(&mut self, input: Input) -> Vec<Action> {
        let (Input::Spawned { robot, .. }
        | Input::NotSpawned { robot }
        | Input::Exited { robot, .. }
        | Input::Liveliness { robot, .. }
        | Input::Due { robot, .. }
        | Input::Hold { robot }
        | Input::Start { robot }) = input;
        let Some(slot) = self.slots.get_mut(&robot) else { return Vec::new() };
        let member = &mut slot.member;
        match input {
            Input::Spawned { pid, .. } => {
                member.process = ProcessState::Running { pid };
                member.restarts += 1;
                vec![Action::Tell(TeamEvent::Restarted { robot, restarts: member.restarts })]
            }
            Input::NotSpawned { .. } => slot.exited(robot, Exit::NotStarted, Duration::ZERO, &self.policy),
            Input::Exited { exit, ran, .. } => slot.exited(robot, exit, ran, &self.policy),
            Input::Liveliness { alive, .. } => {
                // A token without a process is not this team's; one that is late says nothing new.
                let believed = !alive || member.pid().is_some();
                if !believed || alive == member.alive {
                    return Vec::new();
                }
                member.alive = alive;
                let event = if alive { TeamEvent::AgentUp { robot } } else { TeamEvent::AgentDown { robot } };
                vec![Action::Tell(event)]
            }
            Input::Due { restarts, .. } => {
                let waiting = matches!(member.process, ProcessState::Restarting { .. });
                if waiting && member.restarts == restarts { vec![Action::Spawn(robot)] } else { Vec::new() }
            }
            Input::Hold { .. } => {
                slot.wanted = false;
                if let ProcessState::Restarting { exit } = member.process {
                    member.process = ProcessState::Ended { exit };
                }
                Vec::new()
            }
            Input::Start { .. } => {
                let ProcessState::Ended { exit } = member.process else { return Vec::new() };
                member.process = ProcessState::Restarting { exit };
                slot.wanted = true;
                slot.attempts = 0;
                vec![Action::Spawn(robot)]
            }
        }
    }
}

impl Slot {
    fn exited(&mut self, robot: RobotId, exit: Exit, ran: Duration, policy: &RestartPolicy) -> Vec<Action> {
        let mut actions = Vec::new();
        if std::mem::replace(&mut self.member.alive, false) {
            actions.push(Action::Tell(TeamEvent::AgentDown { robot }));
        }
        actions.push(Action::Tell(TeamEvent::Exited { robot, exit }));
        if policy.stable(ran) {
            self.attempts = 0;
        }
        let verdict = if self.wanted { policy.verdict(exit, self.attempts) } else { Verdict::Leave };
        self.member.process = ProcessState::Ended { exit };
        match verdict {
            Verdict::Leave => {}
            Verdict::After(delay) => {
                self.attempts += 1;
                self.member.process = ProcessState::Restarting { exit };
                actions.push(Action::Wait { robot, restarts: self.member.restarts, delay });
            }
            Verdict::GiveUp => {
                actions.push(Action::Tell(TeamEvent::GaveUp { robot, attempts: self.attempts }));
            }
        }
        actions
    }
}

#[cfg(test)]
mod tests;

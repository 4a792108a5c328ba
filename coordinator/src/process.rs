//! One agent's process.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::Duration;

use pleiad_protocol::RobotId;
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, prlimit};
use tokio::process::{Child, Command};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use crate::config::{AgentEntry, CoordinatorConfig, value};
use crate::restart::Exit;
use crate::{CoordinatorError, log_tail};

/// What can be sent to an agent's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessSignal {
    /// End, please (SIGTERM).
    Terminate,
    /// End at once (SIGKILL).
    Kill,
    /// Stand still (SIGSTOP).
    Pause,
    /// Go on (SIGCONT).
    Resume,
}

impl ProcessSignal {
    const fn unix(self) -> Signal {
        match self {
            Self::Terminate => Signal::TERM,
            Self::Kill => Signal::KILL,
            Self::Pause => Signal::STOP,
            Self::Resume => Signal::CONT,
        }
    }
}

impl fmt::Display for ProcessSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Terminate => "SIGTERM",
            Self::Kill => "SIGKILL",
            Self::Pause => "SIGSTOP",
            Self::Resume => "SIGCONT",
        })
    }
}

/// How the agents of a team are started.
#[derive(Debug)]
pub(crate) struct Launcher {
    executable: PathBuf,
    agents: BTreeMap<RobotId, AgentEntry>,
}

impl Launcher {
    pub(crate) fn new(config: &CoordinatorConfig) -> Result<Self, CoordinatorError> {
        let executable = config
            .executable
            .clone()
            .ok_or_else(|| value("executable", &"nothing", "the path of the pleiad program"))?;
        let agents = config.agents.iter().map(|agent| (agent.id(), agent.clone())).collect();
        Ok(Self { executable, agents })
    }

    /// Starts the agent of a robot. The process is killed when dropped, until told otherwise by
    /// [`Process::keep_on_drop`].
    pub(crate) fn spawn(&self, robot: RobotId) -> Result<Process, CoordinatorError> {
        let agent = self.agents.get(&robot).ok_or(CoordinatorError::UnknownRobot { robot })?;
        let path = agent.log();
        let log = log_tail::open(&path).and_then(|log| Ok((log.try_clone()?, log)));
        let (output, errors) = log.map_err(|cause| CoordinatorError::Log { robot, path, cause })?;
        let child = Command::new(&self.executable)
            .args(["agent", "--config"])
            .arg(&agent.config)
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(errors)
            // What is sent to the coordinator's group, such as Ctrl-C, is not meant for the agents.
            .process_group(0)
            .spawn();
        let spawn = |cause| CoordinatorError::Spawn { robot, executable: self.executable.clone(), cause };
        let child = child.map_err(spawn)?;
        let pid = child.id().ok_or_else(|| spawn(io::Error::other("it has no process id")))?;
        Ok(Process { child, pid, started: Instant::now(), kill_on_drop: true })
    }
}

/// What is to be done to a running process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Treatment {
    /// Send a signal.
    Signal(ProcessSignal),
    /// Let none of its files grow beyond so many bytes, as if the disk were full (`RLIMIT_FSIZE`); `None`
    /// lifts that.
    LimitFiles(Option<u64>),
}

impl fmt::Display for Treatment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signal(signal) => signal.fmt(f),
            Self::LimitFiles(Some(bytes)) => write!(f, "a file size limit of {bytes} bytes"),
            Self::LimitFiles(None) => f.write_str("the end of its file size limit"),
        }
    }
}

/// What is to be done to a process, and where the outcome goes.
pub(crate) type Order = (Treatment, oneshot::Sender<io::Result<()>>);

/// A running process, not yet waited for.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    pid: u32,
    started: Instant,
    kill_on_drop: bool,
}

impl Process {
    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// From now on the process outlives this.
    pub(crate) fn keep_on_drop(&mut self) {
        self.kill_on_drop = false;
    }

    /// Waits until the process has ended, treating it meanwhile. Both happen here, so that nothing is done to
    /// a process id that the system has given to someone else.
    pub(crate) async fn wait(mut self, mut orders: mpsc::Receiver<Order>) -> (Exit, Duration) {
        loop {
            tokio::select! {
                status = self.child.wait() => {
                    let exit = status.map_or(Exit::NotStarted, Exit::from);
                    return (exit, self.started.elapsed());
                }
                Some((treatment, outcome)) = orders.recv() => {
                    // Who asked may have stopped waiting.
                    let _ = outcome.send(self.treat(treatment));
                }
            }
        }
    }

    /// A process that has ended needs no treatment.
    fn treat(&self, treatment: Treatment) -> io::Result<()> {
        let pid = self.child.id().and_then(|pid| i32::try_from(pid).ok()).and_then(Pid::from_raw);
        let Some(pid) = pid else { return Ok(()) };
        match treatment {
            Treatment::Signal(signal) => kill_process(pid, signal.unix())?,
            Treatment::LimitFiles(bytes) => {
                // The soft limit alone, so that no privilege is needed to lift it again.
                let own = getrlimit(Resource::Fsize);
                let current = if bytes.is_some() { bytes } else { own.current };
                prlimit(Some(pid), Resource::Fsize, Rlimit { current, maximum: own.maximum })?;
            }
        }
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if self.kill_on_drop {
            // Refused only where it has ended.
            let _ = self.child.start_kill();
        }
    }
}

//! Talking to agents and to the supervisor of their processes, and the steps by which a process is ended.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_protocol::{ControlReply, ControlRequest, RobotId, TeamName};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::Instant;

use crate::membership::Member;
use crate::process::{ProcessSignal, Treatment};
use crate::restart::Exit;
use crate::supervisor::{Members, Request};
use crate::{CoordinatorError, control};

/// How long a process may take to end after a signal.
const GRACE: Duration = Duration::from_secs(5);
/// An agent whose answer does not come is asked again after this.
const PAUSE: Duration = Duration::from_millis(250);

/// How a process came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// It had ended before.
    Before,
    /// It was asked through the bus.
    Asked,
    /// It was sent SIGTERM.
    Terminated,
    /// It was sent SIGKILL.
    Killed,
}

/// The end of an agent's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    /// What it took.
    pub how: How,
    /// How it ended.
    pub exit: Exit,
}

/// What it takes to talk to agents and to their supervisor.
#[derive(Clone)]
pub(crate) struct Handle<B> {
    pub(crate) bus: B,
    pub(crate) team: TeamName,
    pub(crate) requests: mpsc::Sender<Request>,
    pub(crate) members: watch::Receiver<Members>,
}

impl<B: Bus + Clone> Handle<B> {
    pub(crate) async fn ask_all(
        &self,
        robots: &BTreeSet<RobotId>,
        request: ControlRequest,
        timeout: Duration,
    ) -> BTreeMap<RobotId, Result<ControlReply, CoordinatorError>> {
        control::ask_all(&self.bus, &self.team, robots, request, timeout).await
    }

    pub(crate) async fn request<T>(
        &self,
        request: Request,
        answer: oneshot::Receiver<T>,
    ) -> Result<Option<T>, CoordinatorError> {
        self.requests.send(request).await.map_err(|_| CoordinatorError::Unsupervised)?;
        Ok(answer.await.ok())
    }

    pub(crate) async fn hold(&self, robots: BTreeSet<RobotId>) -> Result<(), CoordinatorError> {
        let (done, answer) = oneshot::channel();
        self.request(Request::Hold { robots, done }, answer).await?;
        Ok(())
    }

    pub(crate) async fn signal(&self, robot: RobotId, signal: ProcessSignal) -> Result<(), CoordinatorError> {
        self.treat(robot, Treatment::Signal(signal)).await
    }

    /// A process that has ended in the meantime needs no treatment.
    pub(crate) async fn treat(&self, robot: RobotId, treatment: Treatment) -> Result<(), CoordinatorError> {
        let (done, answer) = oneshot::channel();
        match self.request(Request::Treat { robot, treatment, done }, answer).await? {
            Some(Err(cause)) => {
                Err(CoordinatorError::Treatment { robot, treatment: treatment.to_string(), cause })
            }
            Some(Ok(())) | None => Ok(()),
        }
    }

    /// Waits until this is so, or the time is over.
    pub(crate) async fn wait_for(
        &self,
        timeout: Duration,
        is_so: impl FnMut(&Members) -> bool,
    ) -> Result<(), CoordinatorError> {
        let mut members = self.members.clone();
        match tokio::time::timeout(timeout, members.wait_for(is_so)).await {
            Ok(Err(_)) => Err(CoordinatorError::Unsupervised),
            Ok(Ok(_)) | Err(_) => Ok(()),
        }
    }

    fn member(&self, robot: RobotId) -> Result<Member, CoordinatorError> {
        self.members.borrow().get(&robot).copied().ok_or(CoordinatorError::UnknownRobot { robot })
    }

    /// How the process ended, if it has within this time.
    pub(crate) async fn ended(
        &self,
        robot: RobotId,
        within: Duration,
    ) -> Result<Option<Exit>, CoordinatorError> {
        let ended = |members: &Members| members.get(&robot).is_none_or(|member| member.ended().is_some());
        self.wait_for(within, ended).await?;
        Ok(self.member(robot)?.ended())
    }

    /// Ends a process that is not to be restarted. An agent that is not up cannot be asked.
    pub(crate) async fn end(&self, robot: RobotId, timeout: Duration) -> Result<Departure, CoordinatorError> {
        let member = self.member(robot)?;
        if let Some(exit) = member.ended() {
            return Ok(Departure { how: How::Before, exit });
        }
        if member.alive
            && let Some(exit) = self.ask_to_end(robot, timeout).await?
        {
            return Ok(Departure { how: How::Asked, exit });
        }
        self.signal(robot, ProcessSignal::Terminate).await?;
        if let Some(exit) = self.ended(robot, GRACE).await? {
            return Ok(Departure { how: How::Terminated, exit });
        }
        self.signal(robot, ProcessSignal::Kill).await?;
        Ok(Departure { how: How::Killed, exit: self.killed(robot).await? })
    }

    /// Asks for the end of a process, and waits for it.
    async fn ask_to_end(&self, robot: RobotId, timeout: Duration) -> Result<Option<Exit>, CoordinatorError> {
        let deadline = Instant::now() + timeout;
        let left = || deadline.saturating_duration_since(Instant::now());
        while self.member(robot)?.alive && !left().is_zero() {
            let asked = self.ask(robot, ControlRequest::Shutdown, left()).await;
            match asked.and_then(|reply| control::accepted(robot, &reply)) {
                Ok(()) => return self.ended(robot, left()).await,
                // The question can be lost, and the answer too while its sender ends.
                Err(CoordinatorError::Bus(_)) => {
                    if let Some(exit) = self.ended(robot, PAUSE).await? {
                        return Ok(Some(exit));
                    }
                }
                Err(error) => {
                    tracing::warn!(robot = robot.0, %error, "the agent did not agree to end");
                    return Ok(None);
                }
            }
        }
        // It has left the bus.
        self.ended(robot, left().min(GRACE)).await
    }

    /// Tells an agent that its input has ended, until it has heard it or has ended.
    pub(crate) async fn finish(&self, robot: RobotId, timeout: Duration) -> Result<(), CoordinatorError> {
        let deadline = Instant::now() + timeout;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let asked = self.ask(robot, ControlRequest::Finish, left).await;
            match asked.and_then(|reply| control::accepted(robot, &reply)) {
                // The question can be lost, or a link not be there yet.
                Err(CoordinatorError::Bus(_)) if Instant::now() + PAUSE < deadline => {
                    if let Some(exit) = self.ended(robot, PAUSE).await? {
                        let found = format!("nothing and ended ({exit})");
                        return Err(CoordinatorError::Reply { robot, found, expected: control::DONE });
                    }
                }
                outcome => return outcome,
            }
        }
    }

    async fn ask(
        &self,
        robot: RobotId,
        request: ControlRequest,
        timeout: Duration,
    ) -> Result<ControlReply, CoordinatorError> {
        control::ask(&self.bus, &self.team, robot, request, timeout).await
    }

    /// Waits for the end of a killed process.
    pub(crate) async fn killed(&self, robot: RobotId) -> Result<Exit, CoordinatorError> {
        let pid = self.member(robot)?.pid().unwrap_or_default();
        self.ended(robot, GRACE).await?.ok_or(CoordinatorError::StillRunning { robot, pid })
    }
}

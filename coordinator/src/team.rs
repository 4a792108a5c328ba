//! A team of agent processes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{ControlRequest, RobotId, Status};
use tokio::sync::{broadcast, mpsc, oneshot};
use tokio::task::JoinSet;
use tokio::time::Instant;

use crate::config::{AgentEntry, CoordinatorConfig};
use crate::handle::{Departure, Handle, How};
use crate::membership::{Member, Membership, TeamEvent};
use crate::process::{Launcher, ProcessSignal, Treatment};
use crate::restart::{Exit, seconds};
use crate::settled::{Difference, differences};
use crate::supervisor::{Members, Request, Supervisor};
use crate::{CoordinatorError, Trouble, control, log_tail};

/// Agents that are there answer within this; it is long because processors may be busy.
const STATUS_TIMEOUT: Duration = Duration::from_secs(2);
/// Whether anyone is there already is asked this long.
const PRESENCE_TIMEOUT: Duration = Duration::from_millis(500);
/// An agent writes its results before it answers that it has finished.
const FINISH_TIMEOUT: Duration = Duration::from_mins(1);
/// How many events may wait for a slow receiver.
const EVENTS: usize = 1024;

/// A running team. Dropped without [`Team::shutdown`], it kills its agents, unless `detached`.
pub struct Team<B> {
    handle: Handle<B>,
    agents: BTreeMap<RobotId, AgentEntry>,
    status_period: Duration,
    shutdown_timeout: Duration,
    events: broadcast::Sender<TeamEvent>,
    /// Since the launch, for the first who asks.
    first_events: Option<broadcast::Receiver<TeamEvent>>,
}

impl<B: Bus + Clone> Team<B> {
    /// Starts all agents and their supervision. Agents are started but need not be up on return; see
    /// [`Team::wait_until_alive`].
    ///
    /// # Errors
    /// If the configuration is wrong, an agent of the team answers already, a log cannot be written or a
    /// process not started. None is left running then.
    pub async fn launch(config: &CoordinatorConfig, bus: B) -> Result<Self, CoordinatorError> {
        config.check()?;
        let team = config.team()?;
        let robots = config.robots();
        let launcher = Launcher::new(config)?;
        let present = control::ask_all(&bus, &team, &robots, ControlRequest::Status, PRESENCE_TIMEOUT).await;
        let silent = |reply: &Result<_, _>| matches!(reply, Err(CoordinatorError::Bus(_)));
        let present: Vec<_> =
            present.iter().filter(|(_, reply)| !silent(reply)).map(|(robot, _)| *robot).collect();
        if !present.is_empty() {
            return Err(CoordinatorError::AlreadyRunning { team: team.to_string(), robots: present });
        }
        let liveliness = bus.watch(&keys::all(&team, Kind::Alive)).await?;
        let mut processes = BTreeMap::new();
        for robot in robots {
            processes.insert(robot, launcher.spawn(robot)?);
        }
        let pids: BTreeMap<_, _> = processes.iter().map(|(robot, process)| (*robot, process.pid())).collect();
        tracing::info!(team = team.as_str(), agents = pids.len(), "team launched");
        let membership = Membership::new(config.policy(), &pids);
        let (events, first_events) = broadcast::channel(EVENTS);
        let supervisor = Supervisor::new(launcher, config.detached, membership, processes, events.clone());
        let members = supervisor.members();
        let (requests, asked) = mpsc::channel(64);
        tokio::spawn(supervisor.run(asked, liveliness));
        Ok(Self {
            handle: Handle { bus, team, requests, members },
            agents: config.agents.iter().map(|agent| (agent.id(), agent.clone())).collect(),
            status_period: seconds(config.status_period_s),
            shutdown_timeout: seconds(config.shutdown_timeout_s),
            events,
            first_events: Some(first_events),
        })
    }

    /// What happens in the team: for the first who asks since the launch, for others from now on. Who is
    /// more than a thousand events late loses the oldest.
    pub fn events(&mut self) -> broadcast::Receiver<TeamEvent> {
        self.first_events.take().unwrap_or_else(|| self.events.subscribe())
    }

    /// What is known of every agent.
    pub fn members(&self) -> BTreeMap<RobotId, Member> {
        self.handle.members.borrow().clone()
    }

    /// The ids of the running processes.
    pub fn pids(&self) -> BTreeMap<RobotId, u32> {
        let members = self.members();
        members.iter().filter_map(|(robot, member)| Some((*robot, member.pid()?))).collect()
    }

    /// Waits until the liveliness tokens of all agents are seen.
    ///
    /// # Errors
    /// [`CoordinatorError::Ended`] as soon as an agent has ended for good,
    /// [`CoordinatorError::NotAlive`] after the timeout; both with the ends of the logs.
    pub async fn wait_until_alive(&self, timeout: Duration) -> Result<(), CoordinatorError> {
        let up = |member: &Member| member.alive && member.pid().is_some();
        let decided = |members: &Members| {
            members.values().all(up) || members.values().any(|member| member.ended().is_some())
        };
        self.handle.wait_for(timeout, decided).await?;
        let ended = self.troubles(|_, member| member.ended().is_some());
        if !ended.is_empty() {
            return Err(CoordinatorError::Ended { ended });
        }
        let missing = self.troubles(|_, member| !up(member));
        if missing.is_empty() {
            Ok(())
        } else {
            Err(CoordinatorError::NotAlive { seconds: timeout.as_secs_f64(), missing })
        }
    }

    /// The statuses of all agents, as of now.
    pub async fn statuses(&self) -> BTreeMap<RobotId, Result<Status, CoordinatorError>> {
        self.statuses_of(&self.robots()).await
    }

    async fn statuses_of(
        &self,
        robots: &BTreeSet<RobotId>,
    ) -> BTreeMap<RobotId, Result<Status, CoordinatorError>> {
        let replies = self.handle.ask_all(robots, ControlRequest::Status, STATUS_TIMEOUT).await;
        let status = |(robot, reply): (RobotId, Result<_, _>)| {
            (robot, reply.and_then(|reply| control::status(robot, reply)))
        };
        replies.into_iter().map(status).collect()
    }

    /// Waits until the team has settled: the input of every agent has ended, all observations are
    /// answered as far as they can be, all hold the same entries and have the same estimate. Robots in
    /// `except` (known dead) are neither asked nor waited for; what they said before is compared.
    ///
    /// Returns the statuses that showed it.
    ///
    /// # Errors
    /// [`CoordinatorError::NotSettled`] after the timeout, [`CoordinatorError::NeverSettles`] as soon as
    /// waiting cannot help, [`CoordinatorError::Ended`] if an agent that is needed has ended for good.
    pub async fn wait_until_settled(
        &self,
        except: &BTreeSet<RobotId>,
        timeout: Duration,
    ) -> Result<BTreeMap<RobotId, Status>, CoordinatorError> {
        let needed = &self.robots() - except;
        let deadline = Instant::now() + timeout;
        let mut looks = tokio::time::interval(self.status_period);
        loop {
            // The deadline ends the waiting for a look, not the look itself.
            let _ = tokio::time::timeout_at(deadline, looks.tick()).await;
            let ended = self.troubles(|robot, member| needed.contains(&robot) && member.ended().is_some());
            if !ended.is_empty() {
                return Err(CoordinatorError::Ended { ended });
            }
            let statuses = self.statuses_of(&needed).await;
            let differences = differences(&statuses);
            if differences.is_empty() {
                return statuses.into_iter().map(|(robot, status)| Ok((robot, status?))).collect();
            }
            tracing::debug!(differences = differences.len(), first = %differences[0], "not settled");
            if differences.iter().any(Difference::permanent) {
                return Err(CoordinatorError::NeverSettles { differences });
            }
            if Instant::now() >= deadline {
                return Err(CoordinatorError::NotSettled { seconds: timeout.as_secs_f64(), differences });
            }
        }
    }

    /// Tells all agents that have not ended that their sensor input has, and to write their results.
    pub async fn finish(&self) -> BTreeMap<RobotId, Result<(), CoordinatorError>> {
        let mut finishes = JoinSet::new();
        for (robot, member) in self.members() {
            if member.ended().is_none() {
                let handle = self.handle.clone();
                finishes.spawn(async move { (robot, handle.finish(robot, FINISH_TIMEOUT).await) });
            }
        }
        finishes.join_all().await.into_iter().collect()
    }

    /// Ends all agents: asks those that are up, waits, then sends SIGTERM, then SIGKILL, five seconds
    /// apart. None is restarted.
    ///
    /// # Errors
    /// [`CoordinatorError::StillRunning`] if the system holds a killed process, after all others have
    /// ended.
    pub async fn shutdown(
        &self,
        timeout: Duration,
    ) -> Result<BTreeMap<RobotId, Departure>, CoordinatorError> {
        let robots = self.robots();
        self.handle.hold(robots.clone()).await?;
        let mut ends = JoinSet::new();
        for robot in robots {
            let handle = self.handle.clone();
            ends.spawn(async move { (robot, handle.end(robot, timeout).await) });
        }
        let ends: BTreeMap<_, _> = ends.join_all().await.into_iter().collect();
        for (robot, end) in &ends {
            match end {
                Ok(Departure { how: How::Before | How::Asked, .. }) => {}
                Ok(Departure { how, exit }) => {
                    tracing::warn!(robot = robot.0, ?how, %exit, "the agent did not end by itself");
                }
                Err(error) => tracing::error!(robot = robot.0, %error, "the agent cannot be ended"),
            }
        }
        ends.into_iter().map(|(robot, end)| Ok((robot, end?))).collect()
    }

    /// Kills an agent's process (SIGKILL), waits until it has ended, and does not restart it.
    ///
    /// # Errors
    /// [`CoordinatorError::UnknownRobot`], [`CoordinatorError::StillRunning`].
    pub async fn kill(&self, robot: RobotId) -> Result<Exit, CoordinatorError> {
        self.agent(robot)?;
        self.handle.hold(BTreeSet::from([robot])).await?;
        self.handle.signal(robot, ProcessSignal::Kill).await?;
        self.handle.killed(robot).await
    }

    /// Ends an agent's process, as in [`Team::shutdown`], if it has not ended, and starts it again. It
    /// need not be up on return.
    ///
    /// # Errors
    /// [`CoordinatorError::UnknownRobot`], [`CoordinatorError::StillRunning`],
    /// [`CoordinatorError::Ended`] if it could not be started.
    pub async fn restart(&self, robot: RobotId) -> Result<(), CoordinatorError> {
        self.agent(robot)?;
        self.handle.hold(BTreeSet::from([robot])).await?;
        self.handle.end(robot, self.shutdown_timeout).await?;
        let (done, answer) = oneshot::channel();
        self.handle.request(Request::Start { robot, done }, answer).await?;
        let ended =
            self.troubles(|other, member| other == robot && matches!(member.ended(), Some(Exit::NotStarted)));
        if ended.is_empty() { Ok(()) } else { Err(CoordinatorError::Ended { ended }) }
    }

    /// Sends a signal to an agent's process. One that ends by it is restarted if so configured; see
    /// [`Team::kill`] for one that is not.
    ///
    /// # Errors
    /// [`CoordinatorError::UnknownRobot`], [`CoordinatorError::Treatment`].
    pub async fn signal(&self, robot: RobotId, signal: ProcessSignal) -> Result<(), CoordinatorError> {
        self.agent(robot)?;
        self.handle.signal(robot, signal).await
    }

    /// Lets no file of an agent grow beyond so many bytes, as if its disk were full, until this is lifted
    /// with `None` or the process ends. An agent that ends by it is not restarted; see [`Team::restart`].
    ///
    /// # Errors
    /// [`CoordinatorError::UnknownRobot`], [`CoordinatorError::Treatment`].
    pub async fn limit_files(&self, robot: RobotId, bytes: Option<u64>) -> Result<(), CoordinatorError> {
        self.agent(robot)?;
        if bytes.is_some() {
            self.handle.hold(BTreeSet::from([robot])).await?;
        }
        self.handle.treat(robot, Treatment::LimitFiles(bytes)).await
    }

    /// How an agent ended for good, if it does within this time.
    ///
    /// # Errors
    /// [`CoordinatorError::UnknownRobot`], [`CoordinatorError::Unsupervised`].
    pub async fn ended(&self, robot: RobotId, within: Duration) -> Result<Option<Exit>, CoordinatorError> {
        self.agent(robot)?;
        self.handle.ended(robot, within).await
    }

    /// Waits until all agents have ended for good; returns how.
    ///
    /// # Errors
    /// [`CoordinatorError::Unsupervised`].
    pub async fn wait_until_ended(&self) -> Result<BTreeMap<RobotId, Exit>, CoordinatorError> {
        let mut members = self.handle.members.clone();
        let all = |members: &Members| members.values().all(|member| member.ended().is_some());
        let members = members.wait_for(all).await.map_err(|_| CoordinatorError::Unsupervised)?;
        Ok(members.iter().filter_map(|(robot, member)| Some((*robot, member.ended()?))).collect())
    }

    fn robots(&self) -> BTreeSet<RobotId> {
        self.agents.keys().copied().collect()
    }

    fn agent(&self, robot: RobotId) -> Result<&AgentEntry, CoordinatorError> {
        self.agents.get(&robot).ok_or(CoordinatorError::UnknownRobot { robot })
    }

    /// The agents of which this is true, with the ends of their logs.
    fn troubles(&self, is_so: impl Fn(RobotId, &Member) -> bool) -> Vec<Trouble> {
        let trouble = |(robot, member): (RobotId, Member)| {
            let log = self.agents.get(&robot).map_or_else(PathBuf::new, AgentEntry::log);
            let tail = log_tail::tail(&log);
            Trouble { robot, member, log, tail }
        };
        let members = self.members().into_iter();
        members.filter(|(robot, member)| is_so(*robot, member)).map(trouble).collect()
    }

    /// The configured time between two looks at the statuses.
    pub(crate) fn status_period(&self) -> Duration {
        self.status_period
    }
}

//! A team that somebody else has launched: asked and told through the bus alone.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_protocol::keys::{self, Key, Kind};
use pleiad_protocol::{ControlRequest, RobotId, Status, TeamName};
use tokio::time::Instant;

use crate::CoordinatorError;
use crate::control;
use crate::settled::{Difference, differences};

/// Agents that are there answer within this.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(100);
/// When nobody else has turned up for so long, everybody is there.
const QUIET: Duration = Duration::from_secs(1);

/// Why a robot was not evicted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvictError {
    /// Nobody to tell.
    #[error(
        "no agent of team {team} was found within {seconds:.0} s; are the team's name and --connect right?"
    )]
    Nobody {
        /// The team.
        team: String,
        /// How long was looked.
        seconds: f64,
    },
    /// It is not gone.
    #[error(
        "robot {robot} answers: it has not gone, and would ask to be admitted again; end its agent first, or \
         say --anyway"
    )]
    Answers {
        /// Whom.
        robot: RobotId,
    },
    /// There is nobody else.
    #[error("robot {robot} is the only one of its team that was found; nobody is left to evict it")]
    Alone {
        /// Whom.
        robot: RobotId,
    },
    /// There is nothing to be evicted from.
    #[error(
        "robot {robot} keeps all facts: its configuration names no ledger.members, so that nobody is waited \
         for and nobody needs to be evicted"
    )]
    KeepsEverything {
        /// Who said so.
        robot: RobotId,
    },
    /// It is not done yet.
    #[error(
        "after {seconds:.0} s the eviction of robot {robot} is not decided at {}; is it a member of the team, do \
         these have odometry, and do they reach one another? What was asked for stays asked for",
        list(missing)
    )]
    NotDecided {
        /// Whom.
        robot: RobotId,
        /// Who has not decided.
        missing: Vec<RobotId>,
        /// How long was waited.
        seconds: f64,
    },
    /// Asking failed.
    #[error(transparent)]
    Coordinator(#[from] CoordinatorError),
}

fn list(robots: &[RobotId]) -> String {
    let robots: Vec<String> = robots.iter().map(|robot| format!("robot {robot}")).collect();
    robots.join(", ")
}

/// A team of agents that run by themselves.
#[derive(Clone, Debug)]
pub struct Remote<B> {
    bus: B,
    team: TeamName,
    robots: BTreeSet<RobotId>,
}

impl<B: Bus + Clone> Remote<B> {
    /// The agents of these robots.
    pub fn new(bus: B, team: TeamName, robots: BTreeSet<RobotId>) -> Self {
        Self { bus, team, robots }
    }

    /// Whoever of a team announces himself; looks for at most `within`.
    ///
    /// # Errors
    /// If the bus fails.
    pub async fn find(bus: B, team: TeamName, within: Duration) -> Result<Self, CoordinatorError> {
        let mut tokens = bus.watch(&keys::all(&team, Kind::Alive)).await?;
        let deadline = Instant::now() + within;
        let mut robots = BTreeSet::new();
        loop {
            let until = if robots.is_empty() { deadline } else { deadline.min(Instant::now() + QUIET) };
            let Ok(Some(change)) = tokio::time::timeout_at(until, tokens.recv()).await else { break };
            if let Ok(Key { robot, .. }) = change.key.parse() {
                if change.alive {
                    robots.insert(robot);
                } else {
                    robots.remove(&robot);
                }
            }
        }
        Ok(Self { bus, team, robots })
    }

    /// Who is in it.
    pub fn robots(&self) -> &BTreeSet<RobotId> {
        &self.robots
    }

    /// The statuses of all agents, as of now.
    pub async fn statuses(&self) -> BTreeMap<RobotId, Result<Status, CoordinatorError>> {
        let asked = ControlRequest::Status;
        let replies = control::ask_all(&self.bus, &self.team, &self.robots, asked, ANSWER_TIMEOUT).await;
        let status = |(robot, reply): (RobotId, Result<_, _>)| {
            (robot, reply.and_then(|reply| control::status(robot, reply)))
        };
        replies.into_iter().map(status).collect()
    }

    /// Waits until the statuses are as wanted; `wanted` says in what they are not.
    async fn wait_until(
        &self,
        timeout: Duration,
        wanted: impl Fn(&BTreeMap<RobotId, Result<Status, CoordinatorError>>) -> Vec<Difference>,
    ) -> Result<(), CoordinatorError> {
        let deadline = Instant::now() + timeout;
        loop {
            let differences = wanted(&self.statuses().await);
            if differences.is_empty() {
                return Ok(());
            }
            if differences.iter().any(Difference::permanent) {
                return Err(CoordinatorError::NeverSettles { differences });
            }
            if Instant::now() >= deadline {
                return Err(CoordinatorError::NotSettled { seconds: timeout.as_secs_f64(), differences });
            }
            tokio::time::sleep(LOOK).await;
        }
    }

    /// Waits until all agents answer.
    ///
    /// # Errors
    /// [`CoordinatorError::NotSettled`] after the timeout, with who is silent.
    pub async fn wait_until_up(&self, timeout: Duration) -> Result<(), CoordinatorError> {
        let silent = |difference: &Difference| matches!(difference, Difference::Silent { .. });
        self.wait_until(timeout, |statuses| differences(statuses).into_iter().filter(silent).collect()).await
    }

    /// Waits until the team has settled, as [`crate::Team::wait_until_settled`].
    ///
    /// # Errors
    /// [`CoordinatorError::NotSettled`] after the timeout, [`CoordinatorError::NeverSettles`].
    pub async fn wait_until_settled(&self, timeout: Duration) -> Result<(), CoordinatorError> {
        self.wait_until(timeout, differences).await
    }

    /// Tells all agents to end, and waits until nobody announces himself any more.
    ///
    /// # Errors
    /// [`CoordinatorError::StillThere`] after the timeout.
    pub async fn shutdown(&self, timeout: Duration) -> Result<(), CoordinatorError> {
        let deadline = Instant::now() + timeout;
        let mut tokens = self.bus.watch(&keys::all(&self.team, Kind::Alive)).await?;
        let mut left = self.robots.clone();
        let mut asked = BTreeSet::new();
        loop {
            let to_ask: BTreeSet<RobotId> = left.difference(&asked).copied().collect();
            let replies =
                control::ask_all(&self.bus, &self.team, &to_ask, ControlRequest::Shutdown, ANSWER_TIMEOUT)
                    .await;
            asked.extend(replies.iter().filter(|(_, reply)| reply.is_ok()).map(|(robot, _)| *robot));
            while let Ok(Some(change)) = tokio::time::timeout(LOOK, tokens.recv()).await {
                if let Ok(Key { robot, .. }) = change.key.parse()
                    && !change.alive
                {
                    left.remove(&robot);
                }
            }
            if left.is_empty() {
                return Ok(());
            }
            if Instant::now() >= deadline {
                let (team, robots) = (self.team.to_string(), left.into_iter().collect());
                return Err(CoordinatorError::StillThere { team, robots });
            }
        }
    }

    /// Has a robot that will not come back evicted by the others, and waits until all of them that were
    /// found have decided it. One that answers is evicted only `anyway`.
    ///
    /// # Errors
    /// [`EvictError`].
    pub async fn evict(&self, robot: RobotId, anyway: bool, timeout: Duration) -> Result<(), EvictError> {
        let mut statuses = self.statuses().await;
        let its_own = statuses.remove(&robot);
        if its_own.is_some_and(|status| status.is_ok()) && !anyway {
            return Err(EvictError::Answers { robot });
        }
        let answering: BTreeMap<RobotId, Status> =
            statuses.into_iter().filter_map(|(other, status)| Some((other, status.ok()?))).collect();
        let Some((first, _)) = answering.first_key_value() else {
            return Err(EvictError::Alone { robot });
        };
        let epoch = |status: &Status| status.closure.as_ref().map(|closure| closure.epoch);
        let mut before = BTreeMap::new();
        for (other, status) in &answering {
            let epoch = epoch(status).ok_or(EvictError::KeepsEverything { robot: *other })?;
            before.insert(*other, epoch);
        }
        // One is enough: the others second an operator's vote.
        let told = ControlRequest::Evict(robot);
        let reply = control::ask(&self.bus, &self.team, *first, told, ANSWER_TIMEOUT).await?;
        control::accepted(*first, &reply)?;
        let deadline = Instant::now() + timeout;
        loop {
            let statuses = self.statuses().await;
            let decided = |other: &RobotId, before: &u32| match statuses.get(other) {
                Some(Ok(status)) => epoch(status).is_some_and(|now| now > *before),
                _ => false,
            };
            let missing: Vec<RobotId> = before
                .iter()
                .filter(|(other, before)| !decided(other, before))
                .map(|(other, _)| *other)
                .collect();
            if missing.is_empty() {
                return Ok(());
            }
            if Instant::now() >= deadline {
                return Err(EvictError::NotDecided { robot, missing, seconds: timeout.as_secs_f64() });
            }
            tokio::time::sleep(LOOK).await;
        }
    }
}

//! The whole life of a coordinator: what `pleiad coordinator --config FILE` does.

use std::collections::{BTreeMap, BTreeSet};
use std::future::Future;

use pleiad_bus::Bus;
use pleiad_protocol::RobotId;

use crate::restart::seconds;
use crate::{CoordinatorConfig, CoordinatorError, Departure, How, Recorder, Team, Traffic};

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub struct RunReport {
    /// How each agent's process ended.
    pub departures: BTreeMap<RobotId, Departure>,
    /// What was published, if it was recorded.
    pub traffic: Option<Traffic>,
}

impl RunReport {
    /// The robots whose agents ended with a failure, or had to be made to end.
    pub fn failed(&self) -> BTreeSet<RobotId> {
        let failed = |departure: &Departure| {
            departure.exit.failed() || matches!(departure.how, How::Terminated | How::Killed)
        };
        self.departures.iter().filter(|(_, departure)| failed(departure)).map(|(robot, _)| *robot).collect()
    }
}

/// Launches a team, records it if so configured, supervises it until `stop` or until all agents have
/// ended for good, and ends what is left of it.
///
/// A recorder that fails is reported and does not end the run.
///
/// # Errors
/// As [`Team::launch`] and [`Team::shutdown`].
pub async fn run<B: Bus + Clone>(
    config: &CoordinatorConfig,
    bus: B,
    stop: impl Future<Output = ()> + Send,
) -> Result<RunReport, CoordinatorError> {
    // Before the agents, so that nothing they say is missed.
    let recorder = match &config.record {
        Some(folder) => Some(Recorder::start(&bus, &config.team()?, folder).await?),
        None => None,
    };
    let team = Team::launch(config, bus).await?;
    tokio::select! {
        () = stop => tracing::info!("told to stop"),
        ended = team.wait_until_ended() => tracing::info!(agents = ended?.len(), "all agents have ended"),
        () = follow(&team) => {}
    }
    let departures = team.shutdown(seconds(config.shutdown_timeout_s)).await?;
    let traffic = match recorder {
        Some(recorder) => match recorder.finish().await {
            Ok(traffic) => Some(traffic),
            Err(error) => {
                tracing::error!(%error, "the recording is incomplete");
                None
            }
        },
        None => None,
    };
    Ok(RunReport { departures, traffic })
}

/// Looks at the statuses for as long as it is polled, and tells who is up but does not answer.
async fn follow<B: Bus + Clone>(team: &Team<B>) {
    let mut looks = tokio::time::interval(team.status_period());
    looks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut silent = BTreeSet::new();
    loop {
        looks.tick().await;
        for (robot, status) in team.statuses().await {
            match status {
                Ok(status) => {
                    tracing::debug!(
                        robot = robot.0,
                        facts_used = status.facts.used,
                        facts_pending = status.facts.pending,
                        drained = status.drained,
                        "status"
                    );
                    if silent.remove(&robot) {
                        tracing::info!(robot = robot.0, "the agent answers again");
                    }
                }
                Err(error) => {
                    let up = team.members().get(&robot).is_some_and(|member| member.alive);
                    if up && silent.insert(robot) {
                        tracing::warn!(robot = robot.0, %error, "the agent is up but does not answer");
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Exit;

    #[test]
    fn only_an_orderly_end_is_no_failure() {
        let ends = [
            (1, How::Asked, Exit::Code(0)),
            (2, How::Asked, Exit::Code(1)),
            (3, How::Before, Exit::Code(0)),
            (4, How::Before, Exit::Signal(11)),
            (5, How::Terminated, Exit::Code(0)),
            (6, How::Killed, Exit::Signal(9)),
        ];
        let departures = ends.map(|(robot, how, exit)| (RobotId(robot), Departure { how, exit })).into();
        let report = RunReport { departures, traffic: None };
        assert_eq!(report.failed(), [2, 4, 5, 6].map(RobotId).into());
    }
}

//! Asking agents through their control keys.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{ControlReply, ControlRequest, Message, RobotId, Status, TeamName};
use tokio::task::JoinSet;

use crate::CoordinatorError;

/// What is expected where something is to be done.
pub(crate) const DONE: &str = "that it will be done";

/// Asks one agent.
pub(crate) async fn ask<B: Bus>(
    bus: &B,
    team: &TeamName,
    robot: RobotId,
    request: ControlRequest,
    timeout: Duration,
) -> Result<ControlReply, CoordinatorError> {
    let key = keys::of(team, robot, Kind::Control);
    let reply = bus.request(&key, Message::ControlRequest(request).encode(), timeout).await?;
    match Message::decode(&reply) {
        Ok(Message::ControlReply(reply)) => Ok(reply),
        Ok(other) => Err(unexpected(robot, other.kind(), "control reply")),
        Err(cause) => Err(CoordinatorError::Protocol { robot, cause }),
    }
}

/// Asks several agents at once.
pub(crate) async fn ask_all<B: Bus + Clone>(
    bus: &B,
    team: &TeamName,
    robots: &BTreeSet<RobotId>,
    request: ControlRequest,
    timeout: Duration,
) -> BTreeMap<RobotId, Result<ControlReply, CoordinatorError>> {
    let mut asked = JoinSet::new();
    for robot in robots.iter().copied() {
        let (bus, team) = (bus.clone(), team.clone());
        asked.spawn(async move { (robot, ask(&bus, &team, robot, request, timeout).await) });
    }
    asked.join_all().await.into_iter().collect()
}

/// The status in a reply, if it is one and the robot's own.
pub(crate) fn status(robot: RobotId, reply: ControlReply) -> Result<Status, CoordinatorError> {
    match reply {
        ControlReply::Status(status) if status.robot == robot => Ok(status),
        ControlReply::Status(status) => {
            Err(unexpected(robot, &format!("the status of robot {}", status.robot), "its own status"))
        }
        other => Err(unexpected(robot, &words(&other), "its status")),
    }
}

/// Nothing, if the reply says that it will be done.
pub(crate) fn accepted(robot: RobotId, reply: &ControlReply) -> Result<(), CoordinatorError> {
    match reply {
        ControlReply::Accepted => Ok(()),
        other => Err(unexpected(robot, &words(other), DONE)),
    }
}

fn words(reply: &ControlReply) -> String {
    match reply {
        ControlReply::Status(_) => "a status".to_owned(),
        ControlReply::Accepted => DONE.to_owned(),
        ControlReply::Refused(why) => format!("that it will not: {why}"),
    }
}

fn unexpected(robot: RobotId, found: &str, expected: &'static str) -> CoordinatorError {
    CoordinatorError::Reply { robot, found: found.to_owned(), expected }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use pleiad_bus::{BusError, MemoryBus, MemoryNetwork};

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(30);
    const ONE: RobotId = RobotId(1);
    const TWO: RobotId = RobotId(2);

    fn team() -> TeamName {
        TeamName::new("blue").unwrap()
    }

    /// Answers everything asked of a robot with the same bytes, for as long as the bus is kept.
    async fn answer(network: &MemoryNetwork, robot: RobotId, reply: Vec<u8>) -> MemoryBus {
        let bus = network.join("agent");
        let mut queries = bus.serve(&keys::of(&team(), robot, Kind::Control)).await.unwrap();
        tokio::spawn(async move {
            while let Some(query) = queries.recv().await {
                let _ = query.reply.send(reply.clone());
            }
        });
        bus
    }

    #[tokio::test]
    async fn everyone_is_asked_and_who_is_not_there_is_told() {
        let network = MemoryNetwork::new();
        let _one = answer(&network, ONE, Message::ControlReply(ControlReply::Accepted).encode()).await;
        let bus = Arc::new(network.join("coordinator"));
        let robots = BTreeSet::from([ONE, TWO]);
        let replies = ask_all(&bus, &team(), &robots, ControlRequest::Finish, PATIENCE).await;
        assert_eq!(replies[&ONE].as_ref().unwrap(), &ControlReply::Accepted);
        let silent = replies[&TWO].as_ref().unwrap_err();
        assert!(matches!(silent, CoordinatorError::Bus(BusError::NoReply { .. })), "{silent}");
        assert!(silent.to_string().contains("pleiad/blue/2/control"), "{silent}");
    }

    #[tokio::test]
    async fn an_answer_that_is_none_is_told() {
        let network = MemoryNetwork::new();
        let _one = answer(&network, ONE, vec![99, 99]).await;
        let _two = answer(&network, TWO, pleiad_protocol::encode_entries(&[])).await;
        let bus = network.join("coordinator");
        let ask =
            async |robot| ask(&bus, &team(), robot, ControlRequest::Status, PATIENCE).await.unwrap_err();
        assert!(matches!(ask(ONE).await, CoordinatorError::Protocol { robot: ONE, .. }));
        assert!(matches!(ask(TWO).await, CoordinatorError::Reply { robot: TWO, .. }));
    }

    #[test]
    fn another_reply_than_the_one_asked_for_is_an_error() {
        assert!(accepted(ONE, &ControlReply::Accepted).is_ok());
        let refused = accepted(ONE, &ControlReply::Refused("the disk is full".into())).unwrap_err();
        assert!(refused.to_string().contains("the disk is full"), "{refused}");
        assert!(status(ONE, ControlReply::Accepted).is_err());
    }
}

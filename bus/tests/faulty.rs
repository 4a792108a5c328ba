//! Faults around a real bus: what is lost, what passes, and when.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::time::Duration;

use pleiad_bus::{Bus, BusError, FaultPlan, FaultyBus, Incoming, MemoryBus, MemoryNetwork};
use pleiad_protocol::{RobotId, Timestamp};
use tokio::sync::mpsc::Receiver;

const PATIENCE: Duration = Duration::from_secs(30);

fn plan(text: &str) -> FaultPlan {
    FaultPlan::from_toml(text, "test").expect("a plan")
}

/// Robot 2 behind faults, and robots 1 and 3.
struct Team {
    one: MemoryBus,
    two: FaultyBus<std::sync::Arc<MemoryBus>>,
    three: MemoryBus,
    heard: Receiver<Incoming>,
}

impl Team {
    async fn new(text: &str) -> Self {
        let network = MemoryNetwork::new();
        let own = std::sync::Arc::new(network.join("two"));
        let two = FaultyBus::new(own, RobotId(2), plan(text), 1);
        let heard = two.subscribe("pleiad/t/**").await.unwrap();
        Self { one: network.join("one"), two, three: network.join("three"), heard }
    }

    async fn hear(&mut self) -> String {
        let incoming = tokio::time::timeout(PATIENCE, self.heard.recv()).await.expect("something").unwrap();
        String::from_utf8(incoming.payload).unwrap()
    }
}

#[tokio::test]
async fn a_cut_link_passes_nothing_of_its_sender_and_everything_else() {
    let mut team = Team::new("[[fault]]\nwhat = 'cut'\nfrom = [1]\n").await;
    team.two.team_time(Timestamp::from_seconds(100.0));
    team.one.publish("pleiad/t/1/fact", b"lost".to_vec()).await.unwrap();
    team.three.publish("pleiad/t/3/fact", b"of three".to_vec()).await.unwrap();
    // Its own sensors are fed from elsewhere too.
    team.one.publish("pleiad/t/2/sensor/gps", b"own".to_vec()).await.unwrap();
    assert_eq!([team.hear().await, team.hear().await], ["of three", "own"]);
}

#[tokio::test]
async fn a_plan_counts_from_the_first_instant_that_the_robot_tells() {
    let mut team = Team::new("[[fault]]\nwhat = 'cut'\nstart_s = 10.0\nend_s = 20.0\n").await;
    for (time_s, text) in [(1000.0, "before"), (1010.5, "within"), (1020.0, "after")] {
        team.two.team_time(Timestamp::from_seconds(time_s));
        team.one.publish("pleiad/t/1/status", text.as_bytes().to_vec()).await.unwrap();
        // What was published is judged at the time of its arrival.
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!([team.hear().await, team.hear().await], ["before", "after"]);
    team.two.set_plan(plan("[[fault]]\nwhat = 'duplicate'\nprobability = 1.0\nwithin_s = 0.01\n"));
    team.one.publish("pleiad/t/1/status", b"twice".to_vec()).await.unwrap();
    assert_eq!([team.hear().await, team.hear().await], ["twice", "twice"]);
}

#[tokio::test]
async fn a_robot_that_starts_again_finds_the_faults_where_the_others_have_them() {
    let network = MemoryNetwork::new();
    let one = network.join("one");
    let text = "[[fault]]\nwhat = 'cut'\nstart_s = 50\nend_s = 60\n";
    for (now_s, arrives) in [(149.0, true), (150.0, false), (159.0, false), (160.0, true)] {
        let own = std::sync::Arc::new(network.join("two"));
        let two = FaultyBus::new(own, RobotId(2), plan(text), 1).since(Timestamp::from_seconds(100.0));
        let mut heard = two.subscribe("pleiad/t/**").await.unwrap();
        // The first instant that it tells after its start.
        two.team_time(Timestamp::from_seconds(now_s));
        one.publish("pleiad/t/1/fact", b"fact".to_vec()).await.unwrap();
        // Operators are always heard, so that the end of the waiting is no matter of time.
        one.publish("pleiad/t/2/control", b"end".to_vec()).await.unwrap();
        let first = tokio::time::timeout(PATIENCE, heard.recv()).await.unwrap().unwrap();
        assert_eq!(first.payload == b"fact", arrives, "{now_s}");
    }
}

#[tokio::test]
async fn damage_reaches_the_receiver_as_other_bytes() {
    let mut team = Team::new("[[fault]]\nwhat = 'corrupt'\nprobability = 1.0\nbytes = 1\n").await;
    team.two.team_time(Timestamp::from_seconds(0.0));
    team.one.publish("pleiad/t/1/fact", vec![0; 8]).await.unwrap();
    let incoming = tokio::time::timeout(PATIENCE, team.heard.recv()).await.unwrap().unwrap();
    assert_eq!(incoming.payload.iter().filter(|byte| **byte != 0).count(), 1, "{incoming:?}");
}

#[tokio::test]
async fn a_question_is_lost_on_the_way_there_or_back() {
    for (cut, answered) in [("from = [2]", false), ("from = [1]", false), ("from = [3]", true)] {
        let team = Team::new(&format!("[[fault]]\nwhat = 'cut'\n{cut}\n")).await;
        team.two.team_time(Timestamp::from_seconds(0.0));
        let mut queries = team.one.serve("pleiad/t/1/facts").await.unwrap();
        tokio::spawn(async move {
            while let Some(query) = queries.recv().await {
                query.reply.send(b"answer".to_vec()).unwrap();
            }
        });
        let timeout = if answered { PATIENCE } else { Duration::from_millis(200) };
        let reply = team.two.request("pleiad/t/1/facts", b"question".to_vec(), timeout).await;
        match reply {
            Ok(answer) => assert!(answered && answer == b"answer"),
            Err(BusError::NoReply { .. }) => assert!(!answered, "{cut}"),
            Err(other) => panic!("{other}"),
        }
    }
}

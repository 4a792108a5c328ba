//! A team of agent processes, as tasks, on a network in memory, and what a test does with them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests are tests")]
#![allow(missing_docs, dead_code, reason = "a fixture; not every test uses all of it")]

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use pleiad_agent::AgentConfig;
use pleiad_agent::driver::{DriverError, run};
use pleiad_bus::{Bus, MemoryBus, MemoryNetwork};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Entry;
use pleiad_estimation::sample::Sample;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{
    ControlReply, ControlRequest, FactsRequest, LogRange, Message, SensorAck, SensorBatch, Status, TeamName,
    decode_entries,
};
use tokio::task::JoinHandle;

/// Far beyond what anything here takes; only a failure waits for it.
pub const DEADLINE: Duration = Duration::from_mins(1);

pub type Ended = Result<(), DriverError>;

/// A team under test: its network, and a bus of the test's own.
pub struct Field {
    pub network: MemoryNetwork,
    pub bus: Arc<MemoryBus>,
    team: TeamName,
}

impl Field {
    pub fn new() -> Self {
        let network = MemoryNetwork::new();
        let bus = Arc::new(network.join("test"));
        Self { network, bus, team: TeamName::new("test").unwrap() }
    }

    /// Starts an agent and waits until it answers.
    pub async fn start(&self, config: &AgentConfig) -> JoinHandle<Ended> {
        let process = self.spawn(config);
        self.until(config.robot, |_| true).await;
        process
    }

    pub fn spawn(&self, config: &AgentConfig) -> JoinHandle<Ended> {
        let (config, bus) = (config.clone(), Arc::new(self.network.join(&format!("robot {}", config.robot))));
        let nonce = 77 + u64::from(config.robot);
        tokio::spawn(async move { run(&config, &bus, nonce, std::future::pending()).await })
    }

    pub fn key(&self, robot: u32, kind: Kind) -> String {
        keys::of(&self.team, RobotId(robot), kind)
    }

    pub async fn control(&self, robot: u32, request: ControlRequest) -> Option<ControlReply> {
        let question = Message::ControlRequest(request).encode();
        let reply = self.bus.request(&self.key(robot, Kind::Control), question, DEADLINE).await.ok()?;
        match Message::decode(&reply) {
            Ok(Message::ControlReply(reply)) => Some(reply),
            other => panic!("{other:?}"),
        }
    }

    pub async fn status(&self, robot: u32) -> Option<Status> {
        match self.control(robot, ControlRequest::Status).await? {
            ControlReply::Status(status) => Some(status),
            other => panic!("{other:?}"),
        }
    }

    /// Asks for the status until it is as wanted.
    pub async fn until(&self, robot: u32, wanted: impl Fn(&Status) -> bool) -> Status {
        let mut last = None;
        let asking = async {
            let mut tick = tokio::time::interval(Duration::from_millis(10));
            loop {
                tick.tick().await;
                last = self.status(robot).await;
                if let Some(status) = last.take_if(|status| wanted(status)) {
                    return status;
                }
            }
        };
        let found = tokio::time::timeout(DEADLINE, asking).await;
        found.unwrap_or_else(|_| panic!("robot {robot} is not as wanted after {DEADLINE:?}: {last:?}"))
    }

    pub async fn batch(&self, robot: u32, batch: SensorBatch) -> SensorAck {
        let question = Message::SensorBatch(batch).encode();
        let reply = self.bus.request(&self.key(robot, Kind::SensorBatch), question, DEADLINE).await.unwrap();
        match Message::decode(&reply) {
            Ok(Message::SensorAck(ack)) => ack,
            other => panic!("{other:?}"),
        }
    }

    /// Samples in acknowledged batches of a few, robot by robot in turn; the last one ends the input of all.
    pub async fn feed(&self, samples: &[(RobotId, Sample)], numbers: &mut BTreeMap<RobotId, u64>) {
        for part in samples.chunks(20) {
            let mut batches: BTreeMap<RobotId, Vec<Sample>> = BTreeMap::new();
            for (robot, sample) in part {
                batches.entry(*robot).or_default().push(*sample);
            }
            for (robot, samples) in batches {
                let number = numbers.entry(robot).or_default();
                let ack =
                    self.batch(robot.0, SensorBatch { number: *number, samples, ..Default::default() }).await;
                assert_eq!(ack.number, *number);
                *number += 1;
            }
        }
    }

    pub async fn end(&self, robots: impl IntoIterator<Item = u32>) {
        for robot in robots {
            self.batch(robot, SensorBatch { number: u64::MAX, end: true, ..Default::default() }).await;
        }
    }

    /// Waits until all are done and hold the same, and gives the status they agree on.
    pub async fn agreed(&self, robots: impl IntoIterator<Item = u32> + Clone) -> Status {
        let asking = async {
            let mut tick = tokio::time::interval(Duration::from_millis(10));
            loop {
                tick.tick().await;
                let mut statuses = Vec::new();
                for robot in robots.clone() {
                    statuses.extend(self.status(robot).await);
                }
                let same = statuses.windows(2).all(|pair| pair[0].estimate == pair[1].estimate);
                if same && statuses.iter().all(|status| status.drained && status.facts.pending == 0) {
                    return statuses.swap_remove(0);
                }
            }
        };
        tokio::time::timeout(DEADLINE, asking).await.expect("the team comes to hold the same")
    }

    /// All entries an agent holds, asked for as a peer would.
    pub async fn entries(&self, robot: u32) -> Vec<Entry> {
        let logs = self.status(robot).await.unwrap().logs;
        let mut entries = Vec::new();
        for log in logs {
            let mut from = 0;
            while from < log.held {
                let ranges = vec![LogRange { log: log.log, from, to: u64::MAX }];
                let question = Message::FactsRequest(FactsRequest { ranges }).encode();
                let reply =
                    self.bus.request(&self.key(robot, Kind::Facts), question, DEADLINE).await.unwrap();
                let answer = decode_entries(&reply).unwrap();
                from += answer.len() as u64;
                entries.extend(answer);
            }
        }
        entries
    }

    pub async fn shut_down(&self, robot: u32, process: JoinHandle<Ended>) {
        assert_eq!(self.control(robot, ControlRequest::Shutdown).await, Some(ControlReply::Accepted));
        process.await.unwrap().unwrap();
    }
}

/// An agent that keeps its files in `folder/r<robot>` and tells what it holds often.
pub fn filed(mut config: AgentConfig, folder: &Path) -> AgentConfig {
    config.output.directory = Some(folder.join(format!("r{}", config.robot)));
    config.output.fsync_period_s = 10.0;
    config.bus.status_period_s = 0.05;
    config
}

pub async fn kill(process: JoinHandle<Ended>) {
    process.abort();
    assert!(process.await.unwrap_err().is_cancelled());
}

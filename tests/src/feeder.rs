//! A feed of samples into running agents that can be held at any instant of team time.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::missing_panics_doc, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::sync::Arc;

use pleiad_bus::ZenohBus;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::TeamName;
use pleiad_sim_peers::{FeedOptions, FeedReport, feed};
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::{JoinHandle, block_in_place};

use crate::stage::PATIENCE;

/// A running feed. Dropped, it ends.
pub struct Feeder {
    limit: watch::Sender<f64>,
    now: watch::Receiver<Timestamp>,
    task: JoinHandle<BTreeMap<RobotId, FeedReport>>,
}

impl Feeder {
    /// Feeds as fast as the agents can, up to and including `until_s` of team time. Needs a runtime of
    /// several threads, one of which it blocks while it is held.
    pub fn start(
        bus: &Arc<ZenohBus>,
        team: &TeamName,
        samples: BTreeMap<RobotId, Vec<Sample>>,
        until_s: f64,
    ) -> Self {
        let (limit, mut allowed) = watch::channel(until_s);
        let (reached, now) = watch::channel(Timestamp::MIN);
        let (bus, team) = (Arc::clone(bus), team.clone());
        let task = tokio::spawn(async move {
            let progress = |now: Timestamp| {
                reached.send_replace(now);
                let may_go_on = allowed.wait_for(|limit| now.seconds() < *limit);
                // Nobody to hold it any more: it goes on, to where it is aborted.
                let _ = block_in_place(|| Handle::current().block_on(may_go_on)).is_ok();
            };
            feed(&bus, &team, samples, FeedOptions::default(), progress).await
        });
        Self { limit, now, task }
    }

    /// Waits until everything up to this time has been handed in or given up.
    pub async fn reached(&mut self, seconds: f64) -> Timestamp {
        let reached = self.now.wait_for(|now| now.seconds() >= seconds);
        *tokio::time::timeout(PATIENCE, reached).await.expect("the feed does not advance").unwrap()
    }

    /// As [`Feeder::reached`], however long it takes.
    pub async fn reached_at_last(&mut self, seconds: f64) -> Timestamp {
        *self.now.wait_for(|now| now.seconds() >= seconds).await.unwrap()
    }

    /// Lets it go on to this time.
    pub fn go_on(&self, until_s: f64) {
        self.limit.send_replace(until_s);
    }

    /// Lets it go on to its end, and says what became of the samples.
    pub async fn end(mut self) -> BTreeMap<RobotId, FeedReport> {
        self.go_on(f64::INFINITY);
        tokio::time::timeout(PATIENCE, &mut self.task).await.expect("the feed does not end").unwrap()
    }
}

impl Drop for Feeder {
    fn drop(&mut self) {
        self.task.abort();
    }
}

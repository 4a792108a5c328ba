//! Samples into running agents, through their sensor keys alone: what a robot's own driver would do, for
//! simulated and for recorded robots.
//!
//! All robots advance in steps of team time. A step is over when every agent has acknowledged its samples,
//! so that a run can go as fast as the agents can and still deliver everything in order.

use std::collections::BTreeMap;
use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{Message, SensorBatch, TeamName, limits};

/// How samples are fed.
#[derive(Clone, Copy, Debug)]
pub struct FeedOptions {
    /// Team time per step, seconds. Well below the two seconds beyond which a stamp counts as wrong.
    pub step_s: f64,
    /// Seconds of team time per second; `None` as fast as the agents can.
    pub speed: Option<f64>,
    /// An agent that has not acknowledged after this long loses the step's samples.
    pub acknowledge_within: Duration,
}

impl Default for FeedOptions {
    fn default() -> Self {
        Self { step_s: 0.1, speed: None, acknowledge_within: Duration::from_secs(5) }
    }
}

/// What became of one robot's samples.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FeedReport {
    /// Taken by the agent.
    pub accepted: u64,
    /// Refused by the agent.
    pub refused: u64,
    /// Not acknowledged: the agent was not there.
    pub lost: u64,
    /// Why the first one was refused.
    pub first_refusal: Option<String>,
}

/// Feeds all samples; `progress` is told the team time after each step.
pub async fn feed<B: Bus + Clone>(
    bus: &B,
    team: &TeamName,
    samples: BTreeMap<RobotId, Vec<Sample>>,
    options: FeedOptions,
    mut progress: impl FnMut(Timestamp),
) -> BTreeMap<RobotId, FeedReport> {
    let times = samples.values().flatten().map(|sample| sample.time);
    let (Some(start), Some(end)) = (times.clone().min(), times.max()) else { return BTreeMap::new() };
    let mut feeds: Vec<RobotFeed<B>> = samples
        .into_iter()
        .map(|(robot, mut samples)| {
            samples.sort_by_key(|sample| sample.time);
            RobotFeed {
                bus: bus.clone(),
                key: keys::of(team, robot, Kind::SensorBatch),
                robot,
                samples,
                sent: 0,
                number: 0,
                report: FeedReport::default(),
            }
        })
        .collect();
    let wall = tokio::time::Instant::now();
    let mut now = start;
    loop {
        let last = now >= end;
        let mut steps = tokio::task::JoinSet::new();
        for mut feed in feeds.drain(..) {
            steps.spawn(async move {
                feed.step(now, last, options.acknowledge_within).await;
                feed
            });
        }
        feeds = steps.join_all().await;
        progress(now);
        if last {
            return feeds.into_iter().map(|feed| (feed.robot, feed.report)).collect();
        }
        now = now.plus_seconds(options.step_s).min(end);
        if let Some(speed) = options.speed {
            let due = Duration::from_secs_f64(now.seconds_since(start) / speed);
            tokio::time::sleep_until(wall + due).await;
        }
    }
}

struct RobotFeed<B> {
    bus: B,
    key: String,
    robot: RobotId,
    samples: Vec<Sample>,
    /// Samples handed in so far.
    sent: usize,
    number: u64,
    report: FeedReport,
}

impl<B: Bus> RobotFeed<B> {
    /// Sends what has come up to `now`, and the end of the input with the last step.
    async fn step(&mut self, now: Timestamp, last: bool, patience: Duration) {
        let due = self.samples.partition_point(|sample| sample.time <= now);
        let samples = self.samples[self.sent.min(due)..due].to_vec();
        self.sent = due;
        let mut chunks: Vec<Vec<Sample>> = samples.chunks(limits::SAMPLES).map(<[Sample]>::to_vec).collect();
        if last && chunks.is_empty() {
            chunks.push(Vec::new());
        }
        let count = chunks.len();
        for (index, samples) in chunks.into_iter().enumerate() {
            self.number += 1;
            let end = last && index + 1 == count;
            let batch = SensorBatch { number: self.number, samples, end };
            self.send(batch, patience).await;
        }
    }

    async fn send(&mut self, batch: SensorBatch, patience: Duration) {
        let count = batch.samples.len() as u64;
        let payload = Message::SensorBatch(batch).encode();
        // Congestion can drop a request on its way; the number lets the agent take a batch once.
        for _ in 0..2 {
            let Ok(reply) = self.bus.request(&self.key, payload.clone(), patience).await else { continue };
            if let Ok(Message::SensorAck(ack)) = Message::decode(&reply) {
                self.report.accepted += u64::from(ack.accepted);
                self.report.refused += u64::from(ack.refused);
                if self.report.first_refusal.is_none() {
                    self.report.first_refusal = ack.first_refusal;
                }
                return;
            }
        }
        self.report.lost += count;
    }
}

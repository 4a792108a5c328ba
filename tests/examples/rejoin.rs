//! How soon an agent is back after a SIGKILL, and how soon one that comes late is up to date. Real processes
//! over zenoh on loopback, sensors at the pace of the clock. `docs/benchmarks/faults.md` has the figures.
//!
//!     cargo run -p pleiad-tests --example rejoin -- killed [ROBOTS] [TIMES]
//!     cargo run -p pleiad-tests --example rejoin -- late [FACTS]
//!     cargo run -p pleiad-tests --example rejoin -- snapshot [FACTS]

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a program of its own that fails by panicking"
)]

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use pleiad_bus::Bus;
use pleiad_coordinator::{Restart, Team};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{Message, Status};
use pleiad_tests::feeder::Feeder;
use pleiad_tests::stage::{PATIENCE, SCENARIO, Stage};

/// Between two looks at a status.
const LOOK: Duration = Duration::from_millis(5);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u32| {
        arguments.get(index).map_or(default, |text| text.parse().expect("a whole number"))
    };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    match arguments.first().map(String::as_str) {
        Some("killed") => runtime.block_on(killed(number(1, 10), number(2, 10))),
        Some("late") => runtime.block_on(late(number(1, 10_000), false)),
        Some("snapshot") => runtime.block_on(late(number(1, 10_000), true)),
        other => panic!("{other:?}: expected killed, late or snapshot"),
    }
}

/// How long until what.
#[derive(Clone, Copy, Debug, Default)]
struct Back {
    /// It answers.
    up: Option<f64>,
    /// It has all that the others had when it was started.
    facts: Option<f64>,
    /// It publishes estimates.
    estimate: Option<f64>,
    /// That rest on as many facts.
    whole: Option<f64>,
}

/// What is to be caught up with: entries of each log, and facts.
struct Goal {
    logs: BTreeMap<pleiad_estimation::fact::LogId, u64>,
    used: u64,
    cut: Option<Timestamp>,
}

impl Goal {
    fn of(status: &Status) -> Self {
        let cut = status.closure.as_ref().and_then(|closure| closure.cut).map(|(cut, _)| cut);
        let logs = status.logs.iter().map(|log| (log.log, log.held)).collect();
        Self { logs, used: status.facts.used, cut }
    }

    fn is_reached(&self, status: &Status) -> bool {
        let held: BTreeMap<_, _> = status.logs.iter().map(|log| (log.log, log.held)).collect();
        let cut = status.closure.as_ref().and_then(|closure| closure.cut).map(|(cut, _)| cut);
        // A log that is missing may be closed.
        let closed = self.cut.is_some() && cut >= self.cut;
        cut >= self.cut
            && self.logs.iter().all(|(log, length)| held.get(log).map_or(closed, |held| held >= length))
    }
}

/// Watches a robot from its start on.
async fn watch(stage: &Stage, robot: RobotId, goal: &Goal, begun: Instant) -> Back {
    let mut estimates = stage.bus.subscribe(&keys::of(&stage.team, robot, Kind::Estimate)).await.unwrap();
    let mut back = Back::default();
    let mut looks = tokio::time::interval(LOOK);
    while back.facts.is_none() || back.whole.is_none() {
        let now = || Some(begun.elapsed().as_secs_f64());
        tokio::select! {
            Some(incoming) = estimates.recv() => {
                if let Ok(Message::Estimate(estimate)) = Message::decode(&incoming.payload) {
                    back.estimate = back.estimate.or_else(now);
                    if estimate.facts_used >= goal.used {
                        back.whole = back.whole.or_else(now);
                    }
                }
            }
            _ = looks.tick(), if back.facts.is_none() => {
                if let Ok(status) = stage.status(robot).await {
                    back.up = back.up.or_else(now);
                    if goal.is_reached(&status) {
                        back.facts = now();
                    }
                }
            }
        }
        if begun.elapsed() > PATIENCE {
            println!("robot {robot}: not back after {} s: {back:?}", PATIENCE.as_secs());
            break;
        }
    }
    back
}

fn seconds(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
}

fn tell(what: &str, back: Back) {
    let [up, facts, estimate, whole] = [back.up, back.facts, back.estimate, back.whole].map(seconds);
    println!("{what:>10}  {up:>9}  {facts:>9}  {estimate:>9}  {whole:>9}");
}

fn heading(what: &str) {
    println!("{what:>10}  {:>9}  {:>9}  {:>9}  {:>9}", "answers s", "entries s", "estim. s", "whole s");
}

/// Lets a feed go on at the pace of the clock for as long as it is kept.
fn pace(feeder: Arc<tokio::sync::Mutex<Feeder>>, from_s: f64) -> tokio::task::JoinHandle<()> {
    tokio::spawn(async move {
        let begun = Instant::now();
        let mut ticks = tokio::time::interval(Duration::from_millis(100));
        loop {
            ticks.tick().await;
            feeder.lock().await.go_on(from_s + begun.elapsed().as_secs_f64());
        }
    })
}

/// One robot after the other is killed, is away for three seconds, and is started again.
async fn killed(robots: u32, times: u32) {
    let from_s = 30.0;
    let length_s = from_s + 10.0 * f64::from(times) + 20.0;
    let text = SCENARIO.replace("team_size = 3", &format!("team_size = {robots}"));
    let mut stage = Stage::of(&text.replace("duration_s = 60.0", &format!("duration_s = {length_s}"))).await;
    stage.tell(|config| config.bus.status_period_s = 0.5);
    let mut config = stage.coordinator();
    config.restart = Restart::Never;
    let team = Team::launch(&config, Arc::clone(&stage.bus)).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), from_s);
    feeder.reached(from_s).await;
    let feeder = Arc::new(tokio::sync::Mutex::new(feeder));
    let pace = pace(Arc::clone(&feeder), from_s);
    heading("robot");
    let mut wholes = Vec::new();
    for time in 0..times {
        tokio::time::sleep(Duration::from_secs(2)).await;
        let robot = RobotId(1 + time % robots);
        let other = RobotId(1 + (time + 1) % robots);
        team.kill(robot).await.unwrap();
        tokio::time::sleep(Duration::from_secs(3)).await;
        let goal = Goal::of(&stage.status(other).await.unwrap());
        let begun = Instant::now();
        team.restart(robot).await.unwrap();
        let back = watch(&stage, robot, &goal, begun).await;
        tell(&robot.to_string(), back);
        wholes.extend(back.facts.zip(back.whole).map(|(facts, whole)| facts.max(whole)));
    }
    pace.abort();
    wholes.sort_by(f64::total_cmp);
    if let (Some(median), Some(most)) = (wholes.get(wholes.len() / 2), wholes.last()) {
        println!("back with everything: median {median:.3} s, most {most:.3} s, of {} times", wholes.len());
    }
    team.shutdown(PATIENCE).await.unwrap();
}

/// The last of six robots comes when the others have this many facts: all of them kept, or all in a snapshot.
async fn late(facts: u32, closing: bool) {
    let each_s = 5.0 * 4.0 * 10.0;
    let from_s = (f64::from(facts) / each_s).ceil() + if closing { 6.0 } else { 2.0 };
    let text = SCENARIO
        .replace("team_size = 3", "team_size = 6")
        .replace("duration_s = 60.0", &format!("duration_s = {}", from_s + 60.0))
        .replace("rate_hz = 2.0\nkind = \"pose\"", "rate_hz = 10.0\nkind = \"pose\"");
    let mut stage = Stage::of(&text).await;
    let late = RobotId(6);
    let start = stage.run.tracks[&late].pose_at(Timestamp::from_seconds(from_s));
    stage.tell(|config| {
        config.bus.status_period_s = 0.5;
        if closing {
            config.ledger.members = (1..=5).collect();
            config.ledger.cell_s = 1.0;
            config.ledger.late_s = 0.5;
        }
    });
    stage.place(late, start);
    let mut agents: Vec<_> = (1..=5).map(|robot| stage.start_agent(RobotId(robot))).collect();
    stage.until_up((1..=5).map(RobotId)).await;
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), from_s);
    tokio::time::timeout(Duration::from_mins(10), feeder.reached_at_last(from_s)).await.unwrap();
    let feeder = Arc::new(tokio::sync::Mutex::new(feeder));
    let pace = pace(Arc::clone(&feeder), from_s);
    let status = stage.status(RobotId(1)).await.unwrap();
    let goal = Goal::of(&status);
    println!(
        "{} facts used, {} logs; closed up to {:?} s of {from_s} s",
        status.facts.used,
        status.logs.len(),
        goal.cut.map(Timestamp::seconds)
    );
    let begun = Instant::now();
    agents.push(stage.start_agent(late));
    let back = watch(&stage, late, &goal, begun).await;
    heading("late");
    tell(if closing { "snapshot" } else { "entries" }, back);
    pace.abort();
    drop(feeder);
    stage.shut_down().await;
    for mut agent in agents {
        agent.wait().unwrap();
    }
}

//! Agents of the approximate strategies over the network in memory: what they say to one another, what they
//! leave behind, and how they carry on from a journal.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests are tests")]

#[path = "support/field.rs"]
mod field;
mod support;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use field::{Field, filed, kill};
use pleiad_agent::driver::{DriverError, JOURNAL, run};
use pleiad_agent::journal::Journal;
use pleiad_agent::results::{self, AgentSummary, SETTLED};
use pleiad_agent::{AgentConfig, Approximate, Event, Record, SettledEstimate};
use pleiad_estimation::sample::{Reading, Relative, Sample};
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{Pose2, RobotId};
use pleiad_protocol::{ControlReply, ControlRequest};
use support::team::world;
use support::{agent, sample, sees};

/// Those that agents can follow.
const KINDS: [StrategyKind; 5] = [
    StrategyKind::Pairwise,
    StrategyKind::Intersection,
    StrategyKind::SplitIntersection,
    StrategyKind::Naive,
    StrategyKind::Independent,
];

fn of(kind: StrategyKind, config: AgentConfig, folder: &Path) -> AgentConfig {
    filed(AgentConfig { strategy: kind, ..config }, folder)
}

fn records(folder: &Path, robot: u32) -> Vec<Record> {
    Journal::read(&folder.join(format!("r{robot}")).join(JOURNAL)).unwrap()
}

fn left_behind(folder: &Path, robot: u32) -> (AgentSummary, Vec<SettledEstimate>) {
    let folder = folder.join(format!("r{robot}"));
    (results::read_summary(&folder).unwrap(), results::read_estimates(&folder.join(SETTLED)).unwrap())
}

/// What a robot's journal makes of it, hashed.
fn from_journal(config: &AgentConfig, records: Vec<Record>) -> String {
    let mut robot = Approximate::recover(config.strategy, config.node().unwrap(), records).unwrap();
    let _ = robot.handle(Event::InputEnded);
    robot.fingerprint().to_string()
}

/// A robot told of its start as it will be seen from robot 1.
fn placed(robot: u32) -> AgentConfig {
    let mut config = agent(robot);
    let first = config.prior.as_ref().unwrap();
    let first = Pose2::new(first.x_m, first.y_m, first.heading_rad);
    let Reading::Sighting { relative: Relative::Pose(seen), .. } = sees(0.0, 2).reading else { panic!() };
    if robot > 1 {
        let place = first.compose(&seen);
        let prior = config.prior.as_mut().unwrap();
        (prior.x_m, prior.y_m, prior.heading_rad) = (place.x_m(), place.y_m(), place.yaw_rad());
    }
    config
}

/// Three robots that stand, the first one with satellites; then it sees the second.
fn meeting() -> Vec<(RobotId, Sample)> {
    let mut samples = Vec::new();
    for tick in 0..=40 {
        let t = f64::from(tick) * 0.1;
        samples.extend((1..=3).map(|robot| {
            (RobotId(robot), sample(t, Reading::Velocity { forward_m_s: 0.0, yaw_rate_rad_s: 0.0 }))
        }));
        if (5..20).contains(&tick) {
            samples.push((RobotId(1), sample(t - 0.05, Reading::Gps { x_m: 1.0, y_m: 2.0 })));
        }
        if tick == 30 {
            samples.push((RobotId(1), sees(t - 0.05, 2)));
        }
    }
    samples
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_that_is_seen_learns_from_it_under_every_strategy_but_independent_and_a_third_one_does_not() {
    let mut sigma = BTreeMap::new();
    for kind in KINDS {
        let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
        let mut processes = Vec::new();
        for robot in 1..=3 {
            processes.push(field.start(&of(kind, placed(robot), folder.path())).await);
        }
        let samples = meeting();
        let (before, after) = samples.split_at(samples.partition_point(|(_, s)| s.time.seconds() < 3.05));
        let mut numbers = BTreeMap::new();
        field.feed(before, &mut numbers).await;
        for tick in after.chunks(3) {
            // However busy the machine: what is said arrives before the robots' time goes on.
            let learnt = field.until(2, |status| status.facts.used > 0);
            let _ = tokio::time::timeout(Duration::from_millis(300), learnt).await;
            field.feed(tick, &mut numbers).await;
        }
        field.end(1..=3).await;
        for (robot, process) in (1..).zip(processes) {
            field.shut_down(robot, process).await;
        }
        let used = |robot: u32| left_behind(folder.path(), robot).0.facts_used;
        assert_eq!(used(3), 0, "{kind}");
        assert_eq!(used(2), u64::from(kind != StrategyKind::Independent), "{kind}");
        let (summary, settled) = left_behind(folder.path(), 2);
        assert_eq!((summary.facts_pending, summary.samples_refused.len()), (0, 0), "{kind}");
        let last = settled.last().unwrap().covariance.0;
        sigma.insert(kind.name(), (last[0] + last[2]).sqrt());
    }
    for kind in KINDS {
        let learnt = sigma[kind.name()] < sigma["independent"] - 1e-3;
        assert_eq!(learnt, kind != StrategyKind::Independent, "{sigma:?}");
    }
    // A first meeting, of robots that are independent still, is exact for all but the one that bounds every
    // correlation.
    for kind in ["naive", "split_intersection"] {
        assert!((sigma["pairwise"] - sigma[kind]).abs() < 1e-9, "{sigma:?}");
    }
    assert!(sigma["intersection"] > 1.01 * sigma["pairwise"], "{sigma:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_agent_leaves_what_its_journal_gives_and_after_a_kill_is_who_it_was() {
    for kind in KINDS {
        let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
        let world = world(5, 3, 6.0);
        let configs: Vec<AgentConfig> =
            world.configs.values().map(|config| of(kind, config.clone(), folder.path())).collect();
        let mut processes = Vec::new();
        for config in &configs {
            processes.push(field.start(config).await);
        }
        let (before, after) = world.samples.split_at(world.samples.len() / 2);
        let mut numbers = BTreeMap::new();
        field.feed(before, &mut numbers).await;
        let said = field.status(1).await.unwrap();
        kill(processes.remove(0)).await;
        let written = records(folder.path(), 1);
        processes.insert(0, field.start(&configs[0]).await);
        let again = field.status(1).await.unwrap();
        assert_eq!(again.odometry_until, said.odometry_until, "{kind}");
        assert_eq!(again.samples, said.samples, "{kind}");
        field.feed(after, &mut numbers).await;
        field.end(1..=3).await;
        for (robot, process) in (1..).zip(processes) {
            field.shut_down(robot, process).await;
        }
        for (robot, config) in (1..).zip(&configs) {
            let (summary, settled) = left_behind(folder.path(), robot);
            assert_eq!(
                from_journal(config, records(folder.path(), robot)),
                summary.estimate,
                "{kind} {robot}"
            );
            // Two a second over six seconds, of the first life as well, both ends included.
            let times: Vec<f64> = settled.iter().map(|estimate| estimate.time.seconds()).collect();
            assert_eq!(times, (0..=12).map(|k| f64::from(k) / 2.0).collect::<Vec<_>>(), "{kind} {robot}");
            let own = world.samples.iter().filter(|(id, _)| id.0 == robot).count() as u64;
            assert_eq!(summary.samples_accepted, own, "{kind} {robot}");
        }
        // The bits speak of what was heard as well: half a journal is another robot.
        assert_ne!(from_journal(&configs[0], written), left_behind(folder.path(), 1).0.estimate, "{kind}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_journal_of_another_strategy_is_refused_and_named() {
    let folder = tempfile::tempdir().unwrap();
    for (first, then) in
        [(StrategyKind::Exact, StrategyKind::Pairwise), (StrategyKind::Intersection, StrategyKind::Exact)]
    {
        let field = Field::new();
        let name = folder.path().join(first.name());
        let configs = [1, 2].map(|robot| of(first, placed(robot), &name));
        let mut processes = Vec::new();
        for config in &configs {
            processes.push(field.start(config).await);
        }
        let samples: Vec<_> = meeting().into_iter().filter(|(robot, _)| robot.0 < 3).collect();
        field.feed(&samples, &mut BTreeMap::new()).await;
        field.until(2, |status| status.facts.used > 0).await;
        for (robot, process) in (1..).zip(processes) {
            field.shut_down(robot, process).await;
        }
        let bus = std::sync::Arc::new(field.network.join("again"));
        let again = AgentConfig { strategy: then, ..configs[1].clone() };
        let error = run(&again, &bus, 1, std::future::pending()).await.unwrap_err();
        assert!(matches!(error, DriverError::OtherStrategy { .. }), "{error}");
        let text = error.to_string();
        assert!(
            text.contains(JOURNAL) && text.contains(first.name()) && text.contains(then.name()),
            "{text}"
        );
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nobody_is_evicted_where_nothing_is_kept_together() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let process = field.start(&of(StrategyKind::Pairwise, agent(1), folder.path())).await;
    let reply = field.control(1, ControlRequest::Evict(RobotId(2))).await;
    assert!(matches!(reply, Some(ControlReply::Refused(_))), "{reply:?}");
    field.shut_down(1, process).await;
}

#[test]
fn what_only_the_exact_strategy_knows_is_refused_with_key_value_and_remedy() {
    let refused = |config: AgentConfig| config.node().unwrap_err().to_string();
    let factored = refused(AgentConfig { strategy: StrategyKind::Factored, ..agent(1) });
    assert!(factored.contains("strategy = \"factored\"") && factored.contains("pleiad faults"), "{factored}");
    let of = |kind| AgentConfig { strategy: kind, ..agent(1) };
    let mut additive = of(StrategyKind::Intersection);
    additive.filter.error = pleiad_agent::config::ErrorName::Additive;
    let mut closing = of(StrategyKind::Naive);
    closing.ledger.members = vec![1, 2];
    let modelled = AgentConfig { model: Some("model.toml".into()), ..of(StrategyKind::Pairwise) };
    for (config, key) in [(additive, "filter.error"), (closing, "ledger.members"), (modelled, "model")] {
        let text = refused(config);
        assert!(text.contains(key) && text.contains("exact"), "{text}");
    }
    for kind in KINDS {
        assert!(of(kind).node().is_ok());
    }
}

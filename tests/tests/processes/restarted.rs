//! An agent is killed and starts again from its journal.

use std::sync::Arc;

use pleiad_coordinator::{Exit, Team};
use pleiad_estimation::fact::VoidReason;
use pleiad_tests::feeder::Feeder;
use pleiad_tests::stage::{PATIENCE, Stage};

use crate::{ONE, THREE, TWO, boot, boots};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_agent_carries_on_from_its_journal_though_its_robot_has_moved() {
    let stage = Stage::set(3).await;
    let team = Team::launch(&stage.coordinator(), Arc::clone(&stage.bus)).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();

    // Killed in the middle of whatever it does; restarted only when its robot has moved on.
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 25.0);
    feeder.reached(15.0).await;
    assert_eq!(team.kill(TWO).await.unwrap(), Exit::Signal(9));
    let killed = feeder.reached(25.0).await;
    feeder.go_on(40.0);
    feeder.reached(40.0).await;
    team.restart(TWO).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();
    stage.until_up([TWO]).await;
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);

    assert!(reports[&TWO].lost > 0, "{reports:?}");
    for robot in [ONE, THREE] {
        assert_eq!((reports[&robot].lost, reports[&robot].refused), (0, 0), "{reports:?}");
        assert_eq!(boots(&ledger, robot), 1);
    }
    assert_eq!(boots(&ledger, TWO), 2);
    let second = boot(&ledger, TWO, 1);
    let continued = second.continuation.expect("the journal was intact");
    assert_eq!(continued.previous.0, 0);
    assert!(continued.time <= killed && second.time.seconds() > 40.0, "{second:?}");
    assert_ne!(second.nonce, boot(&ledger, TWO, 0).nonce);
    // Between its lives it can say nothing of itself, and says so.
    let void: Vec<_> = ledger.voids().collect();
    assert!(
        !void.is_empty() && void.iter().all(|(_, reason)| **reason == VoidReason::OdometryGap),
        "{void:?}"
    );
    let counts = ledger.counts();
    assert_eq!((counts.pending, counts.skipped), (0, 0), "{counts:?}");
    team.shutdown(PATIENCE).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_agent_killed_while_nothing_happens_misses_no_movement() {
    let stage = Stage::set(3).await;
    let team = Team::launch(&stage.coordinator(), Arc::clone(&stage.bus)).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();

    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 20.0);
    feeder.reached(20.0).await;
    assert_eq!(team.kill(TWO).await.unwrap(), Exit::Signal(9));
    team.restart(TWO).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();
    stage.until_up([TWO]).await;
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);

    for (robot, report) in &reports {
        let sensed = stage.samples()[robot].len() as u64;
        assert_eq!(
            (report.accepted, report.refused, report.lost),
            (sensed, 0, 0),
            "robot {robot}: {report:?}"
        );
    }
    assert_eq!(boots(&ledger, TWO), 2);
    let second = boot(&ledger, TWO, 1);
    let continued = second.continuation.expect("the journal was intact");
    let period_s = 1.0 / 25.0;
    let gap_s = second.time.seconds_since(continued.time);
    assert!((gap_s - period_s).abs() < 1e-6, "{gap_s} s, not one period of its odometry");
    // An observation is void only if it fell between the last odometry of one life and the first of the next.
    for (id, reason) in ledger.voids() {
        assert_eq!(*reason, VoidReason::OdometryGap, "{id}");
    }
    assert!(ledger.counts().void <= 2, "{:?}", ledger.counts());
    assert_eq!(ledger.counts().pending, 0);
    team.shutdown(PATIENCE).await.unwrap();
}

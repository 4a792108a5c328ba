//! An agent stands still: messages to it are lost, and so are its own sensors' samples.

use std::sync::Arc;

use pleiad_coordinator::{ProcessSignal, Team};
use pleiad_estimation::fact::VoidReason;
use pleiad_tests::feeder::Feeder;
use pleiad_tests::stage::{PATIENCE, Stage};

use crate::{ONE, THREE, TWO, boot, boots};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_agent_that_stood_still_catches_up() {
    let stage = Stage::set(3).await;
    let team = Team::launch(&stage.coordinator(), Arc::clone(&stage.bus)).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();

    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 20.0);
    feeder.reached(20.0).await;
    team.signal(THREE, ProcessSignal::Pause).await.unwrap();
    feeder.go_on(35.0);
    feeder.reached(35.0).await;
    team.signal(THREE, ProcessSignal::Resume).await.unwrap();
    let resumed = stage.until(THREE, |_| true).await;
    assert_eq!(resumed.boot.0, 0, "the same process");
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);

    assert!(reports[&THREE].lost > 0, "{reports:?}");
    for robot in [ONE, TWO] {
        assert_eq!((reports[&robot].lost, reports[&robot].refused), (0, 0), "{reports:?}");
        assert_eq!(boots(&ledger, robot), 1);
    }
    // It was not restarted, yet its odometry has a gap: the trajectory after it is another one.
    assert_eq!(team.members()[&THREE].restarts, 0);
    assert_eq!(boots(&ledger, THREE), 2);
    let second = boot(&ledger, THREE, 1);
    let continued = second.continuation.expect("nothing was forgotten");
    assert!(second.time.seconds_since(continued.time) > 10.0, "{second:?}");
    assert!(ledger.counts().void > 0);
    let reasons = [VoidReason::OdometryGap, VoidReason::Clock];
    assert!(ledger.voids().all(|(_, reason)| reasons.contains(reason)));
    assert_eq!(ledger.counts().pending, 0);
    team.shutdown(PATIENCE).await.unwrap();
}

//! The coordinator dies for good.

use pleiad_tests::feeder::Feeder;
use pleiad_tests::stage::Stage;

use crate::boots;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn agents_carry_on_without_their_coordinator() {
    let stage = Stage::set(3).await;
    let mut config = stage.coordinator();
    config.detached = true;
    let mut coordinator = stage.start_coordinator(&config);
    stage.until_up(stage.robots()).await;
    assert_eq!(stage.processes().len(), 4, "a coordinator and three agents");

    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 30.0);
    feeder.reached(20.0).await;
    assert_eq!(coordinator.try_wait().unwrap(), None, "it is there until it is killed");
    coordinator.kill().unwrap();
    coordinator.wait().unwrap();
    feeder.reached(30.0).await;
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);

    for (robot, report) in &reports {
        assert_eq!((report.lost, report.refused), (0, 0), "robot {robot}: {report:?}");
        assert_eq!(boots(&ledger, *robot), 1);
    }
    // Nobody noticed: bit for bit what nodes without processes, network and coordinator believe.
    let mut in_process = stage.in_process();
    assert_eq!(ledger.clone().fingerprint(), in_process.fingerprint());
    assert_eq!(ledger.counts(), in_process.counts());
    stage.shut_down().await;
}

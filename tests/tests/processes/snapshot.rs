//! A robot comes when the others have closed what was before it.

use pleiad_estimation::Timestamp;
use pleiad_estimation::fact::Body;
use pleiad_tests::feeder::Feeder;
use pleiad_tests::stage::Stage;

use crate::{ONE, THREE, TWO};

const LATE_S: f64 = 30.0;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_robot_is_admitted_takes_the_snapshot_and_closes_with_the_others_from_then_on() {
    let mut stage = Stage::set(3).await;
    stage.tell(|config| {
        config.ledger.members = vec![1, 2];
        config.ledger.cell_s = 1.0;
        config.ledger.late_s = 0.5;
    });
    stage.place(THREE, stage.run.tracks[&THREE].pose_at(Timestamp::from_seconds(LATE_S)));
    let mut agents = vec![stage.start_agent(ONE), stage.start_agent(TWO)];
    stage.until_up([ONE, TWO]).await;
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), LATE_S);
    feeder.reached(LATE_S).await;
    let closed_to = |status: &pleiad_protocol::Status| {
        status.closure.as_ref().and_then(|own| own.cut).map_or(0.0, |(cut, _)| cut.seconds())
    };
    let before = stage.until(ONE, |status| closed_to(status) > LATE_S - 5.0).await;
    assert!(before.facts.used > 50, "{:?}", before.facts);

    agents.push(stage.start_agent(THREE));
    stage.until_up([THREE]).await;
    // Nobody has any of the facts before the cut any more.
    let here = stage.until(THREE, |status| closed_to(status) >= closed_to(&before)).await;
    assert!(here.facts.used >= before.facts.used, "{:?} {:?}", before.facts, here.facts);
    let reports = feeder.end().await;
    for robot in [ONE, TWO, THREE] {
        let closed = stage.until(robot, |status| closed_to(status) > 55.0).await;
        assert_eq!(closed.closure.unwrap().epoch, 1, "one change of the membership");
    }
    assert!(reports[&THREE].accepted > 0 && reports[&ONE].refused + reports[&ONE].lost == 0);
    // All end with one estimate and one snapshot. What was closed before its time is not in the late one's journal.
    let statuses = stage.settled().await;
    let cuts = statuses.values().map(|status| status.closure.clone().unwrap().cut).collect::<Vec<_>>();
    assert!(cuts.iter().all(|cut| *cut == cuts[0]), "{cuts:?}");
    let early = |robot| {
        let journal = stage.journal(robot).into_iter();
        let seen = journal.filter(|entry| match &entry.body {
            Body::Observation(seen) => seen.time.seconds() < LATE_S - 5.0,
            _ => false,
        });
        seen.count()
    };
    assert!(early(ONE) > 50 && early(THREE) == 0, "{} {}", early(ONE), early(THREE));
    stage.shut_down().await;
    for mut agent in agents {
        assert!(agent.wait().unwrap().success());
    }
}

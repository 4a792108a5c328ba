//! An agent starts when the others have been under way for a while.

use pleiad_estimation::fact::{Body, Quantity, VoidReason};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Reading;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_tests::feeder::Feeder;
use pleiad_tests::folded::fold;
use pleiad_tests::stage::Stage;

use crate::{ONE, THREE, TWO, boot, boots};

const LATE_S: f64 = 30.0;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_seen_of_a_late_robot_before_it_was_there_is_void_and_all_agree() {
    let mut stage = Stage::set(3).await;
    let mut agents = vec![stage.start_agent(ONE), stage.start_agent(TWO)];
    stage.until_up([ONE, TWO]).await;
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), LATE_S);
    let held = feeder.reached(LATE_S).await;
    let first = stage.samples()[&THREE].iter().find_map(|sample| {
        let odometry = matches!(sample.reading, Reading::Velocity { .. });
        (odometry && sample.time > held).then_some(sample.time)
    });
    let first = first.unwrap();
    stage.place(THREE, stage.run.tracks[&THREE].pose_at(first));
    agents.push(stage.start_agent(THREE));
    stage.until_up([THREE]).await;
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);

    assert!(reports[&THREE].lost > 0);
    assert_eq!(boots(&ledger, THREE), 1);
    assert_eq!(boot(&ledger, THREE, 0).time, first);
    assert_eq!(boot(&ledger, THREE, 0).continuation, None);
    let seen = seen(&ledger, THREE);
    let early = seen.iter().filter(|time| **time < first).count();
    assert!(early > 10 && early < seen.len(), "{early} of {}", seen.len());
    let void: Vec<_> = ledger.voids().collect();
    assert!(void.iter().all(|(_, reason)| **reason == VoidReason::BeforeBoot), "{void:?}");
    let counts = ledger.counts();
    assert_eq!((void.len(), counts.pending, counts.skipped), (early, 0, 0), "{counts:?}");

    // What the late robot wrote down itself says the same of every fact as what the others did.
    let own = fold(stage.journal(THREE));
    for other in [ONE, TWO] {
        let other = fold(stage.journal(other));
        assert!(own.facts().eq(other.facts()) && own.voids().eq(other.voids()));
    }
    stage.shut_down().await;
    for mut agent in agents {
        assert!(agent.wait().unwrap().success());
    }
}

/// When a robot was seen by others.
fn seen(ledger: &Ledger, robot: RobotId) -> Vec<Timestamp> {
    let logs: Vec<_> = ledger.digests().map(|digest| digest.log).collect();
    let entries = logs.into_iter().flat_map(|log| ledger.entries(log, 0));
    let time = |body: &Body| match body {
        Body::Observation(observation) => match observation.quantity {
            Quantity::Robot { robot: seen, .. } if seen == robot => Some(observation.time),
            _ => None,
        },
        _ => None,
    };
    entries.filter_map(|entry| time(&entry.body)).collect()
}

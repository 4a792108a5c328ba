//! Teams of real agent processes over zenoh on loopback. Whatever happens to them, all end with one
//! estimate, and it is the one an undisturbed robot would have.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests")]

#[path = "processes/by_hand.rs"]
mod by_hand;
#[path = "processes/chaos.rs"]
mod chaos;
#[path = "processes/coordinator.rs"]
mod coordinator;
#[path = "processes/evicted.rs"]
mod evicted;
#[path = "processes/faulty.rs"]
mod faulty;
#[path = "processes/gps.rs"]
mod gps;
#[path = "processes/late.rs"]
mod late;
#[path = "processes/paused.rs"]
mod paused;
#[path = "processes/replayed.rs"]
mod replayed;
#[path = "processes/restarted.rs"]
mod restarted;
#[path = "processes/snapshot.rs"]
mod snapshot;
#[path = "processes/strategies.rs"]
mod strategies;

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Body, Boot};
use pleiad_estimation::ledger::Ledger;
use pleiad_tests::folded::log;

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);
const THREE: RobotId = RobotId(3);

/// The entry with which a boot of a robot began.
fn boot(ledger: &Ledger, robot: RobotId, boot: u32) -> Boot {
    match ledger.entries(log(robot, boot), 0).first().map(|entry| &entry.body) {
        Some(Body::Boot(boot)) => *boot,
        other => panic!("robot {robot} boot {boot} begins with {other:?}"),
    }
}

/// How many boots of a robot there were.
fn boots(ledger: &Ledger, robot: RobotId) -> usize {
    ledger.digests().filter(|digest| digest.log.robot == robot && digest.held > 0).count()
}

//! A snapshot is a function of the logs up to its cut: which cuts came before leaves no trace in it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use pleiad_estimation::fact::{Answer, Body, Boot, Entry, EntryId, Half, Seal, SealedLog, VoidReason};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::ledger::{Closure, Ledger};
use pleiad_estimation::{BootIndex, Pose2, RobotId, Sequence, Timestamp};

fn id(robot: u32, boot: u32, sequence: u64) -> EntryId {
    EntryId { robot: RobotId(robot), boot: BootIndex(boot), sequence: Sequence(sequence) }
}

fn empty() -> Ledger {
    let members = [1, 2].map(RobotId).into();
    Ledger::closing(FoldConfig::default(), Closure { members, cell_ns: 1 }, RobotId(2))
}

/// Numbers the entries of a log from 0; `first` is the time of its boot.
fn log(robot: u32, boot: u32, first: i64, bodies: Vec<Body>) -> Vec<Entry> {
    let begins = Body::Boot(Boot {
        time: Timestamp(first),
        nonce: 0,
        configuration: empty().configuration(),
        nominal: Pose2::identity(),
        continuation: None,
        calibration: None,
    });
    let bodies = std::iter::once(begins).chain(bodies);
    (0..)
        .zip(bodies)
        .map(|(sequence, body)| Entry { id: id(robot, boot, sequence), body, extension: Vec::new() })
        .collect()
}

fn seal(until: i64, logs: Vec<SealedLog>) -> Body {
    Body::Seal(Seal { observed: Timestamp(until), answered: Timestamp(until), closed: Timestamp::MIN, logs })
}

#[test]
fn a_log_lost_before_its_first_entry_is_over_for_every_later_cut_too() {
    // Robot 1 lost its disk, and its boot 0 with it, of which it says that nobody has anything. Robot 2 had
    // answered an observation there before it lost its own.
    let lost = SealedLog { boot: BootIndex(0), length: 0, last: true };
    let answer = Half { observation: id(1, 0, 7), answer: Answer::Void(VoidReason::OdometryGap) };
    let first = log(1, 1, 5, vec![seal(10, vec![lost]), seal(20, Vec::new())]);
    let second = log(2, 0, 1, vec![seal(10, Vec::new()), Body::Half(answer), seal(20, Vec::new())]);

    let mut at_once = empty();
    for entry in first.iter().chain(&second) {
        at_once.insert(entry.clone());
    }
    let mut in_two = empty();
    for entry in first[..2].iter().chain(&second[..2]) {
        in_two.insert(entry.clone());
    }
    assert_eq!(in_two.closable(), Some(Timestamp(10)));
    assert!(in_two.close(Timestamp(10)).is_some());
    for entry in first[2..].iter().chain(&second[2..]) {
        in_two.insert(entry.clone());
    }
    assert_eq!((at_once.closable(), in_two.closable()), (Some(Timestamp(20)), Some(Timestamp(20))));
    let hashes = [&mut at_once, &mut in_two].map(|ledger| ledger.close(Timestamp(20)));
    assert!(hashes[0].is_some());
    assert_eq!(hashes[0], hashes[1]);
    assert_eq!(at_once.checkpoint(), in_two.checkpoint());
    let snapshot = in_two.checkpoint().unwrap();
    assert!(snapshot.open.is_empty(), "the answer goes with the log it answers to");
    assert_eq!(snapshot.floors.get(&RobotId(1)), Some(&BootIndex(1)));
}

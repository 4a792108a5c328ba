//! A robot that says two different things under one identity.

mod support;

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Body, Entry, Fingerprint};
use pleiad_estimation::ledger::{Insertion, Ledger, Refusal};
use support::{Options, team};

/// The same identity with another measurement.
fn forged(entry: &Entry) -> Entry {
    let mut forged = entry.clone();
    forged.extension = vec![1, 2, 3];
    forged
}

#[test]
fn the_smaller_hash_stays_whoever_comes_first_and_nothing_held_is_lost() {
    let options = Options::default();
    let entries = team(7, &options).entries;
    let is_observation = |entry: &&Entry| {
        entry.id.robot == RobotId(2) && matches!(entry.body, Body::Observation(_)) && entry.id.sequence.0 > 10
    };
    let victim = entries.iter().find(is_observation).expect("robot 2 observes something").clone();
    let twin = forged(&victim);
    let stays = if Fingerprint::of(&victim) < Fingerprint::of(&twin) { &victim } else { &twin };
    let mut fingerprints = Vec::new();
    for (first, second) in [(&victim, &twin), (&twin, &victim)] {
        let mut ledger = Ledger::new(options.config);
        for entry in &entries {
            ledger.insert(if entry.id == first.id { first.clone() } else { entry.clone() });
        }
        let before = ledger.counts();
        assert_eq!(ledger.insert(second.clone()), Insertion::Equivocation);
        assert!(ledger.quarantined().contains(&RobotId(2)));
        assert_eq!(&ledger.entries(victim.id.log(), victim.id.sequence.0)[0], stays);
        assert_eq!(ledger.counts().relative, before.relative);
        // A second robot that contradicts itself does not cost the first one's entries.
        let other = entries.iter().rev().find(|entry| entry.id.robot == RobotId(3)).expect("robot 3");
        assert_eq!(ledger.insert(forged(other)), Insertion::Equivocation);
        assert_eq!(ledger.digests().map(|digest| digest.held).sum::<u64>(), entries.len() as u64);
        let mut next =
            entries.iter().rev().find(|entry| entry.id.robot == RobotId(2)).expect("robot 2").clone();
        next.id.sequence.0 += 1;
        assert_eq!(ledger.insert(next), Insertion::Refused(Refusal::Quarantined));
        fingerprints.push(ledger.fingerprint());
    }
    assert_eq!(fingerprints[0], fingerprints[1]);
}

#[test]
fn entries_that_wait_for_a_gap_survive_an_equivocation() {
    let options = Options::default();
    let entries = team(8, &options).entries;
    let of = |robot: u32| entries.iter().filter(move |entry| entry.id.robot == RobotId(robot));
    let missing = of(1).nth(20).expect("robot 1 says enough").clone();
    let contradicted = of(2).nth(15).expect("robot 2 says enough").clone();
    let twin = forged(&contradicted);
    let (larger, smaller) = if Fingerprint::of(&contradicted) < Fingerprint::of(&twin) {
        (twin, contradicted)
    } else {
        (contradicted, twin)
    };
    let mut ledger = Ledger::new(options.config);
    for entry in entries.iter().filter(|entry| entry.id != missing.id) {
        ledger.insert(if entry.id == larger.id { larger.clone() } else { entry.clone() });
    }
    assert_eq!(ledger.insert(smaller), Insertion::Equivocation);
    let waiting = of(1).count() - 21;
    assert_eq!(ledger.insert(missing), Insertion::Added { released: waiting });
}

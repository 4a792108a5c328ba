//! A robot whose journal is lost must not say anything twice: what the team remembers of it decides the index
//! of its next boot. Its old block is marginalized; only a new prior gives it a place again.

use std::collections::BTreeMap;

use pleiad_agent::{Event, Node, Notice, Record};
use pleiad_estimation::fact::{Body, Entry, EntryId, Quantity};
use pleiad_estimation::geometry::Matrix3;
use pleiad_estimation::{BootIndex, RobotId};

use crate::support::{agent, drive, feed, handle, held, log, node, node_of, sees, velocity};

/// Robot 2 after it has heard the whole log of robot 1, who saw it.
fn witness() -> (Node, Vec<Entry>) {
    let (mut one, mut two) = (node(1), node(2));
    drive(&mut one, 0.0, 2.0, 0.1);
    drive(&mut two, 0.0, 2.0, 0.1);
    feed(&mut one, sees(1.0, 2));
    handle(&mut two, Event::Entries(held(&one)));
    let log = two.ledger().entries(log(1, 0), 0).to_vec();
    assert!(log.len() > 10);
    (two, log)
}

fn boots(node: &Node, robot: u32) -> Vec<u32> {
    let boot = |entry: &Entry| matches!(entry.body, Body::Boot(_)) && entry.id.robot == RobotId(robot);
    held(node).iter().filter(|entry| boot(entry)).map(|entry| entry.id.boot.0).collect()
}

#[test]
fn a_status_heard_before_the_first_odometry_makes_it_the_next_boot() {
    let (mut two, old) = witness();
    let mut reborn = node_of(&agent(1), 999);
    let handled = handle(&mut reborn, Event::Status(two.status()));
    assert_eq!(handled.asked.len(), 1, "its own old log is asked for");
    let handled = feed(&mut reborn, velocity(60.0));
    assert_eq!(handled.notices, [Notice::NoPrior { boot: BootIndex(1) }]);
    assert!(handled.notices[0].to_string().contains("for_boot = 1"));
    assert!(handled.published.iter().all(|entry| entry.id.boot == BootIndex(1)));
    let Body::Boot(boot) = handled.published[0].body else { panic!("no boot") };
    assert_eq!(boot.continuation, None);

    // The same set everywhere, and no identity with two contents.
    handle(&mut reborn, Event::Entries(old.clone()));
    handle(&mut reborn, Event::Entries(held(&two)));
    handle(&mut two, Event::Entries(held(&reborn)));
    handle(&mut reborn, Event::Entries(held(&two)));
    let mut contents: BTreeMap<EntryId, Entry> = old.iter().map(|entry| (entry.id, entry.clone())).collect();
    for entry in held(&reborn).into_iter().chain(held(&two)) {
        let first = contents.entry(entry.id).or_insert_with(|| entry.clone());
        assert_eq!(*first, entry);
    }
    assert_eq!(reborn.status().estimate, two.status().estimate);
    assert!(two.ledger().quarantined().is_empty());
}

#[test]
fn the_old_block_is_marginalized_for_everyone() {
    let (mut two, _) = witness();
    let mut reborn = node_of(&agent(1), 999);
    handle(&mut reborn, Event::Status(two.status()));
    assert!(two.ledger().joint().member(RobotId(1)).is_some());
    let handled = feed(&mut reborn, velocity(60.0));
    handle(&mut two, Event::Entries(handled.published));
    two.status();
    assert!(two.ledger().joint().member(RobotId(1)).is_none());
    assert!(two.ledger().joint().member(RobotId(2)).is_some());
    assert_eq!(reborn.estimate(), None);
}

#[test]
fn a_prior_for_the_new_boot_places_it_without_memory_of_its_former_life() {
    let (mut two, _) = witness();
    let mut config = agent(1);
    config.prior.as_mut().unwrap().for_boot = 1;
    let mut reborn = node_of(&config, 999);
    handle(&mut reborn, Event::Status(two.status()));
    handle(&mut reborn, Event::Entries(held(&two)));
    let handled = feed(&mut reborn, velocity(60.0));
    assert!(handled.notices.is_empty(), "{:?}", handled.notices);
    let estimate = reborn.estimate().unwrap();
    for (found, expected) in estimate.sigma.into_iter().zip([0.1, 0.1, 0.05]) {
        assert!((found - expected).abs() < 1e-14, "{:?}", estimate.sigma);
    }
    let joint = reborn.ledger().joint();
    let (one, two) = (joint.index(RobotId(1)).unwrap(), joint.index(RobotId(2)).unwrap());
    assert_eq!(joint.covariance().block(one, two), Matrix3::zeros());
}

#[test]
fn the_prior_of_the_first_boot_is_not_said_again_for_a_robot_that_has_moved() {
    let (mut two, _) = witness();
    let mut reborn = node_of(&agent(1), 999);
    handle(&mut reborn, Event::Status(two.status()));
    let said = feed(&mut reborn, velocity(60.0)).published;
    let placed = said.iter().any(|entry| {
        matches!(entry.body, Body::Observation(fact) if matches!(fact.quantity, Quantity::Absolute(_)))
    });
    assert!(!placed);
}

#[test]
fn entries_of_the_old_log_alone_are_enough_to_know() {
    let (_, old) = witness();
    let mut reborn = node_of(&agent(1), 999);
    handle(&mut reborn, Event::Entries(old));
    feed(&mut reborn, velocity(60.0));
    assert_eq!(boots(&reborn, 1), [0, 1]);
}

#[test]
fn a_heard_former_life_is_not_taken_for_a_lived_one_after_the_next_restart() {
    let (mut two, old) = witness();
    let mut reborn = node_of(&agent(1), 999);
    let mut records: Vec<Record> = Vec::new();
    handle(&mut reborn, Event::Status(two.status()));
    let mut keep = |handled: Vec<crate::support::Handled>| {
        records.extend(handled.into_iter().flat_map(|handled| handled.journal));
    };
    keep(drive(&mut reborn, 60.0, 61.0, 0.1));
    // The old log comes only now, after the new boot has begun.
    keep(vec![handle(&mut reborn, Event::Entries(old))]);
    keep(drive(&mut reborn, 61.1, 62.0, 0.1));
    let end = (reborn.distance_m(), reborn.status().odometry_until);

    let mut again = Node::recover(agent(1).node().unwrap(), 5, records);
    assert_eq!((again.distance_m(), again.status().odometry_until), end);
    let handled = feed(&mut again, velocity(62.1));
    let Body::Boot(boot) = handled.published[0].body else { panic!("no boot") };
    assert_eq!(handled.published[0].id.boot, BootIndex(2));
    let continuation = boot.continuation.expect("a continuation");
    assert_eq!((continuation.previous, continuation.time), (BootIndex(1), end.1.unwrap()));
}

#[test]
fn without_anyone_who_remembers_it_is_the_first_boot() {
    let mut reborn = node_of(&agent(1), 999);
    feed(&mut reborn, velocity(60.0));
    assert_eq!(boots(&reborn, 1), [0]);
}

#[test]
fn a_former_life_heard_of_too_late_is_said_loudly() {
    let (mut two, old) = witness();
    let mut reborn = node_of(&agent(1), 999);
    feed(&mut reborn, velocity(60.0));
    let notices = handle(&mut reborn, Event::Status(two.status())).notices;
    let [Notice::OwnLogAhead { id }] = notices[..] else { panic!("{notices:?}") };
    assert_eq!((id.log(), id.sequence.0 + 1), (log(1, 0), old.len() as u64));
    let notices = handle(&mut reborn, Event::Entries(old)).notices;
    assert!(notices.iter().all(|notice| matches!(notice, Notice::OwnLogAhead { .. })), "{notices:?}");
    assert!(!notices.is_empty());
}

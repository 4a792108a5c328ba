//! However messages are lost, repeated and reordered: once all hold the same facts, all hold the same bits,
//! which are those of one ledger folding all entries, and the numbers of the reference filter.

use std::collections::BTreeMap;

use pleiad_agent::config::ErrorName;
use pleiad_agent::{Event, Node};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Body, Entry, EntryId, Quantity};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::reference::{self, JointEkf, facts_from_entries};

use crate::support::team::{Net, World, world};
use crate::support::{folded, held};

/// Lives through a world with these faults; checks bits, answers and numbers.
fn check(seed: u64, robots: u32, (lost, repeated): (f64, f64), error: ErrorName) -> Net {
    let World { mut configs, samples } = world(seed, robots, 8.0);
    for config in configs.values_mut() {
        config.filter.error = error;
    }
    let mut net = Net::new(&configs, seed);
    (net.lost, net.repeated, net.most) = (lost, repeated, 40);
    net.live(&samples);
    let settled = net.settle();
    let fold = configs[&RobotId(1)].node().unwrap().fold;
    let mut ledger = folded(net.said.values(), fold);
    assert_eq!(ledger.fingerprint(), settled, "seed {seed}");
    for node in net.nodes.values() {
        assert_eq!(held(node).len(), net.said.len());
    }
    answered_once(&net.said);
    against_reference(&ledger, error);
    net
}

/// Every observation of a robot has exactly one answer, by the robot that was seen.
pub fn answered_once(said: &BTreeMap<EntryId, Entry>) {
    let mut seen = 0;
    for entry in said.values() {
        let Body::Observation(observation) = entry.body else { continue };
        let Quantity::Robot { robot, .. } = observation.quantity else { continue };
        let answers = said.values().filter(|other| {
            other.id.robot == robot && matches!(other.body, Body::Half(half) if half.observation == entry.id)
        });
        assert_eq!(answers.count(), 1, "answers to {}", entry.id);
        seen += 1;
    }
    assert!(seen > 3, "robots saw each other {seen} times only");
}

/// Corrections and joint covariance against the reference filter, from the same entries.
fn against_reference(ledger: &Ledger, error: ErrorName) {
    let form = match error {
        ErrorName::Invariant => reference::ErrorForm::Invariant,
        ErrorName::Additive => reference::ErrorForm::Additive,
    };
    let entries: Vec<Entry> =
        ledger.digests().flat_map(|digest| ledger.entries(digest.log, 0).to_vec()).collect();
    let filter = JointEkf::new(form);
    let expected = filter.fold(&facts_from_entries(&entries));
    assert!(expected.near_gate(&filter.gate, 1e-6).is_empty(), "a decision at the gate may go either way");
    let joint = ledger.joint();
    assert_eq!(joint.members().count(), expected.robots.len());
    for robot in &expected.robots {
        let member = joint.member(robot.robot).expect("placed");
        let apart = robot.correction.between(&member.correction).log();
        assert!(apart.norm() < 1e-9, "robot {}: {apart}", robot.robot);
        for other in &expected.robots {
            let (row, column) = (joint.index(robot.robot).unwrap(), joint.index(other.robot).unwrap());
            let found = joint.covariance().block(row, column);
            let block = expected.covariance.block(robot.robot, other.robot).expect("placed");
            // Blocks are of lever arms up to 80 m squared times rad^2; rounding is relative to the largest.
            let size = expected.covariance.matrix().norm();
            assert!((found - block).norm() < 1e-9 * size.max(1.0), "{found} {block}");
        }
    }
}

#[test]
fn a_perfect_network() {
    check(1, 2, (0.0, 0.0), ErrorName::Invariant);
    check(2, 4, (0.0, 0.0), ErrorName::Invariant);
}

#[test]
fn repeated_and_reordered_messages() {
    for robots in 2..=6 {
        check(10 + u64::from(robots), robots, (0.0, 0.5), ErrorName::Invariant);
    }
}

#[test]
fn lost_messages_repaired_by_statuses() {
    for robots in 2..=6 {
        check(20 + u64::from(robots), robots, (0.3, 0.2), ErrorName::Invariant);
    }
}

#[test]
fn most_messages_lost() {
    check(30, 3, (0.7, 0.0), ErrorName::Invariant);
}

#[test]
fn the_additive_error() {
    check(40, 4, (0.2, 0.2), ErrorName::Additive);
}

#[test]
fn the_faults_change_nothing_about_what_can_be_known() {
    // Same samples, other fates of the messages: the same facts but for the order in which a robot says its
    // halves, hence the same numbers.
    let counts = |node: &mut Node| {
        let facts = node.status().facts;
        (facts.relative, facts.absolute, facts.used, facts.rejected, facts.pending, facts.void)
    };
    let mut clean = check(50, 3, (0.0, 0.0), ErrorName::Invariant);
    let mut faulty = check(50, 3, (0.4, 0.3), ErrorName::Invariant);
    let robot = RobotId(1);
    let (clean, faulty) = (clean.nodes.get_mut(&robot).unwrap(), faulty.nodes.get_mut(&robot).unwrap());
    let (facts, other) = (counts(clean), counts(faulty));
    assert_eq!((facts.0 + facts.5, facts.1), (other.0 + other.5, other.1));
    assert_eq!((facts.4, other.4), (0, 0));
}

#[test]
fn a_fact_withheld_from_one_robot_shows() {
    // The planted fault: without it a test of equal fingerprints says nothing.
    let World { configs, samples } = world(60, 3, 4.0);
    let mut net = Net::new(&configs, 60);
    net.live(&samples);
    let settled = net.settle();
    let entries = held(&net.nodes[&RobotId(1)]);
    let last_of_two = entries.iter().rposition(|entry| entry.id.robot == RobotId(2)).unwrap();
    let mut short = Node::new(configs[&RobotId(3)].node().unwrap(), 1);
    let all = |skip: Option<usize>| -> Vec<Entry> {
        let kept = entries.iter().enumerate().filter(|(index, _)| Some(*index) != skip);
        kept.map(|(_, entry)| entry.clone()).collect()
    };
    short.handle(Event::Entries(all(Some(last_of_two))));
    assert_ne!(short.status().estimate, settled);
    short.handle(Event::Entries(all(None)));
    assert_eq!(short.status().estimate, settled);
}

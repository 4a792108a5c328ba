//! A process may be killed at any moment. Whatever its journal holds then, the next one neither contradicts
//! nor repeats what was said, and the team ends with the bits that all entries together have.

use std::collections::BTreeMap;

use pleiad_agent::journal::Journal;
use pleiad_agent::{Event, Node, Record};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Fingerprint;

use super::exactness::answered_once;
use crate::support::team::{Crash, Net, World, world};
use crate::support::{agent, drive, feed, folded, gps, handle, held, node, sees, standing_log, velocity};

const VICTIM: RobotId = RobotId(1);

/// Lives through a world in which robot 1 is killed at `crash`, and checks what must hold in the end; that no
/// identity has two contents is checked on the way.
fn check(world: &World, seed: u64, crash: Option<Crash>) -> Net {
    let mut net = Net::new(&world.configs, seed);
    (net.lost, net.repeated, net.crash) = (0.1, 0.1, crash);
    net.live(&world.samples);
    let settled = net.settle();
    let fold = world.configs[&VICTIM].node().unwrap().fold;
    let mut fresh = folded(net.said.values(), fold);
    assert_eq!(fresh.fingerprint(), settled, "seed {seed}, {crash:?}");
    answered_once(&net.said);
    assert!(net.nodes.values().all(|node| node.ledger().quarantined().is_empty()));
    net
}

#[test]
fn killed_after_any_frame_of_its_journal() {
    let seed = 7;
    let world = world(seed, 3, 3.0);
    let frames = check(&world, seed, None).journals[&VICTIM].len();
    assert!(frames > 60, "{frames} frames are few");
    let mut boots = BTreeMap::new();
    for cut in 1..frames {
        for silent in [false, true] {
            let crash = Crash { robot: VICTIM, frames: cut, silent };
            let net = check(&world, seed, Some(crash));
            let logs = net.said.keys().filter(|id| id.robot == VICTIM).map(|id| id.boot.0).max();
            *boots.entry(logs.unwrap()).or_insert(0) += 1;
        }
    }
    // A kill before or after the last odometry leaves one boot, every other kill makes a second.
    assert!(boots[&1] > frames, "{boots:?}");
}

#[test]
fn killed_again_and_again() {
    for seed in 100..104 {
        let world = world(seed, 3, 6.0);
        let mut net = Net::new(&world.configs, seed);
        (net.lost, net.repeated) = (0.2, 0.2);
        for part in world.samples.chunks(25) {
            let (robot, _) = part[0];
            net.restart(robot);
            for (robot, sample) in part {
                net.event(*robot, Event::Sample(*sample));
            }
            net.statuses();
        }
        net.live(&[]);
        let settled = net.settle();
        let mut fresh = folded(net.said.values(), world.configs[&VICTIM].node().unwrap().fold);
        assert_eq!(fresh.fingerprint(), settled, "seed {seed}");
        answered_once(&net.said);
        assert!(net.said.keys().any(|id| id.boot.0 >= 3), "few restarts");
    }
}

#[test]
fn a_recovered_node_knows_what_the_killed_one_knew() {
    let world = world(9, 3, 4.0);
    let mut net = check(&world, 9, None);
    for (robot, node) in &mut net.nodes {
        let records = net.journals[robot].iter().flatten().cloned();
        let mut again = Node::recover(world.configs[robot].node().unwrap(), 5, records);
        let (before, after) = (node.status(), again.status());
        assert_eq!((before.estimate, before.logs), (after.estimate, after.logs));
        assert_eq!(before.odometry_until, after.odometry_until);
        assert_eq!(node.settled(), again.settled());
        assert_eq!(node.distance_m().to_bits(), again.distance_m().to_bits());
    }
}

#[test]
fn the_file_gives_back_the_records_bit_for_bit() {
    let world = world(11, 2, 3.0);
    let net = check(&world, 11, None);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal.bin");
    let (mut journal, _) = Journal::open(&path).unwrap();
    let frames = &net.journals[&VICTIM];
    let mut ends = Vec::new();
    for frame in frames {
        journal.append(frame).unwrap();
        ends.push(std::fs::read(&path).unwrap().len());
    }
    let whole: Vec<Record> = frames.iter().flatten().cloned().collect();
    assert_eq!(Journal::read(&path).unwrap(), whole);
    // Cut anywhere within a frame, what is left are the frames before it.
    let bytes = std::fs::read(&path).unwrap();
    for (index, end) in ends.iter().enumerate().step_by(9) {
        std::fs::write(&path, &bytes[..end - 1]).unwrap();
        let left: Vec<Record> = frames[..index].iter().flatten().cloned().collect();
        assert_eq!(Journal::read(&path).unwrap(), left);
    }
}

#[test]
fn recovery_says_nothing_and_begins_nothing_before_the_first_odometry() {
    let mut first = node(1);
    let records: Vec<Record> = drive(&mut first, 0.0, 1.0, 0.1).into_iter().flat_map(|h| h.journal).collect();
    let mut again = Node::recover(agent(1).node().unwrap(), 5, records);
    let before = held(&again);
    let entries = standing_log(2, again.config().fold, &[(0.5, 1)]);
    assert!(handle(&mut again, Event::Entries(entries)).published.is_empty());
    assert!(feed(&mut again, gps(0.7)).published.is_empty());
    assert!(feed(&mut again, sees(0.8, 2)).published.is_empty());
    assert_eq!(held(&again)[..before.len()], before);
    // What was seen before the restart belongs to a trajectory that has ended.
    let handled = feed(&mut again, velocity(1.1));
    assert_eq!(handled.notices.len(), 1, "{:?}", handled.notices);
    assert_eq!(again.status().samples.refused, 2);
}

#[test]
fn recovery_from_nothing_is_a_new_node() {
    let mut node = Node::recover(agent(1).node().unwrap(), 5, []);
    let print: Fingerprint = node.status().estimate;
    assert_eq!(print, crate::support::node(1).status().estimate);
    assert_eq!(feed(&mut node, velocity(0.0)).published[0].id.boot.0, 0);
}

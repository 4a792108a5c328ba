//! Processes of a team are killed, stopped, and find their disk full; the team falls apart and comes together.
//! At the end it is as if nothing had happened to what was said.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use pleiad_agent::Record;
use pleiad_agent::journal::Journal;
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Body, Entry, EntryId};
use pleiad_estimation::fold::DEFAULT_GATE;
use pleiad_estimation::reference::{ErrorForm, JointEkf, facts_from_entries};
use pleiad_tests::folded::fold;
use pleiad_tests::program::{self, repository, run};
use serde_json::Value;

use crate::boots;

/// Relative difference from the oracle that rounding explains.
const TOLERANCE: f64 = 1e-9;

/// The shipped scenario, so long.
fn scenario(within: &Path, seconds: u32) {
    let text = std::fs::read_to_string(repository().join("scenarios").join("survey_three.toml")).unwrap();
    let short = text.replace("duration_s = 180.0", &format!("duration_s = {seconds}.0"));
    assert_ne!(short, text);
    std::fs::write(within.join("short.toml"), short).unwrap();
}

/// The program's own account of a run under these faults.
fn ran(within: &Path, faults: &str, more: &[&str]) -> Value {
    std::fs::write(within.join("faults.toml"), faults).unwrap();
    let arguments = ["run", "short.toml", "--faults", "faults.toml", "--out", "out", "--json"];
    run(within, arguments.iter().chain(more)).json()
}

/// What the robots wrote down.
fn journals(within: &Path) -> BTreeMap<RobotId, Vec<Entry>> {
    let journal = |robot: u32| {
        let records = Journal::read(&within.join(format!("out/agents/r{robot}/journal.bin"))).unwrap();
        let entry = |record| match record {
            Record::Entry(entry) => Some(entry),
            _ => None,
        };
        (RobotId(robot), records.into_iter().filter_map(entry).collect())
    };
    (1..=3).map(journal).collect()
}

fn log(within: &Path, robot: u32) -> String {
    std::fs::read_to_string(within.join(format!("out/agents/r{robot}/agent.log"))).unwrap()
}

/// Every journal has every entry; every agent announced the estimate of a fold of them from nothing; and that
/// is the oracle's.
fn assert_whole(within: &Path, ran: &Value) {
    let journals = journals(within);
    let mut union: BTreeMap<EntryId, Entry> = BTreeMap::new();
    for entry in journals.values().flatten() {
        let first = union.entry(entry.id).or_insert_with(|| entry.clone());
        assert_eq!(first, entry, "two contents");
    }
    for (robot, journal) in &journals {
        let held: BTreeSet<EntryId> = journal.iter().map(|entry| entry.id).collect();
        assert!(held.iter().eq(union.keys()), "robot {robot} lacks {} entries", union.len() - held.len());
    }
    let entries: Vec<Entry> = union.into_values().collect();
    let mut undisturbed = fold(entries.iter().cloned());
    let expected = undisturbed.fingerprint().to_string();
    for robot in ran["robots"].as_array().unwrap() {
        assert_eq!(robot["estimate"], expected.as_str(), "{robot}");
    }
    let ekf = JointEkf { form: ErrorForm::Invariant, gate: DEFAULT_GATE };
    let oracle = ekf.fold(&facts_from_entries(&entries));
    assert!(oracle.near_gate(&DEFAULT_GATE, 1e-6).is_empty(), "another seed decides clearly");
    assert_eq!(oracle.robots.len(), 3);
    for robot in &oracle.robots {
        let ours = undisturbed.joint().member(robot.robot).unwrap().correction;
        let apart = ours.between(&robot.correction).log().amax();
        assert!(apart < TOLERANCE * (1.0 + robot.correction.position().norm()), "{apart:e}");
    }
    let faults = &ran["faults"];
    let observations = entries.iter().filter(|entry| matches!(entry.body, Body::Observation(_))).count();
    // Three of them are priors.
    assert_eq!(faults["observations"], observations - 3);
    assert_eq!((&faults["lost"], &faults["counted_twice"]), (&0.into(), &0.into()));
    assert_eq!((&faults["estimates"], &ran["facts"]["pending"]), (&1.into(), &0.into()));
}

#[test]
fn a_team_under_random_kills_stops_partitions_full_disks_and_loss_loses_nothing_and_agrees() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    scenario(within, 80);
    // The ready plan, with everything twice as often.
    let plan = std::fs::read_to_string(repository().join("scenarios/plans/chaos.toml")).unwrap();
    let faster =
        [("60.0", "25.0"), ("= 20.0", "= 10.0"), ("= 25.0", "= 12.0"), ("for_s = 10.0", "for_s = 5.0")];
    let plan = faster.iter().fold(plan, |plan, (from, to)| plan.replace(from, to));
    let ran = ran(within, &plan, &["--speed", "4", "--seed", "3"]);
    assert_whole(within, &ran);
    let faults = &ran["faults"];
    for what in ["kills", "stops", "full_disks", "partitions"] {
        assert!(faults[what].as_u64().unwrap() > 0, "no {what}: {faults}");
    }
    // Who was killed, or ended of a write that failed, really was another process afterwards.
    assert!(faults["boots"].as_u64().unwrap() > 3, "{faults}");
    let logged = |what: &str| (1..=3).map(|robot| log(within, robot).matches(what).count()).sum::<usize>();
    // A write fails in the journal or in the one that is about to replace it.
    let full = logged("journal.bin: File too large") + logged("journal.new: File too large");
    let lives = logged("agent started");
    assert!(full > 0, "{faults}");
    // Every death is followed by another life. A full disk can keep the agent from saying why it ends, in a log that is longer
    // than a journal just replaced.
    let [kills, full_disks] =
        ["kills", "full_disks"].map(|what| usize::try_from(faults[what].as_u64().unwrap()).unwrap());
    let expected = 3 + kills + full..=3 + kills + full.max(full_disks);
    assert!(expected.contains(&lives), "{lives} lives, {full} writes that failed: {faults}");
    // The script that was played is kept, and plays again.
    let script = std::fs::read_to_string(within.join("out/faults.toml")).unwrap();
    assert!(!script.contains("every_s") && script.matches("what = \"kill\"").count() > 0, "{script}");
}

#[test]
fn each_fault_of_a_process_does_what_it_says() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    scenario(within, 50);
    let faults = r#"
        [[fault]]
        what = "kill"
        robots = [2]
        start_s = 10
        for_s = 6
        [[fault]]
        what = "disk_full"
        robots = [1]
        start_s = 20
        for_s = 6
        [[fault]]
        what = "stop"
        robots = [3]
        start_s = 30
        end_s = 36
    "#;
    let ran = ran(within, faults, &["--speed", "2"]);
    assert_whole(within, &ran);
    let counted =
        ["kills", "stops", "full_disks", "coordinator_deaths"].map(|what| ran["faults"][what].as_u64());
    assert_eq!(counted, [1, 1, 1, 0].map(Some));
    let lives = [1, 2, 3].map(|robot| log(within, robot).matches("agent started").count());
    assert_eq!(lives, [2, 2, 1], "who was stopped is the same process");
    // The full disk was met by a write, which failed; nobody else's did.
    let full = [1, 2, 3].map(|robot| log(within, robot).contains("journal.bin: File too large"));
    assert_eq!(full, [true, false, false], "{}", log(within, 1));
    let ledger = fold(journals(within).remove(&RobotId(1)).unwrap());
    for robot in [1, 2, 3] {
        assert_eq!(boots(&ledger, RobotId(robot)), 2, "robot {robot} missed more than 2 s of its own motion");
    }
}

#[test]
fn the_end_of_a_run_ends_every_fault_that_has_begun() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    scenario(within, 20);
    // Killed and stopped until after the last sample.
    let faults = r#"
        [[fault]]
        what = "kill"
        robots = [1]
        start_s = 12
        [[fault]]
        what = "stop"
        robots = [2]
        start_s = 15
        end_s = 1000
    "#;
    let ran = ran(within, faults, &["--speed", "4"]);
    assert_whole(within, &ran);
    assert_eq!(log(within, 1).matches("agent started").count(), 2);
}

#[test]
fn a_coordinator_that_dies_is_not_missed() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    scenario(within, 30);
    let dies = "[[fault]]\nwhat = 'coordinator_dies'\nstart_s = 10\n";
    let dead = ran(within, dies, &[]);
    assert_whole(within, &dead);
    assert_eq!(dead["faults"]["coordinator_deaths"], 1);
    // To the bit what the same robots believe whose coordinator lived.
    let alive = run(within, ["run", "short.toml", "--json", "--out", "alive"]).json();
    assert_eq!(dead["robots"][0]["estimate"], alive["robots"][0]["estimate"]);
    assert_eq!(dead["facts"], alive["facts"]);
}

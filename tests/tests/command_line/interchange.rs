//! `run.mcap`, `pleiad export`, and recordings of other tools through a mapping.

use std::fmt::Write as _;
use std::path::Path;

use pleiad_tests::program::{run, turn};
use serde_json::Value;

use crate::{list, number, recording, scenario};

/// The estimates of all robots as their hashes, and their errors.
fn estimates(replayed: &Value) -> Vec<(String, f64)> {
    let of =
        |robot: &Value| (robot["estimate"].as_str().unwrap().to_owned(), number(robot, "position_rmse_m"));
    let all: Vec<_> = list(replayed, "robots").iter().map(of).collect();
    assert_eq!(all.len(), 2);
    all
}

fn replay(within: &Path, arguments: &[&str]) -> Value {
    run(within, ["replay"].iter().chain(arguments).chain(&["--json"])).json()
}

/// A recording of the scenario with what its robots were told, replayed into `first`.
fn replayed(within: &Path) -> Value {
    scenario(within);
    run(within, ["simulate", "small.toml", "--out", "recording"]).success();
    replay(within, &["recording", "--out", "first"])
}

#[test]
fn a_replay_of_run_mcap_ends_in_the_bits_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let first = replayed(folder.path());
    let of_file = replay(folder.path(), &["first/run.mcap", "--out", "second"]);
    assert_eq!(estimates(&of_file), estimates(&first));
    assert_eq!(of_file["ingest"]["form"], "mcap");
    assert_eq!(of_file["recording"], first["recording"]);
    // The run folder stands for the file in it, and what was replayed is a run again.
    let of_folder = replay(folder.path(), &["second", "--out", "third"]);
    assert_eq!(estimates(&of_folder), estimates(&first));
    let settled = |run: &str| std::fs::read(folder.path().join(run).join("settled/robot-2.tum")).unwrap();
    assert_eq!(settled("third"), settled("first"));
}

#[test]
fn a_run_of_processes_leaves_a_file_that_replays_to_its_estimate() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path());
    let _turn = turn();
    let first = run(folder.path(), ["run", "small.toml", "--out", "run", "--json"]).json();
    let again = replay(folder.path(), &["run/run.mcap", "--out", "again"]);
    assert_eq!(estimates(&again), estimates(&first));
}

#[test]
fn an_export_to_csv_or_mcap_replays_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let first = replayed(folder.path());
    let told = run(folder.path(), ["export", "first", "--to", "csv", "--out", "csv", "--json"]).json();
    assert_eq!(number(&told, "robots"), 2.0);
    let rows = std::fs::read_to_string(folder.path().join("csv/estimate/robot-1.csv")).unwrap();
    let other = std::fs::read_to_string(folder.path().join("csv/estimate/robot-2.csv")).unwrap();
    assert_eq!(number(&told, "estimates"), (rows.lines().count() + other.lines().count() - 2) as f64);
    run(folder.path(), ["export", "csv", "--to", "mcap", "--out", "again.mcap"]).success();
    for (recording, out) in [("csv", "of_csv"), ("again.mcap", "of_mcap")] {
        assert_eq!(estimates(&replay(folder.path(), &[recording, "--out", out])), estimates(&first));
    }
    let refused = run(folder.path(), ["export", "csv", "--to", "mcap", "--out", "again.mcap"]).failure();
    assert!(refused.contains("again.mcap is there already"), "{refused}");
}

#[test]
fn trajectories_are_exported_as_the_run_wrote_them() {
    let folder = tempfile::tempdir().unwrap();
    replayed(folder.path());
    run(folder.path(), ["export", "first", "--to", "tum", "--out", "tum"]).success();
    let text = |path: &str| std::fs::read_to_string(folder.path().join(path)).unwrap();
    let (ours, theirs) = (text("first/settled/robot-1.tum"), text("tum/estimate/robot-1.tum"));
    assert_eq!(ours.lines().count(), theirs.lines().count());
    for (a, b) in ours.lines().zip(theirs.lines()) {
        let cells = |line: &str| line.split(' ').map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>();
        // Headings went through a quaternion, which may cost the last digit.
        assert!(cells(a).iter().zip(cells(b)).all(|(a, b)| (a - b).abs() < 1e-15), "{a}\n{b}");
    }
    assert!(text("tum/truth/robot-2.tum").lines().count() > 10);
}

/// The velocities and positions of both robots in files of other names, columns and units.
fn foreign(within: &Path) {
    recording(within);
    std::fs::create_dir(within.join("logs")).unwrap();
    let mut mapping = String::new();
    for robot in ["1", "2"] {
        for (channel, columns) in
            [("wheel_odometry", 3), ("velocity", 3), ("increment", 4), ("gps", 3), ("truth", 4)]
        {
            let path = within.join(format!("recording/r{robot}/{channel}.csv"));
            let Ok(text) = std::fs::read_to_string(path) else { continue };
            let names: Vec<String> = (0..columns).map(|at| format!("column_{at}")).collect();
            let (_, rows) = text.split_once('\n').unwrap();
            // Seconds with nine decimals are whole nanoseconds without their point.
            let nanos = |row: &str| {
                let (time, rest) = row.split_once(',').unwrap();
                format!("{},{rest}\n", time.replace('.', ""))
            };
            let rows: String = rows.lines().map(nanos).collect();
            let file = format!("{channel}_{robot}.csv");
            std::fs::write(within.join("logs").join(&file), format!("{}\n{rows}", names.join(","))).unwrap();
            let _ = write!(
                mapping,
                "[[csv]]\nfile = \"{file}\"\nrobot = {robot}\nchannel = \"{channel}\"\ntime_unit = \"ns\"\n\
                 columns = {names:?}\n"
            );
        }
    }
    std::fs::write(within.join("any.toml"), mapping).unwrap();
}

#[test]
fn csv_files_of_other_tools_are_replayed_through_a_mapping() {
    let folder = tempfile::tempdir().unwrap();
    foreign(folder.path());
    let refused = run(folder.path(), ["replay", "logs", "--out", "refused"]).failure();
    assert!(refused.contains("logs is not a recording"), "{refused}");
    let made = ["export", "logs", "--mapping", "any.toml", "--to", "csv", "--out", "made"];
    run(folder.path(), made).success();
    let file = |path: &str| std::fs::read_to_string(folder.path().join(path)).unwrap();
    let odometry = ["wheel_odometry", "velocity", "increment"]
        .into_iter()
        .find(|name| folder.path().join(format!("recording/r1/{name}.csv")).is_file())
        .unwrap();
    for name in [odometry, "gps", "truth"] {
        let (made, recorded) = (format!("made/r1/{name}.csv"), format!("recording/r1/{name}.csv"));
        assert_eq!(file(&made), file(&recorded), "to the bit");
    }
    // With nothing beside them that a replay has to know, and by bare names.
    run(folder.path(), ["export", "made", "--to", "mcap", "--out", "plain.mcap"]).success();
    run(folder.path(), ["export", "plain.mcap", "--to", "csv", "--out", "plain"]).success();
    assert_eq!(file("plain/r2/truth.csv"), file("made/r2/truth.csv"));
    let told = run(folder.path(), ["observability", "logs/gps_1.csv"]).failure();
    assert!(told.contains("there is no mapping") && told.contains("mapping.toml"), "{told}");
}

//! `pleiad why`: each reason from a recording in which it was planted.

use std::path::Path;

use pleiad_tests::program::run;
use serde_json::Value;

const SCENARIO: &str = r#"
name = "why"
duration_s = 30.0
team_size = 2

[defaults.prior]
sigma_position_m = 0.05
sigma_heading_rad = 0.02

[defaults.relative]
rate_hz = 1.0
kind = "range_bearing"
max_range_m = 40.0
sigma_range_m = 0.05
sigma_bearing_rad = 0.02
"#;

fn recorded(folder: &Path) -> std::path::PathBuf {
    std::fs::write(folder.join("why.toml"), SCENARIO).unwrap();
    run(folder, ["simulate", "why.toml", "--out", "recording"]).success();
    folder.join("recording")
}

fn why(folder: &Path, more: &[&str]) -> Value {
    run(folder, ["why", "recording", "--json"].iter().chain(more)).json()
}

/// The rows of a file changed, each a list of columns; `change` has the header's names.
fn edit(path: &Path, change: impl Fn(&[String], usize, &mut Vec<String>)) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let rows = lines.enumerate().map(|(row, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(&header, row, &mut cells);
        cells.join(",")
    });
    let text: Vec<String> = std::iter::once(header.join(",")).chain(rows).collect();
    std::fs::write(path, text.join("\n") + "\n").unwrap();
}

#[test]
fn a_wrong_range_is_refused_by_the_gate_and_found_by_robot_and_time() {
    let folder = tempfile::tempdir().unwrap();
    let recording = recorded(folder.path());
    let clean = why(folder.path(), &[]);
    assert_eq!(clean["not_used"], 0, "{clean}");
    assert!(clean["observations"].as_u64().unwrap() >= 50, "{clean}");

    // Ten metres too far: the eleventh sighting of robot 1.
    let file = recording.join("r1").join("relative.csv");
    edit(&file, |header, row, cells| {
        let range = header.iter().position(|name| name.contains("range")).unwrap();
        if row == 10 {
            cells[range] = (cells[range].parse::<f64>().unwrap() + 10.0).to_string();
        }
    });
    let found = why(folder.path(), &[]);
    assert_eq!(found["reasons"], serde_json::json!({ "gate": 1 }), "{found}");
    let one = &found["listed"][0];
    assert_eq!((&one["robot"], &one["of"]), (&1.into(), &"robot 2".into()), "{found}");
    // 10 m at a sigma of 0.05 m and a team that is surer than a metre: far above 13.8.
    assert!(one["nis"].as_f64().unwrap() > 50.0, "{found}");
    let time = one["time_s"].as_f64().unwrap();
    let at = |robot: &str, time: f64| {
        why(folder.path(), &["--robot", robot, "--at", &time.to_string(), "--within", "0.1"])["not_used"]
            .clone()
    };
    assert_eq!(at("1", time), 1);
    assert_eq!(at("2", time), 0);
    assert_eq!(at("1", time + 5.0), 0);
    let people = run(folder.path(), ["why", "recording"]).success();
    assert!(people.contains("robot 1 of robot 2: gate") && people.contains("pleiad tune"), "{people}");
}

#[test]
fn what_cannot_be_answered_says_so() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let approximate = run(folder.path(), ["why", "recording", "--strategy", "pairwise"]).failure();
    assert!(approximate.contains("exact"), "{approximate}");
    let robot = run(folder.path(), ["why", "recording", "--robot", "7"]).failure();
    assert!(robot.contains("--robot 7") && robot.contains("1, 2"), "{robot}");
    let at = run(folder.path(), ["why", "recording", "--at", "nan"]).failure();
    assert!(at.contains("--at NaN"), "{at}");
}

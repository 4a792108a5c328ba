//! `pleiad diagnose` as people and scripts meet it: what it leaves behind, what it refuses and how.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]

use std::path::Path;

use pleiad_recording::{Overwrite, read_model, write_folder};
use pleiad_sim_peers::{Scenario, simulate};
use pleiad_tests::program::run;
use serde_json::Value;

/// Two robots with landmarks, one with GPS.
const SCENARIO: &str = r#"
name = "small"
duration_s = 40.0
team_size = 2
landmarks = [
    { id = 6, x_m = 2.0, y_m = 1.0 },
    { id = 7, x_m = -2.0, y_m = -1.0 },
]

[arena]
width_m = 10.0
height_m = 10.0

[defaults.relative]
rate_hz = 2.0
see = "both"

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.5 }
"#;

const VERDICTS: [&str; 6] =
    ["named", "cannot_tell", "unnameable", "bad_data", "nothing_missing", "untestable"];

/// Writes a recording of the scenario as the folder `name`.
fn recording(within: &Path, name: &str, seed: u64) {
    let scenario = Scenario::from_toml(SCENARIO, "small.toml").unwrap();
    let run = simulate(&scenario, seed).unwrap();
    write_folder(&run.recording, &within.join(name), Overwrite::Refuse).unwrap();
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Runs the program where the recordings `a` and `b` are, and checks that it fails, says all this and leaves
/// no folder of a run behind.
fn refused(arguments: &[&str], words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), "a", 3);
    recording(folder.path(), "b", 4);
    std::fs::create_dir(folder.path().join("full")).unwrap();
    std::fs::write(folder.path().join("full/notes.txt"), "mine").unwrap();
    std::fs::write(folder.path().join("broken.toml"), "format_version = 1\nmodel = \"ideal_unicycle\"\n")
        .unwrap();
    let stderr = run(folder.path(), std::iter::once("diagnose").chain(arguments.iter().copied())).failure();
    for word in words {
        assert!(stderr.contains(word), "{word} is missing in: {stderr}");
    }
    assert!(!folder.path().join("runs").exists(), "a run folder was made");
    assert_eq!(read(folder.path(), "full/notes.txt"), "mine");
}

#[test]
fn a_diagnosis_leaves_a_report_findings_and_a_model() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), "a", 3);
    let text = run(folder.path(), ["diagnose", "a", "--out", "out"]).success();
    assert!(text.starts_with("a: ") && text.contains("out/report.html"), "{text}");
    let out = folder.path().join("out");
    let report = read(&out, "report.html");
    assert!(report.contains("<title>Diagnosis: a</title>") && report.trim_end().ends_with("</html>"));
    assert!(report.contains("pleiad diagnose a --out out"), "the command that makes it again");
    let findings: Value = serde_json::from_str(&read(&out, "findings.json")).unwrap();
    assert!(VERDICTS.contains(&findings["verdict"].as_str().unwrap()), "{findings}");
    assert_eq!(findings["recordings"], serde_json::json!(["a"]));
    for list in ["findings", "undetected", "untestable", "roll_outs", "notes"] {
        assert!(findings[list].is_array(), "{list}");
    }
    let mut warnings = Vec::new();
    let model = read_model(&out.join("corrected.toml"), &mut warnings).unwrap();
    assert_eq!(model.robots.len(), 2);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn json_is_the_object_of_findings_json_and_equal_runs_give_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), "a", 3);
    let printed = run(folder.path(), ["diagnose", "a", "--json", "--out", "one"]).json();
    let written: Value = serde_json::from_str(&read(folder.path(), "one/findings.json")).unwrap();
    assert_eq!(printed, written);
    run(folder.path(), ["diagnose", "a", "--json", "--out", "two"]).json();
    for file in ["findings.json", "corrected.toml"] {
        assert_eq!(read(&folder.path().join("one"), file), read(&folder.path().join("two"), file), "{file}");
    }
}

#[test]
fn several_recordings_are_diagnosed_together_and_split_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a", 3), ("b", 4), ("c", 5)] {
        recording(folder.path(), name, seed);
    }
    let arguments = ["diagnose", "a", "b", "c", "--fit-on", "a", "--test-on", "b", "--json", "--out", "out"];
    let findings = run(folder.path(), arguments).json();
    assert_eq!(findings["fit_on"], serde_json::json!(["a"]));
    assert_eq!(findings["test_on"], serde_json::json!(["b"]));
    assert_eq!(findings["recordings"], serde_json::json!(["a", "b"]));
    let notes = findings["notes"].to_string();
    assert!(notes.contains("c: neither fitted nor tested on"), "{notes}");
    let rest = run(folder.path(), ["diagnose", "a", "b", "--test-on", "b", "--json", "--out", "rest"]).json();
    assert_eq!(rest["fit_on"], serde_json::json!(["a"]));
}

#[test]
fn another_model_takes_the_place_of_the_recordings_own() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), "a", 3);
    let nominal = folder.path().join("a/nominal.toml");
    std::fs::rename(&nominal, folder.path().join("mine.toml")).unwrap();
    let findings =
        run(folder.path(), ["diagnose", "a", "--model", "mine.toml", "--json", "--out", "out"]).json();
    assert!(VERDICTS.contains(&findings["verdict"].as_str().unwrap()), "{findings}");
}

#[test]
fn a_run_folder_goes_by_its_own_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("run-007")).unwrap();
    recording(folder.path(), "run-007/recording", 3);
    let findings = run(folder.path(), ["diagnose", "run-007", "--json", "--out", "out"]).json();
    assert_eq!(findings["recordings"], serde_json::json!(["run-007"]));
}

#[test]
fn names_that_cannot_be_meant_are_refused() {
    refused(&["a", "b", "--fit-on", "x"], &["--fit-on", "x", "there is a, b"]);
    refused(&["a", "b", "--test-on", "a,x"], &["--test-on", "x", "there is a, b"]);
    refused(&["a", "b", "--fit-on", "a", "--test-on", "b,a"], &["a is named by --fit-on and by --test-on"]);
    refused(&["a", "b", "--test-on", "a,b"], &["no recording is left to fit on"]);
    refused(&["a", "b", "--fit-on", "a,,b"], &["--fit-on", "a name is empty"]);
    refused(&["a", "b", "./a"], &["a second recording called a"]);
    refused(&[], &["<RECORDING>"]);
}

#[test]
fn what_is_not_there_or_cannot_be_written_is_named() {
    refused(&["nowhere"], &["nowhere", "no such folder"]);
    refused(&["a", "--model", "nowhere.toml"], &["--model", "nowhere.toml"]);
    refused(&["a", "--model", "broken.toml"], &["broken.toml", "noise"]);
    refused(&["a", "--out", "full"], &["full", "not empty", "--out"]);
}

#[test]
fn whether_truth_is_used_is_yes_or_no() {
    refused(&["a", "--truth", "maybe"], &["--truth", "maybe", "auto"]);
}

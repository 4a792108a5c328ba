//! `pleiad simulate SCENARIO`.

use pleiad_recording::{ReadOptions, open};
use pleiad_sim_peers::{Scenario, simulate};
use pleiad_tests::program::run;

use crate::{SCENARIO, list, number};

/// The small scenario with wheels, an effect on robot 1, and a mis-tuned track.
fn injected() -> String {
    let wheels = "\n[defaults.odometry]\nkind = \"wheels\"\nrate_hz = 50.0\n";
    let effect = "declared = { track_width = 0.41 }\n\n[[robots.effects]]\nname = \"gps_lever_arm\"\n\
                  parameters = { offset_body_m = [0.22, -0.1] }\nwithin = { time_s = [10.0, 20.0] }\n";
    format!("{SCENARIO}{effect}").replace("\n[[robots]]", &format!("{wheels}\n[[robots]]"))
}

#[test]
fn a_scenario_is_recorded_and_what_was_injected_told_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("small.toml"), injected()).unwrap();
    let arguments = ["simulate", "small.toml", "--out", "made", "--seed", "9", "--json"];
    let told = run(folder.path(), arguments).json();
    assert_eq!((&told["scenario"], number(&told, "seed")), (&"small".into(), 9.0), "{told}");
    assert_eq!(list(&list(&told, "robots")[0], "effects"), ["gps_lever_arm"]);
    assert!(list(&list(&told, "robots")[1], "effects").is_empty(), "{told}");

    let (read, report) = open(&folder.path().join("made"), &ReadOptions::default()).unwrap();
    let scenario = Scenario::from_toml(&injected(), "small.toml").unwrap();
    assert_eq!(read, simulate(&scenario, 9).unwrap().recording);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let beside = std::fs::read_to_string(folder.path().join("made.injected.toml")).unwrap();
    let beside: toml::Table = beside.parse().unwrap();
    let robot = &beside["robots"]["r1"];
    assert_eq!(robot["effects"][0]["name"].as_str(), Some("gps_lever_arm"));
    assert_eq!(robot["effects"][0]["parameters"]["offset_body_m"][1].as_float(), Some(-0.1));
    assert_eq!(robot["effects"][0]["within"]["time_s"][0].as_float(), Some(10.0));
    assert_eq!(robot["declared"]["track_width"]["truth"].as_float(), Some(0.4));

    // Nothing in the recording says so, and the nominal model is the mis-tuned one.
    for entry in std::fs::read_dir(folder.path().join("made")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(!text.contains("lever"), "{}", path.display());
    }
    assert!(read.nominal.unwrap().robots.values().map(|robot| robot.track_width).eq([0.41, 0.4]));

    // What is predicted of it does not depend on the manifest.
    let residuals = |out: &str| {
        run(folder.path(), ["simulate", "--from", "made", "--out", out]).success();
        std::fs::read_to_string(folder.path().join(out).join("summary.json")).unwrap().replace(out, "")
    };
    let with = residuals("with");
    std::fs::remove_file(folder.path().join("made.injected.toml")).unwrap();
    assert_eq!(with, residuals("gone"));
}

#[test]
fn a_recording_or_a_manifest_that_is_there_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("small.toml"), SCENARIO).unwrap();
    run(folder.path(), ["simulate", "small.toml", "--out", "made"]).success();
    let stderr = run(folder.path(), ["simulate", "small.toml", "--out", "made"]).failure();
    assert!(stderr.contains("made.injected.toml") && stderr.contains("--out"), "{stderr}");
    std::fs::remove_file(folder.path().join("made.injected.toml")).unwrap();
    let stderr = run(folder.path(), ["simulate", "small.toml", "--out", "made"]).failure();
    assert!(stderr.contains("made is not empty"), "{stderr}");
    std::fs::write(folder.path().join("other.injected.toml"), "mine").unwrap();
    let stderr = run(folder.path(), ["simulate", "small.toml", "--out", "other"]).failure();
    assert!(stderr.contains("other.injected.toml"), "{stderr}");
    assert!(!folder.path().join("other").exists(), "nothing is left behind");
}

#[test]
fn a_scenario_and_a_recording_at_once_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        ["simulate", "small.toml", "--from", "recording"].as_slice(),
        &["simulate", "small.toml", "--model", "m.toml"],
        &["simulate", "--from", "recording", "--seed", "3"],
    ] {
        let stderr = run(folder.path(), arguments).failure();
        assert!(stderr.contains("cannot be used with"), "{stderr}");
    }
    assert!(run(folder.path(), ["simulate"]).failure().contains("SCENARIO"));
}

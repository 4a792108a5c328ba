//! `pleiad calibrate`: from simulated runs to a model that makes agents better.

use pleiad_tests::program::{run, turn};
use serde_json::Value;

use crate::number;

/// Mean position error of a replay, metres.
fn replayed(folder: &std::path::Path, recording: &str, model: &[&str]) -> f64 {
    let arguments = [&["replay", recording, "--json"], model].concat();
    number(&run(folder, arguments).json(), "mean_position_rmse_m")
}

#[test]
fn squares_that_were_driven_are_calibrated_on_and_the_model_makes_a_replay_better() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    let simulated =
        run(within, ["calibrate", "umbmark", "--simulate", "--seeds", "2", "--json", "--out", "sim"]).json();
    let e_max = |value: &Value, stage: &str| number(&value[stage], "e_max_syst_m");
    assert!(e_max(&simulated, "after") < 0.3 * e_max(&simulated, "before"), "{simulated}");
    for key in ["e_d", "e_b", "e_s", "alpha_rad", "beta_rad"] {
        number(&simulated, key);
    }
    // The recordings that it left give the same calibration again.
    let runs: Vec<String> = (1..=5)
        .flat_map(|number| ["cw", "ccw"].map(|name| format!("sim/runs/before/{name}{number}")))
        .chain([1, 2, 3].map(|number| format!("sim/runs/before/straight{number}")))
        .collect();
    let arguments = |recordings: &[String], out: &str| {
        let words = ["calibrate", "umbmark"].map(str::to_owned).into_iter().chain(recordings.iter().cloned());
        words.chain(["--json", "--out", out].map(str::to_owned)).collect::<Vec<_>>()
    };
    let recorded = run(within, arguments(&runs, "rec")).json();
    assert!((number(&recorded, "e_d") - number(&simulated, "e_d")).abs() < 1e-9, "{recorded}");
    assert!(e_max(&recorded, "after") < 0.5 * e_max(&recorded, "before"), "{recorded}");
    // An agent that loads the model, on a run that was not calibrated on.
    let with = replayed(within, "sim/runs/before/cw5", &["--model", "sim/corrected.toml"]);
    let without = replayed(within, "sim/runs/before/cw5", &[]);
    assert!(with < 0.3 * without, "{with} {without}");
    // One direction: refused, with a page that shows why.
    let clockwise: Vec<String> = runs.iter().filter(|run| run.contains("/cw")).cloned().collect();
    let stderr = run(within, arguments(&clockwise, "one")).failure();
    assert!(stderr.contains("clockwise") && stderr.contains("Drive as many squares"), "{stderr}");
    let report = std::fs::read_to_string(within.join("one/report.html")).unwrap();
    assert!(
        report.contains("1.0339") && report.contains("masked square"),
        "the report shows the masked square"
    );
}

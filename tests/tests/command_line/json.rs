//! `--json` of `replay` and `observability`.

use pleiad_tests::program::run;
use serde_json::Value;

use crate::{list, number, recording, scenario};

#[test]
fn a_replay_tells_its_result_in_one_json_object() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    let replay = run(folder.path(), ["replay", "recording", "--json", "--out", "out"]).json();
    let robots = list(&replay, "robots");
    assert_eq!(robots.len(), 2);
    for (robot, expected) in robots.iter().zip([1.0, 2.0]) {
        assert_eq!(number(robot, "robot"), expected);
        for key in ["position_rmse_m", "heading_rmse_rad", "distance_m", "dead_reckoning_rmse_m"] {
            assert!(number(robot, key) > 0.0, "{key} in {robot}");
        }
    }
    for key in ["mean_position_rmse_m", "dead_reckoning_mean_rmse_m", "online_mean_position_rmse_m"] {
        assert!(number(&replay, key) > 0.0, "{key}");
    }
    let mean = |key: &str| robots.iter().map(|robot| number(robot, key)).sum::<f64>() / 2.0;
    assert!((number(&replay, "mean_position_rmse_m") - mean("position_rmse_m")).abs() < 1e-12);
    assert!((number(&replay, "dead_reckoning_mean_rmse_m") - mean("dead_reckoning_rmse_m")).abs() < 1e-12);
    let facts = &replay["facts"];
    assert!(number(facts, "relative") > 0.0 && number(facts, "absolute") > 0.0, "{facts}");
    let known = number(facts, "relative") + number(facts, "absolute");
    let decided = number(facts, "used") + number(facts, "rejected") + number(facts, "skipped");
    assert_eq!((decided, number(facts, "pending")), (known, 0.0), "{facts}");
    let payload = &replay["payload_bytes"];
    assert!(number(payload, "per_relative_observation") > 0.0);
    assert!(
        number(payload, "total") > number(payload, "per_relative_observation") * number(facts, "relative")
    );
    let nis = &replay["nis"];
    assert!(number(nis, "mean") > 0.0 && number(nis, "dof") > 0.0, "{nis}");
    assert!((0.0..=1.0).contains(&number(nis, "within_95")), "{nis}");
    let seconds = &replay["seconds"];
    assert!((number(seconds, "recorded") - 40.0).abs() < 1.0 && number(seconds, "wall") > 0.0, "{seconds}");

    let out = folder.path().join("out");
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary, replay);
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("</html>"));
}

#[test]
fn a_replay_takes_fixes_from_ground_truth_and_leaves_out_landmarks() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    let absolute = |name: &str, more: &[&str]| {
        let arguments = ["replay", "recording", "--json", "--seconds", "20", "--out", name];
        let replay = run(folder.path(), arguments.iter().chain(more)).json();
        number(&replay["facts"], "absolute")
    };
    let all = absolute("all", &[]);
    let one = absolute("one", &["--landmarks", "6"]);
    let none = absolute("none", &["--landmarks", "none"]);
    assert!(all > one && one > none, "{all}, {one}, {none}");
    // Fixes for robot 2 at 2 Hz over 20 s; its odometry may end just before the last of them.
    let fixes = absolute("fixed", &["--landmarks", "none", "--absolute", "2@2.0:0.3"]) - none;
    assert!((39.0..=40.0).contains(&fixes), "{fixes}");
}

#[test]
fn observability_is_told_in_one_json_object() {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path());
    recording(folder.path());
    for input in ["small.toml", "recording"] {
        let told = run(folder.path(), ["observability", input, "--json"]).json();
        assert_eq!((number(&told, "rank"), number(&told, "dimension")), (6.0, 6.0), "{told}");
        assert_eq!(list(&told, "singular_values").len(), 6, "{told}");
        assert_eq!(list(&told, "unobservable").len(), 0, "{told}");
        for (robot, expected) in list(&told, "robots").iter().zip([1, 2]) {
            assert_eq!(robot["robot"], expected);
            assert_eq!((&robot["position_bounded"], &robot["heading_bounded"]), (&true.into(), &true.into()));
        }
    }
    // Without the map and GPS the team knows of itself only what is relative.
    let alone = include_str!("../../../scenarios/survey_three.toml");
    std::fs::write(folder.path().join("alone.toml"), alone).unwrap();
    let told = run(folder.path(), ["observability", "alone.toml", "--seconds", "30", "--json"]).json();
    assert_eq!((number(&told, "rank"), number(&told, "dimension")), (6.0, 9.0), "{told}");
    assert_eq!(list(&told, "unobservable").len(), 3, "{told}");
    assert!(list(&told, "robots").iter().all(|robot| robot["position_bounded"] == false), "{told}");
    assert!(list(&told, "robots").iter().all(|robot| robot["heading_bounded"] == false), "{told}");
}

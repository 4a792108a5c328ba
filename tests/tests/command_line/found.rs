//! What the filter is asked to find out besides poses: clocks, starts, landmarks, garbage.

use std::path::Path;

use pleiad_tests::program::run;
use serde_json::Value;

use crate::{list, number};

/// Three robots, one with GPS, that see each other and landmarks; the clock of the second is 0.15 s ahead.
const SCENARIO: &str = r#"
name = "lost"
seed = 5
duration_s = 90.0
team_size = 3
random_landmarks = 6

[arena]
width_m = 10.0
height_m = 10.0

[defaults.relative]
rate_hz = 2.0
see = "both"
sigma_range_m = 0.05
sigma_bearing_rad = 0.02

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.3 }

[[robots]]
id = 2
declared = { clock_offset_s = 0.0 }
[[robots.effects]]
name = "clock_offset"
parameters = { offset_s = 0.15 }
"#;

fn recorded(within: &Path) {
    std::fs::write(within.join("lost.toml"), SCENARIO).unwrap();
    run(within, ["simulate", "lost.toml", "--out", "recording"]).success();
}

fn replay(within: &Path, more: &[&str], out: &str) -> Value {
    run(within, ["replay", "recording", "--json", "--out", out].iter().chain(more)).json()
}

fn mean(replayed: &Value) -> f64 {
    number(replayed, "mean_position_rmse_m")
}

/// `(value, sigma)` of a parameter that was found, if there is one.
fn parameter(replayed: &Value, robot: u64, name: &str) -> Option<(f64, f64)> {
    let is = |found: &&Value| found["robot"] == robot && found["name"] == name;
    let found = list(&replayed["found"], "parameters").iter().find(is)?;
    Some((number(found, "value"), number(found, "sigma")))
}

#[test]
fn a_clock_that_is_ahead_is_found_and_costs_less_then() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let blind = replay(folder.path(), &[], "blind");
    assert!(blind["found"].is_null(), "{blind}");
    let asked = replay(folder.path(), &["--calibrate", "clock=0.2"], "asked");
    let (offset_s, sigma_s) = parameter(&asked, 2, "clock_offset_s").expect("asked for");
    assert!((offset_s - 0.15).abs() < 4.0 * sigma_s && sigma_s < 0.03, "{offset_s} {sigma_s}");
    let (other_s, sigma_s) = parameter(&asked, 3, "clock_offset_s").expect("asked for");
    assert!(other_s.abs() < 4.0 * sigma_s && sigma_s < 0.03, "{other_s} {sigma_s}");
    assert!(parameter(&asked, 1, "clock_offset_s").is_none(), "the first robot's clock is the team's");
    let heading = |replayed: &Value| number(&list(replayed, "robots")[1], "heading_rmse_rad");
    assert!(heading(&asked) < 0.7 * heading(&blind), "{} {}", heading(&asked), heading(&blind));
}

#[test]
fn robots_that_are_told_nothing_find_out_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let told = replay(folder.path(), &[], "told");
    for (which, out) in [("none", "none"), ("1", "one")] {
        let lost = replay(folder.path(), &["--told", which], out);
        assert!(list(&lost, "robots").iter().all(|robot| robot["position_rmse_m"].is_number()), "{lost}");
        assert!(mean(&lost) < 1.5 * mean(&told) + 0.05, "{} {}", mean(&lost), mean(&told));
    }
}

#[test]
fn landmarks_are_mapped_by_a_team_that_does_not_know_them() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let mapped = replay(folder.path(), &["--landmarks", "team"], "team");
    assert_eq!(list(&mapped["found"], "landmarks").len(), 6);
    assert!(number(&mapped["found"], "landmark_rmse_m") < 0.3, "{}", mapped["found"]);
    let none = replay(folder.path(), &["--landmarks", "none"], "none");
    assert!(mean(&mapped) < mean(&none), "{} {}", mean(&mapped), mean(&none));
}

#[test]
fn agents_in_processes_find_out_the_same_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let asked = [
        "--told",
        "1",
        "--landmarks",
        "team",
        "--clutter",
        "0.02:15",
        "--calibrate",
        "forward=0.05,yaw=0.05,mount_m=0.05,mount_rad=0.02,clock=0.2,drift_ppm=50",
    ];
    let one = replay(folder.path(), &asked, "one");
    let many = replay(folder.path(), &[&asked[..], &["--processes"]].concat(), "many");
    let estimates = |replayed: &Value| -> Vec<Value> {
        list(replayed, "robots").iter().map(|robot| robot["estimate"].clone()).collect()
    };
    assert_eq!(estimates(&one), estimates(&many));
    assert!(estimates(&one).iter().all(|estimate| *estimate == estimates(&one)[0]));
    assert_eq!(one["found"], many["found"]);
}

#[test]
fn what_cannot_be_asked_is_refused_with_what_can() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    for (arguments, words) in [
        (&["--calibrate", "wheel=0.1"][..], &["wheel=0.1", "forward, yaw, bias"][..]),
        (&["--calibrate", "yaw=much"], &["yaw=much"]),
        (&["--calibrate", "yaw=-1"], &["calibration.sigma_yaw_scale", "zero or a positive number"]),
        (&["--clutter", "0.1"], &["SHARE:REACH_M"]),
        (&["--clutter", "1.5:10"], &["filter.clutter.share", "between 0 and 1"]),
        (&["--told", "some"], &["all, none, or numbers"]),
        (&["--told", "1", "--error", "additive"], &["filter.error", "filter.join"]),
        (&["--landmarks", "team", "--strategy", "pairwise"], &["strategy", "unknown_landmarks"]),
    ] {
        let words_given = ["replay", "recording", "--out", "out"].iter().chain(arguments);
        let stderr = run(folder.path(), words_given).failure();
        for word in words {
            assert!(stderr.contains(word), "{word} is missing in: {stderr}");
        }
    }
}

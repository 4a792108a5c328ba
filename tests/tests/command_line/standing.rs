//! Robots that lie, that are carried off, and that are noisier than they say, from a scenario to what is said of them.

use std::path::Path;

use pleiad_tests::program::run;
use serde_json::Value;

use crate::{list, number};

/// Five robots that see each other, two of them with GPS; `{}` is what is wrong with the third.
const SCENARIO: &str = r#"
name = "whom"
seed = 11
duration_s = 120.0
team_size = 5

[arena]
width_m = 10.0
height_m = 10.0

[defaults.relative]
rate_hz = 2.0
see = "robots"
sigma_range_m = 0.05
sigma_bearing_rad = 0.02

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.3 }

[[robots]]
id = 2
gps = { rate_hz = 1.0, sigma_m = 0.3 }

[[robots]]
id = 3
{}
"#;

const LIES: &str = r#"
[[robots.effects]]
name = "range_bias"
parameters = { bias_m = 0.5 }
[[robots.effects]]
name = "sensor_yaw_misalignment"
parameters = { yaw_rad = 0.3 }
"#;

const CARRIED_OFF: &str = r#"
[[robots.effects]]
name = "push"
parameters = { t_on_s = 40.0, jump = [3.0, 0.5, 0.4] }
"#;

fn recorded(within: &Path, wrong: &str) {
    std::fs::write(within.join("whom.toml"), SCENARIO.replace("{}", wrong)).unwrap();
    run(within, ["simulate", "whom.toml", "--out", "recording"]).success();
}

fn replay(within: &Path, more: &[&str], out: &str) -> Value {
    run(within, ["replay", "recording", "--json", "--out", out].iter().chain(more)).json()
}

fn said(replayed: &Value, robot: u64) -> Option<&Value> {
    replayed["found"]["robots"].as_array()?.iter().find(|of| of["robot"] == robot)
}

fn error(replayed: &Value, robot: usize) -> f64 {
    number(&list(replayed, "robots")[robot - 1], "position_rmse_m")
}

#[test]
fn a_robot_whose_sightings_are_false_is_not_believed_by_any_process() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path(), LIES);
    let believed = replay(folder.path(), &[], "believed");
    assert!(believed["found"].is_null(), "{believed}");
    let wary = replay(folder.path(), &["--quarantine", "15:30"], "wary");
    assert!(
        said(&wary, 3).is_some_and(|of| number(of, "detached_s") < number(of, "distrusted_s")),
        "{}",
        wary["found"]
    );
    assert_eq!(list(&wary["found"], "robots").len(), 1, "{}", wary["found"]);
    let many = replay(folder.path(), &["--quarantine", "15:30", "--processes"], "many");
    assert_eq!(many["found"], wary["found"]);
}

#[test]
fn a_robot_that_is_carried_off_is_placed_anew() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path(), CARRIED_OFF);
    let lost = replay(folder.path(), &[], "lost");
    let found = replay(folder.path(), &["--quarantine", "15:30"], "found");
    let of = said(&found, 3).expect("said");
    assert!((40.0..45.0).contains(&number(of, "detached_s")) && of["distrusted_s"].is_null(), "{of}");
    assert!(error(&found, 3) < 0.5 * error(&lost, 3), "{} {}", error(&lost, 3), error(&found, 3));
}

#[test]
fn honest_robots_are_believed_and_hardly_worse_off() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path(), "");
    let plain = replay(folder.path(), &[], "plain");
    let wary = replay(folder.path(), &["--quarantine", "15:30"], "wary");
    assert!(wary["found"].is_null(), "{}", wary["found"]);
    assert_eq!(wary["mean_position_rmse_m"], plain["mean_position_rmse_m"]);
    let follows = replay(folder.path(), &["--inflate", "20:10"], "follows");
    let levels = list(&follows["found"], "robots").iter().map(|of| number(of, "noise_level"));
    assert!(
        levels.clone().count() > 0 && levels.clone().all(|level| (1.0..3.0).contains(&level)),
        "{}",
        follows["found"]
    );
    assert!(number(&follows, "mean_position_rmse_m") < 1.1 * number(&plain, "mean_position_rmse_m"));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path(), "");
    for (arguments, words) in [
        (&["--quarantine", "15"][..], &["LEVEL:WINDOW_S"][..]),
        (&["--quarantine", "0:30"], &["filter.quarantine.level", "positive"]),
        (&["--inflate", "20:1"], &["filter.inflation.most", "more than 1"]),
        (&["--inflate", "20:10", "--strategy", "pairwise"], &["strategy", "filter.inflation"]),
    ] {
        let given = ["replay", "recording", "--out", "out"].iter().chain(arguments);
        let stderr = run(folder.path(), given).failure();
        for word in words {
            assert!(stderr.contains(word), "{word} is missing in: {stderr}");
        }
    }
}

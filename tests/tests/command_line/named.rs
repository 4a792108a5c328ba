//! Robots and landmarks that go by each other's names, from a scenario to how well the team does.

use std::path::Path;

use pleiad_tests::program::run;
use serde_json::Value;

use crate::{list, number};

/// Five robots that know where they start, one of them with GPS, and take each other for one another in a third of the sightings.
const SCENARIO: &str = r#"
name = "named"
seed = 3
duration_s = 90.0
team_size = 5

[arena]
width_m = 10.0
height_m = 10.0

[defaults]
effects = [{ name = "identity_mix_up", parameters = { probability = 0.35 } }]

[defaults.relative]
rate_hz = 0.1
see = "robots"
sigma_range_m = 0.05
sigma_bearing_rad = 0.02

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.3 }
"#;

fn replay(within: &Path, more: &[&str], out: &str) -> Value {
    run(within, ["replay", "recording", "--json", "--out", out].iter().chain(more)).json()
}

#[test]
fn robots_taken_for_one_another_are_told_apart_by_every_process_alike() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("named.toml"), SCENARIO).unwrap();
    run(folder.path(), ["simulate", "named.toml", "--out", "recording"]).success();
    let believed = replay(folder.path(), &[], "believed");
    let asked = replay(folder.path(), &["--clutter", "0.02:15:0.35"], "asked");
    let many = replay(folder.path(), &["--clutter", "0.02:15:0.35", "--processes"], "many");
    let refused = |replayed: &Value| number(&replayed["facts"], "rejected");
    assert!(refused(&asked) < 0.3 * refused(&believed), "{} {}", refused(&asked), refused(&believed));
    let mean = |replayed: &Value| number(replayed, "mean_position_rmse_m");
    assert!(mean(&asked) < 0.95 * mean(&believed), "{} {}", mean(&asked), mean(&believed));
    let estimates = |replayed: &Value| -> Vec<Value> {
        list(replayed, "robots").iter().map(|robot| robot["estimate"].clone()).collect()
    };
    assert_eq!(estimates(&asked), estimates(&many));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("named.toml"), SCENARIO).unwrap();
    run(folder.path(), ["simulate", "named.toml", "--out", "recording"]).success();
    for (arguments, words) in [
        (&["--clutter", "0.02:15:many"][..], &["SHARE:REACH_M:MISNAMED"][..]),
        (&["--clutter", "0.5:15:0.6"], &["filter.clutter.misnamed", "0.6"]),
        (
            &["--clutter", "0.02:15:0.1", "--relinearize", "5:5:4"],
            &["filter.clutter.misnamed", "names are taken for right"],
        ),
    ] {
        let given = ["replay", "recording", "--out", "out"].iter().chain(arguments);
        let stderr = run(folder.path(), given).failure();
        for word in words {
            assert!(stderr.contains(word), "{word} is missing in: {stderr}");
        }
    }
}

//! Faults between real processes delay what a robot knows and change nothing of what it knows in the end.

use std::path::Path;

use pleiad_tests::program::{self, repository, run};
use serde_json::Value;

/// Bursts of loss, copies, damage, and a partition for a third of the run; the last seconds are quiet.
const FAULTS: &str = r#"
[[fault]]
what = "burst"
loss = 0.6
mean_length = 5
end_s = 25.0
[[fault]]
what = "duplicate"
probability = 0.3
within_s = 0.02
end_s = 25.0
[[fault]]
what = "corrupt"
probability = 0.2
bytes = 3
end_s = 25.0
[[fault]]
what = "partition"
groups = [[1], [2, 3]]
start_s = 10.0
end_s = 20.0
"#;

fn ran(within: &Path, more: &[&str]) -> Value {
    let arguments = ["run", "short.toml", "--json"].iter().chain(more);
    run(within, arguments).json()
}

#[test]
fn a_team_whose_messages_are_lost_doubled_and_damaged_ends_with_the_bits_of_one_that_was_left_alone() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    let text = std::fs::read_to_string(repository().join("scenarios").join("survey_three.toml")).unwrap();
    std::fs::write(within.join("short.toml"), text.replace("duration_s = 180.0", "duration_s = 30.0"))
        .unwrap();
    std::fs::write(within.join("faults.toml"), FAULTS).unwrap();
    let alone = ran(within, &["--out", "alone"]);
    let faulty = ran(within, &["--out", "faulty", "--faults", "faults.toml"]);
    assert_eq!(faulty["facts"]["pending"], 0);
    assert_eq!(faulty["facts"], alone["facts"]);
    let estimates = |run: &Value| -> Vec<Value> {
        run["robots"].as_array().unwrap().iter().map(|robot| robot["estimate"].clone()).collect()
    };
    assert_eq!(estimates(&alone).len(), 3);
    assert_eq!(estimates(&faulty), estimates(&alone));
    // The faults were there: damage was refused, and what came late shows while the robots drove.
    let log = |robot: u32| {
        std::fs::read_to_string(within.join(format!("faulty/agents/r{robot}/agent.log"))).unwrap()
    };
    assert!((1..=3).any(|robot| log(robot).contains("refused")), "{}", log(1));
    let online = |run: &Value| run["online_mean_position_rmse_m"].as_f64().unwrap();
    assert!(online(&faulty) > online(&alone), "{} {}", online(&faulty), online(&alone));
}

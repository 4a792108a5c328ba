//! The approximate strategies between real processes do what they do in memory.

use pleiad_tests::program::{self, repository, run};
use serde_json::Value;

/// The strategies, and the share of sightings that each uses in full: by both robots, by the one that was
/// seen, by none.
const KINDS: [(&str, u64); 5] =
    [("pairwise", 2), ("intersection", 1), ("split_intersection", 1), ("naive", 1), ("independent", 0)];

fn number(json: &Value, table: &str, key: &str) -> u64 {
    json[table][key].as_u64().unwrap_or_else(|| panic!("{table}.{key}: {json}"))
}

#[test]
fn every_strategy_that_agents_can_follow_localizes_a_team_of_processes_as_it_does_in_memory() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    let text = std::fs::read_to_string(repository().join("scenarios").join("survey_three.toml")).unwrap();
    std::fs::write(within.join("short.toml"), text.replace("duration_s = 180.0", "duration_s = 20.0"))
        .unwrap();
    for (kind, uses) in KINDS {
        let out = format!("run-{kind}");
        // Ten times as fast as the robots' time: an answer takes far less than the 0.3 s it is waited for.
        let arguments = ["run", "short.toml", "--strategy", kind, "--speed", "10", "--json", "--out", &out];
        let ran = run(within, arguments).json();
        let (input, again) = (format!("{out}/recording"), format!("again-{kind}"));
        let in_memory = run(within, ["replay", &input, "--strategy", kind, "--json", "--out", &again]).json();
        assert_eq!((&ran["processes"], &in_memory["processes"]), (&3.into(), &0.into()));
        let relative = number(&ran, "facts", "relative");
        assert!(relative > 100, "{kind}: {relative} sightings");
        assert_eq!(relative, number(&in_memory, "facts", "relative"), "{kind}");
        assert_eq!(number(&in_memory, "facts", "used"), uses * relative, "{kind}");
        // A busy machine may cost an exchange; most have to be there.
        let used = number(&ran, "facts", "used");
        assert!(10 * used >= 9 * uses * relative && used <= uses * relative, "{kind}: {used} of {relative}");
        let rmse = |run: &Value, which: &str| run[which].as_f64().unwrap();
        let (one, many) = (rmse(&in_memory, "mean_position_rmse_m"), rmse(&ran, "mean_position_rmse_m"));
        assert!((one - many).abs() < 0.005, "{kind}: {one} m in memory, {many} m between processes");
        // Who uses nothing of the others is as good as its odometry, and nobody else is.
        let alone = rmse(&ran, "dead_reckoning_mean_rmse_m");
        assert_eq!((many - alone).abs() < 1e-9, kind == "independent", "{kind}: {many} m, alone {alone} m");
    }
}

#[test]
fn a_strategy_that_no_network_can_serve_is_refused_and_told_where_it_runs() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = repository().join("scenarios").join("survey_three.toml");
    let scenario = scenario.to_str().unwrap();
    let refused = run(folder.path(), ["run", scenario, "--strategy", "factored", "--out", "out"]).failure();
    assert!(refused.contains("factored") && refused.contains("pleiad faults"), "{refused}");
    let unknown = run(folder.path(), ["run", scenario, "--strategy", "magic", "--out", "out"]).failure();
    assert!(unknown.contains("magic") && unknown.contains("pairwise"), "{unknown}");
}

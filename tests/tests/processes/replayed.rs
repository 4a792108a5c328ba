//! A run of processes leaves a recording, and its replay gives the same estimates to the bit, whether the
//! robots are processes again or not.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_tests::program::{self, repository, run};

/// The shipped scenario, shortened.
fn shortened(to: &Path) {
    let text = std::fs::read_to_string(repository().join("scenarios").join("survey_three.toml")).unwrap();
    let short = text.replace("duration_s = 180.0", "duration_s = 40.0");
    assert_ne!(short, text);
    std::fs::write(to, short).unwrap();
}

/// The files of a view of a run: name and text.
fn trajectories(out: &Path, view: &str) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for robot in 1..=3 {
        let name = format!("robot-{robot}.tum");
        let text = std::fs::read_to_string(out.join(view).join(&name)).unwrap();
        assert!(text.lines().count() > 200, "{name}: {} lines", text.lines().count());
        found.insert(name, text);
    }
    assert_eq!(std::fs::read_dir(out.join(view)).unwrap().count(), found.len());
    found
}

#[test]
fn a_run_leaves_everything_in_its_folder_and_replays_to_the_same_bits() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    shortened(&within.join("short.toml"));
    let ran = run(within, ["run", "short.toml", "--out", "run", "--json"]).json();
    assert_eq!(ran["processes"], 3);
    let estimates: Vec<_> =
        ran["robots"].as_array().unwrap().iter().map(|robot| &robot["estimate"]).collect();
    assert_eq!(estimates.len(), 3);
    assert!(estimates.iter().all(|estimate| *estimate == estimates[0]), "{estimates:?}");

    let out = within.join("run");
    let mut expected: Vec<String> = ["report.html", "summary.json", "scenario.toml"].map(String::from).into();
    expected.extend(["recording.toml", "priors.toml"].map(|name| format!("recording/{name}")));
    for robot in 1..=3 {
        let agent = ["agent.toml", "agent.log", "journal.bin", "settled.csv", "online.csv", "agent.json"];
        expected.extend(agent.map(|name| format!("agents/r{robot}/{name}")));
        let channels = ["wheel_odometry.csv", "relative.csv", "truth.csv"];
        expected.extend(channels.map(|name| format!("recording/r{robot}/{name}")));
        expected.push(format!("recording/noise-r{robot}.toml"));
        expected.extend(["settled", "online"].map(|view| format!("{view}/robot-{robot}.tum")));
    }
    for name in expected {
        assert!(out.join(&name).is_file(), "{name} is missing");
    }

    // The same by its recording and by the folder of the run.
    for (input, to) in [("run/recording", "again"), ("run", "once-more")] {
        let replayed = run(within, ["replay", input, "--out", to, "--json"]).json();
        assert_eq!(replayed["processes"], 0);
        assert_eq!(replayed["facts"], ran["facts"]);
        assert_eq!(trajectories(&within.join(to), "settled"), trajectories(&out, "settled"));
        assert_eq!(replayed["robots"][0]["estimate"], *estimates[0]);
        assert_eq!(replayed["mean_position_rmse_m"], ran["mean_position_rmse_m"]);
    }
}

#[test]
fn a_replay_gives_the_same_bits_in_processes_and_without_for_every_strategy() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    shortened(&within.join("short.toml"));
    run(within, ["run", "short.toml", "--out", "run", "--json", "--seed", "5"]).json();
    let mut seen = Vec::new();
    for strategy in ["exact", "independent"] {
        // Both from the start as it was told and, later in the recording, from ground truth.
        for start in ["0", "10"] {
            let (alone, processes) =
                (format!("alone-{strategy}-{start}"), format!("many-{strategy}-{start}"));
            let common = ["replay", "run/recording", "--json", "--strategy", strategy, "--start", start];
            let one = run(within, common.iter().copied().chain(["--out", &alone])).json();
            let many = run(within, common.iter().copied().chain(["--out", &processes, "--processes"])).json();
            assert_eq!((&one["processes"], &many["processes"]), (&0.into(), &3.into()));
            assert_eq!(one["facts"], many["facts"], "{strategy} from {start}");
            let [one, many] = [&alone, &processes].map(|out| trajectories(&within.join(out), "settled"));
            assert_eq!(one, many, "{strategy} from {start}");
            seen.push(one);
        }
    }
    let distinct: std::collections::BTreeSet<_> = seen.iter().collect();
    assert_eq!(distinct.len(), 4, "strategies and starts make a difference");
}

#[test]
fn a_robot_that_was_told_nothing_of_its_start_is_told_nothing_in_the_replay() {
    let _turn = program::turn();
    let folder = tempfile::tempdir().unwrap();
    let within = folder.path();
    let scenario = "name = \"untold\"\nduration_s = 20.0\nteam_size = 2\n[defaults.relative]\nrate_hz = 1.0\n\
                    [[robots]]\nid = 2\nprior = { known = false }\n";
    std::fs::write(within.join("untold.toml"), scenario).unwrap();
    let ran = run(within, ["run", "untold.toml", "--out", "run", "--json"]).json();
    let priors = std::fs::read_to_string(within.join("run/recording/priors.toml")).unwrap();
    assert!(priors.contains("[1]") && !priors.contains("[2]"), "{priors}");
    let replayed = run(within, ["replay", "run", "--out", "again", "--json"]).json();
    assert_eq!(replayed["facts"], ran["facts"]);
    assert_eq!(ran["robots"][1]["position_rmse_m"], serde_json::Value::Null, "it has no place in the map");
    for name in ["settled/robot-1.tum", "settled/robot-2.tum"] {
        let [once, again] = ["run", "again"].map(|out| std::fs::read(within.join(out).join(name)).unwrap());
        assert_eq!(once, again, "{name}");
    }
}

//! What is wrong is said on stderr, by its name; the exit code says that something is, and stdout nothing.

use pleiad_tests::program::run;

use crate::{SCENARIO, recording, scenario};

/// Runs the program where the scenario and its recording are, and checks that it fails and says all this.
fn refused(arguments: &[&str], words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    scenario(folder.path());
    recording(folder.path());
    std::fs::create_dir(folder.path().join("full")).unwrap();
    std::fs::write(folder.path().join("full").join("notes.txt"), "mine").unwrap();
    let misspelt = SCENARIO.replace("rate_hz = 2.0", "rate_hz = 2.0\nmax_rnage_m = 3.0");
    std::fs::write(folder.path().join("misspelt.toml"), misspelt).unwrap();
    let agent = "team = \"pleiad\"\nrobot = 1\n\n[motion]\nlongest_gab_s = 1.0\n";
    std::fs::write(folder.path().join("agent.toml"), agent).unwrap();
    let nominal = std::fs::read_to_string(folder.path().join("recording/nominal.toml")).unwrap();
    let effect = "\n[[robots.r2.effects]]\nname = \"crab\"\nparameters = { rad = 0.1 }\n";
    for (name, from, to) in [
        ("unknown_effect.toml", "\"crab\"", "\"crap\""),
        ("unknown_parameter.toml", "rad =", "degrees ="),
        ("no_number.toml", "0.1", "nan"),
        ("one_robot.toml", "[robots.r1]", "[robots.r9]"),
        ("no_drive.toml", "[noise]", "drive = \"legs\"\n[noise]"),
    ] {
        let text = format!("{nominal}{effect}");
        assert!(text.contains(from), "{from}");
        // The last one: nominal values may be equal to it.
        let at = text.rfind(from).unwrap();
        let text = format!("{}{to}{}", &text[..at], &text[at + from.len()..]);
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let coordinator = "team = \"pleiad\"\nagents = []\nrestrat = \"never\"\n";
    std::fs::write(folder.path().join("coordinator.toml"), coordinator).unwrap();

    let stderr = run(folder.path(), arguments).failure();
    for word in words {
        assert!(stderr.contains(word), "{word} is missing in: {stderr}");
    }
    let notes = std::fs::read_to_string(folder.path().join("full").join("notes.txt")).unwrap();
    assert_eq!(notes, "mine");
}

/// The line of the scenario that has this text, from 1.
fn line(text: &str) -> usize {
    SCENARIO.lines().position(|line| line == text).unwrap() + 1
}

#[test]
fn an_unknown_key_of_a_scenario_is_named_with_file_and_line() {
    let place = format!("misspelt.toml:{}", line("rate_hz = 2.0") + 1);
    for command in ["run", "observability"] {
        refused(&[command, "misspelt.toml"], &["max_rnage_m", &place]);
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    refused(&["run", "nowhere.toml", "--out", "out"], &["nowhere.toml"]);
    refused(&["replay", "nowhere", "--out", "out"], &["nowhere", "no such folder"]);
    refused(&["simulate", "--from", "nowhere"], &["nowhere", "no such folder"]);
    refused(&["replay", "small.toml", "--out", "out"], &["small.toml", "file"]);
    refused(&["observability", "nowhere.toml"], &["nowhere.toml"]);
    refused(&["agent", "--config", "nowhere.toml"], &["nowhere.toml"]);
    refused(&["coordinator", "--config", "nowhere.toml"], &["nowhere.toml"]);
    refused(
        &["replay", "recording", "--noise", "nowhere.toml", "--out", "out"],
        &["nowhere.toml", "cannot read"],
    );
}

#[test]
fn faults_that_processes_cannot_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("small.toml");
    std::fs::write(&scenario, SCENARIO).unwrap();
    let scenario = scenario.display().to_string();
    for (faults, words) in [
        ("[[fault]]\nwhat = 'cut'\n[[fault]]\nwhat = 'clock'\noffset_s = 0.1\n", "fault[1] is of a clock"),
        ("[[falut]]\nwhat = 'cut'\n", "no [[fault]] table"),
        (
            "[[fault]]\nwhat = 'kill'\nrobots = [9]\n",
            "fault[0].robots names 9; expected robots of this team: 1, 2",
        ),
        (
            "[[fault]]\nwhat = 'kill'\nrobots = [2]\n[[fault]]\nwhat = 'stop'\nrobots = [2]\n",
            "fault[1] and fault[0] befall the process of robot 2 at the same time",
        ),
        (
            "[[fault]]\nwhat = 'coordinator_dies'\n[[fault]]\nwhat = 'kill'\nrobots = [1]\n",
            "fault[0] is the death of the coordinator and fault[1] befalls an agent's process",
        ),
    ] {
        std::fs::write(folder.path().join("faults.toml"), faults).unwrap();
        let stderr = run(folder.path(), ["run", &scenario, "--faults", "faults.toml"]).failure();
        assert!(stderr.contains(words) && stderr.contains("faults.toml"), "{stderr}");
    }
}

#[test]
fn faults_of_processes_are_refused_where_there_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("small.toml");
    std::fs::write(&scenario, format!("{SCENARIO}\n[[fault]]\nwhat = 'stop'\nrobots = [1]\n")).unwrap();
    let stderr = run(folder.path(), ["faults", "small.toml"]).failure();
    for words in ["small.toml: fault[0] is `stop`", "use pleiad run"] {
        assert!(stderr.contains(words), "{stderr}");
    }
    // Random times have to be drawn by whoever knows the whole team.
    let agent = "team = 'a'\nrobot = 1\n[faults]\nplan = 'random.toml'\n";
    std::fs::write(folder.path().join("agent.toml"), agent).unwrap();
    let random = "[[fault]]\nwhat = 'cut'\nevery_s = 10\nfor_s = 1\n";
    std::fs::write(folder.path().join("random.toml"), random).unwrap();
    let stderr = run(folder.path(), ["agent", "--config", "agent.toml"]).failure();
    for words in ["agent.toml: faults.plan", "random.toml", "without every_s"] {
        assert!(stderr.contains(words), "{stderr}");
    }
}

#[test]
fn what_cannot_be_evicted_is_said() {
    refused(&["evict", "No", "1", "--connect", "tcp/127.0.0.1:9"], &["No"]);
    refused(&["evict", "blue", "1", "--connect", "tcp/127.0.0.1:9", "--within", "0"], &["--within 0"]);
    refused(
        &["evict", "blue", "1", "--connect", "tcp/127.0.0.1:9"],
        &["no agent of team blue was found", "--connect"],
    );
}

#[test]
fn what_is_wrong_with_position_fixes_is_said() {
    let form = "ROBOT@HZ:SIGMA_M";
    for wrong in ["1", "1@1.0", "x@1.0:0.3", "1@0:0.3", "1@1.0:-0.3", "1@nan:0.3", "1@1.0:0.3:4"] {
        refused(&["replay", "recording", "--absolute", wrong], &["--absolute", wrong, form]);
    }
    refused(&["replay", "recording", "--absolute", "9@1.0:0.3"], &["--absolute", "no robot 9"]);
}

#[test]
fn what_is_wrong_with_a_choice_of_landmarks_is_said() {
    for wrong in ["some", "6,x", "6;7", "-6"] {
        let choice = format!("--landmarks={wrong}");
        refused(&["replay", "recording", &choice], &["--landmarks", wrong, "known, none, team, or numbers"]);
    }
    refused(&["replay", "recording", "--landmarks", "6,99"], &["--landmarks", "99", "6, 7"]);
}

#[test]
fn a_folder_that_holds_something_is_not_written_into() {
    for command in [["run", "small.toml"], ["replay", "recording"]] {
        refused(&[command[0], command[1], "--out", "full"], &["full", "not empty", "--out"]);
    }
    refused(&["demo", "--seconds", "120", "--out", "full"], &["full", "not empty", "--out"]);
}

#[test]
fn an_unknown_key_of_a_configuration_is_named_with_file_and_line() {
    refused(
        &["agent", "--config", "agent.toml"],
        &["agent.toml", "line 5", "longest_gab_s", "docs/agent.md"],
    );
    refused(
        &["coordinator", "--config", "coordinator.toml"],
        &["coordinator.toml", "line 3", "restrat", "docs/coordinator.md"],
    );
}

#[test]
fn numbers_out_of_range_are_named() {
    refused(&["replay", "recording", "--start", "1000"], &["--start 1000"]);
    refused(&["replay", "recording", "--start=-1"], &["--start -1"]);
    refused(&["replay", "recording", "--seconds", "0"], &["--seconds 0"]);
    refused(&["run", "small.toml", "--speed", "0"], &["--speed 0"]);
    refused(&["demo", "--robots", "1"], &["--robots", "1"]);
    refused(&["replay", "recording", "--strategy", "best"], &["--strategy", "best", "exact"]);
    refused(&["sim-peers", "small.toml", "--team", "A Team", "--connect", "tcp/127.0.0.1:1"], &["A Team"]);
}

#[test]
fn a_feed_that_nobody_takes_is_a_failure() {
    // Nothing listens at port 1 of loopback.
    let endpoint = "tcp/127.0.0.1:1";
    let arguments = ["sim-peers", "small.toml", "--team", "nobody", "--connect", endpoint];
    refused(&arguments, &["nobody", "not", "a single sample"]);
}

#[test]
fn an_option_that_could_do_nothing_is_refused() {
    refused(&["observability", "recording", "--seed", "2"], &["--seed", "scenarios"]);
    refused(&["observability", "small.toml", "--landmarks", "none"], &["--landmarks", "recordings"]);
}

#[test]
fn a_model_that_cannot_be_used_is_named_with_its_key_and_the_remedy() {
    for (model, words) in [
        ("nowhere.toml", &["nowhere.toml is missing", "corrected.toml"][..]),
        ("unknown_effect.toml", &["robots.r2.effects[0].name", "\"crap\"", "perhaps \"crab\""]),
        ("unknown_parameter.toml", &["robots.r2.effects[0].parameters.degrees", "which has: rad"]),
        ("no_number.toml", &["robots.r2.effects[0].parameters.rad", "`nan`", "a number (rad)"]),
        ("no_drive.toml", &["key `drive`", "`\"legs\"`", "skid_steer"]),
        ("small.toml", &["small.toml", "noise"]),
    ] {
        refused(&["replay", "recording", "--model", model, "--out", "out"], words);
        refused(&["simulate", "--from", "recording", "--model", model], words);
    }
    let lacking = ["one_robot.toml", "r1"];
    refused(&["replay", "recording", "--model", "one_robot.toml", "--out", "out"], &lacking);
    refused(&["simulate", "--from", "recording", "--model", "one_robot.toml"], &["r1"]);
}

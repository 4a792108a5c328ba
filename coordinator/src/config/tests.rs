use super::*;

const SMALLEST: &str = "\
team = \"blue\"
[bus]
connect = [\"tcp/127.0.0.1:7447\"]
[[agents]]
robot = 1
config = \"agents/1.toml\"
";

const FULL: &str = "\
team = \"blue\"
executable = \"/usr/bin/pleiad\"
restart = \"on_failure\"
detached = true
status_period_s = 2.0
shutdown_timeout_s = 5.0
record = \"out\"
[backoff]
first_s = 1.0
longest_s = 8.0
max_restarts = 3
stable_s = 20.0
[bus]
listen = [\"tcp/127.0.0.1:7448\"]
connect = [\"tcp/127.0.0.1:7447\"]
mode = \"client\"
multicast = true
[[agents]]
robot = 1
config = \"agents/1.toml\"
[[agents]]
robot = 2
config = \"agents/2.toml\"
log = \"logs/two.txt\"
";

fn read(text: &str) -> Result<CoordinatorConfig, ConfigError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("coordinator.toml");
    std::fs::write(&path, text).unwrap();
    CoordinatorConfig::read(&path)
}

/// Asserts that a text is refused with all these words.
fn check_refused(text: &str, words: &[&str]) {
    let refused = read(text).unwrap_err().to_string();
    for word in words.iter().chain(&["coordinator.toml"]) {
        assert!(refused.contains(word), "{word} is missing in: {refused}");
    }
}

#[test]
fn defaults_are_the_documented_ones() {
    let config = read(SMALLEST).unwrap();
    assert_eq!((config.restart, config.detached, config.record), (Restart::Never, false, None));
    assert_eq!((config.status_period_s, config.shutdown_timeout_s), (0.5, 30.0));
    assert_eq!(config.backoff, Backoff { first_s: 0.5, longest_s: 30.0, max_restarts: 5, stable_s: 60.0 });
    assert_eq!(config.agents[0].log(), Path::new("agents/1.log"));
    assert_eq!(config.bus.zenoh().mode, ZenohMode::Peer);
}

#[test]
fn every_key_is_read() {
    let config = read(FULL).unwrap();
    assert_eq!(config.executable.as_deref(), Some(Path::new("/usr/bin/pleiad")));
    assert_eq!((config.restart, config.detached), (Restart::OnFailure, true));
    assert_eq!((config.status_period_s, config.shutdown_timeout_s), (2.0, 5.0));
    assert_eq!(config.record.as_deref(), Some(Path::new("out")));
    assert_eq!(config.backoff, Backoff { first_s: 1.0, longest_s: 8.0, max_restarts: 3, stable_s: 20.0 });
    let bus = config.bus.zenoh();
    assert_eq!((bus.mode, bus.multicast), (ZenohMode::Client, true));
    assert_eq!((bus.listen.len(), bus.connect.len()), (1, 1));
    assert_eq!(config.robots(), BTreeSet::from([RobotId(1), RobotId(2)]));
    assert_eq!(config.agents[1].log(), Path::new("logs/two.txt"));
}

#[test]
fn a_configuration_written_out_reads_back() {
    let config = read(FULL).unwrap();
    assert_eq!(read(&toml::to_string(&config).unwrap()).unwrap(), config);
}

#[test]
fn every_key_is_in_the_documentation() {
    let page = include_str!("../../../docs/coordinator.md");
    for line in FULL.lines() {
        let key = line.split(" =").next().unwrap();
        let name = if key.starts_with('[') { key.to_owned() } else { format!("`{key}`") };
        assert!(page.contains(&name), "docs/coordinator.md does not mention {name}");
    }
}

#[test]
fn unknown_keys_and_wrong_types_are_named_with_their_line() {
    check_refused(&SMALLEST.replace("[bus]", "retries = 3\n[bus]"), &["line 2", "retries"]);
    check_refused(&SMALLEST.replace("robot = 1", "robot = \"one\""), &["line 5", "robot"]);
    check_refused(&SMALLEST.replace("[bus]", "restart = \"always\"\n[bus]"), &["line 2", "on_failure"]);
    check_refused(&FULL.replace("stable_s", "stable"), &["line 12", "stable"]);
}

#[test]
fn values_out_of_range_are_named_with_what_would_be_right() {
    check_refused(&SMALLEST.replace("blue", "Blue"), &["team", "\"Blue\"", "a-z"]);
    check_refused(&SMALLEST.replace("\"tcp/127.0.0.1:7447\"", ""), &["bus.connect", "agent or router"]);
    check_refused(&FULL.replace("robot = 2", "robot = 1"), &["agents[1].robot = 1", "no other"]);
    check_refused(&FULL.replace("logs/two.txt", "agents/1.log"), &["agents[1].log", "no other"]);
    check_refused("team = \"blue\"\nagents = []\n[bus]\nmulticast = true", &["agents", "at least one"]);
    for key in ["status_period_s = 2.0", "shutdown_timeout_s = 5.0", "first_s = 1.0", "longest_s = 8.0"] {
        let name = key.split(" =").next().unwrap();
        for bad in ["0.0", "-1.0", "inf", "nan"] {
            let planted = FULL.replace(key, &format!("{name} = {bad}"));
            check_refused(&planted, &[name, "a positive number"]);
        }
    }
}

#[test]
fn a_missing_file_is_named() {
    let refused = CoordinatorConfig::read(Path::new("nowhere.toml")).unwrap_err().to_string();
    assert!(refused.contains("nowhere.toml"), "{refused}");
}

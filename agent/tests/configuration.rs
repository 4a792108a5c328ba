//! The configuration and its documentation: what `docs/agent.md` says holds for the code, and what is wrong
//! in a file is named.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests are tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use pleiad_agent::config::{BusMode, ErrorName, VelocityName, YawName};
use pleiad_agent::{AgentConfig, ConfigError};
use pleiad_estimation::motion::DifferentialDrive;
use pleiad_estimation::strategy::StrategyKind;
use toml::{Table, Value};

const DOCUMENT: &str = include_str!("../../docs/agent.md");

/// The least that is a configuration.
const LEAST: &str = "team = 'blue'\nrobot = 1\n";

fn documented_example() -> &'static str {
    let (_, after) = DOCUMENT.split_once("```toml\n").expect("an example");
    after.split_once("```").expect("its end").0
}

fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("agent.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn read(text: &str) -> Result<AgentConfig, ConfigError> {
    let (_folder, path) = written(text);
    AgentConfig::read(&path)
}

/// A configuration with every key there is.
fn full() -> Table {
    let text = "
        model = 'corrected.toml'
        [filter.relinearize]
        [filter.inflation]
        [filter.quarantine]
        [filter.clutter]
        share = 0.1
        reach_m = 10.0
        misnamed = 0.1
        [calibration]
        [prior]
        x_m = 0.0
        y_m = 0.0
        heading_rad = 0.0
        sigma_position_m = 1.0
        sigma_heading_rad = 1.0
        [motion]
        wheel_radius_m = 1.0
        track_width_m = 1.0
        [sensors]
        relative_pose = { sigma_position_m = 1.0, sigma_yaw_rad = 1.0 }
        relative_position = { sigma_m = 1.0 }
        range = { sigma_m = 1.0 }
        bearing = { sigma_rad = 1.0 }
        range_bearing = { sigma_range_m = 1.0, sigma_bearing_rad = 1.0 }
        gps = { sigma_m = 1.0 }
        heading = { sigma_rad = 1.0 }
        [[landmarks]]
        id = 1
        x_m = 1.0
        y_m = 1.0
        [ledger]
        evict_after_s = 1.0
        most_items = 5000
        [faults]
        plan = 'faults.toml'
        origin_s = 0.0
        [output]
        directory = 'somewhere'
    ";
    let config: AgentConfig = toml::from_str(&format!("{LEAST}{text}")).unwrap();
    Table::try_from(&config).unwrap()
}

/// The values by their keys with tables, `motion.track_width_m`; of a list of tables the first counts.
fn flat(table: &Table, prefix: &str, into: &mut BTreeMap<String, Value>) {
    for (key, value) in table {
        let key = format!("{prefix}{key}");
        match value {
            Value::Table(inner) => flat(inner, &format!("{key}."), into),
            Value::Array(list) if list.first().is_some_and(Value::is_table) => {
                if let Some(Value::Table(inner)) = list.first() {
                    flat(inner, &format!("{key}."), into);
                }
            }
            _ => {
                into.insert(key, value.clone());
            }
        }
    }
}

fn flattened(table: &Table) -> BTreeMap<String, Value> {
    let mut keys = BTreeMap::new();
    flat(table, "", &mut keys);
    keys
}

/// Key and default of every row of the tables of keys.
fn documented_keys() -> BTreeMap<String, String> {
    let (_, keys) = DOCUMENT.split_once("## Keys").unwrap();
    let (keys, _) = keys.split_once("## Sensor input").unwrap();
    let rows = keys.lines().filter(|line| line.starts_with("| `"));
    rows.map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        (cells[1].trim_matches('`').to_owned(), cells[3].trim_matches('`').to_owned())
    })
    .collect()
}

#[test]
fn the_documented_example_is_a_configuration() {
    let config = read(documented_example()).unwrap();
    assert_eq!((config.team.as_str(), config.robot, config.landmarks.len()), ("blue", 1, 2));
    let node = config.node().unwrap();
    let drive = DifferentialDrive { wheel_radius_m: 0.033, track_width_m: 0.287 };
    assert_eq!(node.motion.drive, Some(drive));
    assert_eq!(node.clock.offset_ns, 35_000_000);
}

/// The keys a table may have, as the refusal of another one lists them.
fn allowed_beside(change: impl Fn(&mut Table)) -> BTreeSet<String> {
    let mut table = full();
    change(&mut table);
    let error = read(&table.to_string()).unwrap_err().to_string();
    let (_, names) = error.split_once("unknown field `zzz`, expected ").unwrap_or_else(|| panic!("{error}"));
    names.lines().next().unwrap_or_default().split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_full_configuration_of_these_tests_is_full() {
    let whole = full();
    let names = |table: &Table| table.keys().cloned().collect::<BTreeSet<_>>();
    let add = |table: &mut Table| table.insert("zzz".to_owned(), Value::Integer(0));
    assert_eq!(allowed_beside(|table| drop(add(table))), names(&whole));
    for (key, value) in &whole {
        match value {
            Value::Table(inner) => {
                let allowed = allowed_beside(|table| drop(add(table[key].as_table_mut().unwrap())));
                assert_eq!(allowed, names(inner), "{key}");
                for (kind, value) in inner.iter().filter(|(_, value)| value.is_table()) {
                    let allowed = allowed_beside(|table| drop(add(table[key][kind].as_table_mut().unwrap())));
                    assert_eq!(allowed, names(value.as_table().unwrap()), "{key}.{kind}");
                }
            }
            Value::Array(list) if list[0].is_table() => {
                let allowed = allowed_beside(|table| drop(add(table[key][0].as_table_mut().unwrap())));
                assert_eq!(allowed, names(list[0].as_table().unwrap()), "{key}");
            }
            _ => {}
        }
    }
}

#[test]
fn every_key_is_documented_and_every_documented_key_exists() {
    let existing: Vec<String> = flattened(&full()).into_keys().collect();
    let documented: Vec<String> = documented_keys().into_keys().collect();
    assert_eq!(documented, existing);
}

#[test]
fn documented_defaults_are_the_defaults() {
    let least: AgentConfig = toml::from_str(LEAST).unwrap();
    let mut defaults = flattened(&Table::try_from(&least).unwrap());
    // Tables that may be left out have defaults within.
    for key in ["prior.for_boot", "faults.seed"] {
        defaults.insert(key.to_owned(), Value::Integer(0));
    }
    for key in
        ["sensors.range.sigma_per_m", "sensors.range_bearing.sigma_range_per_m", "filter.clutter.misnamed"]
    {
        defaults.insert(key.to_owned(), Value::Float(0.0));
    }
    for key in ["filter.relinearize.block_s", "filter.relinearize.ahead_s"] {
        defaults.insert(key.to_owned(), Value::Float(5.0));
    }
    for (key, default) in [
        ("filter.inflation.readings", 20.0),
        ("filter.inflation.most", 10.0),
        ("filter.quarantine.level", 15.0),
        ("filter.quarantine.window_s", 30.0),
    ] {
        defaults.insert(key.to_owned(), Value::Float(default));
    }
    defaults.insert("filter.relinearize.passes".to_owned(), Value::Integer(4));
    for key in flattened(&full()).keys().filter(|key| key.starts_with("calibration.")) {
        defaults.insert(key.clone(), Value::Float(0.0));
    }
    let mut full = flattened(&full());
    for (key, documented) in documented_keys() {
        full.remove(&key);
        match documented.as_str() {
            "required" => assert!(key == "team" || key == "robot" || !defaults.contains_key(&key), "{key}"),
            "none" => assert!(!defaults.contains_key(&key), "{key}"),
            text => {
                let value: Table = toml::from_str(&format!("value = {text}")).unwrap();
                assert_eq!(defaults.get(&key), Some(&value["value"]), "{key}");
            }
        }
    }
    assert!(full.is_empty(), "without a row: {full:?}");
}

#[test]
fn documented_names_are_the_names() {
    fn check<T: serde::Serialize>(key: &str, values: &[T]) {
        let row = DOCUMENT.lines().find(|line| line.starts_with(&format!("| `{key}`"))).expect("a row");
        for value in values {
            let name = Value::try_from(value).unwrap().to_string();
            assert!(row.contains(&format!("`{name}`")), "{key}: {name}");
        }
    }
    let strategies = StrategyKind::ALL.iter().filter(|kind| **kind != StrategyKind::Factored);
    check("strategy", &strategies.map(|kind| kind.name()).collect::<Vec<_>>());
    check("filter.error", &[ErrorName::Invariant, ErrorName::Additive]);
    check("motion.yaw_source", &[YawName::Odometry, YawName::Gyro]);
    check("motion.velocity", &[VelocityName::Measured, VelocityName::Commanded]);
    check("bus.mode", &[BusMode::Peer, BusMode::Client]);
}

#[test]
fn what_is_required_is_missed_by_name() {
    let whole = full();
    let required = documented_keys().into_iter().filter(|(_, default)| default == "required");
    for (key, _) in required {
        let mut table = whole.clone();
        let (outer, name) = key.rsplit_once('.').unwrap_or(("", &key));
        let mut inner = &mut table;
        for step in outer.split('.').filter(|step| !step.is_empty()) {
            inner = match inner.get_mut(step).unwrap() {
                Value::Table(table) => table,
                Value::Array(list) => list[0].as_table_mut().unwrap(),
                other => panic!("{key}: {other}"),
            };
        }
        inner.remove(name);
        let error = read(&table.to_string()).unwrap_err().to_string();
        assert!(error.contains(&format!("missing field `{name}`")), "{key}: {error}");
    }
}

#[test]
fn an_unknown_key_is_refused_by_name_with_file_and_line() {
    let table = [
        ("wheel_base_m = 1.0\n", "wheel_base_m", 3),
        ("[motion]\nlongest_gap_s = 1.0\nwheel_base_m = 1.0\n", "wheel_base_m", 5),
        ("[filter]\ngates = []\n", "gates", 4),
        ("[sensors]\nlidar = { sigma_m = 1.0 }\n", "lidar", 4),
        ("[sensors]\ngps = { sigma = 1.0 }\n", "sigma", 4),
        ("[[landmarks]]\nid = 1\nx_m = 0\ny_m = 0\nz_m = 0\n", "z_m", 7),
        ("[bus]\nport = 1\n", "port", 4),
        ("[output]\nfolder = 'x'\n", "folder", 4),
        ("[clock]\nskew = 0.0\n", "skew", 4),
        ("[motions]\n", "motions", 3),
    ];
    for (text, key, line) in table {
        let (_folder, path) = written(&format!("{LEAST}{text}"));
        let error = AgentConfig::read(&path).unwrap_err();
        assert!(matches!(error, ConfigError::Parse { .. }), "{error}");
        let error = error.to_string();
        for part in [
            path.to_str().unwrap(),
            &format!("unknown field `{key}`"),
            &format!("line {line}"),
            "docs/agent.md",
        ] {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }
}

#[test]
fn a_value_out_of_its_range_is_refused_with_file_key_and_what_would_be_right() {
    let prior = |change: &str| {
        let good =
            "x_m = 0.0\ny_m = 0.0\nheading_rad = 0.0\nsigma_position_m = 0.1\nsigma_heading_rad = 0.1\n";
        let (name, _) = change.split_once(" = ").unwrap();
        let kept: Vec<&str> = good.lines().filter(|line| !line.starts_with(&format!("{name} "))).collect();
        format!("[prior]\n{}\n{change}\n", kept.join("\n"))
    };
    let motion = |change: &str| format!("[motion]\n{change}\n");
    let sensor = |change: &str| format!("[sensors]\n{change}\n");
    let positive = "a positive number";
    let not_negative = "zero or a positive number";
    let finite = "a finite number";
    let table = [
        ("[filter]\ngate = [1.0, 0.0, 1.0]\n".to_owned(), "filter.gate[1] = 0", "a positive number or inf"),
        ("[filter]\ngate = [1.0, 1.0, nan]\n".to_owned(), "filter.gate[2] = NaN", "a positive number or inf"),
        (prior("x_m = inf"), "prior.x_m = inf", finite),
        (prior("y_m = nan"), "prior.y_m = NaN", finite),
        (prior("heading_rad = -inf"), "prior.heading_rad = -inf", finite),
        (prior("sigma_position_m = 0.0"), "prior.sigma_position_m = 0", positive),
        (prior("sigma_heading_rad = -0.5"), "prior.sigma_heading_rad = -0.5", positive),
        (
            motion("wheel_radius_m = 0.1"),
            "motion = one of wheel_radius_m and track_width_m",
            "both or neither",
        ),
        (motion("wheel_radius_m = 0.0\ntrack_width_m = 1.0"), "motion.wheel_radius_m = 0", positive),
        (motion("wheel_radius_m = 0.1\ntrack_width_m = -1.0"), "motion.track_width_m = -1", positive),
        (motion("gyro_bias_rad_s = nan"), "motion.gyro_bias_rad_s = NaN", finite),
        (motion("forward_m_per_sqrt_s = -0.1"), "motion.forward_m_per_sqrt_s = -0.1", not_negative),
        (motion("lateral_m_per_sqrt_s = inf"), "motion.lateral_m_per_sqrt_s = inf", not_negative),
        (motion("yaw_rad_per_sqrt_s = nan"), "motion.yaw_rad_per_sqrt_s = NaN", not_negative),
        (motion("forward_m_per_sqrt_m = -1.0"), "motion.forward_m_per_sqrt_m = -1", not_negative),
        (motion("yaw_rad_per_sqrt_m = -1.0"), "motion.yaw_rad_per_sqrt_m = -1", not_negative),
        (motion("yaw_rad_per_sqrt_rad = -1.0"), "motion.yaw_rad_per_sqrt_rad = -1", not_negative),
        (motion("longest_gap_s = 0.0"), "motion.longest_gap_s = 0", positive),
        (motion("speed_limit_m_s = inf"), "motion.speed_limit_m_s = inf", positive),
        (motion("yaw_rate_limit_rad_s = -1.0"), "motion.yaw_rate_limit_rad_s = -1", positive),
        (
            sensor("relative_pose = { sigma_position_m = -0.1, sigma_yaw_rad = 0.1 }"),
            "sensors.relative_pose.sigma_position_m = -0.1",
            positive,
        ),
        (
            sensor("relative_pose = { sigma_position_m = 0.1, sigma_yaw_rad = 0.0 }"),
            "sensors.relative_pose.sigma_yaw_rad = 0",
            positive,
        ),
        (
            sensor("relative_position = { sigma_m = nan }"),
            "sensors.relative_position.sigma_m = NaN",
            positive,
        ),
        (sensor("range_bias_m = inf"), "sensors.range_bias_m = inf", finite),
        (sensor("range = { sigma_m = inf }"), "sensors.range.sigma_m = inf", positive),
        (
            sensor("range = { sigma_m = 0.1, sigma_per_m = -0.1 }"),
            "sensors.range.sigma_per_m = -0.1",
            not_negative,
        ),
        (
            sensor(
                "range_bearing = { sigma_range_m = 0.1, sigma_range_per_m = nan, sigma_bearing_rad = 1.0 }",
            ),
            "sensors.range_bearing.sigma_range_per_m = NaN",
            not_negative,
        ),
        (sensor("bearing = { sigma_rad = 0.0 }"), "sensors.bearing.sigma_rad = 0", positive),
        (
            sensor("range_bearing = { sigma_range_m = 0.1, sigma_bearing_rad = -1.0 }"),
            "sensors.range_bearing.sigma_bearing_rad = -1",
            positive,
        ),
        (
            sensor("range_bearing = { sigma_range_m = 0.0, sigma_bearing_rad = 1.0 }"),
            "sensors.range_bearing.sigma_range_m = 0",
            positive,
        ),
        (sensor("gps = { sigma_m = -2.0 }"), "sensors.gps.sigma_m = -2", positive),
        (sensor("heading = { sigma_rad = -2.0 }"), "sensors.heading.sigma_rad = -2", positive),
        ("[clock]\nreference_s = nan\n".to_owned(), "clock.reference_s = NaN", finite),
        ("[clock]\noffset_s = inf\n".to_owned(), "clock.offset_s = inf", finite),
        ("[[landmarks]]\nid = 1\nx_m = nan\ny_m = 0.0\n".to_owned(), "landmarks[0].x_m = NaN", finite),
        (
            "[[landmarks]]\nid = 1\nx_m = 0.0\ny_m = 0.0\n[[landmarks]]\nid = 1\nx_m = 1.0\ny_m = 0.0\n"
                .to_owned(),
            "landmarks[1].id = 1",
            "another number: this one is taken",
        ),
        ("[bus]\nstatus_period_s = 0.0\n".to_owned(), "bus.status_period_s = 0", positive),
        ("[output]\nestimate_rate_hz = 0.0\n".to_owned(), "output.estimate_rate_hz = 0", positive),
        ("[output]\nfsync_period_s = -0.1\n".to_owned(), "output.fsync_period_s = -0.1", not_negative),
    ];
    for (text, found, expected) in table {
        let (_folder, path) = written(&format!("{LEAST}{text}"));
        let error = AgentConfig::read(&path).unwrap_err().to_string();
        assert_eq!(error, format!("{}: {found}: expected {expected}", path.display()));
    }
    let team = read("team = 'Blue'\nrobot = 1\n").unwrap_err().to_string();
    assert!(team.contains("team = \"Blue\": expected 1 to 32 of a-z"), "{team}");
}

#[test]
fn an_infinite_gate_and_no_fsync_delay_are_allowed() {
    let config =
        read(&format!("{LEAST}[filter]\ngate = [inf, inf, inf]\n[output]\nfsync_period_s = 0\n")).unwrap();
    assert!(config.node().unwrap().fold.gate.into_iter().all(f64::is_infinite));
}

#[test]
fn a_wrong_type_is_refused_with_its_line() {
    for (text, line) in [("robot = -1\nteam = 'a'\n", 1), ("team = 'a'\nrobot = 1\nstrategy = 'best'\n", 3)] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(&format!("line {line}")), "{error}");
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = AgentConfig::read(&PathBuf::from("no/such/agent.toml")).unwrap_err().to_string();
    assert!(error.contains("cannot read no/such/agent.toml"), "{error}");
}

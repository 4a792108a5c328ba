//! The command line as people and scripts meet it: what is on stdout, what on stderr, what the exit code
//! says, and what is left in folders.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]
#![allow(clippy::float_cmp, reason = "counts, which JSON knows as numbers")]

#[path = "command_line/calibrate.rs"]
mod calibrate;
#[path = "command_line/demo.rs"]
mod demo;
#[path = "command_line/errors.rs"]
mod errors;
#[path = "command_line/evaluate.rs"]
mod evaluate;
#[path = "command_line/examples.rs"]
mod examples;
#[path = "command_line/found.rs"]
mod found;
#[path = "command_line/help.rs"]
mod help;
#[path = "command_line/interchange.rs"]
mod interchange;
#[path = "command_line/json.rs"]
mod json;
#[path = "command_line/models.rs"]
mod models;
#[path = "command_line/named.rs"]
mod named;
#[path = "command_line/simulate.rs"]
mod simulate;
#[path = "command_line/standing.rs"]
mod standing;
#[path = "command_line/tune.rs"]
mod tune;
#[path = "command_line/why.rs"]
mod why;

use std::path::Path;

use pleiad_recording::{Overwrite, write_folder};
use pleiad_sim_peers::{Scenario, simulate};
use serde_json::Value;

/// Two robots, one with GPS, that see each other and landmarks.
const SCENARIO: &str = r#"
name = "small"
seed = 3
duration_s = 40.0
team_size = 2
landmarks = [
    { id = 6, x_m = 2.0, y_m = 1.0 },
    { id = 7, x_m = -2.0, y_m = -1.0 },
]

[arena]
width_m = 10.0
height_m = 10.0

[defaults.relative]
rate_hz = 2.0
see = "both"

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.5 }
"#;

/// Writes the scenario as `small.toml`.
fn scenario(within: &Path) {
    std::fs::write(within.join("small.toml"), SCENARIO).unwrap();
}

/// Writes a recording of the scenario as the folder `recording`, of which nothing is known but its files.
fn recording(within: &Path) {
    let scenario = Scenario::from_toml(SCENARIO, "small.toml").unwrap();
    let run = simulate(&scenario, scenario.seed).unwrap();
    write_folder(&run.recording, &within.join("recording"), Overwrite::Refuse).unwrap();
}

/// The number under this key.
fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} is no number in {value}"))
}

/// The list under this key.
fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("{key} is no list in {value}"))
}

/// The list of numbers under this key.
fn numbers(value: &Value, key: &str) -> Vec<f64> {
    let number = |item: &Value| item.as_f64().unwrap_or_else(|| panic!("{key} holds no numbers in {value}"));
    list(value, key).iter().map(number).collect()
}

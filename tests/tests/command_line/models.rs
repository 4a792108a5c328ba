//! A model of the robots, given to the commands that take one.

use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::{Reading, Relative};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::{DeclaredEffect, Nominal, Overwrite, write_folder, write_model};
use pleiad_sim_peers::{Scenario, simulate};
use pleiad_tests::program::{run, turn};
use serde_json::Value;

use crate::{SCENARIO, list, number};

/// The declared radius and track are wrong by these shares, and robot 1's range sensor is turned by this.
const RADIUS_RELATIVE: f64 = 0.04;
const TRACK_RELATIVE: f64 = -0.06;
const YAW_RAD: f64 = 0.15;

/// Wheels that slip little, so that what is planted stands out.
const WHEELS: &str = r#"
[defaults.odometry]
kind = "wheels"
noise = { speed_m_per_sqrt_s = 0.003, yaw_rad_per_sqrt_s = 0.003 }
"#;

/// Writes the folder `planted`, a recording whose nominal model is wrong, and `corrected.toml`, which says
/// how.
fn planted(within: &Path) {
    let text = format!("{SCENARIO}\n{WHEELS}");
    let scenario = Scenario::from_toml(&text, "small.toml").unwrap();
    let mut recording = simulate(&scenario, scenario.seed).unwrap().recording;
    let nominal = recording.nominal.as_mut().unwrap();
    for robot in nominal.robots.values_mut() {
        robot.wheel_radius /= 1.0 + RADIUS_RELATIVE;
        robot.track_width /= 1.0 + TRACK_RELATIVE;
    }
    let mut corrected: Nominal = nominal.clone();
    let effect = |effect, value| DeclaredEffect::new(ActiveEffect::new(effect, &[value]).unwrap());
    for robot in corrected.robots.values_mut() {
        robot.effects.push(effect(Effect::WheelRadiusError, RADIUS_RELATIVE));
        robot.effects.push(effect(Effect::TrackWidthError, TRACK_RELATIVE));
    }
    let first = corrected.robots.get_mut(&RobotId(1)).unwrap();
    first.effects.push(effect(Effect::SensorYawMisalignment, YAW_RAD));
    for sample in &mut recording.robots.get_mut(&RobotId(1)).unwrap().sightings {
        let Reading::Sighting { relative: Relative::RangeBearing { bearing_rad, .. }, .. } =
            &mut sample.reading
        else {
            panic!("{sample:?}")
        };
        *bearing_rad -= YAW_RAD;
    }
    write_folder(&recording, &within.join("planted"), Overwrite::Refuse).unwrap();
    write_model(&within.join("corrected.toml"), &corrected, "What was planted.").unwrap();
}

fn replay(within: &Path, arguments: &[&str]) -> Value {
    run(within, [&["replay", "planted", "--json"], arguments].concat()).json()
}

fn estimates(run: &Value) -> Vec<String> {
    list(run, "robots").iter().map(|robot| robot["estimate"].to_string()).collect()
}

#[test]
fn a_replay_with_the_true_model_is_better_than_without_in_one_process_and_in_several() {
    let folder = tempfile::tempdir().unwrap();
    planted(folder.path());
    let without = replay(folder.path(), &["--out", "without"]);
    let with = replay(folder.path(), &["--model", "corrected.toml", "--out", "with"]);
    for key in ["mean_position_rmse_m", "dead_reckoning_mean_rmse_m"] {
        let (without_m, with_m) = (number(&without, key), number(&with, key));
        assert!(with_m < 0.5 * without_m, "{key}: {with_m} m, without {without_m} m");
    }
    let nis = |run: &Value| number(&run["nis"], "mean");
    assert!(nis(&with) < 1.3 && nis(&without) > 2.0, "{} {}", nis(&with), nis(&without));
    let _turn = turn();
    let apart = replay(folder.path(), &["--model", "corrected.toml", "--processes", "--out", "apart"]);
    assert_eq!(estimates(&apart), estimates(&with));
    assert_ne!(estimates(&apart), estimates(&without));
    // The model is found beside the recording of the run, which holds what was measured.
    let again = run(folder.path(), ["replay", "apart", "--json", "--out", "again"]).json();
    assert_eq!(estimates(&again), estimates(&with));
    let read = |path: &str| std::fs::read_to_string(folder.path().join(path)).unwrap();
    let measured = read("planted/r1/wheel_odometry.csv");
    let kept = read("apart/recording/r1/wheel_odometry.csv");
    assert!(kept.lines().count() > 900 && kept.lines().all(|row| measured.contains(row)));
    assert!(read("apart/recording/model.toml") == read("corrected.toml"));
}

#[test]
fn a_simulation_from_a_recording_takes_the_model_given() {
    let folder = tempfile::tempdir().unwrap();
    planted(folder.path());
    let spread = |arguments: &[&str], name: &str| {
        let run =
            run(folder.path(), [&["simulate", "--from", "planted", "--json"], arguments].concat()).json();
        let channels = list(&list(&run, "robots")[0], "channels");
        let channel = channels.iter().find(|channel| channel["channel"] == name).unwrap();
        number(&list(channel, "components")[0], "rms")
    };
    // The first component of each: forward motion, and bearing.
    for name in ["body", "bearing_to_landmark"] {
        let (without, with) = (spread(&[], name), spread(&["--model", "corrected.toml"], name));
        assert!(with < 0.6 * without, "{name}: {with}, without {without}");
    }
}

#[test]
fn what_a_model_cannot_do_is_said() {
    let folder = tempfile::tempdir().unwrap();
    planted(folder.path());
    let path = folder.path().join("corrected.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let tails = "[[robots.r1.effects]]\nname = \"heavy_tails\"\nparameters = { degrees_of_freedom = 4 }\n";
    let text = text.replacen("[[robots.r1.effects]]", &format!("{tails}\n[[robots.r1.effects]]"), 1);
    std::fs::write(&path, text.replacen("[noise]", "[noise]\nlidar_sigma_m = 0.1", 1)).unwrap();
    let notes = replay(folder.path(), &["--model", "corrected.toml", "--out", "out"])["notes"].to_string();
    for part in ["heavy_tails is not taken out", "noise.lidar_sigma_m"] {
        assert_eq!(notes.matches(part).count(), 1, "{notes}");
    }
}

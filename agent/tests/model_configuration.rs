//! A configuration that names a model of the robot: where it is looked for, and what is wrong with it.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "helpers of tests are tests")]

use pleiad_agent::AgentConfig;

const MODEL: &str = "
format_version = 1
noise = { gyro_sigma_rad_s = 0, gps_sigma_m = 0, heading_sigma_rad = 0, range_sigma_m = 0, bearing_sigma_rad = 0, truth_sigma_m = 0, truth_sigma_rad = 0 }
range_sensor = { max_range_m = 5, min_range_m = 0, half_fov_rad = 1 }

[robots.r1]
wheel_radius = 0.05
track_width = 0.3
encoder_ticks_per_rev = 0
servo_time_constant_s = 0.1
servo_time_constant_turn_s = 0.1
effects = [{ name = 'gps_lever_arm', parameters = { offset_body_m = [0.2, -0.1] } }]
";

/// A folder with `agent.toml`, and its path.
fn written(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("agent.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn a_model_is_found_beside_the_configuration_that_names_it() {
    let (folder, path) = written("team = 'blue'\nrobot = 1\nmodel = 'models/corrected.toml'\n");
    std::fs::create_dir(folder.path().join("models")).unwrap();
    std::fs::write(folder.path().join("models/corrected.toml"), MODEL).unwrap();
    let node = AgentConfig::read(&path).unwrap().node().unwrap();
    let model = node.correction.expect("a model");
    let effects = &model.correction.given().effects;
    assert_eq!(effects.iter().map(|own| own.effect().name()).collect::<Vec<_>>(), ["gps_lever_arm"]);
}

#[test]
fn a_model_that_cannot_be_used_is_refused_with_both_files_and_the_key() {
    let cases = [
        (MODEL, "model.toml", "robot = 2\n", "no section [robots.r2]"),
        (MODEL, "modle.toml", "robot = 1\n", "modle.toml is missing"),
        (
            &MODEL.replace("gps_lever_arm", "gps_lever"),
            "model.toml",
            "robot = 1\n",
            "robots.r1.effects[0].name",
        ),
        (
            &MODEL.replace("-0.1]", "nan]"),
            "model.toml",
            "robot = 1\n",
            "robots.r1.effects[0].parameters.offset_body_m",
        ),
        ("[robots.r1]", "model.toml", "robot = 1\n", "`noise`: found nothing"),
    ];
    for (model, name, robot, expected) in cases {
        let (folder, path) = written(&format!("team = 'blue'\n{robot}model = '{name}'\n"));
        std::fs::write(folder.path().join("model.toml"), model).unwrap();
        let error = AgentConfig::read(&path).unwrap_err().to_string();
        for part in [path.to_str().unwrap(), name, expected] {
            assert!(error.contains(part), "{part:?} is not in: {error}");
        }
    }
}

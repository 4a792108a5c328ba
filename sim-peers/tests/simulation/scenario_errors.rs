//! What a user is told about a scenario that makes no sense.

use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_sim_peers::{Error, Scenario, simulate};

use crate::scenario;

const HEAD: &str = "name = \"bad\"\nduration_s = 60.0\nteam_size = 2\n";

/// The whole message for a scenario that begins with [`HEAD`], so that `rest` starts in line 4.
fn check(rest: &str, expected: &str) {
    let error = Scenario::from_toml(&format!("{HEAD}{rest}"), "bad.toml").unwrap_err();
    assert_eq!(error.to_string(), expected);
}

#[test]
fn an_unknown_key_is_named_with_file_line_and_the_nearest_known_key() {
    check(
        "[defaults.gps]\nrate_hz = 1.0\nsigma = 0.5\n",
        "bad.toml:6: unknown key `defaults.gps.sigma`; the nearest known key is `sigma_m` (all keys: docs/scenario.md)",
    );
    check(
        "[[robots]]\nid = 1\ngsp.rate_hz = 2.0\n",
        "bad.toml:6: unknown key `robots[0].gsp`; the nearest known key is `gps` (all keys: docs/scenario.md)",
    );
    check(
        "durations = 3\n",
        "bad.toml:4: unknown key `durations`; the nearest known key is `duration_s` (all keys: docs/scenario.md)",
    );
}

#[test]
fn a_value_of_the_wrong_kind_is_shown_with_what_was_expected() {
    check(
        "[defaults.gps]\nrate_hz = \"fast\"\n",
        "bad.toml:5: `defaults.gps.rate_hz` is \"fast\"; expected a number",
    );
    check(
        "[defaults.odometry]\nkind = \"wheel\"\n",
        "bad.toml:5: `defaults.odometry.kind` is \"wheel\"; expected one of velocity, wheels, increment",
    );
    check("[defaults]\ngps = 1.0\n", "bad.toml:5: `defaults.gps` is 1.0; expected a table");
    check("[defaults.prior]\nknown = 1\n", "bad.toml:5: `defaults.prior.known` is 1; expected true or false");
}

#[test]
fn a_value_out_of_range_is_shown_at_the_line_that_set_it() {
    check(
        "[defaults.gps]\nsigma_m = -0.5\n",
        "bad.toml:5: `defaults.gps.sigma_m` is -0.5; expected a finite number above 0",
    );
    check(
        "[[robots]]\nid = 2\nrelative.sigma_range_m = nan\n",
        "bad.toml:6: `robots[0].relative.sigma_range_m` is NaN; expected a finite number above 0",
    );
    check(
        "[defaults.odometry.noise]\nyaw_rad_per_sqrt_s = inf\n",
        "bad.toml:5: `defaults.odometry.noise.yaw_rad_per_sqrt_s` is inf; expected a finite number, 0 or more",
    );
    check(
        "[defaults]\nodometry.rate_hz = 1\n",
        "bad.toml:5: `defaults.odometry.rate_hz` is 1; expected a rate from 5 to 1000 Hz",
    );
    check(
        "[defaults.relative]\nmin_range_m = 3.0\nmax_range_m = 2.0\n",
        "bad.toml:6: `defaults.relative.max_range_m` is 2; expected more than relative.min_range_m = 3",
    );
    check(
        "[defaults.relative]\ndrop_out = 1.5\n",
        "bad.toml:5: `defaults.relative.drop_out` is 1.5; expected a number from 0 to 1",
    );
    check(
        "[defaults.gps]\nwindows_s = [[5.0, 2.0]]\n",
        "bad.toml:5: `defaults.gps.windows_s` is [5.0, 2.0]; expected [from, until] with 0 <= from < until",
    );
    check(
        "[[robots]]\nid = 1\nstart = { x_m = 40.0, y_m = 0.0, heading_rad = 0.0 }\n",
        "bad.toml:6: `robots[0].start.x_m` is 40; expected a number from -10 to 10",
    );
    check("seed = -3\n", "bad.toml:4: `seed` is -3; expected a whole number from 0");
}

#[test]
fn an_effect_that_the_catalogue_does_not_have_is_named_with_its_line() {
    check(
        "[[defaults.effects]]\nname = \"gyro_bais\"\nparameters = { bias_rad_s = 0.1 }\n",
        "bad.toml:5: `defaults.effects[0].name`: found \"gyro_bais\", expected an effect of the catalogue, perhaps \"gyro_bias\"",
    );
    check(
        "[[robots]]\nid = 1\n[[robots.effects]]\nname = \"gyro_bias\"\nparameters = { bias = 0.1 }\n",
        "bad.toml:8: `robots[0].effects[0].parameters.bias`: found this parameter, expected a value for a parameter of `gyro_bias`, which has: bias_rad_s",
    );
    check(
        "[[defaults.effects]]\nname = \"crab\"\nparameters = { rad = 0.1 }\nwithin = { time_s = [5.0, 2.0] }\n",
        "bad.toml:7: `defaults.effects[0].within.time_s`: found `[5.0, 2.0]`, expected [from, to] with from < to",
    );
    check(
        "[[defaults.effects]]\nname = \"crab\"\nparameter = { rad = 0.1 }\n",
        "bad.toml:6: unknown key `defaults.effects[0].parameter`; the nearest known key is `parameters` (all keys: docs/scenario.md)",
    );
}

#[test]
fn a_mistuned_value_that_no_nominal_model_can_have_is_refused() {
    check(
        "[[robots]]\nid = 1\ndeclared = { wheel_radius = 0.0 }\n",
        "bad.toml:6: `robots[0].declared.wheel_radius` is 0; expected a finite number above 0",
    );
    check(
        "[[robots]]\nid = 1\ndeclared = { wheel_base = 0.3 }\n",
        "bad.toml:6: unknown key `robots[0].declared.wheel_base`; the nearest known key is `wheel_radius` (all keys: docs/scenario.md)",
    );
    check(
        "[defaults.motion]\npolicy = \"script\"\nscript = [[0.5, 0.0, 0.0]]\n",
        "bad.toml:6: `defaults.motion.script` is [0.5, 0.0, 0.0]; expected finite numbers [forward m/s, yaw rate rad/s, seconds] with seconds above 0",
    );
}

#[test]
fn effects_of_the_defaults_come_before_those_of_the_robot() {
    let scenario = scenario(&format!(
        "{HEAD}[[defaults.effects]]\nname = \"crab\"\nparameters = {{ rad = 0.1 }}\n\
         [[robots]]\nid = 2\n[[robots.effects]]\nname = \"gps_lever_arm\"\nparameters = {{ offset_body_m = [0.2, -0.1] }}\n"
    ));
    let names = |id| {
        let effects = &scenario.robots[&RobotId(id)].effects;
        effects.iter().map(|own| (own.effect().name(), own.values().to_vec())).collect::<Vec<_>>()
    };
    assert_eq!(names(1), [("crab", vec![0.1])]);
    assert_eq!(names(2), [("crab", vec![0.1]), ("gps_lever_arm", vec![0.2, -0.1])]);
}

#[test]
fn robots_must_be_numbered_from_one_and_listed_once() {
    check("[[robots]]\nid = 0\n", "bad.toml:5: `robots[0].id` is 0; expected a whole number from 1");
    check(
        "[[robots]]\ngps.rate_hz = 1.0\n",
        "bad.toml:4: `robots[0].id` is missing; expected a whole number from 1",
    );
    check(
        "[[robots]]\nid = 1\n[[robots]]\nid = 1\n",
        "bad.toml:7: `robots[1].id` is 1 again; expected every robot to be listed once",
    );
    check(
        "[[landmarks]]\nid = 1\nx_m = 0.0\ny_m = 0.0\n[[landmarks]]\nid = 1\nx_m = 1.0\ny_m = 0.0\n",
        "bad.toml:9: `landmarks[1].id` is 1 again; expected every landmark to be listed once",
    );
}

#[test]
fn a_scenario_without_robots_is_refused() {
    let error = Scenario::from_toml("name = \"empty\"\nduration_s = 1.0\n", "empty.toml").unwrap_err();
    assert_eq!(
        error.to_string(),
        "empty.toml: `robots` is empty; expected at least one robot: give team_size or [[robots]]"
    );
}

#[test]
fn text_that_is_not_toml_and_missing_keys_and_files_are_reported_with_their_place() {
    let error = Scenario::from_toml("name = \"x\"\nduration_s = \n", "broken.toml").unwrap_err();
    assert!(error.to_string().starts_with("broken.toml:2: not TOML: "), "{error}");
    let error = Scenario::from_toml("name = \"x\"\n", "short.toml").unwrap_err();
    assert!(error.to_string().contains("missing field `duration_s`"), "{error}");
    let error = Scenario::load(Path::new("no/such/scenario.toml")).unwrap_err();
    assert!(error.to_string().starts_with("no/such/scenario.toml: cannot be read: "), "{error}");
}

#[test]
fn a_scenario_changed_in_memory_is_checked_before_it_is_simulated() {
    let mut scenario = scenario(HEAD);
    scenario.robots.get_mut(&RobotId(2)).unwrap().heading.sigma_rad = f64::NAN;
    assert_eq!(
        simulate(&scenario, 1).unwrap_err().to_string(),
        "scenario `bad`: `robot 2: heading.sigma_rad` is NaN; expected a finite number above 0"
    );
}

#[test]
fn more_robots_than_the_arena_holds_are_refused_by_name() {
    let crowd = scenario(
        "name = \"crowd\"\nduration_s = 1.0\nteam_size = 40\narena = { width_m = 3.0, height_m = 3.0 }\n",
    );
    match simulate(&crowd, 1) {
        Err(Error::Placement { robot, attempts, .. }) => assert!(robot.0 > 4 && attempts == 1000),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_robot_has_the_defaults_with_its_own_keys_over_them() {
    let scenario = scenario(&format!(
        "{HEAD}[defaults.gps]\nrate_hz = 2.0\nsigma_m = 0.7\n[[robots]]\nid = 2\ngps.sigma_m = 0.1\n[[robots]]\nid = 9\n"
    ));
    let gps = |id| {
        let gps = &scenario.robots[&RobotId(id)].gps;
        (gps.rate_hz, gps.sigma_m)
    };
    assert_eq!(scenario.robots.len(), 3);
    assert_eq!([gps(1), gps(2), gps(9)], [(2.0, 0.7), (2.0, 0.1), (2.0, 0.7)]);
}

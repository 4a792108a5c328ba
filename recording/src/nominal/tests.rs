use pleiad_physics::Drive;

use super::*;

/// As in the sample recordings, shortened to one robot.
const SAMPLE: &str = r#"# What the nominal simulation believes. SI units, radians.
format_version = 1
duration_s = 150
model = "ideal_unicycle"   # no slip, flat floor, common clock, sensors at the body origin

[noise]
gyro_sigma_rad_s = 0.004
gps_sigma_m = 0.04
heading_sigma_rad = 0.012
range_sigma_m = 0.025
bearing_sigma_rad = 0.01
truth_sigma_m = 0.001
truth_sigma_rad = 0.001
odometry_floor_pos_sigma_m_per_1s = 0.0015
odometry_floor_heading_sigma_rad_per_1s = 0.0006
odometry_floor_lateral_slip_s = 0.003
gyro_floor_lag_s = 0.0015
command_floor_lag_s = 0.001
command_floor_wheel_speed_offset_rad_s = 0.006
clean_drift_fraction_of_distance = 0.001
command_jitter_s = 0.004
command_floor_wheel_angle_sigma_rad_per_0p2s = 0.007

[range_sensor]
max_range_m = 5.0
min_range_m = 0.3
half_fov_rad = 1.05
detection_probability = 0.95
mount_x_m = 0.0
mount_y_m = 0.0
mount_yaw_rad = 0.0
latency_s = 0.0
range_scale = 1.0

[robots.r2]
wheel_radius = 0.08847
track_width = 0.40495
encoder_ticks_per_rev = 1024
servo_time_constant_s = 0.01469
servo_time_constant_turn_s = 0.00969
command_latency_s = 0.0
command_rate_hz = 25
gps_rate_hz = 0
range_bias_m = -0.0486
gyro_bias_rad_s = 0.0
gyro_scale = 1.0
gps_mount_x_m = 0.0
gps_mount_y_m = 0.0
gps_latency_s = 0.0
clock_offset_s = 0.0
clock_drift_ppm = 0.0
"#;

fn read(text: &str) -> Result<(Nominal, Vec<String>), String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("nominal.toml");
    std::fs::write(&path, text).expect("writable");
    let mut warnings = Vec::new();
    let nominal = read_nominal(&path, &mut warnings).map_err(|error| error.to_string())?;
    Ok((nominal.expect("the file exists"), warnings))
}

#[test]
fn the_sample_is_read_in_full_without_a_warning() {
    let (nominal, warnings) = read(SAMPLE).expect("the sample is sound");
    assert_eq!(warnings, Vec::<String>::new());
    let (noise, sensor) = (&nominal.noise, &nominal.range_sensor);
    assert_eq!((noise.gyro_sigma_rad_s, noise.command_floor_wheel_angle_sigma_rad_per_0p2s), (0.004, 0.007));
    assert_eq!((sensor.half_fov_rad, sensor.detection_probability), (1.05, 0.95));
    let robot = &nominal.robots[&RobotId(2)];
    assert_eq!(
        (robot.wheel_radius, robot.encoder_ticks_per_rev, robot.range_bias_m),
        (0.08847, 1024.0, -0.0486)
    );
    let rates = [("command_rate_hz".to_owned(), 25.0), ("gps_rate_hz".to_owned(), 0.0)];
    assert_eq!(robot.rates_hz, rates.into());
}

#[test]
fn what_is_written_reads_back_equal() {
    let (mut nominal, _) = read(SAMPLE).expect("the sample is sound");
    nominal.noise.gps_sigma_m = 0.1 + 0.2;
    nominal.noise.gyro_sigma_rad_s = 1e-7;
    nominal.range_sensor.max_range_m = 1e300;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("new/nominal.toml");
    write_nominal(&path, &nominal, 12.5).expect("writable");
    let mut warnings = Vec::new();
    assert_eq!(read_nominal(&path, &mut warnings).expect("readable"), Some(nominal));
    assert_eq!(warnings, Vec::<String>::new());
}

const EFFECT: &str = "
[[robots.r2.effects]]
name = \"track_width_error\"
parameters = { relative = 0.01 }
";

#[test]
fn effects_of_a_robot_are_read_in_their_order_and_reach_its_model() {
    let second = EFFECT.replace("track_width_error", "wheel_radius_error");
    let (nominal, warnings) = read(&format!("{SAMPLE}{EFFECT}{second}")).expect("sound");
    assert_eq!(warnings, Vec::<String>::new());
    let model = nominal.model(RobotId(2)).expect("it is in the file");
    let found: Vec<_> = model.effects.iter().map(|own| (own.effect().name(), own.values()[0])).collect();
    assert_eq!(found, [("track_width_error", 0.01), ("wheel_radius_error", 0.01)]);
    assert_eq!((model.nominal.wheel_radius, model.nominal.range_bias_m), (0.08847, -0.0486));
    assert_eq!(nominal.model(RobotId(1)), None);
}

#[test]
fn a_drive_holds_for_the_team_unless_a_robot_has_its_own() {
    let team = SAMPLE.replacen("[noise]", "drive = \"skid_steer\"\ntrack_ratio = 1.6\n\n[noise]", 1);
    let drive = |text: &str| read(text).expect("sound").0.robots[&RobotId(2)].drive;
    assert_eq!(drive(SAMPLE), Drive::Differential);
    assert_eq!(drive(&team), Drive::SkidSteer { track_ratio: 1.6 });
    assert_eq!(
        drive(&format!("{team}drive = \"car_like\"\nwheelbase_m = 0.5\n")),
        Drive::CarLike { wheelbase_m: 0.5 }
    );
    // Negative: the rear axle is steered.
    assert_eq!(
        drive(&format!("{team}drive = \"car_like\"\nwheelbase_m = -0.5\n")),
        Drive::CarLike { wheelbase_m: -0.5 }
    );
    assert!(read(&format!("{team}drive = \"car_like\"\nwheelbase_m = 0.0\n")).is_err());
    assert_eq!(read(&team).expect("sound").1, Vec::<String>::new());
}

#[test]
fn a_corrected_model_reads_back_equal_and_alone() {
    let (mut nominal, _) = read(&format!("{SAMPLE}{EFFECT}")).expect("sound");
    let robot = nominal.robots.get_mut(&RobotId(2)).expect("it is in the file");
    robot.drive = Drive::CarLike { wheelbase_m: 0.45 };
    robot.effects[0].ci95 = vec![Some([0.009, 0.011])];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("corrected.toml");
    crate::write_model(&path, &nominal, "Found by hand.\n\nTwice.").expect("writable");
    let text = std::fs::read_to_string(&path).expect("written");
    assert!(text.starts_with("# Found by hand.\n#\n# Twice.\nformat_version = 1\n"), "{text}");
    let mut warnings = Vec::new();
    assert_eq!(crate::read_model(&path, &mut warnings).expect("readable"), nominal);
    assert_eq!(warnings, Vec::<String>::new());
    let missing = crate::read_model(&folder.path().join("corected.toml"), &mut warnings);
    let error = missing.expect_err("there is no such file").to_string();
    assert!(error.contains("corected.toml is missing") && error.contains("corrected.toml"), "{error}");
}

#[test]
fn a_model_that_could_not_be_read_back_is_not_written() {
    let (mut nominal, _) = read(&format!("{SAMPLE}{EFFECT}")).expect("sound");
    let robot = nominal.robots.get_mut(&RobotId(2)).expect("it is in the file");
    robot.effects[0].active.set("relative", f64::NAN).expect("it has the parameter");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = crate::write_model(&folder.path().join("corrected.toml"), &nominal, "").expect_err("NaN");
    assert!(error.to_string().contains("robots.r2.effects[0].parameters.relative"), "{error}");
}

#[test]
fn a_missing_file_is_no_nominal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let read = read_nominal(&folder.path().join("nominal.toml"), &mut Vec::new());
    assert_eq!(read.expect("absence is allowed"), None);
}

#[test]
fn unknown_keys_are_named_and_not_read() {
    let text = SAMPLE
        .replace("duration_s = 150", "duration_s = 150\nweather = 3")
        .replace("gyro_scale = 1.0", "gyro_scale = 1.0\nlidar_sigma_m = 0.1");
    let (nominal, warnings) = read(&text).expect("unknown keys are allowed");
    assert_eq!(nominal, read(SAMPLE).expect("the sample is sound").0);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].contains("nominal.toml: key `weather`"));
    assert!(warnings[1].contains("nominal.toml: key `robots.r2.lidar_sigma_m`"));
}

#[test]
fn what_has_an_ideal_value_may_be_absent_with_a_warning() {
    let text = SAMPLE.replace("gyro_scale = 1.0\n", "").replace("clock_offset_s = 0.0\n", "");
    let (nominal, warnings) = read(&text).expect("ideal values stand in");
    assert_eq!(nominal, read(SAMPLE).expect("the sample is sound").0);
    let expected = "nominal.toml: [robots.r2] is taken to say gyro_scale = 1, clock_offset_s = 0";
    assert_eq!(warnings, [expected]);
}

#[test]
fn a_wrong_or_missing_key_is_an_error_naming_file_and_key() {
    for (from, to, expected) in [
        (
            "gps_sigma_m = 0.04\n",
            "",
            "key `noise.gps_sigma_m`: found nothing, expected a finite number, at least 0",
        ),
        ("gps_sigma_m = 0.04", "gps_sigma_m = \"4 cm\"", "key `noise.gps_sigma_m`: found `\"4 cm\"`"),
        ("gps_sigma_m = 0.04", "gps_sigma_m = -0.04", "key `noise.gps_sigma_m`: found `-0.04`"),
        ("gps_sigma_m = 0.04", "gps_sigma_m = nan", "key `noise.gps_sigma_m`: found `nan`"),
        ("track_width = 0.40495", "track_width = 0", "key `robots.r2.track_width`: found `0`"),
        ("command_rate_hz = 25", "command_rate_hz = true", "key `robots.r2.command_rate_hz`: found `true`"),
        ("[robots.r2]", "[robots.left]", "key `robots.left`"),
        ("[range_sensor]", "[ranger]", "key `range_sensor`: found nothing, expected a section"),
        ("ideal_unicycle", "ackermann", "key `model`: found `\"ackermann\"`"),
        ("format_version = 1", "format_version = 9", "key `format_version`: found `9`"),
        ("[noise]", "[noise", "is not valid TOML"),
        ("[noise]", "drive = \"legs\"\n[noise]", "key `drive`: found `\"legs\"`, expected \"differential\""),
        ("[noise]", "track_ratio = 1.5\n[noise]", "key `track_ratio`: found `1.5`, expected the key `drive`"),
        ("[robots.r2]", "[robots.r2]\ndrive = \"skid_steer\"", "key `robots.r2.track_ratio`: found nothing"),
        ("[robots.r2]", "[robots.r2]\neffects = 3", "key `robots.r2.effects`: found `3`, expected a list"),
        (
            "[robots.r2]",
            "[robots.r2]\neffects = [{ name = \"crab\" }]",
            "key `robots.r2.effects[0]`: found an effect that cannot be read (missing field `parameters`",
        ),
        (
            "[robots.r2]",
            "[robots.r2]\neffects = [{ name = \"crab\", parameters = { rad = nan } }]",
            "key `robots.r2.effects[0].parameters.rad`: found `nan`",
        ),
    ] {
        assert!(SAMPLE.contains(from), "{from}");
        let error = read(&SAMPLE.replacen(from, to, 1)).expect_err(to);
        assert!(error.contains("nominal.toml") && error.contains(expected), "{error}");
    }
}

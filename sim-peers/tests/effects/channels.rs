//! Which channels an effect changes, and that it changes no other bit.

use pleiad_estimation::RobotId;
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_physics::{ActiveEffect, Effect, Region, Scope};
use pleiad_recording::RobotRecording;
use pleiad_sim_peers::SimulatedRun;

use crate::{MIXED, ROBOT, channels, scenario, with};

const OTHER: RobotId = RobotId(2);

/// Whatever moves the robot, and whatever is seen of where it is.
const PLACE: &str = "gps sightings truth";
const PLACE_AND_YAW: &str = "gyro gps heading sightings truth";
const WHEELS_ON: &str = "odometry gyro gps heading sightings truth";
/// The same for both wheels.
const BOTH_WHEELS_ON: &str = "odometry gps sightings truth";
const OWN_CLOCK: &str = "commands odometry gyro gps heading sightings";

/// The channels of robot 1 that change; its commands are a script, so that nothing answers.
const ACTS_ON: &[(&str, &str)] = &[
    ("unequal_wheel_radii", PLACE_AND_YAW),
    ("track_width_error", PLACE_AND_YAW),
    ("wheel_radius_error", PLACE_AND_YAW),
    ("longitudinal_slip", PLACE),
    ("lateral_skid", PLACE),
    ("icr_offset", PLACE),
    ("castor_friction", PLACE_AND_YAW),
    ("actuator_lag", WHEELS_ON),
    ("command_delay", WHEELS_ON),
    ("clock_offset", OWN_CLOCK),
    ("clock_drift", OWN_CLOCK),
    ("motor_deadband", WHEELS_ON),
    ("stiction", WHEELS_ON),
    ("sticky_wheel", WHEELS_ON),
    ("speed_saturation", WHEELS_ON),
    ("acceleration_limit", BOTH_WHEELS_ON),
    ("speed_dependent_scale", PLACE),
    ("quadratic_drag", BOTH_WHEELS_ON),
    ("turn_loss", PLACE),
    ("payload_added", WHEELS_ON),
    ("payload_offset", PLACE_AND_YAW),
    ("battery_sag", WHEELS_ON),
    ("floor_tilt", BOTH_WHEELS_ON),
    ("low_friction_patch", PLACE),
    ("low_friction_overall", PLACE),
    ("push", PLACE_AND_YAW),
    ("world_force", BOTH_WHEELS_ON),
    ("world_drift", PLACE),
    ("encoder_coarse", "odometry"),
    ("backlash", WHEELS_ON),
    ("wheel_eccentricity", PLACE_AND_YAW),
    ("steer_trim", PLACE_AND_YAW),
    ("understeer", PLACE_AND_YAW),
    ("gyro_bias", "gyro"),
    ("gyro_scale", "gyro"),
    ("gyro_random_walk", "gyro"),
    ("gyro_thermal_drift", "gyro"),
    ("compass_hard_iron", "heading"),
    ("compass_soft_iron", "heading"),
    ("local_magnetic_field", "heading"),
    ("sun_sensor_misalignment", "heading"),
    ("gps_lever_arm", "gps"),
    ("gps_latency", "gps"),
    ("gps_multipath_patch", "gps"),
    ("sensor_lever_arm", "sightings"),
    ("sensor_yaw_misalignment", "sightings"),
    ("range_bias", "sightings"),
    ("range_scale", "sightings"),
    ("bearing_distortion", "sightings"),
    ("range_dependent_noise", "sightings"),
    ("bearing_dependent_range_bias", "sightings"),
    ("heavy_tails", "sightings"),
    ("landmark_identity_swap", "sightings"),
    ("identity_mix_up", "sightings"),
    ("missed_detections", "sightings"),
    ("motion_blur", "sightings"),
    ("camera_latency", "sightings"),
    ("truth_marker_offset", "truth"),
    ("truth_latency", "truth"),
    ("landmark_survey_error", "sightings"),
    ("partner_influence", PLACE),
    ("actuator_gain", WHEELS_ON),
    ("crab", PLACE),
    ("reverse_asymmetry", PLACE_AND_YAW),
    ("command_loss", WHEELS_ON),
    ("command_jitter", WHEELS_ON),
    ("heading_offset", "heading"),
];

/// The same script, driven by a car where the effect is one of steering.
fn run(effect: Effect, actives: &[ActiveEffect<f64>]) -> SimulatedRun {
    let mut scenario = scenario(MIXED);
    if matches!(effect, Effect::SteerTrim | Effect::Understeer) {
        scenario.robots.get_mut(&ROBOT).unwrap().drive.kind = pleiad_sim_peers::scenario::DriveKind::CarLike;
    }
    with(scenario, actives)
}

/// The names of the channels that are not the same. Yaw is the difference of two wheels: what moves both by
/// the same distance changes its last bits.
fn changed(one: &RobotRecording, other: &RobotRecording) -> String {
    let rate = |sample: &Sample| match sample.reading {
        Reading::Gyro { yaw_rate_rad_s: value } | Reading::Heading { heading_rad: value } => value,
        other => panic!("{other:?}"),
    };
    let same = |one: &[Sample], other: &[Sample]| {
        let near = |(one, other): (&Sample, &Sample)| {
            one.time == other.time && wrap_angle(rate(one) - rate(other)).abs() < 1e-10
        };
        one.len() == other.len() && one.iter().zip(other).all(near)
    };
    let channels = [
        ("commands", one.commands == other.commands),
        ("odometry", one.odometry == other.odometry),
        ("gyro", same(&one.gyro, &other.gyro)),
        ("gps", one.gps == other.gps),
        ("heading", same(&one.heading, &other.heading)),
        ("sightings", one.sightings == other.sightings),
        ("steer", one.steer == other.steer),
        ("truth", one.truth == other.truth),
    ];
    channels.into_iter().filter(|(_, same)| !same).map(|(name, _)| name).collect::<Vec<_>>().join(" ")
}

#[test]
fn every_effect_acts_on_its_channels_at_its_typical_size_and_on_no_other() {
    let listed: Vec<&str> = ACTS_ON.iter().map(|(name, _)| *name).collect();
    assert_eq!(listed, Effect::ALL.iter().map(|effect| effect.name()).collect::<Vec<_>>());
    let mut wrong = Vec::new();
    for (&effect, (name, expected)) in Effect::ALL.iter().zip(ACTS_ON) {
        let clean = run(effect, &[]);
        let typical = ActiveEffect::new(effect, &effect.typical_values()).unwrap();
        let acted = run(effect, &[typical]);
        // Of the other robot at most what it sees of this one changes.
        let moved = expected.contains("gps") && expected.contains("truth");
        let found = [ROBOT, OTHER]
            .map(|robot| changed(&clean.recording.robots[&robot], &acted.recording.robots[&robot]));
        if found != [*expected, if moved { "sightings" } else { "" }] {
            wrong.push(format!("{name}: {found:?}"));
        }
        assert_eq!(acted.injected[&ROBOT], [typical]);
        assert_eq!(acted.recording.nominal, clean.recording.nominal, "{name} is not declared");
    }
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn an_effect_that_is_off_changes_no_bit() {
    for &effect in Effect::ALL {
        let (clean, off) = (run(effect, &[]), run(effect, &[ActiveEffect::off(effect)]));
        assert_eq!(off.recording, clean.recording, "{}", effect.name());
        assert_eq!(off.tracks, clean.tracks, "{}", effect.name());
    }
}

#[test]
fn an_effect_outside_its_time_or_place_changes_no_bit() {
    let never = Scope { region: None, window_s: Some((100.0, 200.0)) };
    let nowhere = Scope { region: Some(Region::from_bounds([20.0, 25.0, 20.0, 25.0])), window_s: None };
    for &effect in Effect::ALL {
        let typical = ActiveEffect::new(effect, &effect.typical_values()).unwrap();
        let clean = run(effect, &[]);
        for scope in [never, nowhere] {
            assert_eq!(run(effect, &[typical.within(scope)]).recording, clean.recording, "{}", effect.name());
        }
    }
}

#[test]
fn within_a_time_window_an_effect_acts_then_and_only_then() {
    let scope = Scope { region: None, window_s: Some((5.0, 9.0)) };
    let bias = ActiveEffect::new(Effect::GyroBias, &[0.01]).unwrap().within(scope);
    let (clean, biased) = (run(Effect::GyroBias, &[]), run(Effect::GyroBias, &[bias]));
    let mut acted = 0;
    for (clean, biased) in channels(&clean).gyro.iter().zip(&channels(&biased).gyro) {
        let inside = (5.0..9.0).contains(&clean.time.seconds());
        assert_eq!(clean != biased, inside, "{clean:?}");
        acted += usize::from(inside);
    }
    assert_eq!(acted, 200);
}

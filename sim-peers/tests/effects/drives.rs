//! Skid steer and cars.

use pleiad_estimation::geometry::Vector3;
use pleiad_physics::{ActiveEffect, Drive, Effect};
use pleiad_sim_peers::scenario::DriveKind;
use pleiad_sim_peers::{Scenario, SimulatedRun};

use crate::{ROBOT, TRACK_M, active, channels, close, pose, rolled, scenario, with};

const EXACT: f64 = 1e-7;

fn drive(script: &str, kind: DriveKind) -> Scenario {
    let mut scenario = scenario(script);
    scenario.robots.get_mut(&ROBOT).unwrap().drive.kind = kind;
    scenario
}

/// Mean velocity of the body in steady motion.
fn twist(run: &SimulatedRun) -> Vector3 {
    pose(run, 6.0).between(&pose(run, 7.5)).log() / 1.5
}

fn car(script: &str, effects: &[ActiveEffect<f64>]) -> Vector3 {
    twist(&with(drive(script, DriveKind::CarLike), effects))
}

#[test]
fn a_skid_steered_robot_turns_its_wheels_farther_and_does_what_it_is_told() {
    let run = with(drive("[[0.5, 0.4, 20.0]]", DriveKind::SkidSteer), &[]);
    close(twist(&run).z, 0.4, EXACT);
    // The wheels turn as for a track 1.6 times as wide.
    let (_, turn_rad, lasted_s) = rolled(&run, 6.0, 9.0);
    close(turn_rad / lasted_s, 1.6 * 0.4, EXACT);
    let nominal = &run.recording.nominal.as_ref().unwrap().robots[&ROBOT];
    assert_eq!((nominal.drive, nominal.track_width), (Drive::SkidSteer { track_ratio: 1.6 }, TRACK_M));
    let wider =
        with(drive("[[0.5, 0.4, 20.0]]", DriveKind::SkidSteer), &[active(Effect::TrackWidthError, &[0.05])]);
    close(twist(&wider).z, 0.4 / 1.05, EXACT);
}

#[test]
fn a_car_drives_the_curve_it_is_told_forwards_and_backwards() {
    for (v, w) in [(0.5, 0.4), (0.5, -0.4), (-0.5, 0.4)] {
        let twist = car(&format!("[[{v:?}, {w:?}, 20.0]]"), &[]);
        close(twist.x, v, EXACT);
        close(twist.z, w, EXACT);
    }
}

#[test]
fn a_car_turns_no_tighter_than_it_can_steer_and_not_at_all_at_rest() {
    let run = with(drive("[[0.3, 2.0, 20.0]]", DriveKind::CarLike), &[]);
    let tightest = 0.3 * 0.6_f64.tan() / 0.4;
    close(twist(&run).z, tightest, EXACT);
    assert!(channels(&run).commands.iter().all(|command| (command.yaw_rate_rad_s - tightest).abs() < 1e-12));
    close(car("[[0.0, 1.0, 20.0]]", &[]).norm(), 0.0, EXACT);
}

#[test]
fn trim_and_understeer_change_the_curve_by_the_bicycle() {
    let (v, w, wheelbase_m): (f64, f64, f64) = (0.5, 0.3, 0.4);
    let steer = (w * wheelbase_m / v).atan();
    let trimmed = car("[[0.5, 0.3, 20.0]]", &[active(Effect::SteerTrim, &[0.02])]);
    close(trimmed.z, v * (steer + 0.02).tan() / wheelbase_m, EXACT);
    let wide = car("[[0.5, 0.3, 20.0]]", &[active(Effect::Understeer, &[0.05])]);
    close(wide.z, w / (1.0 + 0.05 * v * v), EXACT);
}

#[test]
fn a_mistuned_nominal_misleads_the_firmware_and_not_the_robot() {
    let mut scenario = scenario("[[0.5, 0.4, 20.0]]");
    let declared = &mut scenario.robots.get_mut(&ROBOT).unwrap().declared;
    (declared.track_width, declared.wheel_radius, declared.gyro_bias_rad_s) =
        (Some(0.44), Some(0.051), Some(0.2));
    let run = with(scenario, &[]);
    // The firmware turns the wheels by (v -+ w 0.44/2)/0.051, and they roll at 0.05 on a track of 0.4.
    close(twist(&run).x, 0.5 * 0.05 / 0.051, EXACT);
    close(twist(&run).z, 0.4 * 0.44 / 0.4 * 0.05 / 0.051, EXACT);
    let nominal = &run.recording.nominal.as_ref().unwrap().robots[&ROBOT];
    assert_eq!((nominal.track_width, nominal.wheel_radius, nominal.gyro_bias_rad_s), (0.44, 0.051, 0.2));
    let text = pleiad_sim_peers::injected_text(&self::scenario("[[0.5, 0.4, 20.0]]"), &run).unwrap();
    assert!(!text.contains("declared"), "of a scenario that declares the truth: {text}");
}

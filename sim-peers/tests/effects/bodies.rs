//! Effects between wheels and truth: how the robot moves where its wheels turn steadily.

use pleiad_estimation::geometry::Vector3;
use pleiad_physics::{Effect, Scope};

use crate::{RADIUS_M, TRACK_M, active, close, pose, rolled, run, scenario, wheels, with};

/// Steady motion is exact but for what is left of the servo's start and roundings.
const EXACT: f64 = 1e-7;

/// Asserts the velocity of the body `(v + dx, dy, w + dw)` where the wheels say `(v, w)`.
#[track_caller]
fn adds(effect: Effect, values: &[f64], (v, w): (f64, f64), [dx, dy, dw]: [f64; 3]) {
    let run = run(&format!("[[{v:?}, {w:?}, 20.0]]"), effect, values);
    let twist: Vector3 = pose(&run, 6.0).between(&pose(&run, 7.5)).log() / 1.5;
    for (found, expected) in twist.iter().zip([v + dx, dy, w + dw]) {
        close(*found, expected, EXACT);
    }
}

#[test]
fn radii_and_track_act_by_the_kinematics_of_two_wheels() {
    for (v, w) in [(0.5, 0.3), (-0.4, 0.7)] {
        let ratio = 0.01;
        adds(
            Effect::UnequalWheelRadii,
            &[ratio],
            (v, w),
            [-ratio * w * TRACK_M / 4.0, 0.0, -ratio * v / TRACK_M],
        );
        adds(Effect::TrackWidthError, &[0.03], (v, w), [0.0, 0.0, w / 1.03 - w]);
        adds(Effect::WheelRadiusError, &[0.01], (v, w), [0.01 * v, 0.0, 0.01 * w]);
    }
    let (v, w, ratio) = (0.5, 0.3, 0.005);
    let yaw_rate = (w - ratio * v / TRACK_M) / 1.01;
    adds(Effect::PayloadOffset, &[ratio, 0.01], (v, w), [-ratio * w * TRACK_M / 4.0, 0.0, yaw_rate - w]);
    adds(Effect::PayloadAdded, &[3.0, -0.005, 0.02], (v, w), [-0.005 * v, 0.0, -0.005 * w]);
}

#[test]
fn slip_sideways_goes_with_speed_and_yaw_rate() {
    for (v, w) in [(0.5, 0.4), (0.5, -0.4), (-0.5, 0.4)] {
        adds(Effect::LateralSkid, &[0.03], (v, w), [0.0, -0.03 * v * w, 0.0]);
        adds(Effect::LowFrictionOverall, &[0.02, 0.05], (v, w), [0.0, -0.05 * v * w, 0.0]);
        adds(
            Effect::LowFrictionPatch,
            &[-30.0, 30.0, -30.0, 30.0, 0.02, 0.1],
            (v, w),
            [0.0, -0.1 * v * w, 0.0],
        );
        adds(Effect::IcrOffset, &[0.03], (v, w), [0.0, -0.03 * w, 0.0]);
        adds(Effect::Crab, &[0.01], (v, w), [0.0, 0.01 * v, 0.0]);
    }
}

#[test]
fn losses_go_with_the_speed_squared_and_with_the_turn() {
    for (v, w) in [(0.5, 0.4), (-0.5, -0.4)] {
        adds(Effect::SpeedDependentScale, &[0.03], (v, w), [-0.03 * v * v.abs(), 0.0, 0.0]);
        adds(Effect::TurnLoss, &[0.02], (v, w), [-0.02 * w.abs() * v, 0.0, 0.0]);
    }
    adds(Effect::ReverseAsymmetry, &[0.01], (0.5, 0.4), [0.0; 3]);
    adds(Effect::ReverseAsymmetry, &[0.01], (-0.5, 0.4), [-0.005, 0.0, 0.004]);
    // In a spin one wheel turns backwards.
    adds(Effect::ReverseAsymmetry, &[0.01], (0.0, 0.8), [-0.01 * 0.8 * TRACK_M / 4.0, 0.0, 0.004]);
}

#[test]
fn slip_lengthwise_loses_what_the_speed_gained() {
    for (effect, values) in [
        (Effect::LongitudinalSlip, vec![0.04]),
        (Effect::LowFrictionOverall, vec![0.04, 0.0]),
        (Effect::LowFrictionPatch, vec![-30.0, 30.0, -30.0, 30.0, 0.04, 0.0]),
    ] {
        let run = run("[[0.6, 0.0, 4.0], [0.0, 0.0, 16.0]]", effect, &values);
        let start = run.tracks[&crate::ROBOT].start();
        let lost = |seconds: f64| {
            let (time, angles) = wheels(&run).into_iter().find(|(time, _)| *time >= seconds).unwrap();
            RADIUS_M * angles[0] - start.between(&pose(&run, time)).x_m()
        };
        close(lost(3.0), 0.04 * 0.6, EXACT);
        // Braking gives it back.
        close(lost(8.0), 0.0, EXACT);
    }
}

#[test]
fn an_eccentric_wheel_rolls_a_cosine_of_its_angle_farther() {
    let (offset_m, phase) = (0.002, 0.5);
    let run = run("[[0.5, 0.3, 20.0]]", Effect::WheelEccentricity, &[0.0, offset_m, phase]);
    for (time, [left, right]) in wheels(&run).into_iter().step_by(37) {
        let left_m = RADIUS_M * left + offset_m * ((left + phase).sin() - phase.sin());
        let yaw = (RADIUS_M * right - left_m) / TRACK_M;
        let found = run.tracks[&crate::ROBOT].start().between(&pose(&run, time)).yaw_rad();
        close(pleiad_estimation::geometry::wrap_angle(found - yaw), 0.0, EXACT);
    }
}

#[test]
fn a_castor_kicks_the_heading_once_per_reversal() {
    let (kick, decay_m) = (0.05, 0.03);
    let run =
        run("[[0.4, 0.0, 3.0], [-0.4, 0.0, 4.0], [0.4, 0.0, 4.0]]", Effect::CastorFriction, &[kick, decay_m]);
    close(pose(&run, 2.9).yaw_rad(), 0.0, EXACT);
    // 1.6 m after the reversal nothing of the exponential is left; a step of the integration may turn the
    // castor 2 ms late, which at the time of the reversal is less than half a millimetre of its path.
    close(pose(&run, 6.9).yaw_rad(), -kick, kick * 0.5e-3 / decay_m);
    close(pose(&run, 10.9).yaw_rad(), 0.0, kick * 1e-3 / decay_m);
}

#[test]
fn a_push_moves_the_robot_at_its_instant_and_no_wheel() {
    let run = run("[[0.3, 0.0, 20.0]]", Effect::Push, &[5.0, 0.1, 0.05, 0.2]);
    close(pose(&run, 4.99).yaw_rad(), 0.0, EXACT);
    let (before, after) = (pose(&run, 4.98), pose(&run, 5.02));
    close(after.yaw_rad() - before.yaw_rad(), 0.2, EXACT);
    // Half of the 40 ms at 0.3 m/s were driven in the new direction, give or take the step of the jump.
    close(after.x_m() - before.x_m(), 0.1 + 0.006 + 0.006 * 0.2_f64.cos(), 2e-3 * 0.3 * 0.2);
    close(after.y_m() - before.y_m(), 0.05 + 0.006 * 0.2_f64.sin(), 2e-3 * 0.3 * 0.2);
    let (forward_m, turn_rad, lasted_s) = rolled(&run, 4.0, 6.0);
    close(forward_m, 0.3 * lasted_s, EXACT);
    close(turn_rad, 0.0, EXACT);
}

#[test]
fn a_current_carries_a_turning_robot_in_the_map() {
    let clean = with(scenario("[[0.4, 0.5, 20.0]]"), &[]);
    let carried = run("[[0.4, 0.5, 20.0]]", Effect::WorldDrift, &[0.05, -0.03]);
    let first_s = wheels(&clean)[0].0;
    for seconds in [3.0, 9.0, 18.0] {
        let moved = pose(&carried, seconds).position() - pose(&clean, seconds).position();
        close(moved.x, 0.05 * (seconds - first_s), EXACT);
        close(moved.y, -0.03 * (seconds - first_s), EXACT);
    }
}

#[test]
fn a_near_partner_pushes_away_with_a_speed_that_dies_out_with_distance() {
    let (amplitude, range_m) = (0.05, 1.0);
    let run = run("[[0.0, 0.0, 20.0]]", Effect::PartnerInfluence, &[amplitude, range_m]);
    // d' = a exp(-d/r) from d(0): exp(d/r) grows by a/r per second. The other robot stands at (2, -1).
    let distance = |seconds: f64| (pose(&run, seconds).x_m() - 2.0).hypot(pose(&run, seconds).y_m() + 1.0);
    let (from_s, to_s) = (1.0, 19.0);
    let grown = (distance(to_s) / range_m).exp() - (distance(from_s) / range_m).exp();
    close(grown, amplitude / range_m * (to_s - from_s), 1e-5);
    close(distance(from_s), 5.0_f64.sqrt() + 0.005, 0.001);
}

#[test]
fn within_a_region_an_effect_acts_there_and_only_there() {
    let region = pleiad_physics::Region::from_bounds([2.0, 4.0, -1.0, 1.0]);
    let crab = active(Effect::Crab, &[0.02]).within(Scope { region: Some(region), window_s: None });
    let run = with(scenario("[[0.5, 0.0, 20.0]]"), &[crab]);
    for seconds in [1.0, 3.0, 6.0, 12.0, 19.0] {
        let place = pose(&run, seconds);
        let inside_m = (place.x_m() - 2.0).clamp(0.0, 2.0);
        // On either border a step of 2 ms at 0.5 m/s may count or not.
        close(place.y_m(), 0.02 * inside_m, 2.0 * 0.02 * 1e-3);
    }
}

//! Effects between command and encoders: the turning of the wheels.

use pleiad_physics::Effect;

use crate::{RADIUS_M, TAU_S, TAU_TURN_S, TRACK_M, channels, close, rolled, run, wheels};

/// Steady motion is exact but for what is left of the servo's start and roundings.
const EXACT: f64 = 1e-7;

/// Asserts the speed and yaw rate that the wheels reach.
#[track_caller]
fn reaches(effect: Effect, values: &[f64], (v, w): (f64, f64), (speed, yaw_rate): (f64, f64)) {
    let run = run(&format!("[[{v:?}, {w:?}, 20.0]]"), effect, values);
    let (forward_m, turn_rad, lasted_s) = rolled(&run, 8.0, 12.0);
    close(forward_m / lasted_s, speed, EXACT);
    close(turn_rad / lasted_s, yaw_rate, EXACT);
}

#[test]
fn gains_and_drag_change_the_speed_that_is_reached() {
    reaches(Effect::ActuatorGain, &[0.03, -0.04], (0.5, 0.3), (0.5 * 1.03, 0.3 * 0.96));
    reaches(Effect::QuadraticDrag, &[0.03], (-0.5, 0.3), (-0.5 + 0.03 * 0.25, 0.3));
    // A sag of 0.01 V/s and 5e-4/s: after 10 s, in the middle of what is measured, exactly linear.
    let gain = 1.0 + (0.05 * -0.01 - 5e-4) * (10.0 - TAU_S);
    let run = run("[[0.5, 0.0, 20.0]]", Effect::BatterySag, &[0.05, -5e-4]);
    let (forward_m, _, lasted_s) = rolled(&run, 8.0, 12.0);
    // The nearest encoder samples are up to 10 ms off, each.
    close(forward_m / lasted_s, 0.5 * gain, 0.5 * 1e-3 * 0.02);
}

#[test]
fn thresholds_stop_what_is_too_slow_and_clip_what_is_too_fast() {
    reaches(Effect::MotorDeadband, &[0.03, 0.0], (0.029, 0.0), (0.0, 0.0));
    reaches(Effect::MotorDeadband, &[0.03, 0.0], (0.031, 0.0), (0.031, 0.0));
    // The left wheel is asked for 0.2 rad/s and stands, the right for 3.8 rad/s.
    let across = 1.8 * RADIUS_M * 2.0 / TRACK_M;
    reaches(Effect::MotorDeadband, &[0.0, 0.5], (0.1, across), (0.095, 3.8 * RADIUS_M / TRACK_M));
    // 6 rad/s at most: the right wheel is asked for 10 and the left for 5.
    let across = 2.5 * RADIUS_M * 2.0 / TRACK_M;
    reaches(Effect::SpeedSaturation, &[6.0], (7.5 * RADIUS_M, across), (5.5 * RADIUS_M, RADIUS_M / TRACK_M));
    // The right wheel loses 0.3 rad/s.
    reaches(
        Effect::StickyWheel,
        &[1.0, 2.0, 0.3],
        (0.4, 0.0),
        (0.4 - 0.15 * RADIUS_M, -0.3 * RADIUS_M / TRACK_M),
    );
    reaches(Effect::Stiction, &[0.05], (0.04, 0.0), (0.0, 0.0));
    reaches(Effect::Stiction, &[0.05], (0.06, 0.0), (0.06, 0.0));
    let slowing = run("[[0.3, 0.0, 4.0], [0.04, 0.0, 16.0]]", Effect::Stiction, &[0.05]);
    let (forward_m, _, lasted_s) = rolled(&slowing, 8.0, 12.0);
    close(forward_m, 0.04 * lasted_s, EXACT);
}

#[test]
fn slopes_and_wind_make_the_servo_give_way_along_the_heading() {
    let droop = TAU_S * 0.035_f64.sin() * 0.7_f64.cos() * 9.806_65;
    reaches(Effect::FloorTilt, &[0.035, 0.7], (0.4, 0.0), (0.4 + droop, 0.0));
    reaches(Effect::FloorTilt, &[0.035, 0.7], (0.0, 0.0), (droop, 0.0));
    reaches(Effect::WorldForce, &[0.01, 0.7], (0.4, 0.0), (0.4 + 0.01 * 0.7_f64.cos(), 0.0));
    // While it turns, the droop turns too: the first harmonic behind the servo's lag.
    let (w, droop) = (0.8, 0.01);
    let spinning = run("[[0.0, 0.8, 20.0]]", Effect::WorldForce, &[droop, 0.7]);
    let wheels = wheels(&spinning);
    let gain = droop / (1.0 + (TAU_S * w).powi(2)).sqrt();
    for pair in wheels.windows(2).skip(200).step_by(29) {
        let middle_s = f64::midpoint(pair[0].0, pair[1].0);
        let speed = 0.5 * RADIUS_M * (pair[1].1[0] + pair[1].1[1] - pair[0].1[0] - pair[0].1[1])
            / (pair[1].0 - pair[0].0);
        let heading = crate::pose(&spinning, middle_s).yaw_rad();
        let expected = gain * (0.7 - heading + (TAU_S * w).atan()).cos();
        // A mean over 20 ms has (w dt)^2/24 less amplitude, the steps of the integration the same of 2 ms; and
        // below 1e-6 m/s a robot that is told to stop stands.
        close(speed, expected, gain * 2e-5 + 1e-6);
    }
}

/// Seconds from the command of a step from rest to its effect, from the distance lost to it.
fn lateness(effect: Effect, values: &[f64]) -> (f64, f64) {
    let run = run("[[0.5, 0.6, 20.0]]", effect, values);
    let begun_s = channels(&run).commands[0].time.seconds();
    let (time, [left, right]) = wheels(&run).into_iter().find(|(time, _)| *time > 8.0).unwrap();
    let forward_m = 0.5 * RADIUS_M * (left + right);
    let turn_rad = RADIUS_M * (right - left) / TRACK_M;
    (time - begun_s - forward_m / 0.5, time - begun_s - turn_rad / 0.6)
}

#[test]
fn lag_delay_and_payload_are_late_by_their_time() {
    // The integral of a first-order response lacks the time constant.
    for (effect, values, late_s) in [
        (Effect::ActuatorLag, vec![0.1], 0.1),
        (Effect::CommandDelay, vec![0.08], 0.08),
        (Effect::PayloadAdded, vec![0.0, 0.0, 0.02], 0.02),
        (Effect::ActuatorLag, vec![0.0], 0.0),
    ] {
        let (along, turning) = lateness(effect, &values);
        close(along, TAU_S + late_s, EXACT);
        close(turning, TAU_TURN_S + late_s, EXACT);
    }
}

#[test]
fn a_limit_of_acceleration_is_a_ramp_before_the_exponential() {
    let (v, limit): (f64, f64) = (0.5, 1.0);
    let (along, turning) = lateness(Effect::AccelerationLimit, &[limit]);
    // A ramp until the error is limit * tau, then the exponential: the area above the response.
    let knee = limit * TAU_S;
    let missing = (v * v - knee * knee) / (2.0 * limit) + knee * TAU_S;
    close(along, missing / v, EXACT);
    close(turning, TAU_TURN_S, EXACT);
}

#[test]
fn backlash_costs_its_play_at_every_reversal() {
    let script = "[[0.4, 0.0, 5.0], [-0.4, 0.0, 5.0], [0.4, 0.0, 10.0]]";
    let (clean, loose) = (run(script, Effect::Backlash, &[0.0]), run(script, Effect::Backlash, &[0.03]));
    let behind = |seconds: f64| {
        let index = wheels(&clean).iter().position(|(time, _)| *time > seconds).unwrap();
        wheels(&clean)[index].1[1] - wheels(&loose)[index].1[1]
    };
    // From the middle of the play, then all of it.
    close(behind(4.0), 0.015, EXACT);
    close(behind(9.0), -0.015, EXACT);
    close(behind(19.0), 0.015, EXACT);
}

#[test]
fn a_coarse_encoder_reads_its_own_whole_ticks() {
    let run = run("[[0.4, 0.3, 20.0]]", Effect::EncoderCoarse, &[64.0]);
    let tick = std::f64::consts::TAU / 64.0;
    let exact = crate::run("[[0.4, 0.3, 20.0]]", Effect::EncoderCoarse, &[0.0]);
    for ((_, read), (_, angles)) in wheels(&run).into_iter().zip(wheels(&exact)) {
        for (read, angle) in read.into_iter().zip(angles) {
            close(read / tick, (angle / tick).floor(), 1e-9);
        }
    }
}

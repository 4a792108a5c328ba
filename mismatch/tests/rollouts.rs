//! Predictions over horizons, of recordings whose errors are known in closed form.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use common::commanded::{Departure, driven, joystick, without};
use common::{TRACK_M, recorded};
use pleiad_estimation::RobotId;
use pleiad_mismatch::{Evidence, HORIZONS_S, Rollout, models, rollouts};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::Recording;

const ROBOT: RobotId = RobotId(1);

fn rolled(recording: &Recording, effect: Option<(Effect, &[f64])>, horizons_s: &[f64]) -> Vec<Vec<Rollout>> {
    let models = models(recording).expect("a model");
    let mut model = models[&ROBOT].clone();
    if let Some((effect, values)) = effect {
        model = model.with(ActiveEffect::new(effect, values).expect("as many values as parameters"));
    }
    rollouts(&Evidence::new(recording, &models), ROBOT, &model, horizons_s)
}

#[test]
fn a_speed_scale_grows_with_the_horizon() {
    let departure = Departure { speed_relative: -0.1, ..Departure::default() };
    let recording = driven(100.0, departure, |_| [0.4, 0.0]);
    let wrong = rolled(&recording, None, &HORIZONS_S);
    let right = rolled(&recording, Some((Effect::ActuatorGain, &[-0.1, 0.0])), &HORIZONS_S);
    for ((horizon_s, wrong), right) in HORIZONS_S.into_iter().zip(&wrong).zip(&right) {
        let whole = (99.0 / horizon_s).floor();
        assert!((whole - 1.0..=whole + 1.0).contains(&(wrong.len() as f64)), "{horizon_s}: {}", wrong.len());
        for pair in wrong.windows(2) {
            let apart_s = pair[1].time_s - pair[0].time_s;
            assert!((apart_s - horizon_s).abs() < 0.011, "none overlaps: {apart_s}");
        }
        for (wrong, right) in wrong.iter().zip(right) {
            assert!(
                (wrong.position_error_m - 0.04 * horizon_s).abs() < 0.04 * 0.011,
                "{horizon_s} {wrong:?}"
            );
            assert!(wrong.heading_error_rad.abs() < 1e-9);
            assert!(right.position_error_m < 1e-6, "{horizon_s} {right:?}");
        }
    }
}

#[test]
fn a_late_servo_is_followed_from_one_prediction_to_the_next() {
    let late = Departure { lag_s: 0.2, ..Departure::default() };
    let recording = driven(60.0, late, joystick);
    let right = rolled(&recording, Some((Effect::ActuatorLag, &[0.2])), &[0.5, 5.0]);
    // Euler's lag is short by 0.05 ms, at changes of up to 1 rad/s; over 5 s its errors cancel.
    for rollout in right.iter().flatten() {
        assert!(rollout.heading_error_rad.abs() < 6e-5 && rollout.position_error_m < 1e-4, "{rollout:?}");
    }
    let wrong = rolled(&recording, None, &[0.5]);
    assert!(wrong[0].iter().any(|rollout| rollout.heading_error_rad.abs() > 0.1));
}

#[test]
fn the_heading_by_unequal_wheels_is_off_by_the_distance_over_the_track() {
    let ratio = 0.01;
    let recording = recorded(Some((Effect::UnequalWheelRadii, &[ratio])));
    let found = rolled(&recording, None, &[5.0]);
    assert!(found[0].len() >= 22, "{}", found[0].len());
    let turned: f64 = found[0].iter().map(|rollout| rollout.heading_error_rad).sum();
    // The mean speed over whole swings is 0.4 m/s; what the last swing lacks is below 0.3 m/s / 0.9 rad/s.
    let covered_s = 5.0 * found[0].len() as f64;
    let expected = -ratio * 0.4 * covered_s / TRACK_M;
    assert!((turned - expected).abs() < ratio * 0.7 / TRACK_M + 0.005, "{turned} for {expected}");
    let right = rolled(&recording, Some((Effect::UnequalWheelRadii, &[ratio])), &[5.0]);
    // Truth has a milliradian at both ends.
    assert!(right[0].iter().all(|rollout| rollout.heading_error_rad.abs() < 0.006), "{:?}", right[0]);
}

#[test]
fn none_runs_through_a_gap_and_a_horizon_of_nothing_has_none() {
    let mut recording = driven(60.0, Departure::default(), joystick);
    without(&mut recording, (20.0, 22.0), false);
    let found = rolled(&recording, None, &[10.0, 0.0, f64::NAN, 1e9]);
    let begins: Vec<f64> = found[0].iter().map(|rollout| rollout.time_s).collect();
    // From 0.6 s: one; from 23 s, a second after the gap: three.
    assert_eq!(begins.len(), 4, "{begins:?}");
    assert!(begins.iter().all(|begin_s| begin_s + 10.0 < 20.0 || *begin_s >= 23.0), "{begins:?}");
    assert!(found[1].is_empty() && found[2].is_empty() && found[3].is_empty());
}

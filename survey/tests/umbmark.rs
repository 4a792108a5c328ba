//! UMBmark driven in simulation: recovery, improvement, and what must not work.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use pleiad_mismatch::calibration::umbmark::{
    Kind, Run, Turning, UmbmarkError, WheelFactors, calibrate, corrected, stage,
};
use pleiad_sim_peers::scenario::Direction;
use pleiad_sim_peers::simulate;
use pleiad_survey::{StudyOptions, umbmark};

fn few() -> StudyOptions {
    StudyOptions { seeds: Some(4), first_seed: 501 }
}

#[test]
fn squares_in_both_directions_recover_the_wheels_and_the_correction_brings_the_robot_home() {
    let trials = umbmark::trials(&umbmark::scenario().unwrap(), &few()).unwrap();
    for trial in &trials.own {
        let (found, injected) = (trial.calibration.factors.errors(), trial.injected);
        // Injected: 1.0015, 1.02, 1.01. Five runs with 2 cm of scatter know beta to 1 mrad: 4e-5 of E_d each sigma.
        assert!((injected.e_d - 1.0015).abs() < 2e-6, "{injected:?}");
        assert!((found.e_d - injected.e_d).abs() < 3e-4, "{found:?}");
        assert!((found.e_b - injected.e_b).abs() < 4e-3, "{found:?}");
        assert!((found.e_s - injected.e_s).abs() < 3e-3, "{found:?}");
        assert!(trial.improvement() > 3.0, "{}", trial.improvement());
        // The planted fault: the correction on the wrong wheels.
        assert!(trial.swapped.e_max_syst_m > trial.track_alone.e_max_syst_m);
    }
    let outcome = umbmark::study(&trials);
    for key in ["before", "after", "e_d", "e_b", "e_s", "alpha_rad", "beta_rad"] {
        assert!(outcome.numbers.contains_key(key), "{key}");
    }
    assert!(outcome.numbers["after"]["e_max_syst_m"].is_number());
}

#[test]
fn a_track_tuned_on_one_direction_comes_home_there_and_misses_the_other() {
    let trials =
        umbmark::trials(&umbmark::scenario().unwrap(), &StudyOptions { seeds: Some(2), ..few() }).unwrap();
    let first = &trials.own[0];
    let one_way: Vec<Run> = first
        .first
        .runs
        .iter()
        .filter(|run| matches!(run.kind, Kind::Square { turning: Turning::CounterClockwise, .. }))
        .cloned()
        .collect();
    let error = calibrate(&one_way, WheelFactors::NONE).unwrap_err();
    assert!(matches!(error, UmbmarkError::OneDirection { .. }), "{error}");
    // What the refusal is for: the best track alone, by trying, with the wheels left as they are.
    let off = |track: f64| {
        let stage = stage(&first.first.runs, WheelFactors { track, ..WheelFactors::NONE }).unwrap();
        (stage.counter_clockwise.r_cg_m, stage.clockwise.r_cg_m)
    };
    let tried: Vec<f64> = (-400..=400).map(|step| 1.0 + 1e-4 * f64::from(step)).collect();
    let best = tried.into_iter().min_by(|one, other| off(*one).0.total_cmp(&off(*other).0)).unwrap();
    let (home_m, away_m) = off(best);
    assert!(home_m < 0.05 && away_m > 5.0 * home_m && away_m > 0.2, "{best}: {home_m} {away_m}");
}

#[test]
fn odometry_with_the_corrected_model_follows_the_truth_better() {
    // The calibration of squares, on another drive: the scenario's own, which is steered by truth.
    let mut scenario = umbmark::scenario().unwrap();
    let trials = umbmark::trials(&scenario, &StudyOptions { seeds: Some(2), ..few() }).unwrap();
    let factors = trials.own[0].calibration.factors;
    scenario.duration_s = 57.0;
    // Clockwise, where this robot misses its start by ten times the scatter of a run; the other way round by as much as that.
    for own in scenario.robots.values_mut() {
        own.motion.direction = Direction::Clockwise;
    }
    let mut recording = simulate(&scenario, 9).unwrap().recording;
    let robot = *recording.robots.keys().next().unwrap();
    let off = |recording: &pleiad_recording::Recording| {
        let run = Run::of(recording, robot).unwrap();
        pleiad_mismatch::calibration::umbmark::return_error(
            &run,
            pleiad_mismatch::calibration::umbmark::believed(
                &recording.nominal.as_ref().unwrap().robots[&robot].effects,
            ),
        )
    };
    let [x, y] = off(&recording);
    let own = recording.nominal.as_mut().unwrap().robots.get_mut(&robot).unwrap();
    *own = corrected(own, factors, [None; 3]);
    let [x_after, y_after] = off(&recording);
    assert!(x_after.hypot(y_after) < 0.4 * x.hypot(y), "{x} {y}: {x_after} {y_after}");
}

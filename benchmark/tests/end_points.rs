//! A square that hides what is wrong, of which only the end points are known (Borenstein & Feng 1996).

#![allow(clippy::expect_used, reason = "tests fail by panicking")]

use pleiad_mismatch::{DiagnoseOptions, Findings, Verdict, diagnose};
use pleiad_recording::Recording;
use pleiad_sim_peers::{Scenario, simulate};

const COUNTER_CLOCKWISE: &str = include_str!("../../scenarios/masked_square.toml");
const CLOCKWISE: &str = include_str!("../../scenarios/masked_square_clockwise.toml");
/// Left over right wheel, 2 (1 - 1.004) / (1 + 1.004), and the track that makes up for it.
const RATIO: f64 = -0.003_992_015_968;
const TRACK: f64 = 0.0339;
/// What is wanted of the time series; end points have fewer readings.
const WITHIN: f64 = 0.0003;

fn recorded(scenario: &str, name: &str, seed: u64, change: impl Fn(&mut Scenario)) -> Recording {
    let mut scenario = Scenario::from_toml(scenario, name).expect("a scenario that is valid");
    change(&mut scenario);
    let mut recording = simulate(&scenario, seed).expect("a scenario that can be simulated").recording;
    name.clone_into(&mut recording.name);
    recording
}

fn told(recordings: &[Recording]) -> Findings {
    diagnose(recordings, &DiagnoseOptions::default()).expect("recordings with nominal models").findings
}

#[test]
fn end_points_of_one_way_round_cannot_tell_and_ask_for_the_other() {
    for (scenario, way) in [(COUNTER_CLOCKWISE, "clockwise"), (CLOCKWISE, "counter-clockwise")] {
        let findings = told(&[recorded(scenario, "one way", 11, |_| {})]);
        assert_eq!(findings.verdict, Verdict::CannotTell);
        let [own] = findings.findings.as_slice() else { unreachable!("{:?}", findings.findings) };
        assert_eq!(own.support_set, ["unequal_wheel_radii", "track_width_error"]);
        let manoeuvre = own.manoeuvre.as_deref().expect("something to drive");
        assert!(manoeuvre.starts_with(&format!("drive the square {way},")), "{manoeuvre}");
    }
}

#[test]
fn driven_one_way_round_the_square_comes_home_to_a_centimetre() {
    let recording = recorded(COUNTER_CLOCKWISE, "one way", 11, |scenario| {
        scenario.truth_sigma_m = 0.0;
        scenario.truth_sigma_rad = 0.0;
        for own in scenario.robots.values_mut() {
            own.odometry.noise.speed_m_per_sqrt_s = 0.0;
            own.odometry.noise.lateral_m_per_sqrt_s = 0.0;
            own.odometry.noise.yaw_rad_per_sqrt_s = 0.0;
        }
    });
    let truth = &recording.robots.values().next().expect("a robot").truth;
    let [first, second, ..] = truth.as_slice() else { unreachable!("{truth:?}") };
    let away_m = (first.pose.position() - second.pose.position()).norm();
    assert!(away_m < 0.01, "{away_m}");
}

#[test]
fn both_ways_round_name_both_errors_as_they_are() {
    let mut scores = Vec::new();
    for seed in 21..31 {
        let both = [
            recorded(COUNTER_CLOCKWISE, "one way", seed, |_| {}),
            recorded(CLOCKWISE, "the other", seed + 100, |_| {}),
        ];
        let findings = told(&both);
        assert_eq!(findings.verdict, Verdict::Named, "{:?}", findings.findings);
        for (name, parameter, truth) in
            [("unequal_wheel_radii", "ratio", RATIO), ("track_width_error", "relative", TRACK)]
        {
            let own = findings.findings.iter().find(|own| own.effect.as_deref() == Some(name));
            let own = own.expect(name);
            assert!(own.held_out.log_score_gain > 2.0 * own.held_out.log_score_gain_se, "{:?}", own.held_out);
            assert!(own.configuration.contains(name), "{}", own.configuration);
            let found = &own.parameters[parameter];
            let error = (found.ci95[1] - found.ci95[0]) / 3.92;
            scores.push(((found.value - truth) / error).powi(2));
            assert!((found.value - truth).abs() < 5.0 * WITHIN, "{name}: {found:?}");
        }
    }
    // Twenty values of which the intervals hold: the 99.9 % interval of chi-square with 20 degrees of freedom.
    let sum: f64 = scores.iter().sum();
    assert!((5.4..49.4).contains(&sum), "{sum} of {scores:?}");
}

#[test]
fn a_robot_without_errors_is_given_no_name_by_its_end_points() {
    let clean = |scenario: &mut Scenario| scenario.robots.values_mut().for_each(|own| own.effects.clear());
    for seed in 31..41 {
        let both = [
            recorded(COUNTER_CLOCKWISE, "one way", seed, clean),
            recorded(CLOCKWISE, "the other", seed + 100, clean),
        ];
        let findings = told(&both);
        assert!(findings.findings.is_empty(), "seed {seed}: {:?}", findings.findings);
    }
}

#[test]
fn what_a_gyro_names_is_not_named_and_corrected_a_second_time() {
    let gyro = |scenario: &mut Scenario| {
        for own in scenario.robots.values_mut() {
            own.gyro.rate_hz = 50.0;
        }
    };
    let both =
        [recorded(COUNTER_CLOCKWISE, "one way", 51, gyro), recorded(CLOCKWISE, "the other", 151, gyro)];
    let diagnosis = diagnose(&both, &DiagnoseOptions::default()).expect("recordings with nominal models");
    for nominal in diagnosis.corrected.values() {
        for own in nominal.robots.values() {
            let names: Vec<_> = own.effects.iter().map(|effect| effect.active.effect().name()).collect();
            assert!(names.contains(&"track_width_error"), "{names:?}");
            let mut once = names.clone();
            once.sort_unstable();
            once.dedup();
            assert_eq!(once.len(), names.len(), "{names:?}");
        }
    }
}

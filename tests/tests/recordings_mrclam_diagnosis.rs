//! The diagnosis of real robots (MRCLAM, Leung et al. 2011), whose commands were recorded and whose wheels were
//! not. `PLEIAD_RECORDINGS` names the folder that holds `mrclam/`;
//! `cargo test -p pleiad-tests --features recordings --test recordings_mrclam_diagnosis`.
//!
//! Figures are in `docs/benchmarks/mrclam-diagnosis.md`.

#![cfg(feature = "recordings")]
#![allow(clippy::expect_used, reason = "helpers of tests fail by panicking")]

use std::sync::OnceLock;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{Diagnosis, Estimate, Finding};
use pleiad_recording::Recording;
use pleiad_tests::mrclam::{
    CHANGES, CONTROLS, Direction, Of, agents_error_m, corrected, differences, directions, fitted_and_tested,
    mean_of, named, recording, refitted, shown, write_corrected,
};

/// Dataset 6 and dataset 2.
fn recordings() -> &'static [Recording; 2] {
    static RECORDINGS: OnceLock<[Recording; 2]> = OnceLock::new();
    RECORDINGS.get_or_init(|| [6, 2].map(recording))
}

/// Fitted on 6 and tested on 2, and the other way round.
fn diagnoses() -> &'static [Diagnosis; 2] {
    static DIAGNOSES: OnceLock<[Diagnosis; 2]> = OnceLock::new();
    DIAGNOSES.get_or_init(|| {
        let [six, two] = recordings();
        [fitted_and_tested(six, two), fitted_and_tested(two, six)]
    })
}

/// The finding of a robot that holds a parameter.
fn found<'a>(
    diagnosis: &'a Diagnosis,
    robot: RobotId,
    parameter: &str,
) -> Option<(&'a Finding, &'a Estimate)> {
    let mut own = diagnosis.findings.findings.iter().filter(|finding| finding.robots == [robot.0]);
    own.find_map(|finding| Some((finding, finding.parameters.get(parameter)?)))
}

fn half_width(estimate: &Estimate) -> f64 {
    0.5 * (estimate.ci95[1] - estimate.ci95[0])
}

#[test]
fn a_known_change_is_found_as_the_difference_that_it_makes() {
    let [six, _] = recordings();
    for own in CHANGES.iter().flat_map(|change| differences(six, change)) {
        let missed = (own.found() - own.injected).abs();
        // Both fits have the same noise: a difference is known better than either.
        let allowed =
            if own.injected == 0.0 { own.half_width } else { own.half_width.min(0.2 * own.injected.abs()) };
        assert!(
            missed < allowed,
            "{}, robot {}, {}: {:+.5} instead of {:+.5}, allowed +-{allowed:.5}",
            own.change,
            own.robot,
            own.parameter,
            own.found(),
            own.injected
        );
    }
}

#[test]
fn lag_and_delay_are_one_set_whose_total_agrees_between_the_datasets() {
    let [six, two] = diagnoses();
    let (mut on_six, mut on_two) = (0, 0);
    for robot in (1..=5).map(RobotId) {
        let totals = [six, two].map(|diagnosis| found(diagnosis, robot, "total_s"));
        for (count, total) in [&mut on_six, &mut on_two].into_iter().zip(&totals) {
            let Some((finding, total)) = total else { continue };
            *count += 1;
            for effect in ["actuator_lag", "command_delay"] {
                assert!(finding.support_set.iter().any(|own| own == effect), "{:?}", finding.support_set);
            }
            // An independent fit has 0.15 to 0.30 s.
            let [low, high] = total.ci95;
            assert!(low <= 0.30 && high >= 0.15, "robot {robot}: {} s, {low} to {high}", total.value);
        }
        if let [Some((_, six)), Some((_, two))] = totals {
            let apart = (six.value - two.value).abs();
            let allowed = half_width(six).hypot(half_width(two));
            assert!(apart < allowed, "robot {robot}: {} s and {} s, +-{allowed}", six.value, two.value);
        }
    }
    assert!(on_six >= 4 && on_two >= 4, "found on {on_six} and {on_two} of 5 robots");
}

#[test]
fn what_was_fitted_on_one_dataset_predicts_headings_of_the_other_a_tenth_better_than_refitted_scales() {
    let [six, two] = recordings();
    let mut all: Vec<Direction> = Vec::new();
    for (diagnosis, fit_on, test_on) in [(&diagnoses()[0], six, two), (&diagnoses()[1], two, six)] {
        all.extend(directions(test_on, &refitted(fit_on, test_on), &corrected(diagnosis, test_on), 5.0));
    }
    assert_eq!(all.len(), 10);
    let heading = mean_of(&all, Of::Heading);
    assert!(heading.mean >= 0.10 && heading.ci95[0] > 0.0, "{heading:?}");
    let position = mean_of(&all, Of::Position);
    assert!(position.mean >= 0.0, "{position:?}");
}

#[test]
fn commands_that_belong_to_another_time_claim_nothing_of_the_motion_and_name_nothing_new() {
    let known = shown(&diagnoses()[0]);
    let motion = ["actuator_lag", "command_delay", "actuator_gain", "turn_loss", "speed_saturation"];
    for (name, control) in CONTROLS {
        let [six, two] = recordings().clone().map(control);
        let diagnosis = fitted_and_tested(&six, &two);
        let claimed: Vec<_> =
            shown(&diagnosis).into_iter().filter(|(_, effect)| motion.contains(&effect.as_str())).collect();
        assert!(claimed.is_empty(), "{name}: {claimed:?}");
        let new: Vec<_> = named(&diagnosis).difference(&known).cloned().collect();
        assert!(new.is_empty(), "{name}: {new:?}");
    }
}

#[test]
fn agents_that_load_the_corrected_model_err_less_on_the_dataset_that_it_was_not_fitted_on() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let model = folder.path().join("corrected.toml");
    for (diagnosis, test_on, number) in
        [(&diagnoses()[0], &recordings()[1], 2), (&diagnoses()[1], &recordings()[0], 6)]
    {
        write_corrected(diagnosis, test_on, &model);
        for landmarks in ["none", "known"] {
            let without = agents_error_m(number, landmarks, None);
            let with = agents_error_m(number, landmarks, Some(&model));
            assert!(
                with < without,
                "dataset {number}, landmarks {landmarks}: {without} m, corrected {with} m"
            );
        }
    }
}

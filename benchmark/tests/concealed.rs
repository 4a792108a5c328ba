//! What is found of effects that hide, on cases of the benchmark.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use pleiad_benchmark::{Asked, plans};
use pleiad_mismatch::{DiagnoseOptions, Finding, Verdict, diagnose};
use pleiad_sim_peers::simulate;

/// The findings of a case, with what was injected by parameter of its first effect.
fn found(id: &str) -> (Vec<Finding>, Vec<(String, f64)>) {
    let class: Asked = id.split('/').next().unwrap().parse().unwrap();
    let seed = id.rsplit('/').next().unwrap().parse().unwrap();
    let plan = plans(&[class], seed, 1).into_iter().find(|plan| plan.id == id).expect("a case");
    let case = plan.build().unwrap();
    let run = simulate(&case.scenario, case.seed).unwrap();
    let options = DiagnoseOptions { leave_out: case.left_out.clone(), ..DiagnoseOptions::default() };
    let findings = diagnose(&[run.recording], &options).unwrap().findings.findings;
    let injected = case.answer.injected[0].parameters.iter().map(|(name, value)| (name.clone(), *value));
    (findings, injected.collect())
}

fn names(findings: &[Finding]) -> Vec<(&str, Verdict)> {
    let mut names: Vec<_> =
        findings.iter().map(|own| (own.effect.as_deref().unwrap_or("none"), own.verdict)).collect();
    names.sort_by_key(|(name, _)| *name);
    names
}

#[test]
fn two_effects_that_hide_each_other_are_both_named_and_nothing_else() {
    let (findings, _) = found("absorbed/reverse_asymmetry/white/9000");
    let both = ["reverse_asymmetry", "wheel_radius_error"].map(|name| (name, Verdict::Named));
    assert_eq!(names(&findings), both);
}

#[test]
fn a_place_where_a_robot_was_for_seconds_is_found_where_it_is() {
    let (findings, injected) = found("rare/gps_multipath_patch/white/9000");
    assert_eq!(names(&findings), [("gps_multipath_patch", Verdict::Named)]);
    for (name, value) in injected.iter().filter(|(name, _)| name.starts_with("offset")) {
        let own = &findings[0].parameters[name];
        assert!((own.value - value).abs() < 0.05, "{name}: {} and not {value}", own.value);
    }
}

#[test]
fn circles_at_one_speed_do_not_tell_a_track_from_a_ratio_of_wheels() {
    for name in ["track_width_error", "unequal_wheel_radii"] {
        let (findings, _) = found(&format!("unidentifiable/{name}/white/9000"));
        let [only] = findings.as_slice() else { panic!("{:?}", names(&findings)) };
        assert_eq!(only.verdict, Verdict::CannotTell, "{name}");
        for member in ["track_width_error", "unequal_wheel_radii"] {
            assert!(only.support_set.iter().any(|own| own == member), "{name}: {:?}", only.support_set);
        }
    }
}

#[test]
fn a_phase_at_the_end_of_its_period_is_found() {
    // 1.536 rad of a period that ends at 1.571.
    let (findings, injected) = found("single/compass_soft_iron/x1/white/800");
    assert_eq!(names(&findings), [("compass_soft_iron", Verdict::Named)]);
    for (name, value) in &injected {
        let own = &findings[0].parameters[name];
        assert!((own.value - value).abs() < 0.1 * value.abs(), "{name}: {} and not {value}", own.value);
    }
}

#[test]
fn what_acts_in_a_few_blocks_of_time_is_named() {
    for name in ["motor_deadband", "stiction"] {
        let (findings, _) = found(&format!("single/{name}/x1/white/9200"));
        assert_eq!(names(&findings), [(name, Verdict::Named)]);
    }
}

#[test]
fn a_name_that_leaves_far_more_than_the_other_robots_have_left_is_doubted() {
    // A castor, which the catalogue is made to lack: a push explains a tenth of it.
    let (findings, _) = found("out_of_catalogue/castor_friction/white/9200");
    assert_eq!(names(&findings), [("push", Verdict::CannotTell)]);
    assert!(findings[0].support_set.contains(&"something else in body".to_owned()), "{findings:?}");
}

#[test]
fn an_effect_of_spread_that_is_left_out_is_not_named() {
    for name in ["heavy_tails", "encoder_coarse"] {
        let (findings, _) = found(&format!("out_of_catalogue/{name}/white/9200"));
        assert!(findings.iter().all(|own| own.effect.as_deref() != Some(name)), "{:?}", names(&findings));
        let (findings, _) = found(&format!("single/{name}/x1/white/9200"));
        assert_eq!(names(&findings), [(name, Verdict::Named)]);
    }
}

#[test]
fn a_parameter_that_would_have_to_differ_over_time_or_targets_is_no_name() {
    // A clock that drifts is an offset on average, a landmark in the wrong place a scale of all ranges.
    for (left_out, seed, name, verdict) in [
        ("clock_drift", 9600, "clock_offset", Verdict::BadData),
        ("landmark_survey_error", 70, "range_scale", Verdict::Named),
    ] {
        let (findings, _) = found(&format!("out_of_catalogue/{left_out}/white/{seed}"));
        let claimed = [Verdict::Named, Verdict::BadData];
        assert!(
            findings.iter().all(|own| !claimed.contains(&own.verdict)),
            "{left_out}: {:?}",
            names(&findings)
        );
        let (findings, _) = found(&format!("single/{name}/x1/white/{seed}"));
        assert_eq!(names(&findings), [(name, verdict)]);
    }
}

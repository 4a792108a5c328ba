//! What is said of an effect whose entry is left out of the catalogue.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use pleiad_mismatch::{DiagnoseOptions, Finding, Findings, Verdict, diagnose};
use pleiad_physics::Effect;
use pleiad_sim_peers::simulate;
use pleiad_tests::known_effects::{Case, ROBOT, cases_named};

/// Gravity, m/s^2, and what `scenarios/manoeuvres.toml` and the catalogue's typical sizes hold.
const GRAVITY_M_S2: f64 = 9.806_65;
const SERVO_S: f64 = 0.06;
/// Half a 95 % interval is so many standard errors.
const Z_95: f64 = 1.96;

fn case(effect: &str) -> Case {
    let mut cases = cases_named(effect).unwrap_or_else(|error| panic!("{error}"));
    cases.swap_remove(0)
}

/// What is found with the effect in the recording and not in the catalogue, nor others.
fn told(case: &Case, others: &[Effect], seed: u64) -> Findings {
    let run = simulate(&case.scenario, seed).expect("a scenario that is valid");
    let without = [&[case.effect], others].concat();
    let options = DiagnoseOptions { leave_out: without, ..DiagnoseOptions::default() };
    diagnose(&[run.recording], &options).unwrap_or_else(|error| panic!("{error}")).findings
}

/// Checks that a form of a robot with this unit is found, and its coefficient within three standard errors.
fn check(findings: &Findings, robot: u32, expression: &str, units: &str, expected: f64) {
    let own = |own: &&Finding| own.robots == [robot] && own.expression.as_deref() == Some(expression);
    let all: Vec<_> =
        findings.findings.iter().map(|own| (&own.effect, &own.expression, &own.robots)).collect();
    let found = findings.findings.iter().find(own).unwrap_or_else(|| panic!("no {expression}: {all:?}"));
    assert_eq!(found.verdict, Verdict::Form);
    assert_eq!(found.expression_units.as_deref(), Some(units));
    let c = &found.parameters["c"];
    let error = (c.ci95[1] - c.ci95[0]) / (2.0 * Z_95);
    assert!((c.value - expected).abs() < 3.0 * error, "{expression}: {} +- {error}, not {expected}", c.value);
    assert!(error < 0.1 * expected.abs(), "{expression}: {} +- {error} is hardly known", c.value);
}

/// Nothing besides so many forms.
fn check_only(findings: &Findings, forms: usize) {
    let verdicts: Vec<_> =
        findings.findings.iter().map(|own| (own.verdict, &own.effect, &own.expression)).collect();
    assert_eq!(verdicts.len(), forms, "{verdicts:?}");
    assert_eq!(findings.verdict, Verdict::Form);
}

/// Effect, form, unit and coefficient; of the equations in `docs/effects.md` at typical sizes.
const SINGLE: [(&str, &str, &str, f64); 4] = [
    ("lateral_skid", "left velocity += c v w", "s", -0.03),
    ("quadratic_drag", "driven speed += c v |v|", "s/m", -0.03),
    ("gyro_bias", "gyro reading += c", "rad/s", 0.003),
    ("range_scale", "range reading += c r", "1", 0.02),
];

#[test]
fn an_effect_without_a_name_is_told_by_its_form_its_unit_and_its_size() {
    for (effect, expression, units, expected) in SINGLE {
        let findings = told(&case(effect), &[], 301);
        check(&findings, ROBOT.0, expression, units, expected);
        check_only(&findings, 1);
    }
}

#[test]
fn a_slope_without_a_name_is_a_drive_that_depends_on_the_heading_alike_on_every_robot() {
    let case = case("floor_tilt");
    let findings = told(&case, &[Effect::WorldForce], 302);
    let droop_m_s = SERVO_S * GRAVITY_M_S2 * case.values[0].sin();
    for robot in 1..=3 {
        check(&findings, robot, "driven speed += c cos(heading)", "m/s", droop_m_s * case.values[1].cos());
        check(&findings, robot, "driven speed += c sin(heading)", "m/s", droop_m_s * case.values[1].sin());
    }
    check_only(&findings, 6);
}

#[test]
fn what_no_product_describes_is_unnameable_where_it_is_and_gets_no_wrong_name() {
    for effect in ["speed_saturation", "motor_deadband"] {
        let findings = told(&case(effect), &[], 303);
        let named = |own: &&Finding| matches!(own.verdict, Verdict::Named | Verdict::BadData);
        let names: Vec<_> = findings.findings.iter().filter(named).map(|own| &own.effect).collect();
        assert!(names.is_empty(), "{effect}: {names:?}");
        let right = |own: &&Finding| {
            own.verdict == Verdict::Unnameable
                && own.robots == [ROBOT.0]
                && own.channel == "actuator"
                && own.expression.as_deref() == Some("driven speed += f(v)")
        };
        let found = findings.findings.iter().find(right);
        let shape =
            found.and_then(|own| own.shape.as_ref()).unwrap_or_else(|| panic!("{effect}: {findings:?}"));
        assert!(shape.knots.len() >= 4 && shape.knots.len() == shape.values.len());
        assert!(shape.residual_share.ci95[0] > 0.0, "{:?}", shape.residual_share);
    }
}

#[test]
fn without_any_effect_there_is_no_form() {
    let mut scenario = case("lateral_skid").scenario;
    scenario.robots.values_mut().for_each(|own| own.effects.clear());
    let run = simulate(&scenario, 304).expect("a scenario that is valid");
    let found =
        diagnose(&[run.recording], &DiagnoseOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(found.findings.verdict, Verdict::NothingMissing, "{:?}", found.findings.findings);
}

//! What holds for every effect of the catalogue.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]
#![allow(clippy::float_cmp, reason = "what nothing acts on is equal to the bit")]

use std::collections::BTreeSet;

use pleiad_physics::{
    ActiveEffect, Channel, Drive, Dual, Effect, Fit, MAX_PARAMETERS, Nominal, NominalParameter, Parameter,
    PhysicsError, RobotModel, Scope, Stage, Variable,
};

mod common;
use common::{Named, nominal, of_both_drives};

fn robot() -> RobotModel<f64> {
    RobotModel::nominal(Drive::Differential, nominal())
}

fn with_values(effect: Effect, values: &[f64]) -> RobotModel<f64> {
    robot().with(ActiveEffect::new(effect, values).unwrap())
}

/// The greatest difference of two runs, and where.
fn difference(first: &[Named<f64>], second: &[Named<f64>]) -> (f64, String) {
    assert_eq!(first.len(), second.len());
    let pairs = first.iter().zip(second);
    let gaps = pairs.map(|((name, a), (_, b))| (if a == b { 0.0 } else { (a - b).abs() }, name.clone()));
    gaps.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

#[test]
fn an_effect_that_is_off_changes_nothing() {
    let plain = of_both_drives(&robot());
    for &effect in Effect::ALL {
        let off = of_both_drives(&robot().with(ActiveEffect::off(effect)));
        let (gap, place) = difference(&plain, &off);
        assert!(gap < 1e-13, "{}: {gap} in {place}", effect.name());
    }
}

#[test]
fn every_effect_changes_a_prediction() {
    let plain = of_both_drives(&robot());
    for &effect in Effect::ALL {
        let (gap, place) =
            difference(&plain, &of_both_drives(&with_values(effect, &effect.typical_values())));
        assert!(gap > 5e-5, "{} changes nothing: {gap} in {place}", effect.name());
    }
}

#[test]
fn an_effect_acts_only_within_its_scope() {
    let plain = of_both_drives(&robot());
    for &effect in Effect::ALL {
        let never = Scope { window_s: Some((1e6, 2e6)), region: None };
        let values = effect.typical_values();
        let model = robot().with(ActiveEffect::new(effect, &values).unwrap().within(never));
        assert!(difference(&plain, &of_both_drives(&model)).0 == 0.0, "{}", effect.name());
    }
}

/// Compares the derivatives of every prediction with differences at `values[parameter] +- h` (or, where
/// `below` is not allowed, forward differences). The tolerance covers truncation and rounding at this step.
fn check_derivative(effect: Effect, values: &[f64], parameter: usize, below: bool) {
    let h = 1e-6 * values[parameter].abs().max(0.1);
    let at = |offset: f64| {
        let mut moved = values.to_vec();
        moved[parameter] += offset;
        of_both_drives(&with_values(effect, &moved))
    };
    let (upper, lower, width) = if below { (at(h), at(-h), 2.0 * h) } else { (at(h), at(0.0), h) };
    let variable = Variable::Effect { index: 0, parameter };
    let exact = of_both_drives::<Dual<1>>(&with_values(effect, values).differentiated(&[variable]));
    let label = effect.info().parameters[parameter].label();
    for ((name, derivative), (upper, lower)) in exact.iter().zip(upper.iter().zip(&lower)) {
        let derivative = derivative.derivatives()[0];
        let numeric = if upper.1 == lower.1 { 0.0 } else { (upper.1 - lower.1) / width };
        let tolerance = 2e-5 * (1.0 + numeric.abs());
        let gap = (derivative - numeric).abs();
        assert!(gap < tolerance, "{} {label}, {name}: {derivative} against {numeric}", effect.name());
    }
}

#[test]
fn derivatives_match_central_differences_at_typical_values() {
    for &effect in Effect::ALL {
        for (index, parameter) in effect.info().parameters.iter().enumerate() {
            if parameter.fit != Fit::Choice {
                check_derivative(effect, &effect.typical_values(), index, true);
            }
        }
    }
}

#[test]
fn derivatives_match_differences_where_an_effect_is_off() {
    for &effect in Effect::ALL {
        let parameters = effect.info().parameters;
        let off: Vec<_> = parameters.iter().map(|parameter| parameter.off).collect();
        for (index, parameter) in parameters.iter().enumerate() {
            if parameter.fit == Fit::Smooth {
                check_derivative(effect, &off, index, parameter.plausible.0 < parameter.off);
            }
        }
    }
}

#[test]
fn derivatives_in_nominal_parameters_match_central_differences() {
    for &parameter in NominalParameter::ALL {
        let h = 1e-6;
        let at = |offset: f64| {
            let mut model = robot();
            model.nominal.set(parameter, model.nominal.get(parameter) + offset);
            of_both_drives(&model)
        };
        let exact = of_both_drives(&robot().differentiated(&[Variable::Nominal(parameter)]));
        let (upper, lower) = (at(h), at(-h));
        let mut moved =
            parameter == NominalParameter::GpsSigma || parameter == NominalParameter::HeadingSigma;
        for ((name, derivative), (upper, lower)) in exact.iter().zip(upper.iter().zip(&lower)) {
            let derivative = derivative.derivatives()[0];
            let numeric = (upper.1 - lower.1) / (2.0 * h);
            moved |= numeric.abs() > 1e-7;
            let gap = (derivative - numeric).abs();
            let tolerance = 2e-5 * (1.0 + numeric.abs());
            assert!(gap < tolerance, "{}, {name}: {derivative} against {numeric}", parameter.name());
        }
        assert!(moved, "{} moves nothing", parameter.name());
    }
}

#[test]
fn entries_are_complete_and_in_order() {
    let mut names = BTreeSet::new();
    let mut number = 0;
    for &effect in Effect::ALL {
        let info = effect.info();
        assert!(names.insert(info.name), "{} twice", info.name);
        assert!(info.number == number || info.number == number + 1, "{} out of order", info.name);
        number = info.number;
        assert_eq!(Effect::from_name(info.name), Some(effect));
        assert!((1..=MAX_PARAMETERS).contains(&info.parameters.len()), "{}", info.name);
        assert!(!info.channels.is_empty(), "{}", info.name);
        let texts = [info.summary, info.equation, info.confounded_with, info.broken_by];
        assert!(texts.iter().all(|text| !text.is_empty()), "{}", info.name);
        let labels: BTreeSet<_> = info.parameters.iter().map(Parameter::label).collect();
        assert_eq!(labels.len(), info.parameters.len(), "{}", info.name);
        if info.stage == Stage::Actuator {
            assert!(info.channels.contains(&Channel::Command), "{}", info.name);
        }
    }
    assert_eq!(number, 58, "the last entry of the catalogue");
    assert_eq!(Effect::from_name("gravity_waves"), None);
}

#[test]
fn a_model_refuses_values_it_cannot_take() {
    let count = ActiveEffect::new(Effect::GyroBias, &[0.1, 0.2]).unwrap_err();
    assert_eq!(count, PhysicsError::ValueCount { effect: "gyro_bias", expected: 1, found: 2 });
    let number = ActiveEffect::new(Effect::GyroBias, &[f64::NAN]).unwrap_err();
    assert!(number.to_string().contains("`bias_rad_s` is NaN"), "{number}");
    let label = ActiveEffect::<f64>::off(Effect::GpsLeverArm).set("offset", 1.0).unwrap_err();
    assert!(label.to_string().contains("offset_body_m.forward, offset_body_m.left"), "{label}");
    let mut lever = ActiveEffect::off(Effect::GpsLeverArm);
    lever.set("offset_body_m.left", 0.5).unwrap();
    assert_eq!(lever.values(), [0.0, 0.5]);
}

#[test]
fn a_variable_of_no_active_effect_has_no_derivative() {
    let variables = [Variable::Effect { index: 3, parameter: 0 }];
    let model =
        RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3)).differentiated(&variables);
    assert!(of_both_drives(&model).iter().all(|(_, value)| value.derivatives() == &[0.0]));
}

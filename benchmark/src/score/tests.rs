use std::collections::BTreeMap;

use pleiad_mismatch::HeldOut;

use super::*;
use crate::class::{Class, Noise};

fn injected(effect: &str, robots: &[u32], parameters: &[(&str, f64)]) -> Injected {
    Injected {
        effect: effect.to_owned(),
        robots: robots.to_vec(),
        parameters: parameters.iter().map(|(label, value)| ((*label).to_owned(), *value)).collect(),
        time_s: None,
        region_m: None,
    }
}

fn answer(injected: Vec<Injected>) -> Answer {
    let (class, noise) = (Class::Single, Noise::White);
    Answer {
        id: "a".to_owned(),
        class,
        noise,
        size: Some(1.0),
        recording_sha256: String::new(),
        injected,
        left_out: Vec::new(),
    }
}

fn finding(set: &[&str], robots: &[u32], parameters: &[(&str, f64, [f64; 2])]) -> Finding {
    let stage =
        set.first().and_then(|name| Effect::from_name(name)).map_or("", |own| own.info().stage.name());
    let estimate = |(label, value, ci95): &(&str, f64, [f64; 2])| {
        ((*label).to_owned(), Estimate { value: *value, unit: "1".to_owned(), ci95: *ci95 })
    };
    Finding {
        verdict: if set.len() == 1 { Verdict::Named } else { Verdict::CannotTell },
        robots: robots.to_vec(),
        stage: stage.to_owned(),
        channel: "body".to_owned(),
        effect: set.first().map(|name| (*name).to_owned()),
        expression: None,
        expression_units: None,
        support_set: set.iter().map(|name| (*name).to_owned()).collect(),
        parameters: parameters.iter().map(estimate).collect::<BTreeMap<_, _>>(),
        place: Place::default(),
        p_familywise: 1e-9,
        held_out: HeldOut { log_score_gain: 50.0, log_score_gain_se: 5.0, rollout_rmse: Vec::new() },
        shape: None,
        manoeuvre: None,
        summary: String::new(),
        equation: None,
        configuration: String::new(),
    }
}

fn scored(answer: &Answer, all: Vec<Finding>) -> Scored {
    let findings = Findings {
        verdict: if all.is_empty() { Verdict::NothingMissing } else { Verdict::Named },
        recordings: Vec::new(),
        fit_on: Vec::new(),
        test_on: Vec::new(),
        findings: all,
        undetected: Vec::new(),
        untestable: Vec::new(),
        roll_outs: Vec::new(),
        notes: Vec::new(),
    };
    score(answer, &findings, 1.0)
}

#[test]
fn a_perfect_finder_has_everything_and_nothing_more() {
    let two = answer(vec![
        injected("crab", &[2], &[("rad", 0.01)]),
        injected("range_bias", &[2], &[("bias_m", -0.05)]),
    ]);
    // In another order than the answer.
    let bias = finding(&["range_bias"], &[2], &[("bias_m", -0.0505, [-0.052, -0.049])]);
    let crab = finding(&["crab"], &[2], &[("rad", 0.0103, [0.0101, 0.0105])]);
    let said = scored(&two, vec![bias, crab]);
    assert!(said.matches.iter().all(|own| own.top1 && own.top3 && own.in_set && own.localized));
    assert_eq!((said.matches[0].set_size, said.extra.len(), said.nameless.len()), (Some(1), 0, 0));
    let [crab, bias] = [0, 1].map(|index| &said.matches[index].parameters[0]);
    assert_eq!((crab.covered, bias.covered), (Some(false), Some(true)));
    assert!((bias.value + 0.0505).abs() < 1e-15 && (said.evidence - 9.0).abs() < 1e-9);
    assert!((said.gain_z - 10.0).abs() < 1e-12);
}

#[test]
fn an_empty_finder_has_nothing() {
    let said = scored(&answer(vec![injected("crab", &[2], &[("rad", 0.01)])]), Vec::new());
    let own = &said.matches[0];
    assert!(!(own.top1 || own.top3 || own.in_set || own.localized) && own.set_size.is_none());
    assert!(said.extra.is_empty() && said.evidence.abs() < f64::MIN_POSITIVE);
}

#[test]
fn names_too_many_are_counted_and_each_finding_answers_once() {
    let one = answer(vec![injected("crab", &[2], &[("rad", 0.01)])]);
    let again = || finding(&["crab"], &[2], &[]);
    let said = scored(&one, vec![again(), again(), finding(&["push"], &[1], &[])]);
    assert!(said.matches[0].top1);
    assert_eq!(said.extra, ["named crab on [2]", "named push on [1]"]);
}

#[test]
fn a_name_on_another_robot_is_wrong() {
    let said = scored(&answer(vec![injected("crab", &[2], &[])]), vec![finding(&["crab"], &[1], &[])]);
    assert!(!said.matches[0].top1 && !said.matches[0].localized && said.extra.len() == 1);
}

#[test]
fn a_set_holds_the_truth_or_not_and_one_of_four_holds_nothing() {
    let one = answer(vec![injected("crab", &[2], &[("rad", 0.01)])]);
    let of = |set: &[&str]| scored(&one, vec![finding(set, &[2], &[])]);
    let with = of(&["lateral_skid", "crab"]);
    assert!(!with.matches[0].top1 && with.matches[0].top3 && with.matches[0].in_set);
    assert_eq!((with.matches[0].set_size, with.extra.len()), (Some(2), 0));
    let without = of(&["lateral_skid", "icr_offset"]);
    assert!(!without.matches[0].in_set && without.extra.len() == 1);
    let large = of(&["lateral_skid", "icr_offset", "crab", "turn_loss"]);
    assert!(!large.matches[0].in_set && large.extra.len() == 1);
}

#[test]
fn the_right_name_goes_before_a_set_that_holds_it_too() {
    let one = answer(vec![injected("crab", &[2], &[])]);
    let set = finding(&["lateral_skid", "crab"], &[2], &[]);
    let said = scored(&one, vec![set, finding(&["crab"], &[2], &[])]);
    assert!(said.matches[0].top1);
    assert_eq!(said.extra, ["cannot_tell lateral_skid / crab on [2]"]);
}

#[test]
fn directions_are_compared_the_short_way_round() {
    let tilt = injected("floor_tilt", &[1], &[("slope_rad", 0.03), ("downhill_azimuth_rad", 3.1)]);
    let of = |label: &str| match label {
        "slope_rad" => Some((0.031, None)),
        _ => Some((-3.1, Some([-3.2, -3.05]))),
    };
    let own = parameters(&tilt, &of);
    assert!((own[1].value - (2.0 * PI - 3.1)).abs() < 1e-12 && own[1].covered == Some(true));
    assert_eq!(own[0].covered, None);
}

#[test]
fn overlap_is_intersection_over_union() {
    // A square of 1 m and the same moved by half of it: 1/2 over 3/2.
    let moved = of_rectangles([0.0, 1.0, 0.0, 1.0], [0.5, 1.5, 0.0, 1.0]);
    assert!((moved - 1.0 / 3.0).abs() < 1e-12);
    assert!(of_rectangles([0.0, 1.0, 0.0, 1.0], [2.0, 3.0, 0.0, 1.0]).abs() < 1e-15);
    let mut passing = injected("crab", &[2], &[]);
    passing.time_s = Some([10.0, 15.0]);
    let mut found = finding(&["crab"], &[2], &[]);
    found.place.time = vec![[11.0, 14.0], [20.0, 21.0]];
    // 3 s of both, 5 + 4 - 3 of either.
    let own = one(&passing, Some(&found), std::slice::from_ref(&found)).overlap.unwrap();
    assert!((own - 0.5).abs() < 1e-12);
}

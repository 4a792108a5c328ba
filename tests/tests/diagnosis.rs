//! Planted effects: what the simulator puts into a recording, the diagnosis names, on the robot it was put
//! on and nowhere else; and on a clean recording it names nothing.
//!
//! The two share the effects' equations; the simulator integrates in steps of 2 ms, looks up what is late in
//! the true path and samples by wrong clocks, and the diagnosis has nothing but the recording. Sizes are the
//! typical ones of the catalogue, fixed before any result was looked at.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{DiagnoseOptions, Finding, Findings, Verdict, diagnose};
use pleiad_physics::{ActiveEffect, Effect, Fit, Parameter};
use pleiad_recording::Recording;
use pleiad_sim_peers::{Scenario, simulate};

/// Long enough for about half of the manoeuvres.
const DURATION_S: f64 = 120.0;
const SEED: u64 = 5;
/// How many half widths of its 95 % interval an estimate may be off: more is 1 in 10 000 by chance.
const HALF_WIDTHS: f64 = 2.0;
/// What is searched on a grid and has no interval may be off by so much: an onset, seconds; a place, metres.
const ONSET_S: f64 = 0.5;
const PLACE_M: f64 = 0.1;
/// A support set that is larger says nothing.
const LARGEST_SET: usize = 3;

/// An effect that is put on robots.
struct Planted {
    effect: Effect,
    robots: &'static [u32],
    values: Vec<f64>,
}

/// An effect at its typical size.
fn typical(effect: Effect, robots: &'static [u32]) -> Planted {
    Planted { effect, robots, values: effect.typical_values() }
}

fn sized(effect: Effect, robots: &'static [u32], values: &[f64]) -> Planted {
    Planted { effect, robots, values: values.to_vec() }
}

/// Robots 1 and 2 of a ready scenario, each in its own half of the arena.
fn recorded(name: &str, planted: &[Planted]) -> Recording {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    let mut scenario = Scenario::load(&folder.join(format!("{name}.toml"))).unwrap();
    scenario.duration_s = DURATION_S;
    scenario.arena.width_m = 8.0;
    scenario.robots.remove(&RobotId(3));
    for one in planted {
        let effect = ActiveEffect::new(one.effect, &one.values).unwrap();
        for &robot in one.robots {
            scenario.robots.get_mut(&RobotId(robot)).unwrap().effects.push(effect);
        }
    }
    simulate(&scenario, SEED).unwrap().recording
}

fn found(recording: Recording) -> Findings {
    diagnose(&[recording], &DiagnoseOptions::default()).unwrap().findings
}

/// Diagnoses each recording and says everything that is wrong with any of them.
fn check(scenario: &str, recordings: &[&[Planted]]) {
    let wrong = |planted: &&[Planted]| complaints(planted, &found(recorded(scenario, planted)));
    let wrong: Vec<String> = recordings.iter().flat_map(wrong).collect();
    assert_eq!(wrong, Vec::<String>::new());
}

fn complaints(planted: &[Planted], findings: &Findings) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut extra: Vec<&Finding> = findings.findings.iter().collect();
    for one in planted {
        let name = one.effect.name();
        let explains = |finding: &&Finding| {
            finding.support_set.iter().any(|member| member == name) && finding.robots == one.robots
        };
        match extra.iter().position(explains) {
            Some(position) => wrong.extend(about(one, extra.remove(position))),
            None => wrong.push(format!("{name} is not found on {:?}", one.robots)),
        }
    }
    let names: Vec<&str> = planted.iter().map(|one| one.effect.name()).collect();
    wrong.extend(extra.iter().map(|finding| format!("beside {names:?}: {}", told(finding))));
    wrong
}

/// What is wrong with the finding of a planted effect.
fn about(planted: &Planted, finding: &Finding) -> Vec<String> {
    let info = planted.effect.info();
    let mut wrong = Vec::new();
    let verdict = match finding.support_set.len() {
        1 if info.bad_data => Verdict::BadData,
        1 => Verdict::Named,
        _ => Verdict::CannotTell,
    };
    if finding.verdict != verdict || finding.support_set.len() > LARGEST_SET {
        wrong.push(format!("{}: {:?}, {}", info.name, finding.verdict, told(finding)));
    }
    if finding.effect.as_deref() != Some(info.name) {
        return wrong;
    }
    if finding.stage != info.stage.name() {
        wrong.push(format!("{}: stage {}", info.name, finding.stage));
    }
    for (parameter, &truth) in info.parameters.iter().zip(&planted.values) {
        let label = parameter.label();
        let off = match finding.parameters.get(&label) {
            Some(estimate) => {
                let half_width = 0.5 * (estimate.ci95[1] - estimate.ci95[0]);
                (estimate.value - truth).abs() > tolerance(parameter, half_width)
            }
            None => (truth - parameter.off).abs() > 0.0,
        };
        if off {
            wrong.push(format!("{}: {label} is not {truth}: {}", info.name, told(finding)));
        }
    }
    wrong
}

fn tolerance(parameter: &Parameter, half_width: f64) -> f64 {
    match (parameter.fit, parameter.name) {
        (Fit::Grid, "t_on_s") => ONSET_S,
        (Fit::Grid, "region_m") => PLACE_M,
        _ => HALF_WIDTHS * half_width,
    }
}

fn told(finding: &Finding) -> String {
    let one = |(label, own): (&String, &pleiad_mismatch::Estimate)| {
        format!("{label} = {:.5} [{:.5}, {:.5}]", own.value, own.ci95[0], own.ci95[1])
    };
    let values: Vec<String> = finding.parameters.iter().map(one).collect();
    format!("{:?} on {:?}, {}", finding.support_set, finding.robots, values.join(", "))
}

#[test]
fn the_first_ten_effects_are_named_one_on_each_robot() {
    check(
        "manoeuvres",
        &[
            &[typical(Effect::UnequalWheelRadii, &[1]), typical(Effect::TrackWidthError, &[2])],
            &[typical(Effect::WheelRadiusError, &[1]), typical(Effect::ActuatorLag, &[2])],
            &[typical(Effect::CommandDelay, &[1]), typical(Effect::GpsLeverArm, &[2])],
            &[typical(Effect::ClockOffset, &[1]), typical(Effect::GyroBias, &[2])],
            &[typical(Effect::SensorLeverArm, &[1]), typical(Effect::SensorYawMisalignment, &[2])],
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "open: not every one is named yet; run with --features slow")]
fn effects_of_every_stage_are_named_one_on_each_robot() {
    check(
        "manoeuvres",
        &[
            &[typical(Effect::LateralSkid, &[1]), typical(Effect::SpeedSaturation, &[2])],
            &[typical(Effect::LongitudinalSlip, &[1]), typical(Effect::RangeBias, &[2])],
            &[sized(Effect::MotorDeadband, &[1], &[0.0, 0.5]), typical(Effect::CameraLatency, &[2])],
            &[typical(Effect::GyroScale, &[1]), typical(Effect::CompassHardIron, &[2])],
            &[sized(Effect::PayloadAdded, &[1], &[60.313, -0.005, 0.02]), typical(Effect::GpsLatency, &[2])],
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "open: not every one is named yet; run with --features slow")]
fn what_every_robot_shares_is_one_finding() {
    // The place is in the half of robot 1.
    let patch = [-2.5, -1.5, -0.5, 0.5, 0.05, 0.1];
    check(
        "manoeuvres",
        &[
            &[typical(Effect::FloorTilt, &[1, 2])],
            &[typical(Effect::TruthLatency, &[1, 2])],
            &[sized(Effect::LowFrictionPatch, &[1, 2], &patch)],
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "open: not every one is named yet; run with --features slow")]
fn two_effects_on_one_robot_are_told_apart() {
    check(
        "manoeuvres",
        &[
            &[typical(Effect::LateralSkid, &[1]), typical(Effect::CameraLatency, &[1])],
            &[
                sized(Effect::UnequalWheelRadii, &[2], &[0.01]),
                sized(Effect::TrackWidthError, &[2], &[-0.04]),
            ],
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "open: not every one is named yet; run with --features slow")]
fn a_skid_steered_robot_turns_by_an_effective_track() {
    check("manoeuvres_skid_steer", &[&[typical(Effect::TrackWidthError, &[1])]]);
}

#[test]
fn nothing_is_named_in_a_clean_recording() {
    for scenario in ["manoeuvres", "manoeuvres_skid_steer"] {
        let findings = found(recorded(scenario, &[]));
        assert_eq!((findings.verdict, findings.findings.len()), (Verdict::NothingMissing, 0), "{scenario}");
        // What was tested is said: it is no verdict of a tool that did not look.
        assert!(findings.undetected.len() > 100, "{scenario}: {}", findings.undetected.len());
    }
}

//! Effects of spread and chance, planted in simulated robots at their typical size, as the diagnosis finds them.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{DiagnoseOptions, Finding, Findings, Verdict, diagnose};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_sim_peers::{Scenario, simulate};

/// Three robots through manoeuvres with every sensor.
const SCENARIO: &str = include_str!("../../scenarios/manoeuvres.toml");
/// Half widths of 95 % intervals: about three standard errors, so that of some thirty values none is outside.
const WIDER: f64 = 1.6;

/// Diagnoses the scenario with these effects at their typical sizes.
fn findings(effects: &[(u32, Effect)], seed: u64, duration_s: f64) -> Findings {
    let mut scenario = Scenario::from_toml(SCENARIO, "manoeuvres.toml").unwrap();
    scenario.duration_s = duration_s;
    for (robot, effect) in effects {
        let active = ActiveEffect::new(*effect, &effect.typical_values()).unwrap();
        scenario.robots.get_mut(&RobotId(*robot)).unwrap().effects.push(active);
    }
    let run = simulate(&scenario, seed).unwrap();
    diagnose(&[run.recording], &DiagnoseOptions::default()).unwrap().findings
}

/// Checks that these effects are found, each on its robot and at its size, and nothing else.
fn found(effects: &[(u32, Effect)], seed: u64, duration_s: f64) {
    let findings = findings(effects, seed, duration_s);
    let names = |own: &Finding| (own.robots.clone(), own.support_set.clone());
    let named: BTreeSet<_> = findings.findings.iter().map(names).collect();
    let planted: BTreeSet<_> =
        effects.iter().map(|(robot, effect)| (vec![*robot], vec![effect.name().to_owned()])).collect();
    assert_eq!(named, planted, "seed {seed}");
    for (_, effect) in effects {
        let own = findings.findings.iter().find(|own| own.effect.as_deref() == Some(effect.name())).unwrap();
        let verdict = if effect.info().bad_data { Verdict::BadData } else { Verdict::Named };
        assert_eq!(own.verdict, verdict, "{}", effect.name());
        for (parameter, size) in effect.info().parameters.iter().zip(effect.typical_values()) {
            let estimate = &own.parameters[&parameter.label()];
            let [low, high] = estimate.ci95;
            let reach = WIDER * 0.5 * (high - low);
            assert!(
                (estimate.value - size).abs() <= reach,
                "seed {seed}, {} {}: {estimate:?} for {size}",
                effect.name(),
                parameter.label()
            );
        }
    }
}

#[test]
fn noise_that_grows_with_range_a_walking_gyro_and_late_commands_are_told_apart() {
    let effects = [(1, Effect::RangeDependentNoise), (2, Effect::GyroRandomWalk), (3, Effect::CommandJitter)];
    found(&effects, 101, 150.0);
}

#[test]
fn heavy_tails_blurred_bearings_and_lost_commands_are_told_apart() {
    found(&[(1, Effect::HeavyTails), (2, Effect::MotionBlur), (3, Effect::CommandLoss)], 102, 150.0);
}

#[test]
fn wrong_names_swapped_landmarks_and_misses_are_told_apart() {
    let effects =
        [(1, Effect::IdentityMixUp), (2, Effect::LandmarkIdentitySwap), (3, Effect::MissedDetections)];
    found(&effects, 103, 150.0);
}

#[test]
fn the_ticks_of_a_coarse_encoder_are_counted() {
    found(&[(2, Effect::EncoderCoarse)], 104, 150.0);
}

#[test]
fn two_spreads_of_one_sensor_are_both_found() {
    found(&[(2, Effect::MotionBlur), (2, Effect::MissedDetections), (2, Effect::HeavyTails)], 105, 150.0);
}

#[test]
fn nothing_is_named_where_noise_is_as_declared_and_sizes_that_would_have_been_found_are_given() {
    let findings = findings(&[], 106, 150.0);
    assert_eq!(findings.verdict, Verdict::NothingMissing, "{:?}", findings.findings);
    for (effect, parameter) in [
        ("range_dependent_noise", "s1"),
        ("motion_blur", "s"),
        ("heavy_tails", "degrees_of_freedom"),
        ("identity_mix_up", "probability"),
        ("missed_detections", "logit.range"),
        ("gyro_random_walk", "rad_s_sqrt_s"),
        ("command_jitter", "delay_s"),
        ("command_loss", "probability"),
    ] {
        let (_, info) = Effect::from_name(effect).unwrap().info().parameter(parameter).unwrap();
        let typical = Effect::from_name(effect).unwrap().typical_values();
        let position = Effect::from_name(effect)
            .unwrap()
            .info()
            .parameters
            .iter()
            .position(|own| own.label() == parameter);
        let typical = typical[position.unwrap()];
        let own: Vec<_> = findings
            .undetected
            .iter()
            .filter(|own| own.effect == effect && own.parameter == parameter)
            .collect();
        assert_eq!(own.len(), 3, "{effect} on each of three robots");
        for size in own {
            // Degrees of freedom are off at infinity: more than the typical ones are found.
            let found = if info.off.is_infinite() {
                size.minimum_detectable > typical
            } else {
                size.minimum_detectable < typical
            };
            assert!(size.minimum_detectable > 0.0 && found, "{size:?}");
        }
    }
    assert!(findings.untestable.iter().all(|own| own.effect != "encoder_coarse"));
}

/// Twenty seeds of each, one by one.
#[cfg(feature = "slow")]
#[test]
fn each_is_found_on_its_robot_in_every_seed() {
    for effect in [
        Effect::RangeDependentNoise,
        Effect::MotionBlur,
        Effect::HeavyTails,
        Effect::IdentityMixUp,
        Effect::LandmarkIdentitySwap,
        Effect::MissedDetections,
        Effect::GyroRandomWalk,
        Effect::CommandJitter,
        Effect::CommandLoss,
        Effect::EncoderCoarse,
    ] {
        for seed in 200..220 {
            found(&[(2, effect)], seed, 300.0);
        }
    }
}

//! Simulator and prediction against each other: a model that has the injected effect explains what was
//! recorded down to the noise, and one that has not does not. The two share the effects' equations and
//! nothing else: the simulator integrates in steps of 2 ms, looks up what is late in the true path and
//! samples by wrong clocks; the prediction steps from one encoder sample to the next.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{Evidence, nominal_models, residuals};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::Recording;
use pleiad_sim_peers::{Scenario, simulate};

/// The robot in the middle: the places of typical effects are around the origin.
const ROBOT: RobotId = RobotId(2);
const SEED: u64 = 2;
/// Long enough for half of the manoeuvres.
const DURATION_S: f64 = 150.0;

/// Effects that no prediction explains: chance, names, the spread of readings, and those that the prediction
/// of a window takes to first order or does not follow through all channels (clocks, the reference).
const NOT_EXPLAINED: &[Effect] = &[
    Effect::CommandLoss,
    Effect::CommandJitter,
    Effect::EncoderCoarse,
    Effect::GyroRandomWalk,
    Effect::RangeDependentNoise,
    Effect::HeavyTails,
    Effect::LandmarkIdentitySwap,
    Effect::IdentityMixUp,
    Effect::MissedDetections,
    Effect::MotionBlur,
    Effect::ClockOffset,
    Effect::ClockDrift,
    Effect::TruthLatency,
    Effect::TruthMarkerOffset,
    // A castor's state is not known to a window of the gyro.
    Effect::CastorFriction,
];

fn scenario(name: &str) -> Scenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    let mut scenario = Scenario::load(&folder.join(format!("{name}.toml"))).unwrap();
    scenario.duration_s = DURATION_S;
    scenario
}

/// Root mean square of every component of every channel, with its name.
fn spreads(recording: &Recording, effect: Option<ActiveEffect<f64>>) -> Vec<(String, f64)> {
    let models = nominal_models(recording).unwrap();
    let evidence = Evidence::new(recording, &models);
    let mut model = models[&ROBOT].clone();
    model.effects.extend(effect);
    let mut all = Vec::new();
    for channel in residuals(&evidence, ROBOT, &model) {
        for (index, component) in channel.channel.components().iter().enumerate() {
            let squares = channel.rows.iter().map(|row| row.values()[index].powi(2));
            let mean = squares.sum::<f64>() / channel.rows.len().max(1) as f64;
            all.push((format!("{} {}", channel.channel, component.name), mean.sqrt()));
        }
    }
    all
}

#[test]
fn every_effect_is_explained_by_its_own_model_and_by_no_nominal_one() {
    let mut wrong = Vec::new();
    let drives = ["manoeuvres", "manoeuvres_car_like"].map(|name| {
        let scenario = scenario(name);
        let clean = spreads(&simulate(&scenario, SEED).unwrap().recording, None);
        (scenario, clean)
    });
    for &effect in Effect::ALL.iter().filter(|effect| !NOT_EXPLAINED.contains(effect)) {
        let steers = matches!(effect, Effect::SteerTrim | Effect::Understeer);
        let (scenario, clean) = &drives[usize::from(steers)];
        let mut scenario = scenario.clone();
        // An onset at one second leaves nothing before it.
        let mut values = effect.typical_values();
        for (value, parameter) in values.iter_mut().zip(effect.info().parameters) {
            if parameter.name == "t_on_s" {
                *value = 60.313;
            }
        }
        let injected = ActiveEffect::new(effect, &values).unwrap();
        scenario.robots.get_mut(&ROBOT).unwrap().effects.push(injected);
        let recording = simulate(&scenario, SEED).unwrap().recording;
        let (without, with) = (spreads(&recording, None), spreads(&recording, Some(injected)));
        let mut shows = false;
        for (((name, clean), (_, without)), (_, with)) in clean.iter().zip(&without).zip(&with) {
            // The noise of wheels is that of jittering commands, few and large. At the border of a patch the
            // noise of truth may put one reading of 600 on the wrong side, by 0.5 m with a noise of 0.03 m.
            let bound = match effect {
                _ if name.starts_with("actuator") => 1.35,
                Effect::GpsMultipathPatch => (1.0 + 0.5_f64.powi(2) / 600.0 / 0.03_f64.powi(2)).sqrt() + 0.1,
                _ => 1.15,
            };
            if *with > bound * clean {
                wrong.push(format!("{}: {name} is {:.2} times its noise", effect.name(), with / clean));
            }
            shows |= *without > 1.05 * with;
        }
        if !shows {
            wrong.push(format!("{} does not show", effect.name()));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}

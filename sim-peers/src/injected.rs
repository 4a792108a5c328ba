//! What was injected into a simulated recording, in a file apart from it.

use std::collections::BTreeMap;

use pleiad_physics::ActiveEffect;
use pleiad_recording::{DeclaredEffect, EffectSpec};
use serde::Serialize;

use crate::scenario::RobotSettings;
use crate::world::true_nominal;
use crate::{Scenario, SimulatedRun};

#[derive(Serialize)]
struct Manifest<'a> {
    scenario: &'a str,
    seed: u64,
    robots: BTreeMap<String, Injected>,
}

#[derive(Serialize)]
struct Injected {
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    declared: BTreeMap<&'static str, Declared>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    effects: Vec<EffectSpec>,
}

/// A value of the nominal model that is not the truth.
#[derive(Serialize)]
struct Declared {
    declared: f64,
    truth: f64,
}

/// The text of the manifest: per robot the effects that acted on it, and the values that its nominal model
/// declares wrongly. Nothing reads it back.
///
/// # Errors
/// Never for what a scenario can say; as the TOML writer.
pub fn injected_text(scenario: &Scenario, run: &SimulatedRun) -> Result<String, toml::ser::Error> {
    let robots = scenario.robots.iter().map(|(robot, settings)| {
        let effects = run.injected.get(robot).into_iter().flatten().map(spec).collect();
        (format!("r{robot}"), Injected { declared: declared(settings), effects })
    });
    let manifest = Manifest { scenario: &scenario.name, seed: run.seed, robots: robots.collect() };
    let text = toml::to_string(&manifest)?;
    Ok(format!(
        "# What acted on the robots and is not in their recording. No command reads this file.\n{text}"
    ))
}

fn spec(effect: &ActiveEffect<f64>) -> EffectSpec {
    EffectSpec::from(&DeclaredEffect::new(*effect))
}

fn declared(settings: &RobotSettings) -> BTreeMap<&'static str, Declared> {
    let truth = true_nominal(settings);
    let compared = settings.declared.compared(&truth);
    compared.map(|(key, declared, truth)| (key, Declared { declared, truth })).collect()
}

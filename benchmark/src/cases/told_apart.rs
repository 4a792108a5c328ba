//! The recording that is added to tell rivals apart.

use pleiad_sim_peers::Scenario;
use pleiad_sim_peers::scenario::{ManoeuvreKind, Policy};

use super::Case;
use super::build::{base, noise};
use crate::error::BenchmarkError;

/// How long what is driven in addition may take, seconds.
const LASTS_S: f64 = 60.0;

/// The scenario of a case in which a manoeuvre is driven.
///
/// # Errors
/// As [`Plan::build`](super::Plan::build).
pub fn added(case: &Case, manoeuvre: ManoeuvreKind) -> Result<Scenario, BenchmarkError> {
    let mut scenario = base(&format!("{}+", case.answer.id))?;
    noise(&mut scenario, case.answer.noise);
    scenario.duration_s = LASTS_S;
    for (robot, own) in &mut scenario.robots {
        own.motion.policy = Policy::Manoeuvres;
        own.motion.manoeuvres = vec![manoeuvre];
        if let Some(known) = case.scenario.robots.get(robot) {
            own.effects.clone_from(&known.effects);
            own.declared = known.declared;
            own.drive = known.drive;
        }
    }
    Ok(scenario)
}

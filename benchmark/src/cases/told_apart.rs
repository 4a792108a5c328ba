//! The recording that is added to tell rivals apart.

use pleiad_sim_peers::Scenario;
use pleiad_sim_peers::scenario::{ManoeuvreKind, Policy};

use super::Case;
use super::build::{base, noise};
use crate::error::BenchmarkError;

/// How long what is driven in addition may take, seconds.
const LASTS_S: f64 = 60.0;

/// The scenario of a case with the manoeuvres that a proposal names; `None` if it names none.
///
/// # Errors
/// As [`Plan::build`](super::Plan::build).
pub fn added(case: &Case, proposal: &str) -> Result<Option<Scenario>, BenchmarkError> {
    let words: Vec<&str> = proposal.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
    let kinds: Vec<ManoeuvreKind> =
        ManoeuvreKind::ALL.into_iter().filter(|kind| words.contains(&kind.name())).collect();
    if kinds.is_empty() {
        return Ok(None);
    }
    let mut scenario = base(&format!("{}+", case.answer.id))?;
    noise(&mut scenario, case.answer.noise);
    scenario.duration_s = LASTS_S;
    for (robot, own) in &mut scenario.robots {
        own.motion.policy = Policy::Manoeuvres;
        own.motion.manoeuvres.clone_from(&kinds);
        if let Some(known) = case.scenario.robots.get(robot) {
            own.effects.clone_from(&known.effects);
            own.declared = known.declared;
            own.drive = known.drive;
        }
    }
    Ok(Some(scenario))
}

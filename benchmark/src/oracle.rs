//! What could be reached at best: the true structure, fitted, and what else explains the recording. The diagnosis
//! has no part in it.

use pleiad_estimation::RobotId;
use pleiad_mismatch::{
    Explained, Finding, Findings, MismatchError, Structure, acts_on_every_robot, composition, explained,
    fit_known,
};
use pleiad_physics::{Effect, Fit};
use pleiad_recording::Recording;
use serde::{Deserialize, Serialize};

use crate::score::{ParameterError, parameters};
use crate::seal::{Answer, Injected};

/// Twice the log-likelihood gained, over the variance ratio of the scores, from which an effect is detectable.
pub const DETECTABLE: f64 = 30.0;
/// The same lost by the best rival, from which it is identifiable.
pub const IDENTIFIABLE: f64 = 12.0;
/// In place of more than any test could say.
const CERTAIN: f64 = 1e6;
/// What anyone would refit first.
const REFITTED: [Effect; 2] = [Effect::WheelRadiusError, Effect::TrackWidthError];

/// What the true structure explains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Oracle {
    /// One per effect injected, in the order of the answer.
    pub effects: Vec<Known>,
    /// The variance ratio of the scores.
    pub inflation: f64,
    /// Every single effect in place of the structure: name, robot (0: all), and what it loses, deflated.
    pub rivals: Vec<(String, u32, f64)>,
    /// Log score gained on folds left out, over the nominal model: by the true structure, its standard error, by
    /// the refitted nominal model, and by what the tool said. `None` where effects of spread act, which it cannot
    /// tell.
    pub held_out: Option<[f64; 4]>,
    /// What the structure that the tool named loses against the true one, fitted to everything, deflated; `None` if
    /// it named nothing, or where effects of spread act.
    #[serde(default)]
    pub tool_loses: Option<f64>,
}

impl Oracle {
    /// What the best rival loses; `None` if nothing comes near. One with more parameters than the true structure may
    /// have the truth within it, and is no rival.
    pub fn best_rival(&self) -> Option<f64> {
        let sizes = |name: &str| {
            let parameters = Effect::from_name(name).map_or(&[][..], |effect| effect.info().parameters);
            parameters.iter().filter(|own| own.fit != Fit::Choice).count()
        };
        let truth: usize = self.effects.iter().map(|own| sizes(&own.effect)).sum();
        let rivals = self.rivals.iter().filter(|(name, _, _)| sizes(name) <= truth);
        rivals.map(|(_, _, loses)| *loses).min_by(f64::total_cmp)
    }

    /// Whether a rival does nearly as well. An effect that is by its equation two others together always has one.
    pub fn has_rival(&self) -> bool {
        let composed = |own: &Known| Effect::from_name(&own.effect).and_then(composition).is_some();
        self.effects.iter().any(composed) || self.best_rival().is_some_and(|loses| loses < IDENTIFIABLE)
    }

    /// Whether effects other than those that act reproduce the recording: a single one, of any number of parameters, or
    /// the several that the tool named, which are shown to by being fitted.
    pub fn is_reproduced(&self) -> bool {
        let close = |loses: f64| loses < IDENTIFIABLE;
        self.has_rival()
            || self.rivals.iter().any(|(_, _, loses)| close(*loses))
            || self.tool_loses.is_some_and(close)
    }
}

/// An effect that is known to act.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Which.
    pub effect: String,
    /// What it gains beside the others, twice in log-likelihood, deflated; of effects of spread, the largest squared
    /// ratio of a value to its standard error.
    pub gain: f64,
    /// Whether that is enough.
    pub detectable: bool,
    /// Whether, besides, no rival does nearly as well.
    pub identifiable: bool,
    /// Values with the true structure imposed.
    pub parameters: Vec<ParameterError>,
}

/// Fits the true structure, parts of it, the refitted nominal model and what the tool said.
///
/// # Errors
/// As [`fit_known`].
pub fn oracle(recording: &Recording, answer: &Answer, said: &Findings) -> Result<Oracle, MismatchError> {
    let truth = structure(&answer.injected);
    let of_mean = |structure: &Structure| -> bool {
        !structure.is_empty() && structure.iter().all(|(effect, _)| !is_of_spread(*effect))
    };
    if truth.is_empty() {
        return Ok(Oracle::default());
    }
    let mut oracle = Oracle { inflation: 1.0, ..Oracle::default() };
    let tool = named(&said.findings);
    let mut structures = vec![truth.clone()];
    if truth.len() > 1 {
        structures.extend((0..truth.len()).map(|left| {
            let others = truth.iter().enumerate().filter(|(index, _)| *index != left);
            others.map(|(_, own)| *own).collect()
        }));
    }
    let parts = structures.len();
    structures.push(refitted(&truth, &tool));
    let same = alike(&truth, &tool);
    let named = !tool.is_empty() && !same;
    if !same {
        structures.push(tool);
    }
    let all: Vec<Explained> = if of_mean(&truth) { explained(recording, &structures)? } else { Vec::new() };
    if let Some(whole) = all.first() {
        oracle.inflation = whole.inflation;
        let deflated = |gain: f64| gain / whole.inflation;
        let name = |robot: Option<RobotId>| robot.map_or(0, |robot| robot.0);
        let rivals = whole.rivals.iter();
        oracle.rivals =
            rivals.map(|own| (own.effect.name().to_owned(), name(own.robot), deflated(own.loses))).collect();
        let tool = if same { whole.held_out } else { all.last().map_or(0.0, |own| own.held_out) };
        let loses = || Some(deflated(whole.gain - all.last()?.gain));
        oracle.tool_loses = if named { loses() } else { None };
        oracle.held_out = Some([whole.held_out, whole.held_out_se, all[parts].held_out, tool]);
    }
    for (index, own) in answer.injected.iter().enumerate() {
        let Some(effect) = Effect::from_name(&own.effect) else { continue };
        let fit = match all.first() {
            Some(whole) => whole
                .fits
                .iter()
                .find(|fit| {
                    fit.effect == effect
                        && own.robots.iter().all(|robot| fit.robots.contains(&RobotId(*robot)))
                })
                .cloned(),
            None => own
                .robots
                .first()
                .and_then(|robot| fit_known(recording, RobotId(*robot), &[effect]).ok()?.into_iter().next()),
        };
        let mut known = Known { effect: own.effect.clone(), ..Known::default() };
        if let Some(fit) = &fit {
            let of = |label: &str| fit.parameter(label).map(|own| (own.value, own.ci95));
            known.parameters = parameters(own, &of);
        }
        known.gain = match all.first() {
            Some(whole) if parts > 1 => (whole.gain - all[1 + index].gain) / whole.inflation,
            Some(whole) => whole.gain / whole.inflation,
            None => fit.as_ref().map_or(0.0, wald),
        };
        known.detectable = known.gain >= DETECTABLE;
        oracle.effects.push(known);
    }
    let lone = !oracle.has_rival();
    for known in &mut oracle.effects {
        known.identifiable = known.detectable && lone;
    }
    Ok(oracle)
}

/// The largest squared ratio of a value to its standard error; a label that was found is as sure as can be.
fn wald(fit: &pleiad_mismatch::KnownFit) -> f64 {
    let parameters = fit.parameters.iter().zip(fit.effect.info().parameters);
    let ratios = parameters.map(|(own, parameter)| match own.standard_error {
        Some(error) if parameter.off.is_finite() => ((own.value - parameter.off) / error).powi(2),
        // Tails are off at infinity: their inverse, by the delta method.
        Some(error) => (own.value / error).powi(2),
        None => CERTAIN,
    });
    ratios.filter(|ratio| !ratio.is_nan()).fold(0.0, f64::max).min(CERTAIN)
}

/// The effects of the spread, of chance and of names: they move no mean.
pub fn is_of_spread(effect: Effect) -> bool {
    matches!(
        effect,
        Effect::RangeDependentNoise
            | Effect::MotionBlur
            | Effect::HeavyTails
            | Effect::IdentityMixUp
            | Effect::MissedDetections
            | Effect::GyroRandomWalk
            | Effect::CommandJitter
            | Effect::CommandLoss
            | Effect::EncoderCoarse
            | Effect::LandmarkIdentitySwap
    )
}

fn structure(injected: &[Injected]) -> Structure {
    let one = |own: &Injected| {
        let effect = Effect::from_name(&own.effect)?;
        Some((effect, RobotId(*own.robots.first()?)))
    };
    injected.iter().filter_map(one).collect()
}

/// What findings name, rivals apart.
fn named(findings: &[Finding]) -> Structure {
    let one = |own: &Finding| {
        let effect = Effect::from_name(own.effect.as_deref()?)?;
        let robots = if acts_on_every_robot(effect) {
            &own.robots[..1.min(own.robots.len())]
        } else {
            &own.robots[..]
        };
        Some(robots.iter().map(|robot| (effect, RobotId(*robot))).collect::<Vec<_>>())
    };
    findings.iter().filter_map(one).flatten().collect()
}

fn alike(a: &Structure, b: &Structure) -> bool {
    let key = |(effect, robot): &(Effect, RobotId)| {
        (*effect, if acts_on_every_robot(*effect) { RobotId(0) } else { *robot })
    };
    let sorted = |all: &Structure| {
        let mut keys: Vec<_> = all.iter().map(key).collect();
        keys.sort_unstable();
        keys
    };
    sorted(a) == sorted(b)
}

/// The nominal parameters, but for those that are the effect itself, of every robot that either structure acts on.
fn refitted(truth: &Structure, tool: &Structure) -> Structure {
    let shared = truth.iter().chain(tool).any(|(effect, _)| acts_on_every_robot(*effect));
    let mut robots: Vec<RobotId> = if shared {
        [1, 2, 3].map(RobotId).to_vec()
    } else {
        truth.iter().chain(tool).map(|(_, robot)| *robot).collect()
    };
    robots.sort_unstable();
    robots.dedup();
    let acts = |effect: Effect| truth.iter().any(|(own, _)| *own == effect);
    REFITTED
        .into_iter()
        .filter(|effect| !acts(*effect))
        .flat_map(|effect| robots.iter().map(move |robot| (effect, *robot)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oracle(effect: &str, rivals: &[(&str, f64)]) -> Oracle {
        Oracle {
            effects: vec![Known { effect: effect.to_owned(), ..Known::default() }],
            rivals: rivals.iter().map(|(name, loses)| ((*name).to_owned(), 2, *loses)).collect(),
            ..Oracle::default()
        }
    }

    #[test]
    fn a_rival_is_one_that_loses_little_and_has_no_more_parameters() {
        assert!(oracle("longitudinal_slip", &[("turn_loss", 11.9)]).has_rival());
        assert!(!oracle("longitudinal_slip", &[("turn_loss", 12.1)]).has_rival());
        // Slip and skid in one: it holds the truth.
        assert!(!oracle("longitudinal_slip", &[("low_friction_overall", 0.1)]).has_rival());
        assert!(oracle("low_friction_overall", &[("longitudinal_slip", 5.0)]).has_rival());
        assert!(!oracle("longitudinal_slip", &[]).has_rival());
        // Two others, by its equation.
        assert!(oracle("payload_offset", &[]).has_rival());
    }

    #[test]
    fn what_is_left_out_is_reproduced_by_one_of_more_parameters_or_by_several_that_were_named() {
        let own = oracle("wheel_radius_error", &[("payload_added", 0.1)]);
        assert!(!own.has_rival() && own.is_reproduced());
        let several = |loses: Option<f64>| Oracle { tool_loses: loses, ..oracle("icr_offset", &[]) };
        assert!(several(Some(11.0)).is_reproduced());
        assert!(!several(Some(13.0)).is_reproduced() && !several(None).is_reproduced());
    }
}

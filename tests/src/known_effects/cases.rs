//! What is injected, and where. The rules are in `docs/benchmarks/effects.md`; they were fixed before any
//! result was looked at.

use pleiad_estimation::RobotId;
use pleiad_mismatch::acts_on_every_robot;
use pleiad_physics::{ActiveEffect, Channel, Effect, Fit};
use pleiad_sim_peers::Scenario;

/// The robot that an effect of its own acts on: the one in the middle, which sees both others.
pub const ROBOT: RobotId = RobotId(2);
/// When effects that begin set in, as a share of the run.
const ONSET_SHARE: f64 = 0.4;
/// The area that all robots share where one effect needs them near each other.
const MEETING_AREA_M: [f64; 4] = [-2.0, 2.0, -2.0, 2.0];
/// The recording.
const SCENARIO: &str = include_str!("../../../scenarios/manoeuvres.toml");

/// An effect and the scenario in which it acts.
#[derive(Clone, Debug)]
pub struct Case {
    /// Which effect.
    pub effect: Effect,
    /// The values injected, in the order of its parameters.
    pub values: Vec<f64>,
    /// The scenario with the effect in it.
    pub scenario: Scenario,
}

/// An effect that is not in the benchmark.
#[derive(Clone, Debug)]
pub struct Apart {
    /// Which effect.
    pub effect: Effect,
    /// Why.
    pub why: &'static str,
}

/// Every effect that can be estimated, in the order of the catalogue.
pub fn cases() -> Vec<Case> {
    Effect::ALL.iter().filter(|&&effect| why_apart(effect).is_none()).map(|&effect| case(effect)).collect()
}

/// Every effect that cannot, and why.
pub fn apart() -> Vec<Apart> {
    Effect::ALL.iter().filter_map(|&effect| why_apart(effect).map(|why| Apart { effect, why })).collect()
}

fn why_apart(effect: Effect) -> Option<&'static str> {
    let info = effect.info();
    if info.channels.contains(&Channel::Steer) {
        return Some("the steering angle is not a channel of recordings");
    }
    match effect {
        Effect::RangeDependentNoise
        | Effect::MotionBlur
        | Effect::GyroRandomWalk
        | Effect::HeavyTails
        | Effect::IdentityMixUp
        | Effect::MissedDetections
        | Effect::CommandLoss
        | Effect::CommandJitter
        | Effect::EncoderCoarse => Some("it acts on the spread of residuals, which has no estimator yet"),
        Effect::LandmarkIdentitySwap => Some("it is a choice between labels, without a size"),
        _ => None,
    }
}

/// An effect at its typical size.
pub fn case(effect: Effect) -> Case {
    let mut scenario = Scenario::from_toml(SCENARIO, "manoeuvres.toml").expect("a shipped scenario");
    let info = effect.info();
    let mut values = effect.typical_values();
    for (value, parameter) in values.iter_mut().zip(info.parameters) {
        match parameter.name {
            "t_on_s" => *value = ONSET_SHARE * scenario.duration_s,
            // The supply voltage is no channel of recordings.
            "gain_per_v" => *value = parameter.off,
            _ => {}
        }
    }
    let active = ActiveEffect::new(effect, &values).expect("a typical size for every parameter");
    for (robot, settings) in &mut scenario.robots {
        if *robot == ROBOT || acts_on_every_robot(effect) {
            settings.effects.push(active);
        }
        if effect == Effect::PartnerInfluence {
            settings.motion.area_m = Some(MEETING_AREA_M);
        }
    }
    Case { effect, values, scenario }
}

/// Whether a parameter has a size: labels have none.
pub(super) fn has_size(fit: Fit) -> bool {
    fit != Fit::Choice
}

//! What is injected, and where. The rules are in `docs/benchmarks/effects.md`; they were fixed before any
//! result was looked at.

use pleiad_estimation::RobotId;
use pleiad_mismatch::acts_on_every_robot;
use pleiad_physics::{ActiveEffect, Channel, Effect, Fit};
use pleiad_sim_peers::Scenario;
use pleiad_sim_peers::scenario::{DriveKind, Policy};

/// The robot that an effect of its own acts on: the one in the middle, which sees both others.
pub const ROBOT: RobotId = RobotId(2);
/// When effects that begin set in, as a share of the run.
const ONSET_SHARE: f64 = 0.4;
/// The area that all robots share where one effect needs them near each other.
const MEETING_AREA_M: [f64; 4] = [-2.0, 2.0, -2.0, 2.0];
/// The recording.
const SCENARIO: &str = include_str!("../../../scenarios/manoeuvres.toml");

/// The slow triangle of speeds that dead band and stiction ask for: steps of the speed, m/s, how many, and how
/// long each, seconds.
const TRIANGLE: (f64, u32, f64) = (0.012, 8, 0.4);
/// The yaw rate at which a wheel rolls as fast as at this speed on a straight line, with a track of 0.3 m, 1/m.
const TURN_PER_M: f64 = 1.0 / 0.15;

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

/// Every effect, in the order of the catalogue.
pub fn cases() -> Vec<Case> {
    Effect::ALL.iter().flat_map(|&effect| cases_of(effect)).collect()
}

/// The cases of the effect of this name.
///
/// # Errors
///
/// No effect has the name.
pub fn cases_named(name: &str) -> Result<Vec<Case>, String> {
    let effect = Effect::from_name(name).ok_or_else(|| format!("no effect `{name}`; see pleiad effects"))?;
    Ok(cases_of(effect))
}

/// The cases of an effect at its typical size: one, but for a dead band, which is of the speed or of a wheel.
fn cases_of(effect: Effect) -> Vec<Case> {
    let scenario = Scenario::from_toml(SCENARIO, "manoeuvres.toml").expect("a shipped scenario");
    let mut values = effect.typical_values();
    for (value, parameter) in values.iter_mut().zip(effect.info().parameters) {
        match parameter.name {
            "t_on_s" => *value = ONSET_SHARE * scenario.duration_s,
            // The supply voltage is no channel of recordings.
            "gain_per_v" => *value = parameter.off,
            _ => {}
        }
    }
    if effect == Effect::MotorDeadband {
        return vec![
            case(scenario.clone(), effect, vec![values[0], 0.0]),
            case(scenario, effect, vec![0.0, values[1]]),
        ];
    }
    vec![case(scenario, effect, values)]
}

fn case(mut scenario: Scenario, effect: Effect, values: Vec<f64>) -> Case {
    let active = ActiveEffect::new(effect, &values).expect("a typical size for every parameter");
    let needs = |channel: Channel| effect.info().channels.contains(&channel);
    for (robot, settings) in &mut scenario.robots {
        if *robot == ROBOT || acts_on_every_robot(effect) {
            settings.effects.push(active);
        }
        if effect == Effect::PartnerInfluence {
            settings.motion.area_m = Some(MEETING_AREA_M);
        }
        if needs(Channel::Steer) {
            settings.drive.kind = DriveKind::CarLike;
        }
        if *robot == ROBOT && matches!(effect, Effect::MotorDeadband | Effect::Stiction) {
            settings.motion.policy = Policy::Script;
            settings.motion.script = triangles(effect, scenario.duration_s);
        }
    }
    Case { effect, values, scenario }
}

/// Slow triangles of the speed, forth and back, for so long; for a dead band also of the yaw rate, because on a
/// straight line one of the speed and one of the wheels are the same.
fn triangles(effect: Effect, duration_s: f64) -> Vec<[f64; 3]> {
    let (step_m_s, steps, each_s) = TRIANGLE;
    let shares = (1..=steps).chain((1..steps).rev()).map(f64::from);
    let axes: &[[f64; 2]] =
        if effect == Effect::MotorDeadband { &[[1.0, 0.0], [0.0, TURN_PER_M]] } else { &[[1.0, 0.0]] };
    let mut once = Vec::new();
    for [along, turning] in axes {
        for sense in [1.0, -1.0] {
            let size = |share: f64| sense * share * step_m_s;
            once.extend(shares.clone().map(|share| [along * size(share), turning * size(share), each_s]));
            once.push([0.0, 0.0, each_s]);
        }
    }
    let lasts_s: f64 = once.iter().map(|row| row[2]).sum();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small number")]
    let times = (duration_s / lasts_s).ceil() as usize;
    once.repeat(times)
}

/// Whether a parameter has a size: labels have none.
pub(super) fn has_size(fit: Fit) -> bool {
    fit != Fit::Choice
}

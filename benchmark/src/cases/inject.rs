//! Puts an effect of a size into a scenario, and says what was put there.

use pleiad_estimation::RobotId;
use pleiad_mismatch::acts_on_every_robot;
use pleiad_physics::{ActiveEffect, Channel, Effect, Fit, Parameter, Scope};
use pleiad_sim_peers::Scenario;
use pleiad_sim_peers::scenario::DriveKind;

use super::draw::Draw;
use crate::error::BenchmarkError;
use crate::seal::Injected;

/// The robot with GPS, and the one with absolute headings.
pub(crate) const GPS_ROBOT: RobotId = RobotId(1);
pub(crate) const HEADING_ROBOT: RobotId = RobotId(3);
/// The area that all robots share where one effect needs them near each other.
const MEETING_AREA_M: [f64; 4] = [-2.0, 2.0, -2.0, 2.0];
/// Where effects begin, as shares of the run.
const ONSETS: [f64; 2] = [0.25, 0.75];
/// A place lies about a point of one robot's area: of the middles of the areas, x in metres, and so far from it.
const MIDDLES_M: [f64; 3] = [-4.0, 0.0, 4.0];
const OFF_MIDDLE_M: f64 = 1.0;
/// Numbers of landmarks of the scenario.
const LANDMARKS: usize = 12;

/// Effects whose sign says in which sense chance or noise differs: the typical one is kept.
const SIGNED: [Effect; 3] = [Effect::MissedDetections, Effect::RangeDependentNoise, Effect::MotionBlur];

/// Whether another size of an effect can be had: an exchange of names has none.
pub(crate) fn has_size(effect: Effect) -> bool {
    effect.info().parameters.iter().any(|parameter| parameter.fit != Fit::Choice)
}

/// The robot that an effect acts on: one that has the channels for it.
pub(crate) fn robot_for(effect: Effect, draw: &mut Draw) -> RobotId {
    let drawn = [1, 2, 3].map(RobotId)[draw.below(3)];
    let needs = |channel: Channel| effect.info().channels.contains(&channel);
    if needs(Channel::Gps) {
        GPS_ROBOT
    } else if needs(Channel::Heading) {
        HEADING_ROBOT
    } else {
        drawn
    }
}

/// The values of an effect at a size over the typical one; signs, angles, onsets and places are drawn.
pub(crate) fn values(effect: Effect, size: f64, duration_s: f64, draw: &mut Draw) -> Vec<f64> {
    let parameters = effect.info().parameters;
    let mut values = effect.typical_values();
    let turned = parameters.iter().any(|own| own.unit == "rad" && is_direction(own));
    let sign = if turned || SIGNED.contains(&effect) { 1.0 } else { draw.sign() };
    let middle_m = [
        MIDDLES_M[draw.below(3)] + draw.between(-OFF_MIDDLE_M, OFF_MIDDLE_M),
        draw.between(-OFF_MIDDLE_M, OFF_MIDDLE_M),
    ];
    for (value, parameter) in values.iter_mut().zip(parameters) {
        let (least, greatest) = parameter.plausible;
        *value = match (parameter.name, parameter.component) {
            ("t_on_s", _) => duration_s * draw.between(ONSETS[0], ONSETS[1]),
            // The supply voltage is no channel of recordings.
            ("gain_per_v", _) => parameter.off,
            ("region_m", Some("x_min" | "x_max")) => *value + middle_m[0],
            ("region_m", _) => *value + middle_m[1],
            ("ids", Some("first")) => 1.0 + draw.below(LANDMARKS / 2) as f64,
            ("ids", _) => (1 + LANDMARKS / 2 + draw.below(LANDMARKS / 2)) as f64,
            ("id", _) => 1.0 + draw.below(LANDMARKS) as f64,
            ("wheel", _) => draw.below(2) as f64,
            _ if is_direction(parameter) => draw.between(least, greatest).clamp(-3.1, 3.1),
            _ if parameter.fit == Fit::Choice => *value,
            // A limit, a tail and a count of ticks do more the smaller they are.
            ("actual_ticks_per_rev", _) => (*value / size).round(),
            _ if !parameter.off.is_finite() => (*value / size).clamp(least, greatest),
            // A shape.
            _ if parameter.off != 0.0 => *value,
            _ => {
                #[allow(clippy::float_cmp, reason = "as they are written in the catalogue")]
                let either = least == -greatest;
                (if either { sign } else { 1.0 } * size * *value).clamp(least, greatest)
            }
        };
    }
    if effect == Effect::MotorDeadband {
        // Of the speed or of a wheel.
        values[draw.below(2)] = 0.0;
    }
    values
}

fn is_direction(parameter: &Parameter) -> bool {
    parameter.name.contains("azimuth") || parameter.name.contains("phase")
}

/// Puts an effect into a scenario, on one robot or, if it is shared, on all.
pub(crate) fn inject(
    scenario: &mut Scenario,
    effect: Effect,
    values: &[f64],
    robot: RobotId,
    window_s: Option<[f64; 2]>,
) -> Result<Injected, BenchmarkError> {
    let active = ActiveEffect::new(effect, values).map_err(|error| BenchmarkError::Case {
        id: scenario.name.clone(),
        why: format!("{} cannot have the values {values:?}: {error}", effect.name()),
    })?;
    let scope = Scope { window_s: window_s.map(|[from, to]| (from, to)), ..Scope::default() };
    let shared = acts_on_every_robot(effect);
    let mut robots = Vec::new();
    for (own, settings) in &mut scenario.robots {
        if *own == robot || shared {
            settings.effects.push(active.within(scope));
            robots.push(own.0);
        }
        if effect == Effect::PartnerInfluence {
            settings.motion.area_m = Some(MEETING_AREA_M);
        }
        if effect.info().channels.contains(&Channel::Steer) {
            settings.drive.kind = DriveKind::CarLike;
        }
    }
    Ok(injected(effect, values, robots, window_s))
}

/// What is said of an effect that acts.
pub(crate) fn injected(
    effect: Effect,
    values: &[f64],
    robots: Vec<u32>,
    window_s: Option<[f64; 2]>,
) -> Injected {
    let info = effect.info();
    let labels = info.parameters.iter().map(Parameter::label);
    let corner = |label: &str| info.parameter(label).and_then(|(index, _)| values.get(index).copied());
    let region_m = match ["region_m.x_min", "region_m.x_max", "region_m.y_min", "region_m.y_max"].map(corner)
    {
        [Some(x0), Some(x1), Some(y0), Some(y1)] => Some([x0, x1, y0, y1]),
        _ => None,
    };
    Injected {
        effect: info.name.to_owned(),
        robots,
        parameters: labels.zip(values.iter().copied()).collect(),
        time_s: window_s,
        region_m,
    }
}

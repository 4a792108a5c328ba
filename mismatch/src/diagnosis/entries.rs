//! What is tried: every effect of the catalogue that the recorded channels allow, on every robot that it
//! could act on.

use std::collections::BTreeSet;

use pleiad_physics::{Channel as Needed, Effect, EffectInfo, Stage};

use crate::channel::Channel;
use crate::diagnosis::select::Entry;
use crate::diagnosis::term::Whose;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;
use crate::findings::Untestable;

/// What can be tried, and what cannot and why.
pub(crate) struct Entries {
    pub(crate) entries: Vec<Entry>,
    pub(crate) untestable: Vec<Untestable>,
}

/// Sorts the catalogue into what the units allow and what they do not.
pub(crate) fn entries(units: &[&Unit<'_>]) -> Entries {
    let robots: BTreeSet<_> = units.iter().map(|unit| unit.robot).collect();
    let mut sorted = Entries { entries: Vec::new(), untestable: Vec::new() };
    for &effect in Effect::ALL {
        let info = effect.info();
        if composition(effect).is_some() {
            continue;
        }
        if is_shared(info) {
            match units.iter().find_map(|unit| obstacle(effect, unit).is_none().then_some(())) {
                Some(()) => sorted.entries.push((effect, Whose::Everyone)),
                None => {
                    if let Some(why) = units.first().and_then(|unit| obstacle(effect, unit)) {
                        sorted.untestable.push(Untestable { effect: info.name.to_owned(), robot: None, why });
                    }
                }
            }
            continue;
        }
        for &robot in &robots {
            let mut own = units.iter().filter(|unit| unit.robot == robot);
            let first = own.clone().next();
            if own.any(|unit| obstacle(effect, unit).is_none()) {
                sorted.entries.push((effect, Whose::Robot(robot)));
            } else if let Some(why) = first.and_then(|unit| obstacle(effect, unit)) {
                let effect = info.name.to_owned();
                sorted.untestable.push(Untestable { effect, robot: Some(robot.0), why });
            }
        }
    }
    sorted
}

/// Whether an effect is the same for every robot: of the world, of a place in the map, of the map itself, or
/// of the reference system's clock.
pub(crate) fn is_shared(info: &EffectInfo) -> bool {
    let has = |name: &str| info.parameters.iter().any(|parameter| parameter.name == name);
    let own_event = has("t_on_s") || has("range_m");
    let reference_clock = info.channels == [Needed::Truth] && info.stage == Stage::Sensor && has("latency_s");
    (info.stage == Stage::World && !own_event)
        || has("region_m")
        || has("id")
        || has("ids")
        || reference_clock
}

/// Why an effect cannot be tested on a unit.
fn obstacle(effect: Effect, unit: &Unit<'_>) -> Option<String> {
    let info = effect.info();
    let steered = unit.evidence.robot(unit.robot).is_some_and(|(own, _)| !own.steer.is_empty());
    if info.channels.contains(&Needed::Steer) && !steered {
        return Some("the steering angle was not recorded".to_owned());
    }
    let shows = |channel: &Channel| touches(effect, *channel) && unit.stretch(*channel).is_some();
    if Channel::ALL.iter().any(shows) {
        return None;
    }
    let reasons: Vec<String> = unit
        .stretches
        .iter()
        .filter(|stretch| touches(effect, stretch.channel))
        .flat_map(|stretch| &stretch.omissions)
        .map(ToString::to_string)
        .collect::<BTreeSet<String>>()
        .into_iter()
        .collect();
    let missing = if reasons.is_empty() {
        "nothing to compare it with was recorded".to_owned()
    } else {
        reasons.join("; ")
    };
    Some(missing)
}

/// The effects that an effect is the same as, together: a cause that shows in two elementary ways. The
/// elementary ones are tried, and it is named as their rival.
pub(crate) fn composition(effect: Effect) -> Option<[Effect; 2]> {
    match effect {
        Effect::PayloadOffset => Some([Effect::UnequalWheelRadii, Effect::TrackWidthError]),
        _ => None,
    }
}

//! What is tried: every effect of the catalogue that the recorded channels allow, on every robot that it
//! could act on.

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_physics::{Channel as Needed, Effect, EffectInfo, Stage};

use crate::channel::Channel;
use crate::diagnose::DiagnoseOptions;
use crate::diagnosis::select::Entry;
use crate::diagnosis::starts::Placing;
use crate::diagnosis::term::Whose;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Stretch, Unit};
use crate::findings::Untestable;
use crate::residual::Omission;

/// What can be tried, and what cannot and why.
pub(crate) struct Entries {
    pub(crate) entries: Vec<Entry>,
    pub(crate) untestable: Vec<Untestable>,
}

impl Entries {
    /// Without what is not to be tried.
    pub(crate) fn tried(mut self, options: &DiagnoseOptions) -> Self {
        let placed = |effect: Effect| Placing::of(effect.info()).is_some();
        let dropped =
            |effect: Effect| options.leave_out.contains(&effect) || (options.without.scans && placed(effect));
        self.entries.retain(|(effect, _)| !dropped(*effect));
        self.untestable.retain(|own| !Effect::from_name(&own.effect).is_some_and(dropped));
        self
    }
}

/// Below this, seconds, there are too few blocks of time for a robust variance.
pub(crate) const SHORT_S: f64 = 20.0;

/// What one row in so many lacks is not worth telling.
const FEW: usize = 20;

/// For how long a robot can be compared in these units together, seconds.
pub(crate) fn lasting_s(units: &[&Unit<'_>], robot: RobotId) -> f64 {
    units.iter().filter(|unit| unit.robot() == robot).map(|unit| unit.span_s.1 - unit.span_s.0).sum()
}

/// Sorts the catalogue into what the units allow and what they do not.
pub(crate) fn entries(units: &[&Unit<'_>]) -> Entries {
    let obstacle = |effect: Effect, unit: &Unit<'_>| {
        let lasting_s = lasting_s(units, unit.robot());
        let short = || format!("{lasting_s:.1} s can be compared, {SHORT_S} s are needed");
        obstacle(effect, unit).or_else(|| (lasting_s < SHORT_S).then(short))
    };
    let robots: BTreeSet<_> = units.iter().map(|unit| unit.robot()).collect();
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
            let mut own = units.iter().filter(|unit| unit.robot() == robot);
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
    let steered = unit.evidence.robot(unit.robot()).is_some_and(|(own, _)| !own.steer.is_empty());
    if info.channels.contains(&Needed::Steer) && !steered {
        return Some("the steering angle was not recorded".to_owned());
    }
    if unit.evidence.is_by_reference() && info.channels == [Needed::Truth] {
        return Some("no ground truth was used".to_owned());
    }
    if effect == Effect::ClockOffset && all_may_be_late(unit) {
        return Some(
            "where only commands, sightings and positions were recorded it is the same as all of them late"
                .to_owned(),
        );
    }
    if effect == Effect::PartnerInfluence && unit.evidence.is_of_one() {
        return Some("no other robot was recorded".to_owned());
    }
    let shows = |channel: &Channel| touches(effect, *channel) && unit.stretch(*channel).is_some();
    if Channel::ALL.iter().any(shows) {
        return None;
    }
    let reasons = omissions(effect, unit, &|_, _| true);
    let nothing = || "nothing to compare it with was recorded".to_owned();
    Some(if reasons.is_empty() { nothing() } else { reasons.join("; ") })
}

/// What is missing in the channels of an effect, of what is `worth` telling.
fn omissions(effect: Effect, unit: &Unit<'_>, worth: &dyn Fn(&Omission, &Stretch) -> bool) -> Vec<String> {
    let own = unit.stretches.iter().filter(|stretch| touches(effect, stretch.channel));
    let reasons: BTreeSet<String> = own
        .flat_map(|stretch| stretch.omissions.iter().filter(|own| worth(own, stretch)))
        .map(ToString::to_string)
        .collect();
    reasons.into_iter().collect()
}

/// An effect that was tried and changes no prediction of what was recorded.
pub(crate) fn unseen(units: &[&Unit<'_>], (effect, whose): Entry) -> Untestable {
    let (robot, unit) = match whose {
        Whose::Robot(robot) => (Some(robot.0), units.iter().find(|unit| unit.robot() == robot)),
        Whose::Everyone => (None, units.first()),
    };
    let mut why = "it would change nothing of what can be compared".to_owned();
    let reasons = unit.map_or_else(Vec::new, |unit| {
        omissions(effect, unit, &|own, stretch| own.matters(stretch.rows / FEW))
    });
    if !reasons.is_empty() {
        why = format!("{why} ({})", reasons.join("; "));
    }
    Untestable { effect: effect.name().to_owned(), robot, why }
}

/// Whether everything by the robot's clock has an unknown delay of its own: commands, sightings, positions.
fn all_may_be_late(unit: &Unit<'_>) -> bool {
    let prompt = [Channel::Actuator, Channel::Body, Channel::Gyro, Channel::Heading];
    unit.stretch(Channel::CommandedBody).is_some()
        && prompt.iter().all(|&channel| unit.stretch(channel).is_none())
}

/// The effects that an effect is the same as, together: a cause that shows in two elementary ways. The
/// elementary ones are tried, and it is named as their rival.
pub fn composition(effect: Effect) -> Option<[Effect; 2]> {
    match effect {
        Effect::PayloadOffset => Some([Effect::UnequalWheelRadii, Effect::TrackWidthError]),
        _ => None,
    }
}

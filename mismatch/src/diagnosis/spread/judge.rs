//! From what a likelihood shows to what may be said of it.

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::channel::Channel;
use crate::diagnosis::naming::{Estimated, GAIN_ERRORS, Judged, NEAR_END};
use crate::diagnosis::power::POWER_80;
use crate::diagnosis::select::FAMILYWISE;
use crate::diagnosis::spread::SpreadTerm;
use crate::diagnosis::spread::check::stands_out;
use crate::diagnosis::spread::family::{Family, Member, Shown, Shows};
use crate::diagnosis::spread::maximum::{Optimum, Uncertainty};
use crate::diagnosis::term::{Term, Whose};
use crate::findings::{Place, Undetected, Verdict};

/// Judges what a family of one robot shows, among so many tests.
pub(super) fn judged(family: &Family<'_, '_>, shows: &Shows, robot: RobotId, tests: usize) -> SpreadTerm {
    let member = &family.members[shows.member];
    let estimated = estimated(member, robot, &shows.with, &shows.known);
    let relevant = is_relevant(family, member, &estimated, &shows.with, &shows.known);
    let mut support = vec![member.effect];
    support.extend(&shows.rivals);
    let p_familywise = (shows.p * tests as f64).min(1.0);
    let useful = shows.gain.total > GAIN_ERRORS * shows.gain.standard_error;
    let mut verdict =
        (p_familywise < FAMILYWISE && relevant && useful).then(|| verdict(member.effect, support.len()));
    // What is left beside the whole of it has no structure.
    let rest = verdict.and_then(|_| stands_out(&family.density.checks(&shows.with.parameters)));
    if rest.is_some() {
        verdict = Some(Verdict::CannotTell);
    }
    let unnamed_rivals = rest.into_iter().map(|rest| format!("something else in {rest}")).collect();
    let judged = Judged {
        estimated: vec![estimated],
        total: None,
        verdict,
        p_familywise,
        channel: channel(member.effect, shows.channel),
        place: Place::default(),
        one_off: false,
    };
    SpreadTerm { judged, gain: shows.gain, robots: vec![robot], support, unnamed_rivals }
}

/// The parameters of the catalogue, from those of a likelihood.
pub(super) fn estimated(member: &Member, robot: RobotId, with: &Optimum, known: &Uncertainty) -> Estimated {
    let parameters = &with.parameters;
    let values = member.shown.iter().map(|shown| shown.value(parameters)).collect();
    let errors = member.shown.iter().map(|shown| shown.error(parameters, known)).collect();
    let mut term = Term::new(member.effect, Whose::Robot(robot), values);
    for (free, shown) in term.free.iter_mut().zip(&member.shown) {
        *free = !matches!(shown, Shown::Fixed(_));
    }
    Estimated { term, errors, profiled: Vec::new(), halves: Vec::new() }
}

/// The channel of an effect that shows in rows of this one: a row of sightings goes by its range, and truth only
/// tells what of the gyro is slip.
fn channel(effect: Effect, of_rows: Channel) -> Channel {
    match (effect, of_rows) {
        (Effect::MotionBlur, Channel::RangeToLandmark) => Channel::BearingToLandmark,
        (Effect::MotionBlur, Channel::RangeToRobot) => Channel::BearingToRobot,
        (Effect::GyroRandomWalk, Channel::Body) => Channel::Gyro,
        _ => of_rows,
    }
}

/// The verdict of a named effect with so many that explain it.
pub(super) fn verdict(effect: Effect, members: usize) -> Verdict {
    if members > 1 {
        Verdict::CannotTell
    } else if effect.info().bad_data {
        Verdict::BadData
    } else {
        Verdict::Named
    }
}

fn is_relevant(
    family: &Family<'_, '_>,
    member: &Member,
    estimated: &Estimated,
    with: &Optimum,
    known: &Uncertainty,
) -> bool {
    let contrast = member.contrasts.iter().any(|contrast| {
        let beyond = |(size, error): (f64, f64)| size - NEAR_END * error > contrast.threshold;
        contrast.estimate(&with.parameters, known).is_some_and(beyond)
    });
    // What is told from a declared value alone is not what was tested.
    let tested = |shown: &Shown| !matches!(shown, Shown::ExpLess(..) | Shown::Fixed(_));
    contrast
        || family.units.iter().any(|unit| {
            let parameters = estimated.term.parameters().iter().enumerate();
            parameters.filter(|(index, _)| tested(&member.shown[*index])).any(|(index, parameter)| {
                let threshold = parameter.relevance.threshold(&unit.members[0].floors);
                let size = (estimated.term.values[index] - parameter.off).abs();
                // Of a probability the logarithm is nearer to a normal distribution.
                let near = |error: f64| match member.shown[index] {
                    Shown::Exp(_) => size * libm::exp(-NEAR_END * error / size) > threshold,
                    _ => size - NEAR_END * error > threshold,
                };
                let near = |error: f64| threshold > 0.0 && near(error);
                estimated.errors[index].is_some_and(near)
            })
        })
}

/// The smallest sizes of a family's effects that would have been found in four of five recordings.
pub(super) fn undetected(
    family: &Family<'_, '_>,
    base: &Optimum,
    found: &[Effect],
    robot: RobotId,
    tests: usize,
) -> Vec<Undetected> {
    let critical = Normal::standard().inverse_cdf(1.0 - 0.5 * FAMILYWISE / tests.max(1) as f64);
    let mut all = Vec::new();
    for (position, member) in family.members.iter().enumerate() {
        if found.contains(&member.effect) {
            continue;
        }
        let info = member.effect.info();
        // Where a parameter ends at its bound, nothing is known of its error there: half a step inside.
        let mut there = base.clone();
        for (&index, (&off, &start)) in member.parameters.iter().zip(member.off.iter().zip(&member.start)) {
            there.parameters[index] = if off.is_finite() { off + 1e-3 * (start - off) } else { start };
        }
        let is_root = member.shown.iter().any(|shown| matches!(shown, Shown::Root(_)));
        let known = match member.chances {
            Some(_) => None,
            // Where a variance is off, the likelihood may bend either way.
            None if is_root => family.expected(&[position], &there),
            None => family.known(&[position], &there),
        };
        for (shown, parameter) in member.shown.iter().zip(info.parameters) {
            let threshold = family
                .units
                .iter()
                .map(|unit| parameter.relevance.threshold(&unit.members[0].floors))
                .fold(0.0, f64::max);
            // Each size for itself, the effect's other parameters off.
            let error = |index: usize| known.as_ref()?.alone(&member.parameters, index);
            let near = NEAR_END + POWER_80;
            let size = match *shown {
                Shown::Value(index) => {
                    error(index).map(|error| ((critical + POWER_80) * error).max(threshold + near * error))
                }
                // Of a square known to e the root is known to e/(2 root).
                Shown::Root(index) => error(index).map(|error| {
                    let relevant = 0.5 * (threshold + (threshold * threshold + 2.0 * near * error).sqrt());
                    ((critical + POWER_80) * error).sqrt().max(relevant)
                }),
                Shown::Inverse(index) => error(index).map(|error| {
                    let least = member.contrasts.first().map_or(0.0, |contrast| contrast.threshold);
                    1.0 / ((critical + POWER_80) * error).max(least + near * error)
                }),
                Shown::Exp(_) => member.chances.map(|chances| least_probability(chances, threshold)),
                Shown::ExpLess(..) | Shown::Fixed(_) => None,
            };
            let Some(minimum_detectable) = size.filter(|size| size.is_finite()) else { continue };
            all.push(Undetected {
                effect: info.name.to_owned(),
                robot: Some(robot.0),
                parameter: parameter.label(),
                minimum_detectable,
                unit: parameter.unit.to_owned(),
            });
        }
    }
    all
}

/// The least probability of events of so many chances whose near end is beyond a threshold in four of five
/// recordings: a count of `n p` events is known to its root.
fn least_probability(chances: usize, threshold: f64) -> f64 {
    let near = NEAR_END + POWER_80;
    let (mut low, mut high) = (threshold, 1.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        let beyond = middle * libm::exp(-near / (chances as f64 * middle).sqrt()) > threshold;
        if beyond {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

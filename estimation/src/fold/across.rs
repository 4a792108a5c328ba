//! What is seen across two components ties them, until it is known how they lie to one another (`docs/theory.md`, unknown
//! start).

mod solve;

use super::{FactKey, FoldConfig, Outcome, Residual, SkipReason, Taken, seen_poses};
use crate::fact::{Absolute, Quantity};
use crate::geometry::Matrix3;
use crate::joint::{Component, End, Joint, Measured, Tie};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;

/// So many ties of two components are kept; of more, the one that lies closest between its neighbours in time goes.
const MOST_TIES: usize = 24;
const LAST_TIES: usize = 12;

/// Whether a measurement is across two components: the map is one, also where nobody is in it.
pub(super) fn is_across(joint: &Joint, quantity: &Quantity, taken: &[Taken]) -> bool {
    let component = |taken: &Taken| joint.component(taken.0);
    let Some(observer) = taken.first().and_then(component) else { return false };
    match quantity {
        Quantity::Absolute(_) | Quantity::Landmark { .. } => observer != Component::MAP,
        Quantity::Robot { .. } | Quantity::Feature { .. } => {
            taken.get(1).and_then(component).is_some_and(|other| other != observer)
        }
    }
}

/// Takes a measurement across two components; the robots in it have been brought to its time.
pub(super) fn fold_across(
    joint: &mut Joint,
    config: &FoldConfig,
    key: &FactKey,
    quantity: &Quantity,
    noise: &Matrix3,
    taken: &[Taken],
) -> Result<Residual, SkipReason> {
    if matches!(quantity, Quantity::Landmark { relative: Relative::Pose(_), .. }) {
        return Err(SkipReason::PointHasNoHeading);
    }
    let (poses, influences) = seen_poses(joint, key.time, quantity, taken);
    let mut anchored = Vec::with_capacity(2);
    for (which, ((index, _), pose)) in taken.iter().zip(&poses).enumerate() {
        let end = joint.anchor(*index, *pose);
        if let End::Anchor(at) = end {
            for (block, _, by) in influences.iter().filter(|(_, of, _)| *of == which) {
                joint.couple(at, *block, by);
            }
        }
        anchored.push(end);
    }
    let (ends, measured) = match (quantity, anchored.as_slice()) {
        (Quantity::Robot { relative, .. } | Quantity::Feature { relative, .. }, [a, b]) => {
            ([*a, *b], Measured::Relative(*relative))
        }
        (Quantity::Landmark { position_m, relative, .. }, [a]) => {
            ([*a, End::Point(*position_m)], Measured::Relative(*relative))
        }
        (Quantity::Absolute(Absolute::Pose(pose)), [a]) => {
            ([End::Map, *a], Measured::Relative(Relative::Pose(*pose)))
        }
        (Quantity::Absolute(Absolute::Position([x_m, y_m])), [a]) => {
            ([End::Map, *a], Measured::Relative(Relative::Position { x_m: *x_m, y_m: *y_m }))
        }
        (Quantity::Absolute(Absolute::Heading(heading)), [a]) => {
            ([End::Map, *a], Measured::Heading(*heading))
        }
        _ => return Err(SkipReason::Noise),
    };
    joint.tie(Tie { time: key.time, ends, measured, noise: Symmetric3::from_lower(noise) });
    let [one, other] = ends.each_ref().map(|end| joint.component_of(end));
    let (stays, moves) = (one.min(other), one.max(other));
    thin(joint, stays, moves);
    let outcome = match solve::solve(joint, config, stays, moves) {
        Some(solution) => {
            joint.join(stays, moves, &solution.placement);
            Outcome::Joined { redundancy: solution.redundancy }
        }
        None => Outcome::Tied,
    };
    Ok(Residual::without_measurement(outcome))
}

/// Numbers of the ties of two components, in the order of time.
fn ties_of(joint: &Joint, stays: Component, moves: Component) -> Vec<usize> {
    let between = |tie: &Tie| {
        let ends = tie.ends.each_ref().map(|end| joint.component_of(end));
        ends == [stays, moves] || ends == [moves, stays]
    };
    let mut numbers: Vec<usize> =
        joint.ties().iter().enumerate().filter(|(_, tie)| between(tie)).map(|(number, _)| number).collect();
    numbers.sort_by_key(|number| (joint.ties()[*number].time, *number));
    numbers
}

fn thin(joint: &mut Joint, stays: Component, moves: Component) {
    let ties = ties_of(joint, stays, moves);
    if ties.len() <= MOST_TIES {
        return;
    }
    let time = |place: usize| joint.ties()[ties[place]].time.0;
    // The last ones stay: robots that drift are told by what they saw in one meeting.
    let closest =
        (1..ties.len() - LAST_TIES).min_by_key(|place| time(place + 1).saturating_sub(time(place - 1)));
    if let Some(place) = closest {
        joint.untie(ties[place]);
    }
}

//! Many effects linearized at once: what a model predicts is the same for all, and most of the work.
//!
//! An effect that has directions to start in is off at its start, so that it may stand in the same model as
//! others that are: their derivatives are those that each would have alone.

mod push;

use pleiad_physics::{Effect, Variable};

use crate::channel::Channel;
use crate::diagnosis::fit::{State, residuals};
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Column, MOST_AT_ONCE, Stretch, Unit, Values};
use pleiad_recording::parallel;

/// An effect at a start.
pub(crate) struct Request {
    pub(crate) term: Term,
    /// The parameters to differentiate by; empty for one column that is the effect itself at the values.
    pub(crate) along: Vec<usize>,
}

/// A piece of the work.
enum Job {
    /// Derivatives of a group of stretches of a unit: requests, and positions in what they are along.
    Slopes { unit: usize, group: Vec<usize>, slots: Vec<(usize, usize)> },
    /// The same of pushes in one stretch: of each only the windows around it.
    Pushes { unit: usize, which: usize, requests: Vec<usize> },
    /// A whole effect in a unit.
    Whole { unit: usize, request: usize },
}

/// The columns of requests per unit that they act on, with the unit's position, beside the terms of a
/// hypothesis.
pub(crate) fn linearized(
    units: &[&Unit<'_>],
    terms: &[Term],
    states: &[State],
    requests: &[Request],
) -> Vec<Vec<(usize, Vec<Column>)>> {
    let jobs = jobs(units, terms, requests);
    let done = parallel::map(&jobs, |job| match job {
        Job::Slopes { unit, group, slots } => slopes(units[*unit], terms, requests, group, slots),
        Job::Pushes { unit, which, requests: pushes } => {
            let pushes: Vec<&Request> = pushes.iter().map(|&push| &requests[push]).collect();
            push::slopes(units[*unit], terms, &pushes, *which)
        }
        Job::Whole { unit, request } => {
            vec![whole(units[*unit], terms, &states[*unit], &requests[*request].term)]
        }
    });
    let empty = |request: &Request| -> Vec<(usize, Vec<Column>)> {
        let acting = (0..units.len()).filter(|&unit| units[unit].has(&request.term));
        acting.map(|unit| (unit, vec![Column::empty(units[unit]); request.along.len().max(1)])).collect()
    };
    let mut all: Vec<Vec<(usize, Vec<Column>)>> = requests.iter().map(empty).collect();
    let mut place = |request: usize, unit: usize, position: usize, which: usize, part: Option<Vec<f64>>| {
        if let Some((_, columns)) = all[request].iter_mut().find(|(own, _)| *own == unit) {
            columns[position].parts[which] = part;
        }
    };
    for (job, values) in jobs.iter().zip(done) {
        match job {
            Job::Slopes { unit, group, slots } => {
                for (&(request, position), parts) in slots.iter().zip(values) {
                    for (&which, part) in group.iter().zip(parts) {
                        place(request, *unit, position, which, part);
                    }
                }
            }
            Job::Pushes { unit, which, requests: pushes } => {
                let slots = pushes
                    .iter()
                    .flat_map(|&push| (0..requests[push].along.len()).map(move |position| (push, position)));
                for ((push, position), part) in slots.zip(values.into_iter().flatten()) {
                    place(push, *unit, position, *which, part);
                }
            }
            Job::Whole { unit, request } => {
                for (which, part) in values.into_iter().flatten().enumerate() {
                    place(*request, *unit, 0, which, part);
                }
            }
        }
    }
    all
}

fn jobs(units: &[&Unit<'_>], terms: &[Term], requests: &[Request]) -> Vec<Job> {
    let mut jobs = Vec::new();
    for (index, unit) in units.iter().enumerate() {
        for group in unit.groups() {
            let robot = unit.members[unit.stretches[group[0]].member].robot;
            let own = || requests.iter().enumerate().filter(|(_, request)| request.term.acts_on(robot));
            let channels = || group.iter().map(|&which| unit.stretches[which].channel);
            let showing =
                own().filter(|(_, request)| channels().any(|channel| touches(request.term.effect, channel)));
            let (pushes, rest): (Vec<_>, Vec<_>) =
                showing.partition(|(_, request)| request.term.effect == Effect::Push);
            let slots = |requests: &[(usize, &Request)]| -> Vec<(usize, usize)> {
                let all = requests.iter();
                all.flat_map(|(request, own)| (0..own.along.len()).map(move |position| (*request, position)))
                    .collect()
            };
            let rest = slots(&rest);
            // Which window shows a push depends on its instant: no two in one model.
            if let [which] = group[..]
                && push::is_local(unit, terms, which)
            {
                let pushes: Vec<usize> = pushes.iter().map(|(request, _)| *request).collect();
                if !pushes.is_empty() {
                    jobs.push(Job::Pushes { unit: index, which, requests: pushes });
                }
                let chunks = rest.chunks(MOST_AT_ONCE).map(<[_]>::to_vec);
                jobs.extend(chunks.map(|slots| Job::Slopes { unit: index, group: group.clone(), slots }));
                continue;
            }
            let pushes = pushes.iter().map(|push| slots(std::slice::from_ref(push)));
            let chunks = rest.chunks(MOST_AT_ONCE).map(<[_]>::to_vec).chain(pushes);
            jobs.extend(chunks.map(|slots| Job::Slopes { unit: index, group: group.clone(), slots }));
        }
        let own = requests.iter().enumerate().filter(|(_, request)| unit.has(&request.term));
        let whole = own.filter(|(_, request)| request.along.is_empty());
        jobs.extend(whole.map(|(request, _)| Job::Whole { unit: index, request }));
    }
    jobs
}

/// The derivatives of a group of stretches with respect to parameters of several requests.
fn slopes(
    unit: &Unit<'_>,
    terms: &[Term],
    requests: &[Request],
    group: &[usize],
    slots: &[(usize, usize)],
) -> Vec<Values> {
    let Some(&first) = group.first() else { return Vec::new() };
    let mut model = unit.members[unit.stretches[first].member].model(terms);
    let mut variables = Vec::with_capacity(slots.len());
    let mut before = None;
    for &(request, position) in slots {
        if before != Some(request) {
            model.effects.push(requests[request].term.active());
            before = Some(request);
        }
        let index = model.effects.len() - 1;
        variables.push(Variable::Effect { index, parameter: requests[request].along[position] });
    }
    unit.slopes(&model, &variables, group)
}

/// What an effect changes in each stretch of a unit.
fn whole(unit: &Unit<'_>, terms: &[Term], state: &State, term: &Term) -> Values {
    let mut all = terms.to_vec();
    all.push(term.clone());
    let channels = |channel: Channel| touches(term.effect, channel);
    let Some(there) = residuals(unit, &all, &channels, Some(&state.residuals)) else {
        return vec![None; unit.stretches.len()];
    };
    let part = |stretch: &Stretch| {
        let range = stretch.range();
        let difference: Vec<f64> =
            there[range.clone()].iter().zip(&state.residuals[range]).map(|(a, b)| a - b).collect();
        difference.iter().any(|value| *value != 0.0).then_some(difference)
    };
    unit.stretches.iter().map(part).collect()
}

#[cfg(test)]
mod tests;

//! Effects that could be added to a hypothesis, linearized where their search begins.

use pleiad_physics::{Effect, Variable};

use crate::diagnosis::fit::{State, residuals};
use crate::diagnosis::starts::{Start, starts};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Column, Unit};

/// A start of an effect with its columns.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub(crate) term: Term,
    /// Parameters that the columns are derivatives by; empty for one column that is the effect itself at the
    /// values of the term.
    pub(crate) along: Vec<usize>,
    /// Per unit that it acts on: the unit's position and the columns.
    pub(crate) columns: Vec<(usize, Vec<Column>)>,
}

/// Linearizes an effect at all its starts beside the terms of a hypothesis. Starts that show nowhere are left
/// out; parameters that do not show stay at their values.
pub(crate) fn candidates(
    effect: Effect,
    whose: Whose,
    units: &[&Unit<'_>],
    terms: &[Term],
    states: &[State],
) -> Vec<Candidate> {
    let own: Vec<usize> = (0..units.len()).filter(|&unit| acts(whose, units[unit])).collect();
    let acting: Vec<&Unit<'_>> = own.iter().map(|&unit| units[unit]).collect();
    let mut found = Vec::new();
    for start in starts(effect, &acting) {
        let term = Term::new(effect, whose, start.values.clone());
        let columns: Vec<Vec<Column>> =
            own.iter().map(|&unit| linearized(units[unit], &term, &start, terms, &states[unit])).collect();
        if let Some(candidate) = shown(term, &start, &own, columns) {
            found.push(candidate);
        }
    }
    found
}

fn acts(whose: Whose, unit: &Unit<'_>) -> bool {
    match whose {
        Whose::Robot(robot) => robot == unit.robot,
        Whose::Everyone => true,
    }
}

fn linearized(unit: &Unit<'_>, term: &Term, start: &Start, terms: &[Term], state: &State) -> Vec<Column> {
    let channels = |channel| touches(term.effect, channel);
    if start.along.is_empty() {
        let mut all = terms.to_vec();
        all.push(term.clone());
        let Some(there) = residuals(unit, &all, &channels, Some(&state.residuals)) else {
            return vec![Column::empty(unit)];
        };
        let part = |stretch: &crate::diagnosis::unit::Stretch| {
            let range = stretch.range();
            let difference: Vec<f64> =
                there[range.clone()].iter().zip(&state.residuals[range]).map(|(a, b)| a - b).collect();
            difference.iter().any(|value| *value != 0.0).then_some(difference)
        };
        return vec![Column { parts: unit.stretches.iter().map(part).collect() }];
    }
    let mut model = unit.model(terms);
    let index = model.effects.len();
    model.effects.push(term.active());
    let variables: Vec<Variable> =
        start.along.iter().map(|&parameter| Variable::Effect { index, parameter }).collect();
    unit.columns(&model, &variables, &channels)
}

/// Keeps the columns that show somewhere.
fn shown(mut term: Term, start: &Start, own: &[usize], columns: Vec<Vec<Column>>) -> Option<Candidate> {
    let count = columns.first()?.len();
    let shows: Vec<bool> =
        (0..count).map(|index| columns.iter().any(|columns| !columns[index].is_zero())).collect();
    if !shows.contains(&true) {
        return None;
    }
    for (&parameter, &shows) in start.along.iter().zip(&shows) {
        term.free[parameter] = term.free[parameter] && shows;
    }
    let along = start.along.iter().zip(&shows).filter(|(_, shows)| **shows).map(|(index, _)| *index).collect();
    let keep = |columns: Vec<Column>| -> Vec<Column> {
        columns.into_iter().zip(&shows).filter(|(_, shows)| **shows).map(|(column, _)| column).collect()
    };
    let columns = own.iter().copied().zip(columns.into_iter().map(keep)).collect();
    Some(Candidate { term, along, columns })
}

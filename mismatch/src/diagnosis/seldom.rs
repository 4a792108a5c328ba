//! Places in which a robot was too seldom for what is found there to be tried on data left out.

use std::collections::BTreeSet;

use pleiad_physics::Region;

use crate::diagnosis::fit::{Fit, Slot, columns};
use crate::diagnosis::held_out::{FEWEST_BLOCKS, FOLDS, fold};
use crate::diagnosis::starts::Placing;
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Column, Row, Stretch, Unit};
use crate::diagnosis::white::{White, step};

/// A place that fewer folds than this saw is not tried on folds: what is fitted on the others says nothing of those.
const FEWEST_FOLDS: usize = 3;

/// How often robots were where a term acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seen {
    /// It acts everywhere, or in a place where they were often.
    Often,
    /// In a place where they were in few blocks of time, of several folds.
    Seldom,
    /// In a place that too few folds saw.
    Once,
}

/// How often robots were where a term acts.
pub(crate) fn seen(units: &[&Unit<'_>], term: &Term) -> Seen {
    let Some(first) = Placing::of(term.effect.info()).region else { return Seen::Often };
    let values = &term.values;
    let region =
        Region::from_bounds([values[first], values[first + 1], values[first + 2], values[first + 3]]);
    let (mut blocks, mut folds) = (BTreeSet::new(), BTreeSet::new());
    for (index, unit) in units.iter().enumerate() {
        let shown = unit.stretches.iter().filter(|stretch| touches(term.effect, stretch.channel));
        for row in shown.flat_map(Stretch::range) {
            let Row { time_s, regime, .. } = &unit.rows[row];
            if regime.pose.is_some_and(|pose| region.contains(pose.position())) {
                blocks.insert((index, unit.block_of[row]));
                folds.extend((0..FOLDS).filter(|&number| fold(unit, number).contains(time_s)));
            }
        }
    }
    match (blocks.len(), folds.len()) {
        (FEWEST_BLOCKS.., FEWEST_FOLDS..) => Seen::Often,
        (_, FEWEST_FOLDS..) => Seen::Seldom,
        _ => Seen::Once,
    }
}

/// By how much the errors that the effect of a term would be mistaken for are correlated along the whole
/// recording: in a place there are too few blocks to say. At least 1.
pub(crate) fn inflation_everywhere(units: &[&Unit<'_>], without: &Fit, term: &Term) -> f64 {
    let mut terms = without.terms.clone();
    let mut everywhere = term.clone();
    let placing = Placing::of(term.effect.info());
    placing.widen(&mut everywhere.values);
    let placed = |parameter: usize| {
        placing.onset == Some(parameter)
            || placing.region.is_some_and(|first| (first..first + 4).contains(&parameter))
    };
    let along = (0..term.values.len()).filter(|&parameter| term.free[parameter] && !placed(parameter));
    let slots: Vec<Slot> = along.map(|parameter| (terms.len(), parameter)).collect();
    terms.push(everywhere);
    let shown: Vec<Vec<Column>> = units.iter().map(|unit| columns(unit, &terms, &slots)).collect();
    let whites: Vec<White<'_, '_>> = units
        .iter()
        .zip(&without.states)
        .zip(&without.columns)
        .map(|((unit, state), columns)| White::new(unit, state, columns))
        .collect();
    let shown: Vec<&[Column]> = shown.iter().map(Vec::as_slice).collect();
    step(&whites.iter().collect::<Vec<_>>(), &shown).map_or(1.0, |step| step.inflation.max(1.0))
}

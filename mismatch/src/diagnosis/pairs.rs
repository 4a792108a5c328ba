//! Two effects at once, of which neither is worth anything alone.
//!
//! Effects that hide each other gain little one at a time: forward selection ends before it has seen them. So when it
//! has ended, every two candidates of a robot are tried together, by the products of their columns: the
//! gain of two follows from four numbers.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_physics::Effect;

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN, Pool, fit_beside, whites};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::{Step, White, dot, step};
use pleiad_recording::parallel;

/// So many of the strongest pairs are fitted.
const FITTED: usize = 2;
/// What is left of a column beside what is fitted must be more than this share of it.
const LEAST_LEFT: f64 = 1e-3;
/// Two columns that are this much alike say one thing.
const ALIKE: f64 = 1.0 - 1e-4;

/// Two effects more of one robot, beside what is fitted; `None` if no two are worth it.
pub(crate) fn two_more(units: &[&Unit<'_>], pool: &Pool, current: &Fit) -> Option<[Term; 2]> {
    let mut robots: Vec<Whose> = pool.candidates().map(|candidate| candidate.term.whose).collect();
    robots.sort_unstable();
    robots.dedup();
    robots.retain(|whose| matches!(whose, Whose::Robot(_)));
    let found = parallel::map(&robots, |&whose| of_robot(units, pool, current, whose));
    found.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, added)| added)
}

/// The best two of a robot, and what they gain.
fn of_robot(units: &[&Unit<'_>], pool: &Pool, current: &Fit, whose: Whose) -> Option<(f64, [Term; 2])> {
    let known = |effect: Effect| current.terms.iter().any(|term| term.effect == effect);
    let candidates: Vec<&Candidate> = pool
        .candidates()
        .filter(|own| own.term.whose == whose && !own.along.is_empty() && !own.is_placed())
        .filter(|own| !known(own.term.effect))
        .collect();
    let probe = &candidates.first()?.term;
    let acting: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].has(probe)).collect();
    let whites = whites(units, current);
    let table = Table::new((units, &acting), &whites, &candidates);
    let mut best: Option<(f64, [Term; 2])> = None;
    for [first, second] in table.strongest() {
        let pair = [candidates[first], candidates[second]];
        let Some(step) = together(units, &whites, pair) else { continue };
        let gain = step.gain / step.inflation.max(1.0);
        let p = upper_tail(step.wald, step.change.len()) * table.tried();
        if p >= FAMILYWISE || gain <= table.alone[first].max(table.alone[second]) + LEAST_GAIN {
            continue;
        }
        let split = pair[0].along.len();
        let change: Vec<f64> = step.change.iter().copied().collect();
        let [a, b] = [moved(pair[0], &change[..split]), moved(pair[1], &change[split..])];
        let Some(alone) = fit_beside(units, current, a) else { continue };
        let before: f64 = acting.iter().map(|&unit| current.states[unit].noise.log_likelihood).sum();
        let own: Vec<&Unit<'_>> = acting.iter().map(|&unit| units[unit]).collect();
        let Some(both) = fit_beside(&own, &alone, b) else { continue };
        let reached = 2.0 * (both.log_likelihood - before) / step.inflation.max(1.0);
        let [.., a, b] = both.terms.as_slice() else { continue };
        let inside = a.is_inside() && b.is_inside();
        if inside && reached > 2.0 * LEAST_GAIN && best.as_ref().is_none_or(|(most, _)| reached > *most) {
            best = Some((reached, [a.clone(), b.clone()]));
        }
    }
    best
}

/// Products of the columns of candidates, what is fitted taken out of them.
struct Table {
    /// The effect of each candidate.
    effects: Vec<Effect>,
    /// The positions of its columns.
    places: Vec<Vec<usize>>,
    products: DMatrix<f64>,
    scores: DVector<f64>,
    /// What each candidate gains alone.
    alone: Vec<f64>,
}

impl Table {
    /// Of the units that candidates act on, by their positions.
    fn new(
        (units, acting): (&[&Unit<'_>], &[usize]),
        whites: &[White<'_, '_>],
        candidates: &[&Candidate],
    ) -> Self {
        let mut places = Vec::with_capacity(candidates.len());
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut first_row: BTreeMap<usize, usize> = BTreeMap::new();
        let mut whole = 0;
        for &unit in acting {
            first_row.insert(unit, whole);
            whole += units[unit].rows.len();
        }
        for candidate in candidates {
            let shown = candidate.columns(units);
            let first = columns.len();
            columns.resize(first + candidate.along.len(), vec![0.0; whole]);
            for (unit, own) in &shown {
                for (position, column) in own.iter().enumerate() {
                    for (stretch, part) in units[*unit].stretches.iter().zip(whites[*unit].of(column)) {
                        let Some(part) = part else { continue };
                        let from = first_row[unit] + stretch.offset;
                        columns[first + position][from..from + part.len()].copy_from_slice(&part);
                    }
                }
            }
            places.push((first..columns.len()).collect());
        }
        let mut fitted: Vec<Vec<f64>> = vec![vec![0.0; whole]; active_of(acting, whites)];
        let mut errors = Vec::with_capacity(whole);
        for (unit, white) in acting.iter().map(|&unit| (units[unit], &whites[unit])) {
            let from = errors.len();
            errors.extend_from_slice(&white.errors);
            for (which, stretch) in unit.stretches.iter().enumerate() {
                for (slot, part) in white.columns(which) {
                    let own = &mut fitted[slot][from + stretch.offset..][..part.len()];
                    own.copy_from_slice(part);
                }
            }
        }
        // Gram-Schmidt: what is fitted among itself, then out of candidates and errors.
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut own in fitted {
            let before = dot(&own, &own);
            take_out(&basis, &mut own);
            let left = dot(&own, &own);
            if left > LEAST_LEFT * LEAST_LEFT * before && left > 0.0 {
                let scale = left.sqrt().recip();
                for value in &mut own {
                    *value *= scale;
                }
                basis.push(own);
            }
        }
        take_out(&basis, &mut errors);
        for own in &mut columns {
            let before = dot(own, own);
            take_out(&basis, own);
            if dot(own, own) <= LEAST_LEFT * before {
                own.fill(0.0);
            }
        }
        let products = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            if j > i { 0.0 } else { dot(&columns[i], &columns[j]) }
        });
        let products = DMatrix::from_fn(columns.len(), columns.len(), |i, j| products[(i.max(j), i.min(j))]);
        let scores = DVector::from_fn(columns.len(), |i, _| dot(&columns[i], &errors));
        let effects = candidates.iter().map(|own| own.term.effect).collect();
        let mut table = Self { effects, places, products, scores, alone: Vec::new() };
        table.alone = (0..candidates.len()).map(|own| table.gain(&table.places[own])).collect();
        table
    }

    /// What columns gain together, twice in log-likelihood; 0 if they say one thing.
    fn gain(&self, columns: &[usize]) -> f64 {
        let own = |i: usize, j: usize| self.products[(columns[i], columns[j])];
        let count = columns.len();
        if (0..count).any(|i| own(i, i) <= 0.0) {
            return 0.0;
        }
        let alike = |i: usize, j: usize| own(i, j).abs() > ALIKE * (own(i, i) * own(j, j)).sqrt();
        if (0..count).any(|i| (0..i).any(|j| alike(i, j))) {
            return 0.0;
        }
        let scores = DVector::from_fn(count, |i, _| self.scores[columns[i]]);
        DMatrix::from_fn(count, count, own)
            .cholesky()
            .map_or(0.0, |factor| scores.dot(&factor.solve(&scores)))
    }

    fn tried(&self) -> f64 {
        let count = self.places.len() as f64;
        (0.5 * count * (count - 1.0)).max(1.0)
    }

    /// The pairs of different effects that gain most beyond the better of the two; the best start of each two effects.
    fn strongest(&self) -> Vec<[usize; 2]> {
        let mut best: BTreeMap<[Effect; 2], (f64, [usize; 2])> = BTreeMap::new();
        for second in 0..self.places.len() {
            for first in 0..second {
                if self.effects[first] == self.effects[second] {
                    continue;
                }
                let both = [self.places[first].as_slice(), &self.places[second]].concat();
                let better = self.gain(&both) - self.alone[first].max(self.alone[second]);
                let pair = [self.effects[first], self.effects[second]];
                if better > LEAST_GAIN && best.get(&pair).is_none_or(|(most, _)| better > *most) {
                    best.insert(pair, (better, [first, second]));
                }
            }
        }
        let mut all: Vec<(f64, [usize; 2])> = best.into_values().collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all.into_iter().take(FITTED).map(|(_, pair)| pair).collect()
    }
}

/// How many parameters are fitted.
fn active_of(acting: &[usize], whites: &[White<'_, '_>]) -> usize {
    let last = |&unit: &usize| {
        let stretches = 0..whites[unit].unit.stretches.len();
        let slots = stretches.flat_map(|which| whites[unit].columns(which).map(|(slot, _)| slot + 1));
        slots.max().unwrap_or(0)
    };
    acting.iter().map(last).max().unwrap_or(0)
}

fn take_out(basis: &[Vec<f64>], own: &mut [f64]) {
    for direction in basis {
        let share = dot(direction, own);
        for (value, along) in own.iter_mut().zip(direction) {
            *value -= share * along;
        }
    }
}

fn moved(candidate: &Candidate, change: &[f64]) -> Term {
    let mut term = candidate.term.clone();
    for (&parameter, change) in candidate.along.iter().zip(change) {
        term.values[parameter] += change;
    }
    term.clamp();
    term
}

/// The step along the columns of two candidates of the same units.
fn together(units: &[&Unit<'_>], whites: &[White<'_, '_>], pair: [&Candidate; 2]) -> Option<Step> {
    let [first, second] = pair.map(|candidate| candidate.columns(units));
    let mut columns: Vec<Vec<Column>> = Vec::with_capacity(first.len());
    let mut own: Vec<&White<'_, '_>> = Vec::with_capacity(first.len());
    for ((unit, first), (same, second)) in first.iter().zip(&second) {
        if unit != same {
            return None;
        }
        columns.push(first.iter().chain(second.iter()).cloned().collect());
        own.push(&whites[*unit]);
    }
    let columns: Vec<&[Column]> = columns.iter().map(Vec::as_slice).collect();
    step(&own, &columns)
}

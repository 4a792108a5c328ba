//! Two effects at once, where one at a time leads astray.
//!
//! Of two effects that hide each other neither gains much alone, and a third that resembles what is left of both gains
//! more. Forward selection then ends with the third, or with nothing. So when it has ended, every two candidates of a
//! robot are tried together: beside all that was found, and in place of each of its terms.

use std::collections::BTreeMap;

use pleiad_physics::Effect;

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::fit::{Effort, Fit, State, fit, fit_at};
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN, Pool, Scored, fit_beside, score, whites};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::{Step, White, step};
use crate::parallel;

/// So many of the strongest candidates are tried in pairs.
const STRONGEST: usize = 16;
/// So many of the strongest pairs are fitted.
const FITTED: usize = 3;
/// A pair must be better than what it replaces by this, twice in log-likelihood beyond the price of its parameters: odds
/// of more than a hundred.
const LEAST_BETTER: f64 = 10.0;

/// The fit with two effects more, one of which may take the place of a term; `None` if no two are worth it.
pub(crate) fn with_two(units: &[&Unit<'_>], pool: &Pool, current: &Fit) -> Option<Fit> {
    let mut robots: Vec<Whose> = pool.candidates().map(|candidate| candidate.term.whose).collect();
    robots.sort_unstable();
    robots.dedup();
    robots.retain(|whose| matches!(whose, Whose::Robot(_)));
    let found = parallel::map(&robots, |&whose| of_robot(units, pool, current, whose));
    let (_, terms) = found.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0))?;
    fit(units, terms, &|_| true, Effort::RIVAL)
}

/// What is better of one robot, by how much, and all terms with it.
fn of_robot(units: &[&Unit<'_>], pool: &Pool, current: &Fit, whose: Whose) -> Option<(f64, Vec<Term>)> {
    let probe = pool.candidates().find(|candidate| candidate.term.whose == whose)?;
    let own: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].has(&probe.term)).collect();
    let acting: Vec<&Unit<'_>> = own.iter().map(|&unit| units[unit]).collect();
    let states: Vec<State> = own.iter().map(|&unit| current.states[unit].clone()).collect();
    let candidates: Vec<Candidate> = pool
        .candidates()
        .filter(|candidate| candidate.term.whose == whose && !candidate.along.is_empty())
        .map(|candidate| candidate.renumbered(&own))
        .collect();
    let terms: Vec<Term> =
        current.terms.iter().filter(|term| acting.iter().any(|unit| unit.has(term))).cloned().collect();
    let likelihood: f64 = states.iter().map(|state| state.noise.log_likelihood).sum();
    let rows = acting.iter().map(|unit| unit.rows.len()).sum::<usize>() as f64;
    let removable = (0..terms.len()).filter(|&index| terms[index].whose == whose).map(Some);
    let mut best: Option<(f64, Vec<Term>)> = None;
    for removed in [None].into_iter().chain(removable) {
        let mut rest = terms.clone();
        let gone = removed.map(|index| rest.remove(index));
        let movable: Vec<bool> = rest.iter().map(|term| term.whose == whose).collect();
        let base = match &gone {
            None => Fit { terms: rest, states: states.clone(), ..restricted(current, &own, &terms)? },
            Some(_) => fit_at(&acting, rest, &states, &|index| movable[index], Effort::RIVAL)?,
        };
        let price = |parameters: usize, inflation: f64| parameters as f64 * (rows / inflation).max(2.0).ln();
        let parameters_gone = gone.as_ref().map_or(0, |term| term.free.iter().filter(|free| **free).count());
        for pair in strongest(&acting, &base, &candidates, gone.is_none()) {
            let inflation = pair.step.inflation.max(1.0);
            let Some(first) = fit_beside(&acting, &base, pair.terms[0].clone()) else { continue };
            let Some(both) = fit_beside(&acting, &first, pair.terms[1].clone()) else { continue };
            let count = both.terms.len();
            if !both.terms[count - 2..].iter().all(Term::is_inside) {
                continue;
            }
            let parameters: usize = pair.step.change.len();
            let gained = 2.0 * (both.log_likelihood - likelihood) / inflation;
            let better = gained - price(parameters, inflation) + price(parameters_gone, inflation);
            if better > LEAST_BETTER && best.as_ref().is_none_or(|(most, _)| better > *most) {
                let kept = |term: &&Term| gone.as_ref().is_none_or(|gone| !gone.is_of(term));
                let mut all: Vec<Term> = current.terms.iter().filter(kept).cloned().collect();
                all.extend(both.terms[count - 2..].iter().cloned());
                best = Some((better, all));
            }
        }
    }
    best
}

/// A fit on some of its units, with the terms that act on them.
fn restricted(whole: &Fit, own: &[usize], terms: &[Term]) -> Option<Fit> {
    let mut slots = Vec::new();
    let mut kept = Vec::new();
    for (position, &(term, parameter)) in whole.slots.iter().enumerate() {
        if let Some(place) = terms.iter().position(|known| known.is_of(&whole.terms[term])) {
            slots.push((place, parameter));
            kept.push(position);
        }
    }
    let of_unit = |&unit: &usize| -> Vec<Column> {
        kept.iter().map(|&slot| whole.columns[unit][slot].clone()).collect()
    };
    let states: Vec<State> =
        own.iter().map(|&unit| whole.states.get(unit).cloned()).collect::<Option<_>>()?;
    Some(Fit {
        terms: terms.to_vec(),
        log_likelihood: states.iter().map(|state| state.noise.log_likelihood).sum(),
        states,
        slots,
        columns: own.iter().map(of_unit).collect(),
    })
}

/// Two terms where a step leads, and the step.
struct Pair {
    terms: [Term; 2],
    step: Step,
}

/// The pairs that gain most by linearization, if they are significant. With `alone` neither of the two may be enough.
fn strongest(units: &[&Unit<'_>], base: &Fit, candidates: &[Candidate], alone: bool) -> Vec<Pair> {
    let whites = whites(units, base);
    let known = |effect: Effect| base.terms.iter().any(|term| term.effect == effect);
    let mut best: BTreeMap<Effect, Scored> = BTreeMap::new();
    for candidate in candidates.iter().filter(|candidate| !known(candidate.term.effect)) {
        let Some(scored) = score(units, &whites, candidate) else { continue };
        if best.get(&candidate.term.effect).is_none_or(|known| scored.step.gain > known.step.gain) {
            best.insert(candidate.term.effect, scored);
        }
    }
    let pairs_tried = best.len() * best.len().saturating_sub(1) / 2;
    let mut singles: Vec<Scored> = best.into_values().collect();
    singles.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    singles.truncate(STRONGEST);
    let single_best = singles.first().map_or(0.0, Scored::gain);
    let mut found: Vec<Pair> = Vec::new();
    for (position, first) in singles.iter().enumerate() {
        for second in &singles[position + 1..] {
            let Some(step) = together(units, &whites, [&first.candidate, &second.candidate]) else {
                continue;
            };
            let inflation = step.inflation.max(1.0);
            let (gain, p) = (step.gain / inflation, upper_tail(step.wald, step.change.len()));
            let enough = gain > single_best + LEAST_GAIN && p * (pairs_tried as f64) < FAMILYWISE;
            if enough && (!alone || gain > LEAST_GAIN) {
                let split = first.candidate.along.len();
                let change: Vec<f64> = step.change.iter().copied().collect();
                let terms =
                    [moved(&first.candidate, &change[..split]), moved(&second.candidate, &change[split..])];
                found.push(Pair { terms, step });
            }
        }
    }
    found.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    found.truncate(FITTED);
    found
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

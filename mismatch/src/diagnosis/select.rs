//! Forward selection of effects, with re-linearization after each, and pruning.

use std::collections::BTreeMap;

use pleiad_physics::{Channel as Needed, Effect, Parameter, Relevance};

use crate::diagnosis::candidate::{Candidate, candidates};
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::fit::{Effort, Fit, Slot, State, fit, fit_from, with_another};
use crate::diagnosis::pairs::two_more;
use crate::diagnosis::profile::{is_on, is_threshold, polish_some};
use crate::diagnosis::refine::refine;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::wald::{covariance, wald};
use crate::diagnosis::white::{Step, White, step};
use pleiad_recording::parallel;

/// Probability that anything is found in a clean recording, over everything that is tried in it.
pub(crate) const FAMILYWISE: f64 = 0.002;

/// A probability among all tests, if it is small enough for a finding.
pub(crate) fn familywise(p: f64) -> Option<f64> {
    (p < FAMILYWISE).then_some(p)
}
/// An effect enters only if it gains more than this, twice in log-likelihood.
pub(crate) const LEAST_GAIN: f64 = 20.0;
/// A term is dropped if it is this likely without the effect.
const PRUNE: f64 = 1e-4;
/// A rival that gains less than this share of the best one by linearization is not fitted.
const LEAST_SHARE: f64 = 0.4;
/// So many rivals are fitted before one is chosen.
const RIVALS: usize = 8;
/// The most rounds of additions.
const MOST_ROUNDS: usize = 24;
/// So often two effects are added at once.
const MOST_PAIRS: usize = 2;
/// A step from "off" to a start is a sound guess if the data want between these multiples of it.
const SOUND_STEP: std::ops::RangeInclusive<f64> = 0.2..=4.0;

/// An effect and whose it could be.
pub(crate) type Entry = (Effect, Whose);

/// A candidate with its step.
#[derive(Clone, Debug)]
pub(crate) struct Scored {
    pub(crate) candidate: Candidate,
    pub(crate) step: Step,
    /// Probability of as strong a step without the effect, at this start alone.
    pub(crate) p: f64,
}

/// A hypothesis: what is fitted, and how it was found.
pub(crate) struct Selected {
    pub(crate) fit: Fit,
    /// How many starts were tried: what a probability is multiplied by.
    pub(crate) tests: usize,
    /// What could be added, linearized beside the terms that were found.
    pub(crate) pool: Pool,
}

/// Adds effects from `entries` to terms as long as one is significant; prunes.
pub(crate) fn select(units: &[&Unit<'_>], entries: &[Entry], terms: Vec<Term>) -> Option<Selected> {
    let mut current = fit(units, terms, &|_| true, Effort::FULL)?;
    let mut pool = Pool::default();
    let mut tests = 0;
    for _ in 0..MOST_ROUNDS {
        let scored = pool.scored(units, entries, &current);
        tests = tests.max(scored.len());
        let whites = whites(units, &current);
        let added = additions(units, &whites, &current, &scored, tests);
        if added.is_empty() {
            // Nothing by linearizations that may be stale: once more by fresh ones.
            if pool.is_fresh(&current.terms) {
                break;
            }
            pool.freshen(units, &current.terms);
            continue;
        }
        for fit in &added {
            pool.forget(fit.terms.last()?);
        }
        if units.iter().all(|unit| unit.mesh.is_none()) {
            for fit in added {
                current = joined(units, &current, &fit)?;
            }
        } else {
            // Terms of one robot show in what others see of it: all are fitted together, and the noise anew.
            let mut terms = current.terms;
            terms.extend(added.into_iter().filter_map(|fit| fit.terms.last().cloned()));
            let joined = fit(units, terms, &|_| true, Effort::RIVAL)?;
            current = fit(units, joined.terms, &|_| true, Effort::RIVAL)?;
        }
    }
    let current = fit(units, current.terms, &|_| true, Effort::FULL)?;
    let mut fitted = prune(units, current)?;
    // By what a team measured of each other a column is no column of one robot.
    let meshed = units.iter().any(|unit| unit.mesh.is_some());
    for _ in 0..if meshed { 0 } else { MOST_PAIRS } {
        let Some(added) = two_more(units, &pool, &fitted) else { break };
        let terms = fitted.terms.into_iter().chain(added).collect();
        fitted = prune(units, fit(units, terms, &|_| true, Effort::FULL)?)?;
    }
    Some(Selected { fit: fitted, tests, pool })
}

/// Linearized candidates. What is linear enough is kept when terms are added: it serves to choose whom to fit.
#[derive(Default)]
pub(crate) struct Pool {
    known: BTreeMap<Entry, Vec<Candidate>>,
    /// The terms of the robots that each was linearized beside.
    beside: BTreeMap<Entry, Vec<Term>>,
    /// How many terms there were when the oldest of them was linearized.
    terms: Option<usize>,
}

impl Pool {
    /// Every candidate of the entries that are not among the terms of a fit, scored.
    pub(crate) fn scored(&mut self, units: &[&Unit<'_>], entries: &[Entry], current: &Fit) -> Vec<Scored> {
        let open: Vec<Entry> = entries
            .iter()
            .copied()
            .filter(|&(effect, whose)| {
                !current.terms.iter().any(|term| term.effect == effect && overlap(term.whose, whose))
            })
            .collect();
        let missing: Vec<Entry> =
            open.iter().copied().filter(|entry| !self.known.contains_key(entry)).collect();
        let found = candidates(&missing, units, &current.terms, &current.states);
        if self.known.is_empty() {
            self.terms = Some(current.terms.len());
        }
        for &entry in &missing {
            self.beside.insert(entry, beside(entry, &current.terms));
        }
        self.known.extend(missing.into_iter().zip(found));
        let whites: Vec<White<'_, '_>> = whites(units, current);
        let scores = parallel::map(&open, |entry| {
            self.known[entry]
                .iter()
                .filter_map(|candidate| score(units, &whites, candidate))
                .collect::<Vec<_>>()
        });
        scores.into_iter().flatten().collect()
    }

    /// Every candidate, whether or not it adds anything to a fit.
    pub(crate) fn candidates(&self) -> impl Iterator<Item = &Candidate> {
        self.known.values().flatten()
    }

    /// Forgets what these terms change. A robot that is judged by itself and has the terms that it had predicts what it
    /// predicted.
    fn freshen(&mut self, units: &[&Unit<'_>], terms: &[Term]) {
        if units.iter().any(|unit| unit.mesh.is_some()) {
            *self = Self::default();
            return;
        }
        let linearized = &self.beside;
        self.known
            .retain(|entry, _| linearized.get(entry).is_some_and(|known| *known == beside(*entry, terms)));
        self.terms = Some(terms.len());
    }

    /// Whether every candidate was linearized beside these terms.
    fn is_fresh(&self, terms: &[Term]) -> bool {
        self.terms == Some(terms.len())
    }

    /// Forgets candidates that an added term has changed much.
    fn forget(&mut self, added: &Term) {
        let later = is_later(added);
        self.known.retain(|&(effect, whose), _| {
            !(later && overlap(added.whose, whose) && effect.info().channels.contains(&Needed::Command))
        });
    }
}

/// The terms that act on the robots of an entry.
fn beside((_, whose): Entry, terms: &[Term]) -> Vec<Term> {
    terms.iter().filter(|term| overlap(term.whose, whose)).cloned().collect()
}

/// Whether an effect makes the servo answer later: that moves every effect between command and wheel in time.
fn is_later(added: &Term) -> bool {
    let later =
        |parameter: &Parameter| matches!(parameter.relevance, Relevance::Lag(_) | Relevance::CommandLag(_));
    added.parameters().iter().any(later)
}

pub(crate) fn overlap(a: Whose, b: Whose) -> bool {
    a == Whose::Everyone || b == Whose::Everyone || a == b
}

pub(crate) fn whites<'u, 'a>(units: &[&'u Unit<'a>], fit: &'u Fit) -> Vec<White<'u, 'a>> {
    let each = units.iter().zip(&fit.states).zip(&fit.columns);
    each.map(|((unit, state), columns)| White::new(unit, state, columns)).collect()
}

pub(crate) fn score(units: &[&Unit<'_>], whites: &[White<'_, '_>], candidate: &Candidate) -> Option<Scored> {
    let all = candidate.columns(units);
    let own: Vec<&White<'_, '_>> = all.iter().map(|(unit, _)| &whites[*unit]).collect();
    let columns: Vec<&[_]> = all.iter().map(|(_, columns)| columns.as_slice()).collect();
    let mut step = step(&own, &columns)?;
    if candidate.along.is_empty() {
        // The effect is there as a whole or not at all: the gain is that of a step of one.
        let change = step.change[0];
        if !SOUND_STEP.contains(&change) {
            return None;
        }
        step.gain *= (2.0 - 1.0 / change) / change;
    }
    let p = (upper_tail(step.wald, step.change.len()) * candidate.looked).min(1.0);
    Some(Scored { candidate: candidate.clone(), step, p })
}

impl Scored {
    fn entry(&self) -> Entry {
        (self.candidate.term.effect, self.candidate.term.whose)
    }

    /// Gain of twice the log-likelihood, deflated by how much errors are correlated.
    pub(crate) fn gain(&self) -> f64 {
        self.step.gain / self.step.inflation.max(1.0)
    }

    /// The term where the step ends.
    pub(crate) fn term(&self) -> Term {
        let mut term = self.candidate.term.clone();
        for (&parameter, change) in self.candidate.along.iter().zip(self.step.change.iter()) {
            term.values[parameter] += change;
        }
        term.clamp();
        term
    }
}

/// The best start of every entry that is significant, the strongest first.
fn significant(scored: &[Scored], tests: usize) -> Vec<&Scored> {
    let mut best: BTreeMap<Entry, &Scored> = BTreeMap::new();
    for one in scored {
        if one.p * tests as f64 >= FAMILYWISE || one.gain() <= LEAST_GAIN {
            continue;
        }
        let known = best.entry(one.entry()).or_insert(one);
        if one.step.gain > known.step.gain {
            *known = one;
        }
    }
    let mut all: Vec<&Scored> = best.into_values().collect();
    // By the likelihood alone: how much errors are correlated depends on what is still missing, and would
    // favour what explains little.
    all.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    all
}

/// What to add: the best effect of the world, or each robot's best own one.
fn additions(
    units: &[&Unit<'_>],
    whites: &[White<'_, '_>],
    current: &Fit,
    scored: &[Scored],
    tests: usize,
) -> Vec<Fit> {
    let strong = significant(scored, tests);
    let shared: Vec<&Scored> =
        strong.iter().copied().filter(|one| one.candidate.term.whose == Whose::Everyone).collect();
    let mut groups: BTreeMap<Whose, Vec<&Scored>> = BTreeMap::new();
    for one in &strong {
        groups.entry(one.candidate.term.whose).or_default().push(one);
    }
    groups.remove(&Whose::Everyone);
    let best_shared = shared.first().map(|best| best.step.gain);
    if let Some(gain) = best_shared
        && groups.values().all(|own| own[0].step.gain < gain)
    {
        // What shows on one robot alone may be its own.
        return choose(units, whites, current, &strong).into_iter().collect();
    }
    // A robot waits if what it shows may be its share of an effect of the world.
    let sharers = units.len().max(1) as f64;
    let groups: Vec<Vec<&Scored>> = groups
        .into_values()
        .filter(|own| best_shared.is_none_or(|gain| own[0].step.gain > 2.0 * gain / sharers))
        .collect();
    parallel::map(&groups, |rivals| choose(units, whites, current, rivals)).into_iter().flatten().collect()
}

/// Fits the strongest rivals and gives the best of them, fitted. Where none of these gains anything once it is
/// fitted (a few wild readings promise much by linearization), the next strongest have their turn.
fn choose(units: &[&Unit<'_>], whites: &[White<'_, '_>], current: &Fit, rivals: &[&Scored]) -> Option<Fit> {
    let mut rest = rivals;
    while let Some(first) = rest.first() {
        let close = rest.iter().take_while(|rival| rival.step.gain > LEAST_SHARE * first.step.gain).count();
        let (tried, later) = rest.split_at(close.clamp(1, RIVALS));
        let inflation = tried.iter().map(|rival| rival.step.inflation).fold(f64::INFINITY, f64::min).max(1.0);
        let fitted: Vec<Option<(f64, Fit)>> = parallel::map(tried, |rival| {
            let rival = refine(units, whites, rival);
            let added = fit_beside(units, current, rival.term())?;
            let kept = added.terms.last()?.is_inside() && gained(units, current, &added).1 > LEAST_GAIN;
            kept.then(|| (criterion(units, current, &added, inflation), added))
        });
        // Of equals the first: the one whose linearization was the strongest.
        let mut best: Option<(f64, Fit)> = None;
        for (value, fit) in fitted.into_iter().flatten() {
            if best.as_ref().is_none_or(|(most, _)| value > *most) {
                best = Some((value, fit));
            }
        }
        if let Some((_, fit)) = best {
            return Some(fit);
        }
        rest = later;
    }
    None
}

/// A fit in which some units and their terms are replaced by those of another, which has one more term.
fn joined(units: &[&Unit<'_>], whole: &Fit, part: &Fit) -> Option<Fit> {
    let added = part.terms.last()?;
    let mut terms = whole.terms.clone();
    // The position in the whole of each term of the part.
    let mut place = Vec::with_capacity(part.terms.len());
    for term in &part.terms[..part.terms.len() - 1] {
        let known = terms.iter().position(|own| own.is_of(term))?;
        terms[known] = term.clone();
        place.push(known);
    }
    place.push(terms.len());
    terms.push(added.clone());
    let placed = |&(term, parameter): &Slot| (place[term], parameter);
    let mut slots = whole.slots.clone();
    slots.extend(part.slots.iter().map(placed).filter(|slot| !whole.slots.contains(slot)));
    let mut columns: Vec<Vec<Column>> = Vec::with_capacity(units.len());
    let mut states: Vec<State> = Vec::with_capacity(units.len());
    let mut mine = part.states.iter().zip(&part.columns);
    for (index, unit) in units.iter().enumerate() {
        let mut own = whole.columns[index].clone();
        own.resize(slots.len(), Column::empty(unit));
        if unit.has(added) {
            let (state, fitted) = mine.next()?;
            for (slot, column) in part.slots.iter().zip(fitted) {
                let position = slots.iter().position(|known| *known == placed(slot))?;
                own[position] = column.clone();
            }
            states.push(state.clone());
        } else {
            states.push(whole.states[index].clone());
        }
        columns.push(own);
    }
    let log_likelihood = states.iter().map(|state| state.noise.log_likelihood).sum();
    Some(Fit { terms, states, slots, columns, log_likelihood })
}

/// Fits a term beside those of a fit; of the units, those that it acts on.
pub(crate) fn fit_beside(units: &[&Unit<'_>], current: &Fit, term: Term) -> Option<Fit> {
    let own: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].has(&term)).collect();
    let acting: Vec<&Unit<'_>> = own.iter().map(|&unit| units[unit]).collect();
    let whose = term.whose;
    let mut terms: Vec<Term> =
        current.terms.iter().filter(|known| acting.iter().any(|unit| unit.has(known))).cloned().collect();
    terms.push(term);
    // What other robots share stays where it is.
    let movable: Vec<bool> =
        terms.iter().map(|term| whose == Whose::Everyone || term.whose == whose).collect();
    let known: Vec<State> = own.iter().map(|&unit| current.states[unit].clone()).collect();
    let states = with_another(&acting, &known, &terms)?;
    let movable = |index: usize| movable[index];
    let added = terms.len() - 1;
    let later = is_later(&terms[added]);
    let known = |(position, parameter): Slot| {
        if position == added || later {
            return None;
        }
        let whole = current.terms.iter().position(|own| own.is_of(&terms[position]))?;
        let slot = current.slots.iter().position(|own| *own == (whole, parameter))?;
        Some(own.iter().map(|&unit| current.columns[unit][slot].clone()).collect())
    };
    let fitted = fit_from(&acting, terms.clone(), states, &movable, Effort::RIVAL, &known);
    let threshold = |fit: &Fit, (term, parameter): Slot| {
        let own = &fit.terms[term];
        term == added && is_threshold(own, parameter) && is_on(own, parameter)
    };
    Some(polish_some(&acting, fitted, &threshold, &movable, Effort::RIVAL))
}

/// What a fit with one more term gains by Bayes' information criterion on the effective sample size; more is
/// better. Rivals may act on other robots.
fn criterion(units: &[&Unit<'_>], current: &Fit, added: &Fit, inflation: f64) -> f64 {
    let (rows, gain) = gained(units, current, added);
    let effective = (rows as f64 / inflation).max(2.0);
    gain / inflation - added.parameters_of_last() as f64 * effective.ln()
}

/// The rows of the units that the last term of a fit acts on, and what it gains there, twice in log-likelihood.
fn gained(units: &[&Unit<'_>], current: &Fit, added: &Fit) -> (usize, f64) {
    let Some(term) = added.terms.last() else { return (0, 0.0) };
    let (mut rows, mut before) = (0, 0.0);
    for (unit, state) in units.iter().zip(&current.states).filter(|(unit, _)| unit.has(term)) {
        rows += unit.rows.len();
        before += state.noise.log_likelihood;
    }
    (rows, 2.0 * (added.log_likelihood - before))
}

/// Drops terms that are no longer significant beside the others, the weakest first.
fn prune(units: &[&Unit<'_>], mut current: Fit) -> Option<Fit> {
    loop {
        let Some(covariance) = covariance(units, &current) else { return Some(current) };
        let weakest = (0..current.terms.len())
            .filter_map(|term| {
                let (wald, count) = wald(&current, &covariance, &[term])?;
                Some((upper_tail(wald, count), term))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match weakest {
            Some((p, term)) if p > PRUNE => {
                let mut terms = current.terms.clone();
                terms.remove(term);
                current = fit(units, terms, &|_| true, Effort::FULL)?;
            }
            _ => return Some(current),
        }
    }
}

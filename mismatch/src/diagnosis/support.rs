//! The effects that explain a finding about as well as the one that was chosen.

use std::collections::BTreeMap;

use pleiad_physics::Effect;

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::parallel;
use crate::diagnosis::refine::refine;
use crate::diagnosis::select::{Scored, fit_beside, overlap, score, whites};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::step;

/// A rival explains the data about equally if it loses less than this, twice in log-likelihood: odds of 20.
pub(crate) const ODDS: f64 = 5.991_464_547_107_98;
/// So many rivals are fitted.
const RIVALS: usize = 8;
/// A rival that gains less than this share by linearization does not explain it.
const LEAST_SHARE: f64 = 0.5;

/// A finding with and without its term, on the units that it acts on.
pub(crate) struct Support {
    /// The positions of the units.
    pub(crate) units: Vec<usize>,
    /// Everything but the term, fitted again.
    pub(crate) without: Fit,
    /// With the term.
    pub(crate) with: Fit,
    /// The position of the term in `with`.
    pub(crate) term: usize,
    /// Effects that explain it about equally, the term's own first.
    pub(crate) members: Vec<Effect>,
    /// Variance of scores over that of independent errors, at least 1.
    pub(crate) inflation: f64,
}

/// Looks for rivals of a term of a fit among candidates that were scored beside that fit.
pub(crate) fn support(units: &[&Unit<'_>], full: &Fit, term: usize, pool: &[Scored]) -> Option<Support> {
    let chosen = &full.terms[term];
    let own: Vec<usize> = (0..units.len()).filter(|&unit| chosen.acts_on(units[unit].robot)).collect();
    let acting: Vec<&Unit<'_>> = own.iter().map(|&unit| units[unit]).collect();
    let others: Vec<Term> = full
        .terms
        .iter()
        .enumerate()
        .filter(|(index, other)| *index != term && overlap(other.whose, chosen.whose))
        .map(|(_, other)| other.clone())
        .collect();
    // What other robots share with this one stays where it is.
    let movable: Vec<bool> = others.iter().map(|other| other.whose == chosen.whose).collect();
    let without = fit(&acting, others, &|index| movable[index], Effort::RIVAL)?;
    let with = fit_beside(&acting, &without, chosen.clone())?;
    let position = with.terms.len() - 1;

    let whites = whites(&acting, &without);
    let mine: Vec<usize> =
        (0..with.slots.len()).filter(|&slot| with.slots[slot].0 == position).collect();
    let columns: Vec<Vec<Column>> = with
        .columns
        .iter()
        .map(|columns| mine.iter().map(|&slot| columns[slot].clone()).collect())
        .collect();
    let own_step = step(&whites.iter().collect::<Vec<_>>(), &columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let inflation = own_step.as_ref().map_or(1.0, |own| own.inflation.max(1.0));
    let own_gain = own_step.map_or(0.0, |own| own.gain);

    let rescored = parallel::map(&rivals(pool, chosen, &own), |candidate| score(&acting, &whites, candidate));
    let mut best: BTreeMap<Effect, Scored> = BTreeMap::new();
    for one in rescored.into_iter().flatten() {
        let effect = one.candidate.term.effect;
        if best.get(&effect).is_none_or(|known| one.step.gain > known.step.gain) {
            best.insert(effect, one);
        }
    }
    let mut rivals: Vec<Scored> = best.into_values().collect();
    rivals.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    rivals.retain(|rival| rival.step.gain > LEAST_SHARE * own_gain);
    rivals.truncate(RIVALS);
    let size = with.slots.len();
    let fitted = parallel::map(&rivals, |rival| {
        let rival = refine(&acting, &whites, rival);
        let fit = fit_beside(&acting, &without, rival.term())?;
        // A rival of more parameters that does no better is the finding in disguise.
        let lost = 2.0 * (with.log_likelihood - fit.log_likelihood) / inflation;
        (lost < ODDS && fit.slots.len() <= size).then_some(rival.candidate.term.effect)
    });
    let mut members = vec![chosen.effect];
    members.extend(fitted.into_iter().flatten());
    Some(Support { units: own, without, with, term: position, members, inflation })
}

/// The candidates that act on the same robots, with the units numbered as those that act.
fn rivals(pool: &[Scored], chosen: &Term, own: &[usize]) -> Vec<Candidate> {
    let same = pool.iter().filter(|rival| rival.candidate.term.whose == chosen.whose);
    same.map(|rival| rival.candidate.renumbered(own)).collect()
}

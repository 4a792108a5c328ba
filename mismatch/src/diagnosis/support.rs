//! The effects that explain a finding about as well as the one that was chosen.

use pleiad_physics::Effect;

use crate::diagnosis::fit::{Fit, fit};
use crate::diagnosis::parallel;
use crate::diagnosis::refine::refine;
use crate::diagnosis::select::{Entry, Scored, fit_beside, linearized_beside, overlap, score, whites};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;

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

/// Looks for rivals of a term of a fit among entries.
pub(crate) fn support(units: &[&Unit<'_>], full: &Fit, term: usize, entries: &[Entry]) -> Option<Support> {
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
    let without = fit(&acting, others, &|index| movable[index], None)?;
    let with = fit_beside(&acting, &without, chosen.clone())?;
    let position = with.terms.len() - 1;

    let whites = whites(&acting, &without);
    let open: Vec<Entry> = entries
        .iter()
        .copied()
        .filter(|&(effect, whose)| {
            whose == chosen.whose && !without.terms.iter().any(|known| known.effect == effect)
        })
        .collect();
    let best: Vec<Option<Scored>> = parallel::map(&open, |&entry| {
        let candidates = linearized_beside(&acting, &without, entry);
        let scored = candidates.iter().filter_map(|candidate| score(&acting, &whites, candidate));
        scored.max_by(|a, b| a.step.gain.total_cmp(&b.step.gain))
    });
    let mut rivals: Vec<Scored> = best.into_iter().flatten().collect();
    rivals.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    let own_step = rivals.iter().find(|rival| rival.candidate.term.effect == chosen.effect);
    let own_gain = own_step.map_or(0.0, |own| own.step.gain);
    let inflation = own_step.map_or(1.0, |own| own.step.inflation.max(1.0));
    let size = with.slots.len();
    rivals.retain(|rival| {
        rival.candidate.term.effect != chosen.effect && rival.step.gain > LEAST_SHARE * own_gain
    });
    rivals.truncate(RIVALS);
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

//! The effects that explain a finding about as well as the one that was chosen.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use pleiad_physics::Effect;

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::naming::Estimated;
use crate::diagnosis::parallel;
use crate::diagnosis::refine::refine;
use crate::diagnosis::select::{Pool, Scored, covariance, fit_beside, overlap, score, whites};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::step;

/// A rival explains the data about equally if it loses less than this, twice in log-likelihood: odds of 20.
pub(crate) const ODDS: f64 = 5.991_464_547_107_98;
/// So many rivals are fitted.
const RIVALS: usize = 8;
/// A rival that gains less than this share by linearization does not explain it.
const LEAST_SHARE: f64 = 0.5;

/// A finding with and without its terms, on the units that they act on.
pub(crate) struct Support {
    /// The positions of the units.
    pub(crate) units: Vec<usize>,
    /// Everything but the terms, fitted again.
    pub(crate) without: Fit,
    /// With the terms, at the end.
    pub(crate) with: Fit,
    /// The positions of the terms in `with`.
    pub(crate) group: Vec<usize>,
    /// The robust covariance of the parameters of `with`.
    pub(crate) covariance: DMatrix<f64>,
    /// Effects that explain it about equally, the term's own first.
    pub(crate) members: Vec<Effect>,
    /// Variance of scores over that of independent errors, at least 1.
    pub(crate) inflation: f64,
}

/// Looks for rivals of terms of one robot, or of everyone, among candidates that were linearized beside the fit;
/// one that the fit leaves nothing to explain may be exactly the same.
/// `None` if the terms are too small to be a finding, or their parameters cannot be told apart.
pub(crate) fn support(units: &[&Unit<'_>], full: &Fit, group: &[usize], pool: &Pool) -> Option<Support> {
    let chosen = &full.terms[*group.first()?];
    let own: Vec<usize> = (0..units.len()).filter(|&unit| chosen.acts_on(units[unit].robot)).collect();
    let acting: Vec<&Unit<'_>> = own.iter().map(|&unit| units[unit]).collect();
    let others: Vec<Term> = full
        .terms
        .iter()
        .enumerate()
        .filter(|(index, other)| !group.contains(index) && overlap(other.whose, chosen.whose))
        .map(|(_, other)| other.clone())
        .collect();
    // What other robots share with this one stays where it is.
    let movable: Vec<bool> = others.iter().map(|other| other.whose == chosen.whose).collect();
    let count = others.len();
    let with = {
        let mut terms = others.clone();
        terms.extend(group.iter().map(|&term| full.terms[term].clone()));
        let movable: Vec<bool> = terms.iter().map(|term| term.whose == chosen.whose).collect();
        fit(&acting, terms, &|index| movable[index], Effort::RIVAL)?
    };
    let positions: Vec<usize> = (count..with.terms.len()).collect();
    let covariance = covariance(&acting, &with)?;
    let relevant = positions.iter().any(|&position| {
        let estimated = Estimated::of(&with, &covariance, position);
        acting.iter().any(|unit| estimated.may_be_relevant(unit))
    });
    // What is too small to matter needs no rivals.
    if !relevant {
        return None;
    }
    let without = fit(&acting, others, &|index| movable[index], Effort::RIVAL)?;

    let whites = whites(&acting, &without);
    let mine: Vec<usize> = (0..with.slots.len()).filter(|&slot| with.slots[slot].0 >= count).collect();
    let columns: Vec<Vec<Column>> =
        with.columns.iter().map(|columns| mine.iter().map(|&slot| columns[slot].clone()).collect()).collect();
    let own_step =
        step(&whites.iter().collect::<Vec<_>>(), &columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let inflation = own_step.as_ref().map_or(1.0, |own| own.inflation.max(1.0));
    // A threshold has no derivative, and so no step.
    let own_gain = own_step.map_or(2.0 * (with.log_likelihood - without.log_likelihood), |own| own.gain);

    let rescored =
        parallel::map(&rivals(units, full, chosen, pool), |candidate| score(&acting, &whites, candidate));
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
        let lost = |to: &Fit| 2.0 * (to.log_likelihood - fit.log_likelihood) / inflation;
        // A rival of more parameters that does no better is the finding in disguise.
        if lost(&with) > ODDS || fit.slots.len() > size {
            return None;
        }
        // It has to explain the same: beside a rival the finding is not needed. Another effect that also
        // acts is no rival.
        let mut both = fit.clone();
        for &term in group {
            both = fit_beside(&acting, &both, full.terms[term].clone())?;
        }
        (lost(&both) < ODDS).then_some(rival.candidate.term.effect)
    });
    let mut members: Vec<Effect> = group.iter().map(|&term| full.terms[term].effect).collect();
    members.extend(fitted.into_iter().flatten());
    Some(Support { units: own, without, with, group: positions, covariance, members, inflation })
}

/// The candidates that act on the same robots, with the units numbered as those that act.
fn rivals(units: &[&Unit<'_>], full: &Fit, chosen: &Term, pool: &Pool) -> Vec<Candidate> {
    let known = |rival: &Term| {
        full.terms.iter().any(|term| term.effect == rival.effect && overlap(term.whose, rival.whose))
    };
    let same = |rival: &Term| {
        units.iter().all(|unit| rival.acts_on(unit.robot) == chosen.acts_on(unit.robot)) && !known(rival)
    };
    let own: Vec<usize> = (0..units.len()).filter(|&unit| chosen.acts_on(units[unit].robot)).collect();
    pool.candidates()
        .filter(|candidate| same(&candidate.term))
        .map(|candidate| candidate.renumbered(&own))
        .collect()
}

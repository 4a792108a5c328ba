//! The effects that explain a finding about as well as the one that was chosen.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use pleiad_physics::Effect;

use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::fit::{Effort, Fit, Normal, Slot, columns, fit, fit_at};
use crate::diagnosis::naming::{Estimated, is_unseen, twin};
use crate::diagnosis::profile::{is_on, polish_some};
use crate::diagnosis::refine::refine;
use crate::diagnosis::select::{LEAST_GAIN, Pool, Scored, fit_beside, overlap, score, whites};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::wald::covariance;
use crate::diagnosis::white::{White, step};
use crate::diagnosis::without_truth::at_own_references;
use pleiad_recording::parallel;

/// Of forms, and of effects of spread: what loses less than this describes the data about equally, twice in
/// log-likelihood: odds of 20.
pub(crate) const ODDS: f64 = 5.991_464_547_107_98;
/// A name is given if every rival loses at least this, twice in log-likelihood: a name is as rarely wrong as a finding
/// is false (odds of 500, `2 ln(1 / FAMILYWISE)`).
const NAMED: f64 = 12.429_216_196_844_383;
/// Errors of the nominal geometry that every robot has a little of.
const NOMINAL: [Effect; 3] = [Effect::WheelRadiusError, Effect::TrackWidthError, Effect::UnequalWheelRadii];
/// A rival that loses more than this is none at its own references either.
const FAR: f64 = 60.0;
/// So many rivals are fitted.
const RIVALS: usize = 8;
/// A rival that gains less than this share by linearization does not explain it.
const LEAST_SHARE: f64 = 0.5;

/// Terms that are so likely without anything, among all tests, will not become a finding.
const HOPELESS: f64 = 1.0;

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
/// `None` if the terms are too small to be a finding, or their parameters cannot be told apart. Terms that are not
/// significant among so many tests get no rivals.
pub(crate) fn support(
    units: &[&Unit<'_>],
    full: &Fit,
    group: &[usize],
    pool: &Pool,
    tests: usize,
) -> Option<Support> {
    let chosen = &full.terms[*group.first()?];
    let own_units: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].has(chosen)).collect();
    let acting: Vec<&Unit<'_>> = own_units.iter().map(|&unit| units[unit]).collect();
    let others: Vec<Term> = full
        .terms
        .iter()
        .enumerate()
        .filter(|(index, other)| !group.contains(index) && acting.iter().any(|unit| unit.has(other)))
        .map(|(_, other)| other.clone())
        .collect();
    // What other robots share with this one stays where it is.
    let meshed = acting.iter().any(|unit| unit.mesh.is_some());
    let movable: Vec<bool> = others.iter().map(|other| meshed || other.whose == chosen.whose).collect();
    let count = others.len();
    let with = {
        let mut terms = others.clone();
        terms.extend(group.iter().map(|&term| full.terms[term].clone()));
        fit(&acting, terms, &|index| index >= count || movable[index], Effort::RIVAL)?
    };
    let positions: Vec<usize> = (count..with.terms.len()).collect();
    let relevant = {
        let covariance = covariance(&acting, &with)?;
        positions.iter().any(|&position| {
            let estimated = Estimated::of(&with, &covariance, position);
            acting.iter().any(|unit| estimated.may_be_relevant(unit))
        })
    };
    // What is too small to matter needs no rivals.
    if !relevant {
        return None;
    }
    let without = fit_at(&acting, others, &with.states, &|index| movable[index], Effort::RIVAL)?;
    let whites = whites(&acting, &without);
    let own = Own::of(&whites, &with, &without, count);
    let significant = upper_tail(own.ratio(&with, &without), own.parameters()) * tests as f64 <= HOPELESS;
    let searched = |fit: &Fit, (term, parameter): Slot| term >= count && is_on(&fit.terms[term], parameter);
    let with = if significant {
        polish_some(&acting, with, &searched, &|index| index >= count || movable[index], Effort::RIVAL)
    } else {
        with
    };
    let covariance = covariance(&acting, &with)?;
    let own = Own::of(&whites, &with, &without, count);
    let inflation = own.inflation;
    let rivals = if significant {
        own.rivals(&acting, &whites, &rivals(units, full, chosen, pool))
    } else {
        Vec::new()
    };
    let own_reference = if meshed && !rivals.is_empty() {
        at_own_references(&acting, &with, &with.states).map(|own| own + slack(&acting, &with))
    } else {
        None
    };
    let fitted = parallel::map(&rivals, |rival| {
        let rival = refine(&acting, &whites, rival);
        let fit = fit_beside(&acting, &without, rival.term())?;
        let lost = |to: &Fit| 2.0 * (to.log_likelihood - fit.log_likelihood) / inflation;
        let mut less = lost(&with);
        if meshed && less > NAMED && less < FAR {
            let own = at_own_references(&acting, &fit, &with.states)? + slack(&acting, &fit);
            less = 2.0 * (own_reference? - own) / inflation;
        }
        // A rival of more parameters that does no better is the finding in disguise.
        if less > NAMED || slots_of(&fit, fit.terms.len() - 1) > slots_of(&with, count) {
            return None;
        }
        // It has to explain the same: beside a rival the finding would not be added. Another effect that also acts
        // is no rival.
        let mut both = fit.clone();
        for &term in group {
            both = fit_beside(&acting, &both, full.terms[term].clone())?;
        }
        let mut needed = lost(&both);
        if meshed && needed > LEAST_GAIN && needed < FAR {
            needed += 2.0 * (slack(&acting, &both) - slack(&acting, &fit)) / inflation;
        }
        (needed < LEAST_GAIN).then_some(rival.candidate.term.effect)
    });
    let mut members: Vec<Effect> = group.iter().map(|&term| full.terms[term].effect).collect();
    members.extend(fitted.into_iter().flatten());
    if is_unseen(units, chosen) {
        members.extend(twin(chosen.effect).filter(|twin| !members.contains(twin)));
    }
    Some(Support { units: own_units, without, with, group: positions, covariance, members, inflation })
}

/// What a fit could still gain in log-likelihood by errors of the nominal geometry that are too small to matter: each
/// as unsure as it is relevant. Two effects between which only those decide are the same.
pub(crate) fn slack(units: &[&Unit<'_>], fit: &Fit) -> f64 {
    let mut terms = fit.terms.clone();
    let mut floors = Vec::new();
    for member in units.iter().flat_map(|unit| &unit.members) {
        for effect in NOMINAL {
            let whose = Whose::Robot(member.robot);
            let off = effect.info().parameters.iter().map(|parameter| parameter.off).collect();
            let term = Term::new(effect, whose, off);
            if fit.terms.iter().any(|own| own.effect == effect && overlap(own.whose, whose)) {
                continue;
            }
            floors.push(term.parameters()[0].relevance.threshold(&member.floors));
            terms.push(term);
        }
    }
    let added: Vec<Slot> = (0..floors.len()).map(|index| (fit.terms.len() + index, 0)).collect();
    let slots: Vec<Slot> = fit.slots.iter().copied().chain(added).collect();
    let columns: Vec<Vec<Column>> = units.iter().map(|unit| columns(unit, &terms, &slots)).collect();
    let mut normal = Normal::new(units, &fit.states, &columns, slots.len());
    for (index, floor) in floors.iter().enumerate() {
        let slot = fit.slots.len() + index;
        normal.information[(slot, slot)] += 1.0 / (floor * floor);
    }
    normal.step(1e-9).map_or(0.0, |step| 0.5 * step.dot(&normal.gradient).max(0.0))
}

/// How many parameters of the terms from a position on are fitted.
fn slots_of(fit: &Fit, first: usize) -> usize {
    fit.slots.iter().filter(|(term, _)| *term >= first).count()
}

/// What a finding gains beside everything but itself, by linearization.
struct Own {
    /// Its columns by unit; none for a threshold, which has no derivative.
    columns: Vec<Vec<Column>>,
    /// Of a step, twice in log-likelihood; for a threshold, of the fit.
    gain: f64,
    is_step: bool,
    inflation: f64,
}

impl Own {
    fn of(whites: &[White<'_, '_>], with: &Fit, without: &Fit, first: usize) -> Self {
        let mine: Vec<usize> = (0..with.slots.len()).filter(|&slot| with.slots[slot].0 >= first).collect();
        let of_unit =
            |columns: &Vec<Column>| mine.iter().map(|&slot| columns[slot].clone()).collect::<Vec<_>>();
        let columns: Vec<Vec<Column>> = with.columns.iter().map(of_unit).collect();
        let each: Vec<&[Column]> = columns.iter().map(Vec::as_slice).collect();
        let own = step(&whites.iter().collect::<Vec<_>>(), &each);
        let inflation = own.as_ref().map_or(1.0, |own| own.inflation.max(1.0));
        let is_step = own.is_some();
        let gain = own.map_or(2.0 * (with.log_likelihood - without.log_likelihood), |own| own.gain);
        Self { columns, gain, is_step, inflation }
    }

    fn parameters(&self) -> usize {
        self.columns.first().map_or(1, Vec::len).max(1)
    }

    /// Twice the log of the likelihood ratio, deflated by how much errors are correlated.
    fn ratio(&self, with: &Fit, without: &Fit) -> f64 {
        2.0 * (with.log_likelihood - without.log_likelihood) / self.inflation
    }

    /// The strongest start of every effect that may explain the finding.
    fn rivals(&self, units: &[&Unit<'_>], whites: &[White<'_, '_>], candidates: &[Candidate]) -> Vec<Scored> {
        let scored = parallel::map(candidates, |candidate| score(units, whites, candidate));
        let mut best: BTreeMap<Effect, Scored> = BTreeMap::new();
        for one in scored.into_iter().flatten() {
            let effect = one.candidate.term.effect;
            if best.get(&effect).is_none_or(|known| one.step.gain > known.step.gain) {
                best.insert(effect, one);
            }
        }
        let mut rivals: Vec<Scored> = best.into_values().collect();
        rivals.retain(|rival| {
            rival.step.gain > LEAST_SHARE * self.gain && self.is_taken_by(units, whites, rival)
        });
        rivals.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
        rivals.truncate(RIVALS);
        rivals
    }

    /// Whether a rival takes enough of the gain: one that explains something else leaves it all.
    fn is_taken_by(&self, units: &[&Unit<'_>], whites: &[White<'_, '_>], rival: &Scored) -> bool {
        if !self.is_step {
            return true;
        }
        let all = rival.candidate.columns(units);
        let both: Vec<Vec<Column>> = all
            .iter()
            .map(|(unit, columns)| columns.iter().chain(&self.columns[*unit]).cloned().collect())
            .collect();
        let acting: Vec<&White<'_, '_>> = all.iter().map(|(unit, _)| &whites[*unit]).collect();
        let each: Vec<&[Column]> = both.iter().map(Vec::as_slice).collect();
        // Beside what is the same, nothing can be told.
        step(&acting, &each).is_none_or(|both| both.gain - rival.step.gain < (1.0 - LEAST_SHARE) * self.gain)
    }
}

/// The candidates that act on the same robots, with the units numbered as those that act.
fn rivals(units: &[&Unit<'_>], full: &Fit, chosen: &Term, pool: &Pool) -> Vec<Candidate> {
    let known = |rival: &Term| {
        full.terms.iter().any(|term| term.effect == rival.effect && overlap(term.whose, rival.whose))
    };
    let same = |rival: &Term| {
        let members = || units.iter().flat_map(|unit| &unit.members);
        members().all(|member| rival.acts_on(member.robot) == chosen.acts_on(member.robot)) && !known(rival)
    };
    let own: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].has(chosen)).collect();
    pool.candidates()
        .filter(|candidate| same(&candidate.term))
        .map(|candidate| candidate.renumbered(&own))
        .collect()
}

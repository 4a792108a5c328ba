//! How much of a recording structures that are given explain: what a diagnosis could reach at best, and what
//! rivals would reach in its place. Nothing here selects; benchmarks hold a diagnosis against it.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;
use pleiad_recording::Recording;

use crate::diagnosis::candidate::candidates;
use crate::diagnosis::entries::{composition, entries, is_shared};
use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::held_out::cross_fitted;
use crate::diagnosis::known::{KnownFit, found, of_mean_known};
use crate::diagnosis::profile::polish;
use crate::diagnosis::refine::refine;
use crate::diagnosis::run::Prepared;
use crate::diagnosis::select::{Entry, Scored, fit_beside, score, whites};
use crate::diagnosis::spread::is_of_spread;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::step;
use crate::error::MismatchError;

/// So many of the strongest rivals are fitted.
const RIVALS: usize = 5;
/// A rival that gains less than this share by linearization is not fitted.
const LEAST_SHARE: f64 = 0.3;

/// Effects with the robot that each acts on; of what every robot shares, the robot does not matter.
pub type Structure = Vec<(Effect, RobotId)>;

/// A single effect in place of a structure.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Which effect.
    pub effect: Effect,
    /// On which robot; `None` for every robot.
    pub robot: Option<RobotId>,
    /// What the structure gains over it, twice in log-likelihood.
    pub loses: f64,
}

/// A structure, fitted.
#[derive(Clone, Debug)]
pub struct Explained {
    /// Twice the log-likelihood that it gains over the nominal model.
    pub gain: f64,
    /// Variance of the scores of its parameters over that of independent errors; at least 1.
    pub inflation: f64,
    /// Log score gained on folds left out, over the nominal model.
    pub held_out: f64,
    /// Its standard error.
    pub held_out_se: f64,
    /// The effects with their parameters, those that show at all.
    pub fits: Vec<KnownFit>,
    /// Single effects in its place, the one that loses least first; empty unless asked for.
    pub rivals: Vec<Rival>,
}

/// Fits structures to a recording, each from the nominal model. Of the first, single rivals are fitted as well.
/// Effects of spread or chance (noise, misses, names) move no mean and are not in any of it.
///
/// # Errors
/// As [`fit_known`](crate::fit_known).
pub fn explained(recording: &Recording, structures: &[Structure]) -> Result<Vec<Explained>, MismatchError> {
    let prepared = Prepared::alone(recording, false)?;
    let all = prepared.units(|_| true);
    let units: Vec<&Unit<'_>> = all.iter().filter(|unit| !unit.rows.is_empty()).collect();
    let Some(nominal) = fit(&units, Vec::new(), &|_| true, Effort::FULL) else { return Ok(Vec::new()) };
    let each = structures.iter().enumerate();
    Ok(each.map(|(index, structure)| one(&units, &nominal, structure, index == 0)).collect())
}

fn one(units: &[&Unit<'_>], nominal: &Fit, structure: &Structure, rivals: bool) -> Explained {
    let mut current = nominal.clone();
    for &(effect, robot) in structure.iter().filter(|(effect, _)| !is_of_spread(*effect)) {
        let whose = if is_shared(effect.info()) { Whose::Everyone } else { Whose::Robot(robot) };
        if current.terms.iter().any(|term| term.effect == effect && term.whose == whose) {
            continue;
        }
        let Some(term) = found(units, &current, effect, whose) else { continue };
        let mut terms = current.terms.clone();
        terms.push(term);
        current = fit(units, terms, &|_| true, Effort::FULL).unwrap_or(current);
    }
    if current.terms.is_empty() {
        let nothing = Explained {
            gain: 0.0,
            inflation: 1.0,
            held_out: 0.0,
            held_out_se: 0.0,
            fits: Vec::new(),
            rivals: Vec::new(),
        };
        return nothing;
    }
    let current = polish(units, current);
    let gain = cross_fitted(units, &current, nominal);
    Explained {
        gain: 2.0 * (current.log_likelihood - nominal.log_likelihood),
        inflation: inflation(units, nominal, &current),
        held_out: gain.total,
        held_out_se: gain.standard_error,
        fits: of_mean_known(units, &current),
        rivals: if rivals { fitted_rivals(units, nominal, &current) } else { Vec::new() },
    }
}

/// Mean of robust over independent variance of the scores of what was fitted.
fn inflation(units: &[&Unit<'_>], nominal: &Fit, with: &Fit) -> f64 {
    let whites = whites(units, nominal);
    let columns: Vec<&[Column]> = with.columns.iter().map(Vec::as_slice).collect();
    let acting: Vec<usize> =
        (0..units.len()).filter(|&unit| with.columns[unit].iter().any(|column| !column.is_zero())).collect();
    let own: Vec<_> = acting.iter().map(|&unit| &whites[unit]).collect();
    let columns: Vec<&[Column]> = acting.iter().map(|&unit| columns[unit]).collect();
    step(&own, &columns).map_or(1.0, |step| step.inflation.max(1.0))
}

/// Single effects in place of all terms of a fit, on the robots that they act on.
fn fitted_rivals(units: &[&Unit<'_>], nominal: &Fit, with: &Fit) -> Vec<Rival> {
    let acts = |whose: Whose| {
        let robots: Vec<RobotId> = units.iter().map(|unit| unit.robot()).collect();
        let acts_on = |robot: &RobotId| match whose {
            Whose::Robot(own) => own == *robot,
            Whose::Everyone => true,
        };
        robots.iter().any(|robot| acts_on(robot) && with.terms.iter().any(|term| term.acts_on(*robot)))
    };
    let known = |entry: &Entry| with.terms.iter().any(|term| term.effect == entry.0 && term.whose == entry.1);
    let open: Vec<Entry> = entries(units)
        .entries
        .into_iter()
        .filter(|entry| !is_of_spread(entry.0) && acts(entry.1) && !known(entry))
        .filter(|entry| composition(entry.0).is_none())
        .collect();
    let whites = whites(units, nominal);
    let mut best: BTreeMap<Entry, Scored> = BTreeMap::new();
    for (entry, own) in open.iter().zip(candidates(&open, units, &nominal.terms, &nominal.states)) {
        for scored in own.iter().filter_map(|candidate| score(units, &whites, candidate)) {
            if best.get(entry).is_none_or(|known| scored.step.gain > known.step.gain) {
                best.insert(*entry, scored);
            }
        }
    }
    let mut strongest: Vec<(Entry, Scored)> = best.into_iter().collect();
    strongest.sort_by(|a, b| b.1.step.gain.total_cmp(&a.1.step.gain));
    let gained = 2.0 * (with.log_likelihood - nominal.log_likelihood);
    let most = strongest.first().map_or(0.0, |(_, scored)| scored.step.gain);
    strongest.retain(|(_, scored)| scored.step.gain > LEAST_SHARE * most);
    strongest.truncate(RIVALS);
    let fitted = pleiad_recording::parallel::map(&strongest, |((effect, whose), scored)| {
        let term: Term = refine(units, &whites, scored).term();
        let fit = fit_beside(units, nominal, term)?;
        // Those that it does not act on stay as they are.
        let before: f64 = units
            .iter()
            .zip(&nominal.states)
            .filter(|(unit, _)| fit.terms.iter().any(|term| term.acts_on(unit.robot())))
            .map(|(_, state)| state.noise.log_likelihood)
            .sum();
        let robot = match whose {
            Whose::Robot(robot) => Some(*robot),
            Whose::Everyone => None,
        };
        let gain = 2.0 * (fit.log_likelihood - before);
        Some(Rival { effect: *effect, robot, loses: gained - gain })
    });
    let mut rivals: Vec<Rival> = fitted.into_iter().flatten().collect();
    rivals.sort_by(|a, b| a.loses.total_cmp(&b.loses));
    rivals
}

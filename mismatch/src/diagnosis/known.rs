//! Fits effects that are known to act: the structure is given, the parameters are searched.
//!
//! This is what a diagnosis could reach at best, and how its standard errors are held against the truth
//! (`docs/benchmarks/effects.md`). The search is the diagnosis's own: its starts, its scores, its refinement
//! of places and onsets, its fit.

use nalgebra::DMatrix;
use pleiad_estimation::RobotId;
use pleiad_physics::{Effect, Fit as How};
use pleiad_recording::Recording;

use crate::diagnose::{DiagnoseOptions, TruthUse};
use crate::diagnosis::candidate::candidates;
use crate::diagnosis::entries::is_shared;
use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::naming::{Estimated, Z_95, groups, total};
use crate::diagnosis::profile::{Profile, polish};
use crate::diagnosis::refine::refine;
use crate::diagnosis::robust::{Robust, robust};
use crate::diagnosis::run::Prepared;
use crate::diagnosis::select::{Scored, fit_beside, score, whites};
use crate::diagnosis::spread::{is_of_spread, known, known_swap};
use crate::diagnosis::support::slack;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::diagnosis::without_truth::{teams, withheld_of};
use crate::error::MismatchError;
use crate::findings::Estimate;

/// So many of the strongest starts are fitted.
const STARTS: usize = 6;

/// What an interval of a known parameter is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interval {
    /// The derivative of the predictions and the robust covariance of the scores.
    Sandwich,
    /// The values at which the likelihood, with everything else fitted again, is not yet too low: of
    /// thresholds, onsets and borders.
    Profile,
    /// There is none: a label, or nothing in the recording shows the parameter.
    None,
}

/// A parameter of an effect that is known to act.
#[derive(Clone, Debug)]
pub struct KnownParameter {
    /// The name with its component.
    pub label: String,
    /// The unit; `1` for a pure number.
    pub unit: &'static str,
    /// The value fitted.
    pub value: f64,
    /// Standard error: of a profile, half of the interval over 1.96.
    pub standard_error: Option<f64>,
    /// The 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// What the interval is from.
    pub interval: Interval,
}

/// An effect that is known to act, fitted.
#[derive(Clone, Debug)]
pub struct KnownFit {
    /// Which effect.
    pub effect: Effect,
    /// The robots on whose residuals it was fitted.
    pub robots: Vec<RobotId>,
    /// In the order of the effect's parameters.
    pub parameters: Vec<KnownParameter>,
    /// Of lag or delay fitted together on a robot without encoders: their sum, seconds, which is known far
    /// better than either.
    pub total: Option<KnownParameter>,
}

impl KnownFit {
    /// The parameter of this label.
    pub fn parameter(&self, label: &str) -> Option<&KnownParameter> {
        self.parameters.iter().find(|parameter| parameter.label == label)
    }
}

/// Whether an effect acts on every robot alike: of the world, of a place, of the map, of the reference system.
pub fn acts_on_every_robot(effect: Effect) -> bool {
    is_shared(effect.info())
}

/// Fits effects that are known to act on a robot, one after the other and then together. One that every
/// robot shares, such as a slope of the floor, is fitted to the residuals of all of them.
///
/// An effect that shows nowhere in the recording is left out.
///
/// # Errors
/// The recording has no nominal model and its odometry is not of commands, or the model lacks a robot.
pub fn fit_known(
    recording: &Recording,
    robot: RobotId,
    effects: &[Effect],
) -> Result<Vec<KnownFit>, MismatchError> {
    let prepared = Prepared::alone(recording, false)?;
    let shared = effects.iter().any(|effect| is_shared(effect.info()));
    let mut all = prepared.units(|own| shared || own == robot);
    // Sightings under wrong names are put right before anything is fitted.
    let swapped = effects.contains(&Effect::LandmarkIdentitySwap).then(|| known_swap(&mut all)).flatten();
    let units: Vec<&Unit<'_>> = all.iter().filter(|unit| !unit.rows.is_empty()).collect();

    let Some(mut current) = fit(&units, Vec::new(), &|_| true, Effort::FULL) else { return Ok(Vec::new()) };
    let of_mean = effects.iter().copied().filter(|&effect| !is_of_spread(effect));
    for effect in of_mean {
        let whose = if is_shared(effect.info()) { Whose::Everyone } else { Whose::Robot(robot) };
        if let Some(term) = found(&units, &current, effect, whose) {
            let mut terms = current.terms.clone();
            terms.push(term);
            current = fit(&units, terms, &|_| true, Effort::FULL).unwrap_or(current);
        }
    }
    let current = polish(&units, current);
    let of_mean = of_mean_known(&units, &current);
    let of_spread = effects.iter().filter(|&&effect| is_of_spread(effect)).filter_map(|&effect| {
        if effect == Effect::LandmarkIdentitySwap {
            return swapped.clone();
        }
        known(&units, &current, effect, robot)
    });
    let of_spread = of_spread.map(|estimated| known_fit(&units, &estimated, &|_| Z_95, None));
    Ok(of_mean.into_iter().chain(of_spread).collect())
}

/// How well effects of one robot explain a recording, with their parameters fitted and with what the nominal geometry may
/// be off by: a log-likelihood, to be compared with that of other effects on the same recording.
///
/// # Errors
/// As [`diagnose`](crate::diagnose()); a prediction is no finite number.
pub fn log_likelihood(
    recording: &Recording,
    robot: RobotId,
    effects: &[Effect],
    options: &DiagnoseOptions,
) -> Result<f64, MismatchError> {
    let by_reference = options.truth == TruthUse::No;
    let withheld;
    let recording = if by_reference || options.without_landmarks {
        withheld = withheld_of(recording, options)?;
        &withheld
    } else {
        recording
    };
    let prepared = Prepared::alone(recording, by_reference)?;
    let shared = effects.iter().any(|effect| is_shared(effect.info()));
    let all = prepared.units(|own| shared || by_reference || own == robot);
    let joined = if by_reference { teams(&all, std::slice::from_ref(&prepared))? } else { Vec::new() };
    let units: Vec<&Unit<'_>> = if by_reference { &joined } else { &all }.iter().collect();
    let units: Vec<&Unit<'_>> = units.into_iter().filter(|unit| !unit.rows.is_empty()).collect();
    let infinite = || MismatchError::NotFinite { recording: recording.name.clone() };
    let mut current = fit(&units, Vec::new(), &|_| true, Effort::FULL).ok_or_else(infinite)?;
    for &effect in effects {
        let whose = if is_shared(effect.info()) { Whose::Everyone } else { Whose::Robot(robot) };
        if let Some(term) = found(&units, &current, effect, whose) {
            let mut terms = current.terms.clone();
            terms.push(term);
            current = fit(&units, terms, &|_| true, Effort::FULL).unwrap_or(current);
        }
    }
    Ok(current.log_likelihood + slack(&units, &current))
}

/// An effect where the likelihood is greatest beside a fit, of all its starts.
pub(crate) fn found(units: &[&Unit<'_>], current: &Fit, effect: Effect, whose: Whose) -> Option<Term> {
    let whites = whites(units, current);
    let candidates = candidates(&[(effect, whose)], units, &current.terms, &current.states).concat();
    let mut scored: Vec<Scored> =
        candidates.iter().filter_map(|candidate| score(units, &whites, candidate)).collect();
    scored.sort_by(|a, b| b.step.gain.total_cmp(&a.step.gain));
    scored.truncate(STARTS);
    let mut best: Option<(f64, Term)> = None;
    for start in &scored {
        let start = refine(units, &whites, start);
        let Some(fitted) = fit_beside(units, current, start.term()) else { continue };
        if best.as_ref().is_none_or(|(most, _)| fitted.log_likelihood > *most) {
            best = fitted.terms.last().map(|term| (fitted.log_likelihood, term.clone()));
        }
    }
    best.map(|(_, term)| term)
}

/// Values and intervals of every term of a fit.
pub(crate) fn of_mean_known(units: &[&Unit<'_>], fit: &Fit) -> Vec<KnownFit> {
    // Thresholds alone leave nothing that has a derivative.
    let Robust { covariance, quantiles } = robust(units, fit).unwrap_or_else(|| {
        let size = fit.slots.len();
        Robust { covariance: DMatrix::from_element(size, size, f64::NAN), quantiles: vec![Z_95; size] }
    });
    let profile = Profile::new(units, fit);
    let groups = groups(units, &fit.terms);
    let one = |position: usize| {
        let estimated = Estimated::of(fit, &covariance, position);
        let quantile = |parameter: usize| {
            let slot = fit.slots.iter().position(|slot| *slot == (position, parameter));
            slot.map_or(Z_95, |slot| quantiles[slot])
        };
        let mut own = known_fit(units, &estimated, &quantile, Some((&profile, position)));
        own.total =
            groups.iter().filter(|group| group.len() > 1 && group.contains(&position)).find_map(|group| {
                let (label, Estimate { value, ci95, .. }) = total(units, (fit, &covariance, group))?;
                Some(KnownParameter {
                    label,
                    unit: "s",
                    value,
                    standard_error: Some((ci95[1] - ci95[0]) / (2.0 * Z_95)),
                    ci95: Some(ci95),
                    interval: Interval::Sandwich,
                })
            });
        own
    };
    (0..fit.terms.len()).map(one).collect()
}

/// Values and intervals of a term; those that its derivatives do not give come from `profile`. The values that
/// are fitted at a threshold, an onset or a place are as unsure, besides, as they are dragged along with it.
pub(crate) fn known_fit(
    units: &[&Unit<'_>],
    estimated: &Estimated,
    quantile: &dyn Fn(usize) -> f64,
    profile: Option<(&Profile<'_, '_>, usize)>,
) -> KnownFit {
    let term = &estimated.term;
    let mut dragged = vec![0.0; term.values.len()];
    let mut parameters = Vec::with_capacity(term.values.len());
    for (index, parameter) in term.parameters().iter().enumerate() {
        let mut own = KnownParameter {
            label: parameter.label(),
            unit: parameter.unit,
            value: term.values[index],
            standard_error: estimated.errors[index],
            ci95: estimated.interval(index),
            interval: if estimated.errors[index].is_some() { Interval::Sandwich } else { Interval::None },
        };
        if own.interval == Interval::None
            && parameter.fit != How::Choice
            && let Some((profile, position)) = profile
            && let Some(bounded) = profile.bounded((position, index))
        {
            let ci95 = bounded.ci95;
            own.standard_error = Some((ci95[1] - ci95[0]) / (2.0 * Z_95));
            own.ci95 = Some(ci95);
            own.interval = Interval::Profile;
            let errors = profile.dragged((position, index), &bounded).into_iter().flatten();
            for (sum, error) in dragged.iter_mut().zip(errors) {
                *sum += error * error;
            }
        }
        parameters.push(own);
    }
    for (index, (own, variance)) in parameters.iter_mut().zip(dragged).enumerate() {
        if let (Interval::Sandwich, Some(error)) = (own.interval, own.standard_error) {
            let error = error.hypot(variance.sqrt());
            let half = quantile(index) * error;
            own.standard_error = Some(error);
            own.ci95 = Some([own.value - half, own.value + half]);
        }
    }
    KnownFit {
        effect: term.effect,
        robots: units.iter().flat_map(|unit| unit.acted_on(term)).map(|member| member.robot).collect(),
        parameters,
        total: None,
    }
}

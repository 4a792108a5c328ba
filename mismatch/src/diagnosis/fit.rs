//! Maximum likelihood of the parameters of effects: Gauss-Newton with re-linearization, damped
//! (`marquardt1963`), on residuals whose pull is bounded and whose noise is estimated along with them.

use nalgebra::{DMatrix, DVector};
use pleiad_physics::Variable;

use crate::channel::Channel;
use crate::diagnosis::noise::{self, Noise};
use crate::diagnosis::starts::Placing;
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Column, Unit};
use crate::diagnosis::white::{White, dot, symmetric};
use pleiad_recording::parallel;

/// A linearization is kept as long as steps lower the cost by less than this.
const RELINEARIZE: f64 = 0.5;
/// Steps are given up at this damping.
const MAX_DAMPING: f64 = 1e8;

/// How hard a fit tries.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// The most steps.
    steps: usize,
    /// It has converged if a step lowers the cost by less than this.
    converged: f64,
}

impl Effort {
    /// For what is kept.
    pub(crate) const FULL: Self = Self { steps: 20, converged: 1e-4 };
    /// For telling rivals apart: their log-likelihood to a few hundredths.
    pub(crate) const RIVAL: Self = Self { steps: 10, converged: 0.02 };
}

/// A parameter: the position of its term and its position in the term.
pub(crate) type Slot = (usize, usize);

/// What a unit looks like under the terms of a fit.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) residuals: Vec<f64>,
    pub(crate) noise: Noise,
}

/// Fitted terms.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) terms: Vec<Term>,
    /// One per unit.
    pub(crate) states: Vec<State>,
    /// The parameters that were fitted.
    pub(crate) slots: Vec<Slot>,
    /// Derivatives of each unit's residuals with respect to the parameters, by unit, then parameter.
    pub(crate) columns: Vec<Vec<Column>>,
    /// Log-likelihood with the noise profiled out.
    pub(crate) log_likelihood: f64,
}

impl Fit {
    /// How many parameters of the last term were fitted, or searched because they are onset, place or threshold.
    pub(crate) fn parameters_of_last(&self) -> usize {
        let Some(last) = self.terms.len().checked_sub(1) else { return 0 };
        let fitted = self.slots.iter().filter(|(term, _)| *term == last).count();
        (fitted + Placing::of(self.terms[last].effect.info()).count()).max(1)
    }
}

/// Residuals of every unit under terms; `None` if a prediction is no finite number.
pub(crate) fn states(units: &[&Unit<'_>], terms: &[Term]) -> Option<Vec<State>> {
    states_at(units, terms, None)
}

/// The same, at the noise of the meshes of other states.
pub(crate) fn states_at(units: &[&Unit<'_>], terms: &[Term], known: Option<&[State]>) -> Option<Vec<State>> {
    let numbered: Vec<_> = units.iter().enumerate().collect();
    let state = |&(index, unit): &(usize, &&Unit<'_>)| {
        let residuals = residuals(unit, terms, &|_| true, None)?;
        let known = known.and_then(|known| known.get(index)).map(|state| &state.noise);
        Some(State { noise: noise::estimate(unit, terms, &residuals, known), residuals })
    };
    parallel::map(&numbered, state).into_iter().collect()
}

/// The states of units to whose terms one is added.
pub(crate) fn with_another(units: &[&Unit<'_>], known: &[State], terms: &[Term]) -> Option<Vec<State>> {
    let added = terms.last()?.effect;
    let state = |(unit, state): (&&Unit<'_>, &State)| {
        let residuals = residuals(unit, terms, &|channel| touches(added, channel), Some(&state.residuals))?;
        let noise = noise::estimate(unit, terms, &residuals, Some(&state.noise));
        Some(State { residuals, noise })
    };
    units.iter().zip(known).map(state).collect()
}

/// Residuals of a unit; those of channels that are not asked for are taken from `known`.
pub(crate) fn residuals(
    unit: &Unit<'_>,
    terms: &[Term],
    channels: &dyn Fn(Channel) -> bool,
    known: Option<&[f64]>,
) -> Option<Vec<f64>> {
    let wanted = |channel: Channel| known.is_none() || channels(channel);
    let mut all = known.map_or_else(|| vec![0.0; unit.rows.len()], <[f64]>::to_vec);
    let values = unit.values(terms, &wanted);
    for (stretch, values) in unit.stretches.iter().zip(values) {
        match values {
            Some(values) => all[stretch.range()].copy_from_slice(&values),
            None if stretch.rows > 0 && wanted(stretch.channel) => return None,
            None => {}
        }
    }
    Some(all)
}

/// Fits the terms for which `movable` holds, starting at their values. `None` if the model predicts no finite
/// numbers at the start.
pub(crate) fn fit(
    units: &[&Unit<'_>],
    terms: Vec<Term>,
    movable: &dyn Fn(usize) -> bool,
    effort: Effort,
) -> Option<Fit> {
    let states = states(units, &terms)?;
    Some(fit_from(units, terms, states, movable, effort, &|_| None))
}

/// The same at the noise of the meshes of other states.
pub(crate) fn fit_at(
    units: &[&Unit<'_>],
    terms: Vec<Term>,
    known: &[State],
    movable: &dyn Fn(usize) -> bool,
    effort: Effort,
) -> Option<Fit> {
    let states = states_at(units, &terms, Some(known))?;
    Some(fit_from(units, terms, states, movable, effort, &|_| None))
}

/// The same from what the units look like under the terms. Parameters that `known` has columns of, by unit, keep
/// them: they are hardly moved.
pub(crate) fn fit_from(
    units: &[&Unit<'_>],
    terms: Vec<Term>,
    states: Vec<State>,
    movable: &dyn Fn(usize) -> bool,
    effort: Effort,
    known: &dyn Fn(Slot) -> Option<Vec<Column>>,
) -> Fit {
    let (mut terms, mut states) = (terms, states);
    let mut slots = free_slots(&terms, movable);
    let mut open: Vec<bool> = Vec::with_capacity(slots.len());
    let mut found: Vec<Vec<Column>> = vec![Vec::with_capacity(slots.len()); units.len()];
    for &slot in &slots {
        let kept = known(slot);
        open.push(kept.is_none());
        let kept = kept.unwrap_or_else(|| units.iter().map(|unit| Column::empty(unit)).collect());
        for (columns, own) in found.iter_mut().zip(kept) {
            columns.push(own);
        }
    }
    linearize(units, &terms, &slots, &open, &mut found);
    // What shows nowhere cannot be fitted.
    let shows: Vec<bool> =
        (0..slots.len()).map(|slot| found.iter().any(|columns| !columns[slot].is_zero())).collect();
    keep(&mut slots, &shows);
    keep(&mut open, &shows);
    for columns in &mut found {
        keep(columns, &shows);
    }
    let mut damping = 1e-4;
    for _ in 0..effort.steps {
        if slots.is_empty() {
            break;
        }
        let normal = Normal::new(units, &states, &found, slots.len());
        let Some(step) = improve(units, &states, &terms, &slots, &normal, &mut damping) else { break };
        terms = step.terms;
        for ((state, residuals), unit) in states.iter_mut().zip(step.residuals).zip(units) {
            state.noise = noise::estimate(unit, &terms, &residuals, Some(&state.noise));
            state.residuals = residuals;
        }
        if step.gain > RELINEARIZE {
            linearize(units, &terms, &slots, &open, &mut found);
        }
        if step.gain < effort.converged {
            break;
        }
    }
    let log_likelihood = states.iter().map(|state| state.noise.log_likelihood).sum();
    Fit { terms, states, slots, columns: found, log_likelihood }
}

struct Step {
    terms: Vec<Term>,
    residuals: Vec<Vec<f64>>,
    /// By how much the cost at fixed noise fell.
    gain: f64,
}

/// A damped step that lowers the cost, if there is one.
fn improve(
    units: &[&Unit<'_>],
    states: &[State],
    terms: &[Term],
    slots: &[Slot],
    normal: &Normal,
    damping: &mut f64,
) -> Option<Step> {
    let all = |residuals: &mut dyn Iterator<Item = &Vec<f64>>| -> f64 {
        units
            .iter()
            .zip(states)
            .zip(residuals)
            .map(|((unit, state), own)| cost(unit, &state.noise, own))
            .sum()
    };
    let before = all(&mut states.iter().map(|state| &state.residuals));
    let moving = |channel: Channel| slots.iter().any(|&(term, _)| touches(terms[term].effect, channel));
    while *damping < MAX_DAMPING {
        if let Some(step) = normal.step(*damping) {
            let moved = stepped(terms, slots, &step);
            let evaluate = |(unit, state): &(&&Unit<'_>, &State)| {
                residuals(unit, &moved, &moving, Some(&state.residuals))
            };
            let each = parallel::map(&units.iter().zip(states).collect::<Vec<_>>(), evaluate);
            let residuals: Option<Vec<_>> = each.into_iter().collect();
            if let Some(residuals) = residuals {
                let after = all(&mut residuals.iter());
                if after < before {
                    *damping = (*damping * 0.1).max(1e-9);
                    return Some(Step { terms: moved, residuals, gain: before - after });
                }
            }
        }
        *damping *= 10.0;
    }
    None
}

fn stepped(terms: &[Term], slots: &[Slot], step: &DVector<f64>) -> Vec<Term> {
    let mut moved = terms.to_vec();
    for (&(term, parameter), change) in slots.iter().zip(step.iter()) {
        moved[term].values[parameter] += change;
    }
    for term in &mut moved {
        term.clamp();
    }
    moved
}

/// The cost of residuals at a noise.
pub(crate) fn cost(unit: &Unit<'_>, noise: &Noise, residuals: &[f64]) -> f64 {
    0.5 * noise.whitened(unit, residuals).into_iter().map(noise::rho).sum::<f64>()
}

/// The parameters of movable terms that are no labels.
fn free_slots(terms: &[Term], movable: &dyn Fn(usize) -> bool) -> Vec<Slot> {
    let mut slots = Vec::new();
    for (index, term) in terms.iter().enumerate().filter(|(index, _)| movable(*index)) {
        slots.extend((0..term.values.len()).filter(|&value| term.free[value]).map(|value| (index, value)));
    }
    slots
}

fn keep<T>(items: &mut Vec<T>, which: &[bool]) {
    let mut which = which.iter();
    items.retain(|_| which.next().copied().unwrap_or(true));
}

/// Puts the columns of the slots that are open in their places.
fn linearize(units: &[&Unit<'_>], terms: &[Term], slots: &[Slot], open: &[bool], found: &mut [Vec<Column>]) {
    let places: Vec<usize> = (0..slots.len()).filter(|&position| open[position]).collect();
    let own: Vec<Slot> = places.iter().map(|&position| slots[position]).collect();
    let each = parallel::map(units, |unit| columns(unit, terms, &own));
    for (columns, known) in each.into_iter().zip(found) {
        for (&position, column) in places.iter().zip(columns) {
            known[position] = column;
        }
    }
}

/// Columns of all slots for a unit; those of terms that do not act on it are empty.
pub(crate) fn columns(unit: &Unit<'_>, terms: &[Term], slots: &[Slot]) -> Vec<Column> {
    let mut all = vec![Column::empty(unit); slots.len()];
    for (index, member) in unit.members.iter().enumerate() {
        // The positions of the terms among the effects of the member's model.
        let mut next = member.nominal.effects.len()..;
        let places: Vec<Option<usize>> =
            terms.iter().map(|term| term.acts_on(member.robot).then(|| next.next()).flatten()).collect();
        let own: Vec<usize> = (0..slots.len()).filter(|&slot| places[slots[slot].0].is_some()).collect();
        let variables: Vec<Variable> = own
            .iter()
            .filter_map(|&slot| {
                let (term, parameter) = slots[slot];
                Some(Variable::Effect { index: places[term]?, parameter })
            })
            .collect();
        let show = |position: usize, channel: Channel| touches(terms[slots[own[position]].0].effect, channel);
        let columns = unit.columns(index, &member.model(terms), &variables, &show);
        for (slot, column) in own.iter().zip(columns) {
            all[*slot].take(column);
        }
    }
    all
}

/// The normal equations of a linearization: information and gradient of the log-likelihood.
pub(crate) struct Normal {
    pub(crate) information: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
}

impl Normal {
    /// From columns of `size` parameters per unit.
    pub(crate) fn new(units: &[&Unit<'_>], states: &[State], columns: &[Vec<Column>], size: usize) -> Self {
        let mut normal = Self { information: DMatrix::zeros(size, size), gradient: DVector::zeros(size) };
        for ((unit, state), columns) in units.iter().zip(states).zip(columns) {
            let white = White::new(unit, state, columns);
            for (which, stretch) in unit.stretches.iter().enumerate() {
                let present: Vec<(usize, &[f64])> = white.columns(which).collect();
                let errors = &white.errors[stretch.range()];
                for (position, &(slot, part)) in present.iter().enumerate() {
                    normal.gradient[slot] += dot(part, errors);
                    for &(other, other_part) in &present[..=position] {
                        normal.information[(slot, other)] += dot(part, other_part);
                    }
                }
            }
        }
        symmetric(&mut normal.information);
        normal
    }

    /// The step of these equations with the diagonal raised by a share.
    pub(crate) fn step(&self, damping: f64) -> Option<DVector<f64>> {
        // Scaled to a unit diagonal, so that units of parameters do not matter.
        let size = self.gradient.len();
        let scale: Vec<f64> =
            (0..size).map(|slot| self.information[(slot, slot)].sqrt().max(f64::MIN_POSITIVE)).collect();
        let mut scaled = DMatrix::from_fn(size, size, |row, column| {
            self.information[(row, column)] / scale[row] / scale[column]
        });
        for slot in 0..size {
            scaled[(slot, slot)] += damping;
        }
        let right = DVector::from_fn(size, |slot, _| self.gradient[slot] / scale[slot]);
        let solved = scaled.cholesky()?.solve(&right);
        let step = DVector::from_fn(size, |slot, _| solved[slot] / scale[slot]);
        step.iter().all(|change| change.is_finite()).then_some(step)
    }
}

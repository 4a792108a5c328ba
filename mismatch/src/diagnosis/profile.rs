//! The likelihood of parameters in which predictions jump: thresholds, onsets, borders of a place.
//!
//! They have no derivative to follow. The likelihood is profiled: at each value the parameters that have one
//! are fitted again, by one step at the noise of the fit, which is exact where they are amplitudes.

use pleiad_physics::{Fit as How, Parameter};

use crate::diagnosis::fit::{Effort, Fit, Normal, Slot, State, columns, fit, residuals};
use crate::diagnosis::noise;
use crate::diagnosis::starts::{Placing, thresholds};
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;
use crate::diagnosis::white::{White, step};

/// The 95 % quantile of chi-square with one degree of freedom: what twice the log-likelihood may lose.
const CHI_SQUARE_95: f64 = 3.841_458_820_694_124;
/// Onsets are searched from this to this, seconds.
const ONSET_STEPS_S: (f64, f64) = (0.5, 0.01);
/// Borders are searched from this to this, metres.
const BORDER_STEPS_M: (f64, f64) = (0.1, 0.005);
/// Thresholds are searched from this to this share of themselves.
const THRESHOLD_STEPS: (f64, f64) = (0.08, 0.002);
/// Ends of an interval are halved so often.
const HALVINGS: usize = 5;
/// An end that is farther than so many doublings of the least step is not there.
const DOUBLINGS: usize = 12;

/// The profile about a fit.
pub(crate) struct Profile<'u, 'a> {
    units: &'u [&'u Unit<'a>],
    fit: &'u Fit,
    /// Variance of scores over that of independent errors.
    inflation: f64,
}

impl<'u, 'a> Profile<'u, 'a> {
    pub(crate) fn new(units: &'u [&'u Unit<'a>], fit: &'u Fit) -> Self {
        let bare: Vec<White<'_, '_>> =
            units.iter().zip(&fit.states).map(|(unit, state)| White::new(unit, state, &[])).collect();
        let bare: Vec<&White<'_, '_>> = bare.iter().collect();
        let columns: Vec<&[_]> = fit.columns.iter().map(Vec::as_slice).collect();
        let inflation = if fit.slots.is_empty() { None } else { step(&bare, &columns) };
        Self { units, fit, inflation: inflation.map_or(1.0, |step| step.inflation.max(1.0)) }
    }

    /// Log-likelihood at a value of a parameter, but for a constant. `None` if the model predicts no finite
    /// numbers there.
    fn at(&self, (term, parameter): Slot, value: f64) -> Option<f64> {
        let mut terms = self.fit.terms.clone();
        terms[term].values[parameter] = value;
        let effect = terms[term].effect;
        let slots: Vec<Slot> = self.fit.slots.iter().copied().filter(|slot| slot.0 == term).collect();
        let mut states: Vec<State> = Vec::with_capacity(self.units.len());
        let mut own = Vec::with_capacity(self.units.len());
        for (unit, state) in self.units.iter().zip(&self.fit.states) {
            let residuals =
                residuals(unit, &terms, &|channel| touches(effect, channel), Some(&state.residuals))?;
            states.push(State { residuals, noise: state.noise.clone() });
            own.push(columns(unit, &terms, &slots));
        }
        let cost: f64 = states.iter().map(cost).sum();
        let normal = Normal::new(self.units, &states, &own, slots.len());
        let gained = if slots.is_empty() { 0.0 } else { 0.5 * normal.step(1e-9)?.dot(&normal.gradient) };
        Some(gained - cost)
    }

    /// The 95 % interval of a parameter; `None` if the likelihood does not bound it.
    pub(crate) fn interval(&self, slot: Slot) -> Option<[f64; 2]> {
        let term = &self.fit.terms[slot.0];
        let parameter = &term.parameters()[slot.1];
        let value = term.values[slot.1];
        if parameter.fit != How::Grid || !value.is_finite() {
            return None;
        }
        let (_, least) = steps(term, slot.1);
        let most = self.at(slot, value)?;
        let low = self.end(slot, value, -least, most)?;
        let high = self.end(slot, value, least, most)?;
        Some([low, high])
    }

    /// The end of the interval on one side.
    fn end(&self, slot: Slot, value: f64, least: f64, most: f64) -> Option<f64> {
        let inside = |there: f64| {
            self.at(slot, there).is_some_and(|found| 2.0 * (most - found) / self.inflation < CHI_SQUARE_95)
        };
        let (mut near, mut far) = (0.0, least);
        let mut doublings = 0;
        while inside(value + far) {
            near = far;
            far *= 2.0;
            doublings += 1;
            if doublings > DOUBLINGS {
                return None;
            }
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(near, far);
            if inside(value + middle) {
                near = middle;
            } else {
                far = middle;
            }
        }
        Some(value + far)
    }
}

fn cost(state: &State) -> f64 {
    let of = |(value, sigma): (&f64, &f64)| noise::rho(value / sigma);
    0.5 * state.residuals.iter().zip(&state.noise.sigma).map(of).sum::<f64>()
}

/// The first and the last step of a search, in the unit of the parameter.
fn steps(term: &Term, parameter: usize) -> (f64, f64) {
    let placing = Placing::of(term.effect.info());
    if placing.onset == Some(parameter) {
        return ONSET_STEPS_S;
    }
    if placing.region.is_some_and(|first| (first..first + 4).contains(&parameter)) {
        return BORDER_STEPS_M;
    }
    let size = term.values[parameter].abs();
    (THRESHOLD_STEPS.0 * size, THRESHOLD_STEPS.1 * size)
}

/// Moves parameters without derivative to where the likelihood is greatest, and fits the others again.
pub(crate) fn polish(units: &[&Unit<'_>], mut current: Fit) -> Fit {
    let loose: Vec<Slot> = (0..current.terms.len())
        .flat_map(|term| (0..current.terms[term].values.len()).map(move |parameter| (term, parameter)))
        .filter(|slot| {
            let parameter: &Parameter = &current.terms[slot.0].parameters()[slot.1];
            parameter.fit == How::Grid && !current.slots.contains(slot)
        })
        .collect();
    if loose.is_empty() {
        return current;
    }
    for _ in 0..2 {
        for &slot in &loose {
            let value = best(&Profile::new(units, &current), slot);
            current.terms[slot.0].values[slot.1] = value;
            let mut terms = current.terms.clone();
            terms[slot.0].values[slot.1] = value;
            match fit(units, terms, &|_| true, Effort::FULL) {
                Some(next) => current = next,
                None => return current,
            }
        }
    }
    current
}

/// The value of greatest likelihood: for a threshold the best of a grid, then by halving steps.
fn best(profile: &Profile<'_, '_>, slot: Slot) -> f64 {
    let term = &profile.fit.terms[slot.0];
    let parameter = &term.parameters()[slot.1];
    let placing = Placing::of(term.effect.info());
    let placed = placing.onset == Some(slot.1)
        || placing.region.is_some_and(|first| (first..first + 4).contains(&slot.1));
    let at = |value: f64| profile.at(slot, value).unwrap_or(f64::NEG_INFINITY);
    let mut value = term.values[slot.1];
    let mut most = at(value);
    if !placed {
        for other in thresholds(parameter, profile.units) {
            let there = at(other);
            if there > most {
                (value, most) = (other, there);
            }
        }
    }
    let mut moved = term.clone();
    moved.values[slot.1] = value;
    let (mut size, last) = steps(&moved, slot.1);
    while size >= last && size > 0.0 {
        let mut improved = false;
        for change in [-size, size] {
            let there = at(value + change);
            if there > most {
                (value, most) = (value + change, there);
                improved = true;
                break;
            }
        }
        if !improved {
            size *= 0.5;
        }
    }
    value
}

//! The likelihood of parameters in which predictions jump: thresholds, onsets, borders of a place.
//!
//! They have no derivative to follow. The likelihood is profiled: at each value the parameters that have one
//! are fitted again, by one step at the noise of the fit, which is exact where they are amplitudes.

use pleiad_physics::{Effect, Fit as How, Parameter};

use crate::body::PUSH_S;
use crate::channel::Channel;
use crate::diagnosis::fit::{Effort, Fit, Normal, Slot, State, columns, cost, fit, residuals};
use crate::diagnosis::naming::Z_95;
use crate::diagnosis::starts::{Placing, thresholds};
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;
use crate::diagnosis::white::{White, step};
use crate::track::median_step;

/// What twice the log-likelihood may lose at a value where predictions jump, in 95 % of all cases: the quantile of
/// `(1 - exp(-x/2))^2` (`hansen2000`). It is not that of chi-square: readings change sides one by one, and the best
/// value is the greatest of a random walk.
const JUMP_95: f64 = 7.352_276_694_155_739;
/// Onsets are searched from this to this, seconds.
const ONSET_STEPS_S: (f64, f64) = (0.05, 0.005);
/// A push is searched to so short steps, seconds: how a push is split between the windows before and after a
/// reference pose hangs on where in its short duration the pose is.
const LAST_PUSH_STEP_S: f64 = 0.0005;
/// Borders are searched from this to this, metres.
const BORDER_STEPS_M: (f64, f64) = (0.1, 0.005);
/// Thresholds are searched from this to this share of themselves.
const THRESHOLD_STEPS: (f64, f64) = (0.08, 0.002);
/// An onset is first looked for at these distances on either side, seconds: a step, and how many of them.
const ONSET_GRID: (f64, i32) = (0.1, 15);
/// A change of twice the log-likelihood that is none.
const SAME: f64 = 1e-3;
/// At a value, parameters with a derivative are fitted in so many steps at most, until one gains less than this.
const MOST_STEPS: i32 = 4;
const SMALL_GAIN: f64 = 2.0;
/// A robot that stays so far from a place, metres, knows nothing of its borders.
const NEAR_M: f64 = 1.0;
/// Ends of an interval are halved so often.
const HALVINGS: usize = 5;
/// An end that is farther than so many doublings of the least step is not there.
const DOUBLINGS: usize = 12;

/// The interval of a parameter without derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounded {
    pub(crate) ci95: [f64; 2],
    /// The last values tried that are within, and the first that are not.
    within: [f64; 2],
    beyond: [f64; 2],
}

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
    fn at(&self, slot: Slot, value: f64) -> Option<f64> {
        self.fitted(slot, value).map(|(found, _)| found)
    }

    /// The same with the term as it is fitted there.
    fn fitted(&self, slot: Slot, value: f64) -> Option<(f64, Term)> {
        let mut terms = self.fit.terms.clone();
        terms[slot.0].values[slot.1] = value;
        let effect = terms[slot.0].effect;
        let slots: Vec<Slot> = self.fit.slots.iter().copied().filter(|own| own.0 == slot.0).collect();
        let concerned: Vec<usize> = (0..self.units.len()).filter(|&unit| self.concerns(slot, unit)).collect();
        let units: Vec<&Unit<'_>> = concerned.iter().map(|&unit| self.units[unit]).collect();
        // Amplitudes are nearly linear: their columns serve every step.
        let own: Vec<_> = units.iter().map(|unit| columns(unit, &terms, &slots)).collect();
        for step in 1.. {
            let mut states: Vec<State> = Vec::with_capacity(units.len());
            for (&unit, &position) in units.iter().zip(&concerned) {
                let known = &self.fit.states[position];
                let residuals =
                    residuals(unit, &terms, &|channel| touches(effect, channel), Some(&known.residuals))?;
                states.push(State { residuals, noise: known.noise.clone() });
            }
            let each = units.iter().zip(&states);
            let cost: f64 = each.map(|(unit, state)| cost(unit, &state.noise, &state.residuals)).sum();
            if slots.is_empty() {
                return Some((-cost, terms.swap_remove(slot.0)));
            }
            let normal = Normal::new(&units, &states, &own, slots.len());
            let change = normal.step(1e-9)?;
            let gained = 0.5 * change.dot(&normal.gradient);
            for (&(term, parameter), change) in slots.iter().zip(change.iter()) {
                terms[term].values[parameter] += change;
            }
            terms[slot.0].clamp();
            if gained < SMALL_GAIN || step == MOST_STEPS {
                return Some((gained - cost, terms.swap_remove(slot.0)));
            }
        }
        None
    }

    /// Whether a parameter can matter to a unit: a place only to a robot that came near it.
    fn concerns(&self, slot: Slot, unit: usize) -> bool {
        let term = &self.fit.terms[slot.0];
        if !self.units[unit].has(term) {
            return false;
        }
        let Some(first) = Placing::of(term.effect.info()).region else { return true };
        let [x_min, x_max, y_min, y_max] = [0, 1, 2, 3].map(|bound| term.values[first + bound]);
        let (low, high) = ([x_min, y_min], [x_max, y_max]);
        self.units[unit].rows.iter().filter_map(|row| row.regime.pose).any(|pose| {
            let place = pose.position();
            (0..2).all(|axis| place[axis] > low[axis] - NEAR_M && place[axis] < high[axis] + NEAR_M)
        })
    }

    /// The middle of all values whose likelihood is that of this one: where predictions do not change, none
    /// of them is better.
    fn plateau(&self, slot: Slot, value: f64) -> f64 {
        let (_, least) = steps(&self.fit.terms[slot.0], slot.1);
        let ends = self.at(slot, value).and_then(|most| {
            let low = self.end(slot, value, -least, most, SAME)?;
            let high = self.end(slot, value, least, most, SAME)?;
            Some((low[1], high[1]))
        });
        ends.map_or(value, |(low, high)| f64::midpoint(low, high))
    }

    /// The 95 % interval of a parameter; `None` if the likelihood does not bound it.
    pub(crate) fn interval(&self, slot: Slot) -> Option<[f64; 2]> {
        self.bounded(slot).map(|found| found.ci95)
    }

    /// The same, with the last values tried that are within.
    pub(crate) fn bounded(&self, slot: Slot) -> Option<Bounded> {
        let term = &self.fit.terms[slot.0];
        let parameter = &term.parameters()[slot.1];
        let value = term.values[slot.1];
        if parameter.fit != How::Grid || !value.is_finite() {
            return None;
        }
        let (_, least) = steps(term, slot.1);
        let most = self.at(slot, value)?;
        let low = self.end(slot, value, -least, most, JUMP_95)?;
        let high = self.end(slot, value, least, most, JUMP_95)?;
        let mut reach =
            if Placing::of(term.effect.info()).onset == Some(slot.1) { self.step_s() } else { 0.0 };
        if term.effect == Effect::Push {
            reach += 0.5 * PUSH_S;
        }
        Some(Bounded {
            ci95: [low[1] - reach, high[1] + reach],
            within: [low[0], high[0]],
            beyond: [low[1], high[1]],
        })
    }

    /// The longest usual step of the encoders, seconds: predictions act in such steps and have no onset within
    /// one.
    fn step_s(&self) -> f64 {
        let tracks = self.units.iter().flat_map(|unit| {
            unit.members.iter().filter_map(|member| unit.evidence.tracks.get(&member.robot))
        });
        let steps = tracks.map(|track| median_step(track.encoders.iter().map(|sample| sample.time_s)));
        steps.filter(|step_s| step_s.is_finite()).fold(0.0, f64::max)
    }

    /// The stamps of the reference poses at which windows of the body meet, as near as this to an instant, seconds.
    fn reference_near(&self, time_s: f64, reach_s: f64) -> Vec<f64> {
        let mut found = Vec::new();
        for unit in self.units {
            let (Some(stretch), Some(track)) =
                (unit.stretch(Channel::Body), unit.evidence.tracks.get(&unit.robot()))
            else {
                continue;
            };
            let middles = unit.rows[stretch.range()].iter().step_by(stretch.components).map(|row| row.time_s);
            let middles: Vec<f64> = middles.collect();
            let meet = middles.windows(2).map(|pair| f64::midpoint(pair[0], pair[1]));
            let near = meet.filter(|meet_s| (meet_s - time_s).abs() < reach_s);
            found.extend(near.filter_map(|meet_s| track.truth_near(meet_s)).map(|(stamp_s, _)| stamp_s));
        }
        found
    }

    /// How unsure the other parameters of a term are because one without derivative is: half of what they move
    /// where the likelihood leaves it, over 1.96. Beyond its ends they may be anything; within the steps that an
    /// interval is wider by, predictions do not change.
    pub(crate) fn dragged(&self, slot: Slot, bounded: &Bounded) -> Option<Vec<f64>> {
        let [from, to] = bounded.within;
        let share = (bounded.beyond[1] - bounded.beyond[0]) / (to - from);
        if !share.is_finite() {
            return None;
        }
        let ((_, at_low), (_, at_high)) = (self.fitted(slot, from)?, self.fitted(slot, to)?);
        let error = |(low, high): (&f64, &f64)| share * (high - low) / (2.0 * Z_95);
        Some(at_low.values.iter().zip(&at_high.values).map(error).collect())
    }

    /// Where twice the log-likelihood has lost so much on one side: the last value tried that is within, and the
    /// first that is not.
    fn end(&self, slot: Slot, value: f64, least: f64, most: f64, loss: f64) -> Option<[f64; 2]> {
        let inside = |there: f64| {
            self.at(slot, there).is_some_and(|found| 2.0 * (most - found) / self.inflation < loss)
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
        Some([value + near, value + far])
    }
}

/// The first and the last step of a search, in the unit of the parameter.
fn steps(term: &Term, parameter: usize) -> (f64, f64) {
    let placing = Placing::of(term.effect.info());
    if placing.onset == Some(parameter) {
        let last_s = if term.effect == Effect::Push { LAST_PUSH_STEP_S } else { ONSET_STEPS_S.1 };
        return (ONSET_STEPS_S.0, last_s);
    }
    if placing.region.is_some_and(|first| (first..first + 4).contains(&parameter)) {
        return BORDER_STEPS_M;
    }
    let size = term.values[parameter].abs();
    (THRESHOLD_STEPS.0 * size, THRESHOLD_STEPS.1 * size)
}

/// Whether a parameter is a size from which an effect begins to act: without derivative, and no place or onset.
pub(crate) fn is_threshold(term: &Term, parameter: usize) -> bool {
    term.parameters()[parameter].fit == How::Grid && !is_placed(term, parameter)
}

fn is_placed(term: &Term, parameter: usize) -> bool {
    let placing = Placing::of(term.effect.info());
    placing.onset == Some(parameter)
        || placing.region.is_some_and(|first| (first..first + 4).contains(&parameter))
}

/// Moves parameters without derivative to where the likelihood is greatest, and fits the others again.
pub(crate) fn polish(units: &[&Unit<'_>], current: Fit) -> Fit {
    polish_some(units, current, &|_, _| true, &|_| true, Effort::FULL)
}

/// The same for those parameters of terms for which `chosen` holds; of the others those of terms for which
/// `movable` holds are fitted again.
pub(crate) fn polish_some(
    units: &[&Unit<'_>],
    mut current: Fit,
    chosen: &dyn Fn(&Fit, Slot) -> bool,
    movable: &dyn Fn(usize) -> bool,
    effort: Effort,
) -> Fit {
    let loose: Vec<Slot> = (0..current.terms.len())
        .flat_map(|term| (0..current.terms[term].values.len()).map(move |parameter| (term, parameter)))
        .filter(|slot| {
            let parameter: &Parameter = &current.terms[slot.0].parameters()[slot.1];
            parameter.fit == How::Grid && !current.slots.contains(slot) && chosen(&current, *slot)
        })
        .collect();
    if loose.is_empty() {
        return current;
    }
    for round in 0..2 {
        let mut terms = current.terms.clone();
        let mut moved = false;
        for &slot in &loose {
            let profile = Profile::new(units, &current);
            let before = current.terms[slot.0].values[slot.1];
            let value = profile.plateau(slot, best(&profile, slot, round == 0));
            moved |= (value - before).abs() > steps(&current.terms[slot.0], slot.1).1;
            terms[slot.0].values[slot.1] = value;
            current.terms[slot.0].values[slot.1] = value;
        }
        // A push that was taken for half of one, because two windows show half each, is the whole.
        let doubled = doubled(&terms, &loose).and_then(|terms| fit(units, terms, movable, effort));
        match fit(units, terms, movable, effort) {
            Some(next) => current = next,
            None => return current,
        }
        if let Some(doubled) = doubled
            && doubled.log_likelihood > current.log_likelihood
        {
            current = doubled;
        }
        // Another round is for parameters that follow each other.
        if !moved || loose.len() == 1 {
            break;
        }
    }
    current
}

/// Terms in which the pushes that are searched jump twice as far; `None` if there are none.
fn doubled(terms: &[Term], searched: &[Slot]) -> Option<Vec<Term>> {
    let mut doubled = terms.to_vec();
    let mut any = false;
    for &(term, onset) in searched.iter().filter(|(term, _)| terms[*term].effect == Effect::Push) {
        let jumps = doubled[term].values.iter_mut().enumerate().filter(|(index, _)| *index != onset);
        jumps.for_each(|(_, jump)| *jump *= 2.0);
        doubled[term].clamp();
        any = true;
    }
    any.then_some(doubled)
}

/// Whether a parameter was moved away from "off".
#[allow(clippy::float_cmp, reason = "the off value itself")]
pub(crate) fn is_on(term: &Term, parameter: usize) -> bool {
    term.values[parameter] != term.parameters()[parameter].off
}

/// The value of greatest likelihood: first the best of a grid, if it may be `far`, then by halving steps.
fn best(profile: &Profile<'_, '_>, slot: Slot, far: bool) -> f64 {
    let term = &profile.fit.terms[slot.0];
    let parameter = &term.parameters()[slot.1];
    let at = |value: f64| profile.at(slot, value).unwrap_or(f64::NEG_INFINITY);
    let mut value = term.values[slot.1];
    let mut most = at(value);
    if far && Placing::of(term.effect.info()).onset == Some(slot.1) {
        let (step_s, steps) = ONSET_GRID;
        let begun_s = term.values[slot.1];
        let mut others: Vec<f64> = (-steps..=steps).map(|step| begun_s + step_s * f64::from(step)).collect();
        if term.effect == Effect::Push {
            others.extend(profile.reference_near(begun_s, step_s * f64::from(steps)));
        }
        for other in others {
            let there = at(other);
            if there > most {
                (value, most) = (other, there);
            }
        }
    }
    if far && is_threshold(term, slot.1) {
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

//! What a finding is worth on data that the fit did not see.
//!
//! Folds are contiguous. For each, the parameters are fitted to the rest, less an embargo on both sides, by a
//! step from the fit to everything: so close to it that one linearization is enough.

use std::ops::Range;

use nalgebra::DVector;

use crate::diagnosis::fit::{Fit, Normal, State};
use crate::diagnosis::noise;
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;

/// How many folds.
pub(crate) const FOLDS: usize = 5;
/// Nothing this close to a fold is fitted, seconds.
pub(crate) const EMBARGO_S: f64 = 5.0;

/// In fewer blocks than this a gain is hardly above two of its standard errors, however clear it is in each.
pub(crate) const FEWEST_BLOCKS: usize = 10;
/// So many blocks must speak for what shows in few.
const LEAST_BLOCKS: usize = 3;
/// A block speaks for or against a model by at least this, in log-likelihood.
const SPEAKS: f64 = 1.0;
/// What a model explains is as small as the rest under it, in mean squared sigmas.
const ORDINARY: f64 = 1.5;
/// What a model changes by less than this is as it was, in log-likelihood.
const CHANGED: f64 = 1e-3;

/// A gain of log score with its standard error.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gain {
    pub(crate) total: f64,
    pub(crate) standard_error: f64,
    /// It arises in few blocks of time, at least three; in none of them anything is lost, and what is left there is as
    /// small as elsewhere. A deadband acts where a robot is slow and nowhere else: no two standard errors can be
    /// reached there. A burst of wild readings that a model takes up in part would leave more than elsewhere.
    pub(crate) consistent: bool,
}

impl Gain {
    /// Whether the gain may be relied on: more than so many of its standard errors, or little but consistent.
    pub(crate) fn is_useful(&self, errors: f64) -> bool {
        self.total > errors * self.standard_error || self.consistent
    }
}

/// What one block of time says of two models.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// Of log score.
    gain: f64,
    /// Squared sigmas under the better model, of what it changes.
    left: f64,
    /// The number of such elements.
    changed: usize,
}

/// A fold of a unit: its span of time.
pub(crate) fn fold(unit: &Unit<'_>, number: usize) -> Range<f64> {
    let (first_s, last_s) = unit.span_s;
    let length_s = (last_s - first_s) / FOLDS as f64;
    let from_s = first_s + length_s * number as f64;
    let to_s = if number + 1 == FOLDS { f64::INFINITY } else { from_s + length_s };
    from_s..to_s
}

/// The terms of a fit as they would be without a fold, and the residuals of the units under them.
pub(crate) fn left_out(units: &[&Unit<'_>], fit: &Fit, number: usize) -> (Vec<Term>, Vec<State>) {
    let training = |unit: &Unit<'_>, index: usize| {
        let fold = fold(unit, number);
        let time_s = unit.rows[index].time_s;
        time_s < fold.start - EMBARGO_S || time_s >= fold.end + EMBARGO_S
    };
    let masked = |(unit, state): (&&Unit<'_>, &State)| {
        let mut state = state.clone();
        for index in (0..unit.rows.len()).filter(|&index| !training(unit, index)) {
            state.noise.sigma[index] = f64::INFINITY;
        }
        state
    };
    let states: Vec<State> = units.iter().zip(&fit.states).map(masked).collect();
    let normal = Normal::new(units, &states, &fit.columns, fit.slots.len());
    let step = normal.step(1e-9).unwrap_or_else(|| DVector::zeros(fit.slots.len()));
    let mut terms = fit.terms.clone();
    for (&(term, parameter), change) in fit.slots.iter().zip(step.iter()) {
        terms[term].values[parameter] += change;
    }
    let moved = |((unit, state), columns): ((&&Unit<'_>, &State), &Vec<crate::diagnosis::unit::Column>)| {
        let mut residuals = state.residuals.clone();
        for (column, change) in columns.iter().zip(step.iter()) {
            for (part, stretch) in column.parts.iter().zip(&unit.stretches) {
                let Some(part) = part else { continue };
                for (residual, slope) in residuals[stretch.range()].iter_mut().zip(part) {
                    *residual += slope * change;
                }
            }
        }
        State {
            noise: noise::estimate_from(unit, &terms, &residuals, Some(&state.noise), &|index| {
                training(unit, index)
            }),
            residuals,
        }
    };
    let states = units.iter().zip(&fit.states).zip(&fit.columns).map(moved).collect();
    (terms, states)
}

/// The gain of one fit over another on folds that neither saw.
pub(crate) fn cross_fitted(units: &[&Unit<'_>], with: &Fit, without: &Fit) -> Gain {
    let mut blocks: Vec<Vec<Block>> = units.iter().map(|unit| vec![Block::default(); unit.blocks]).collect();
    for number in 0..FOLDS {
        let (_, with) = left_out(units, with, number);
        let (_, without) = left_out(units, without, number);
        for ((unit, blocks), (with, without)) in units.iter().zip(&mut blocks).zip(with.iter().zip(&without))
        {
            let fold = fold(unit, number);
            add(unit, with, without, blocks, &|index| fold.contains(&unit.rows[index].time_s));
        }
    }
    told(&blocks)
}

/// The gain of one set of states over another, where noise is known from elsewhere.
pub(crate) fn compared(units: &[&Unit<'_>], with: &[State], without: &[State]) -> Gain {
    let mut blocks: Vec<Vec<Block>> = units.iter().map(|unit| vec![Block::default(); unit.blocks]).collect();
    for ((unit, blocks), (with, without)) in units.iter().zip(&mut blocks).zip(with.iter().zip(without)) {
        add(unit, with, without, blocks, &|_| true);
    }
    told(&blocks)
}

/// Adds what each element says to its block.
fn add(unit: &Unit<'_>, with: &State, without: &State, blocks: &mut [Block], held: &dyn Fn(usize) -> bool) {
    let left = squares(unit, with, with);
    for (index, gain) in gains(unit, with, without).into_iter().enumerate() {
        if held(index) {
            let block = &mut blocks[unit.block_of[index]];
            block.gain += gain;
            if gain.abs() > CHANGED {
                block.left += left[index];
                block.changed += 1;
            }
        }
    }
}

/// Sum over blocks, and whether few of them are of one mind.
fn told(units: &[Vec<Block>]) -> Gain {
    let gains: Vec<Vec<f64>> =
        units.iter().map(|blocks| blocks.iter().map(|block| block.gain).collect()).collect();
    let speak: Vec<&Block> = units.iter().flatten().filter(|block| block.gain.abs() > SPEAKS).collect();
    let few = (LEAST_BLOCKS..FEWEST_BLOCKS).contains(&speak.len());
    let (left, changed) =
        speak.iter().fold((0.0, 0), |(left, changed), block| (left + block.left, changed + block.changed));
    let consistent = few && speak.iter().all(|block| block.gain > 0.0) && left <= ORDINARY * changed as f64;
    Gain { consistent, ..summed(&gains) }
}

/// Log-density that each element gains by the better model, both at the noise of the better one: a model gains
/// by what it predicts, not by claiming less noise where errors are small and more where they are not. What
/// is farther off than [`noise::CLIP`] sigmas counts as that far, so that no instant outweighs the rest.
pub(crate) fn gains(unit: &Unit<'_>, with: &State, without: &State) -> Vec<f64> {
    let each = squares(unit, with, without).into_iter().zip(squares(unit, with, with));
    each.map(|(without, with)| 0.5 * (without - with)).collect()
}

/// Squared residuals of `state` in sigmas of `with`, clipped.
fn squares(unit: &Unit<'_>, with: &State, state: &State) -> Vec<f64> {
    let errors = with.noise.whitened(unit, &state.residuals);
    errors.into_iter().map(|error| error.abs().min(noise::CLIP).powi(2)).collect()
}

/// Sum over blocks; its variance with the covariance of neighbours (`newey1987`, one lag).
pub(crate) fn summed(units: &[Vec<f64>]) -> Gain {
    let total: f64 = units.iter().flatten().sum();
    let count = units.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let mean = total / count;
    let mut variance = 0.0;
    for blocks in units {
        variance += blocks.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        variance += blocks.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum::<f64>();
    }
    Gain { total, standard_error: variance.max(0.0).sqrt(), consistent: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks that gain so much and leave so much per element, among many that nothing changes.
    fn of(speaking: &[(f64, f64)]) -> Gain {
        let block = |&(gain, left): &(f64, f64)| Block { gain, left: 10.0 * left, changed: 10 };
        let quiet = std::iter::repeat_n(Block::default(), 70);
        told(&[speaking.iter().map(block).chain(quiet).collect()])
    }

    #[test]
    fn few_blocks_of_one_mind_are_relied_on_though_they_are_no_two_standard_errors() {
        let gain = of(&[(54.0, 1.0), (113.0, 1.0), (117.0, 1.1)]);
        assert!(gain.total < 2.0 * gain.standard_error && gain.is_useful(2.0));
    }

    #[test]
    fn few_blocks_are_not_if_one_loses_or_much_is_left_or_they_are_two() {
        assert!(!of(&[(54.0, 1.0), (113.0, 1.0), (-2.0, 1.0)]).consistent);
        assert!(!of(&[(54.0, 1.0), (113.0, 4.0), (117.0, 1.0)]).consistent);
        assert!(!of(&[(113.0, 1.0), (117.0, 1.0)]).consistent);
        assert!(!of(&[(5.0, 1.0); 12]).consistent);
    }
}

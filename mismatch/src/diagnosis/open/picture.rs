//! One robot's residuals beside everything that is fitted to them: terms of the catalogue, linearized where their
//! fit ended, and forms.

use pleiad_estimation::RobotId;

use crate::diagnosis::fit::{Fit, Normal, Slot, State};
use crate::diagnosis::held_out::{EMBARGO_S, FOLDS, Gain, fold, gains, summed};
use crate::diagnosis::noise;
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Column, Unit};

/// Rounds in which coefficients and noise settle.
const ROUNDS: usize = 4;
/// So much of the diagonal keeps parameters that say the same apart.
const DAMPING: f64 = 1e-9;

/// How data are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Folds {
    /// Spans of the recording, with an embargo on both sides.
    Spans,
    /// Blocks of time by turns, for what depends on the time itself: a span that is left out says nothing of it.
    Turns,
}

impl Folds {
    fn holds(self, unit: &Unit<'_>, number: usize, index: usize) -> bool {
        match self {
            Self::Spans => fold(unit, number).contains(&unit.rows[index].time_s),
            Self::Turns => unit.block_of[index] % FOLDS == number,
        }
    }

    fn trains(self, unit: &Unit<'_>, number: usize, index: usize) -> bool {
        match self {
            Self::Spans => {
                let fold = fold(unit, number);
                let time_s = unit.rows[index].time_s;
                time_s < fold.start - EMBARGO_S || time_s >= fold.end + EMBARGO_S
            }
            Self::Turns => !self.holds(unit, number, index),
        }
    }
}

#[derive(Clone)]
pub(crate) struct Picture<'u, 'a> {
    pub(crate) units: Vec<&'u Unit<'a>>,
    pub(crate) terms: Vec<Term>,
    pub(crate) states: Vec<State>,
    /// By unit, then parameter: those of the terms, then one per form.
    pub(crate) columns: Vec<Vec<Column>>,
    /// Term and parameter of each column of terms.
    pub(crate) slots: Vec<Slot>,
    /// How far each parameter has moved: of forms, the coefficient.
    pub(crate) moved: Vec<f64>,
}

impl<'u, 'a> Picture<'u, 'a> {
    /// Of a robot, from a fit to these units.
    pub(crate) fn new(units: &[&'u Unit<'a>], fit: &Fit, robot: RobotId) -> Self {
        let own: Vec<usize> = (0..units.len()).filter(|&unit| units[unit].robot() == robot).collect();
        let shows: Vec<usize> = (0..fit.slots.len())
            .filter(|&slot| own.iter().any(|&unit| !fit.columns[unit][slot].is_zero()))
            .collect();
        let columns = |&unit: &usize| shows.iter().map(|&slot| fit.columns[unit][slot].clone()).collect();
        Self {
            units: own.iter().map(|&unit| units[unit]).collect(),
            terms: fit.terms.clone(),
            states: own.iter().map(|&unit| fit.states[unit].clone()).collect(),
            columns: own.iter().map(columns).collect(),
            slots: shows.iter().map(|&slot| fit.slots[slot]).collect(),
            moved: vec![0.0; shows.len()],
        }
    }

    pub(crate) fn size(&self) -> usize {
        self.moved.len()
    }

    pub(crate) fn log_likelihood(&self) -> f64 {
        self.states.iter().map(|state| state.noise.log_likelihood).sum()
    }

    /// With more columns, one of each unit, fitted again.
    pub(crate) fn with(&self, added: &[Vec<Column>]) -> Self {
        let mut all = self.clone();
        for columns in added {
            for (own, column) in all.columns.iter_mut().zip(columns) {
                own.push(column.clone());
            }
            all.moved.push(0.0);
        }
        all.settle();
        all
    }

    /// Without some of the columns of forms: what they explained is left again.
    pub(crate) fn without(&self, dropped: &[usize]) -> Self {
        let mut all = self.clone();
        for &position in dropped {
            let back = -all.moved[position];
            all.shift(position, back);
        }
        let mut sorted = dropped.to_vec();
        sorted.sort_unstable();
        for &position in sorted.iter().rev() {
            for own in &mut all.columns {
                own.remove(position);
            }
            all.moved.remove(position);
            if position < all.slots.len() {
                all.slots.remove(position);
            }
        }
        for (unit, state) in all.units.iter().zip(&mut all.states) {
            state.noise = noise::estimate(unit, &all.terms, &state.residuals, None);
        }
        all.settle();
        all
    }

    /// Moves a parameter.
    fn shift(&mut self, position: usize, change: f64) {
        for ((unit, state), columns) in self.units.iter().zip(&mut self.states).zip(&self.columns) {
            shift(unit, &columns[position], change, &mut state.residuals);
        }
        self.moved[position] += change;
    }

    /// Fits all parameters together, and the noise.
    fn settle(&mut self) {
        for _ in 0..ROUNDS {
            let normal = Normal::new(&self.units, &self.states, &self.columns, self.size());
            let Some(step) = normal.step(DAMPING) else { return };
            for (position, &change) in step.iter().enumerate() {
                self.shift(position, change);
            }
            for (unit, state) in self.units.iter().zip(&mut self.states) {
                state.noise = noise::estimate(unit, &self.terms, &state.residuals, None);
            }
        }
    }

    /// The states as they are if a fold is not fitted.
    fn left_out(&self, number: usize, folds: Folds) -> Vec<State> {
        let training = |unit: &Unit<'_>, index: usize| folds.trains(unit, number, index);
        let mut states = self.states.clone();
        for (unit, state) in self.units.iter().zip(&mut states) {
            for index in (0..unit.rows.len()).filter(|&index| !training(unit, index)) {
                state.noise.sigma[index] = f64::INFINITY;
            }
        }
        let normal = Normal::new(&self.units, &states, &self.columns, self.size());
        if let Some(step) = normal.step(DAMPING) {
            for ((unit, state), columns) in self.units.iter().zip(&mut states).zip(&self.columns) {
                for (column, &change) in columns.iter().zip(step.iter()) {
                    shift(unit, column, change, &mut state.residuals);
                }
            }
        }
        for (unit, state) in self.units.iter().zip(&mut states) {
            let kept = |index: usize| training(unit, index);
            state.noise = noise::estimate_from(unit, &self.terms, &state.residuals, None, &kept);
        }
        states
    }

    /// The gain over another on folds that neither saw.
    pub(crate) fn gain_over(&self, other: &Self, folds: Folds) -> Gain {
        let mut blocks: Vec<Vec<f64>> = self.units.iter().map(|unit| vec![0.0; unit.blocks]).collect();
        for number in 0..FOLDS {
            let (with, without) = (self.left_out(number, folds), other.left_out(number, folds));
            for (((unit, blocks), with), without) in
                self.units.iter().zip(&mut blocks).zip(&with).zip(&without)
            {
                for (index, gain) in gains(unit, with, without).into_iter().enumerate() {
                    if folds.holds(unit, number, index) {
                        blocks[unit.block_of[index]] += gain;
                    }
                }
            }
        }
        summed(&blocks)
    }

    /// The share of the squares of one component that this explains beyond another, on folds that neither saw,
    /// with its standard error.
    pub(crate) fn share_over(
        &self,
        other: &Self,
        main: &[Option<(usize, usize)>],
        folds: Folds,
    ) -> (f64, f64) {
        // What is left, and what is less: by block.
        let mut blocks: Vec<[f64; 2]> = Vec::new();
        let offsets: Vec<usize> =
            self.units.iter().scan(0, |sum, unit| Some(std::mem::replace(sum, *sum + unit.blocks))).collect();
        blocks.resize(self.units.iter().map(|unit| unit.blocks).sum(), [0.0; 2]);
        for number in 0..FOLDS {
            let (with, without) = (self.left_out(number, folds), other.left_out(number, folds));
            for (index, unit) in self.units.iter().enumerate() {
                let Some((which, component)) = main[index] else { continue };
                let stretch = &unit.stretches[which];
                for row in stretch.range().skip(component).step_by(stretch.components) {
                    if !folds.holds(unit, number, row) {
                        continue;
                    }
                    let sigma = with[index].noise.sigma[row];
                    let square =
                        |state: &State| (state.residuals[row] / sigma).abs().min(2.0 * noise::CLIP).powi(2);
                    let block = &mut blocks[offsets[index] + unit.block_of[row]];
                    block[0] += square(&without[index]);
                    block[1] += square(&without[index]) - square(&with[index]);
                }
            }
        }
        let [whole, less] = blocks.iter().fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
        if whole <= 0.0 {
            return (0.0, 0.0);
        }
        let share = less / whole;
        let variance: f64 = blocks.iter().map(|own| (own[1] - share * own[0]).powi(2)).sum();
        (share, variance.sqrt() / whole)
    }
}

/// Adds a multiple of a column to residuals.
pub(crate) fn shift(unit: &Unit<'_>, column: &Column, change: f64, residuals: &mut [f64]) {
    for (part, stretch) in column.parts.iter().zip(&unit.stretches) {
        let Some(part) = part else { continue };
        for (residual, slope) in residuals[stretch.range()].iter_mut().zip(part) {
            *residual += slope * change;
        }
    }
}

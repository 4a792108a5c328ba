//! How unsure the parameters of a final fit are.
//!
//! A window ends at the reading with which the next one begins: its error counts in both, with opposite signs, and
//! cancels in whatever changes slowly; and slip lasts longer than a window. How errors of such a channel are
//! correlated is estimated ([`Correlation`]), and scores are formed of errors and columns that are freed of it
//! (prewhitening, `andrews1992`). What correlation is left counts by blocks (`liang1986`), whose residuals are too
//! small by what the block itself has pulled (CR2, `bell2002`). The variance is never below that of the estimated
//! correlation alone. Where few blocks say all, quantiles are those of Student's t with as many degrees of freedom as
//! blocks that say as much as each other would be.
//!
//! The tests of a search keep the covariance of `white`: a slow effect must not be found because errors happen to
//! cancel.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::channel::Channel;
use crate::diagnosis::correlation::{Chain, Correlation};
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::Z_95;
use crate::diagnosis::noise::Noise;
use crate::diagnosis::select::whites;
use crate::diagnosis::unit::{Stretch, Unit};
use crate::diagnosis::white::{White, raised};

/// Windows farther apart than this many median steps share no reading.
const APART: f64 = 1.5;
/// A block pulls at most this share of the fit towards itself.
const MOST_LEVERAGE: f64 = 0.99;
/// An interval of fewer degrees of freedom than this says nothing.
const LEAST_FREEDOM: f64 = 2.0;

/// The covariance of a fit's parameters, and how wide their intervals are.
pub(crate) struct Robust {
    pub(crate) covariance: DMatrix<f64>,
    /// Half the width of a 95 % interval in standard errors, per parameter.
    pub(crate) quantiles: Vec<f64>,
}

/// Of the parameters of a fit; `None` if there are none, or they cannot be told apart.
pub(crate) fn robust(units: &[&Unit<'_>], fit: &Fit) -> Option<Robust> {
    let size = fit.slots.len();
    if size == 0 {
        return None;
    }
    let mut information: DMatrix<f64> = DMatrix::zeros(size, size);
    let mut blocks: Vec<Block> = Vec::new();
    for (white, state) in whites(units, fit).iter().zip(&fit.states) {
        let mut own = vec![Block::new(size); white.unit.blocks];
        for (which, stretch) in white.unit.stretches.iter().enumerate() {
            add(white, &state.noise, (which, stretch), &mut information, &mut own);
        }
        blocks.extend(own);
    }
    blocks.retain(|block| block.variance.trace() > 0.0);
    let inverse = information.cholesky()?.inverse();
    let model = blocks.iter().fold(DMatrix::zeros(size, size), |sum, block| sum + &block.variance);
    // In the axes in which the variance of the model is one, the leverage of a block is what of it is the block's.
    let factor = model.clone().cholesky()?.l();
    let flat = factor.solve_lower_triangular(&DMatrix::identity(size, size))?;
    let mut meat: DMatrix<f64> = DMatrix::zeros(size, size);
    for block in &blocks {
        let leverage = &flat * &block.variance * flat.transpose();
        let eigen = SymmetricEigen::new(0.5 * (&leverage + leverage.transpose()));
        let grown = eigen.eigenvalues.map(|value| 1.0 / (1.0 - value.clamp(0.0, MOST_LEVERAGE)).sqrt());
        let turned = eigen.eigenvectors.transpose() * &flat * &block.score;
        let score = &factor * &eigen.eigenvectors * turned.component_mul(&grown);
        meat += &score * score.transpose();
    }
    let (meat, _) = raised(&meat, &model, 1.0)?;
    let covariance = &inverse * meat * &inverse;
    let quantiles = (0..size).map(|slot| quantile(freedom(&blocks, &inverse, slot))).collect();
    Some(Robust { covariance, quantiles })
}

/// What a block in time says.
#[derive(Clone)]
struct Block {
    /// The sum of its scores.
    score: nalgebra::DVector<f64>,
    /// What its variance is if errors are as they are modelled.
    variance: DMatrix<f64>,
}

impl Block {
    fn new(size: usize) -> Self {
        Self { score: nalgebra::DVector::zeros(size), variance: DMatrix::zeros(size, size) }
    }
}

/// Adds a stretch to the information and to the blocks.
fn add(
    white: &White<'_, '_>,
    noise: &Noise,
    (which, stretch): (usize, &Stretch),
    information: &mut DMatrix<f64>,
    blocks: &mut [Block],
) {
    let mut shown: Vec<(usize, Vec<f64>)> =
        white.columns(which).map(|(slot, part)| (slot, part.to_vec())).collect();
    if shown.is_empty() {
        return;
    }
    for (position, (slot, a)) in shown.iter().enumerate() {
        for (other, b) in &shown[..=position] {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            information[(*slot, *other)] += sum;
            if slot != other {
                information[(*other, *slot)] += sum;
            }
        }
    }
    let mut errors = white.errors[stretch.range()].to_vec();
    if shares_readings(stretch.channel) {
        free(white.unit, noise, stretch, (&mut errors, &mut shown));
    }
    for (row, error) in errors.iter().enumerate() {
        let block = &mut blocks[white.unit.block_of[stretch.offset + row]];
        for (position, (slot, a)) in shown.iter().enumerate() {
            block.score[*slot] += a[row] * error;
            for (other, b) in &shown[..=position] {
                block.variance[(*slot, *other)] += a[row] * b[row];
                if slot != other {
                    block.variance[(*other, *slot)] += a[row] * b[row];
                }
            }
        }
    }
}

/// Whether a channel is of windows, of which one ends where the next begins.
fn shares_readings(channel: Channel) -> bool {
    matches!(channel, Channel::Actuator | Channel::Body | Channel::CommandedBody | Channel::Gyro)
}

/// Frees errors of their correlation, and changes columns such that their product with the errors stays: of
/// errors `L u`, columns `a` become `L' a`. A pose that two windows share is wrong in the map: forward and left are
/// turned to there, in metres.
fn free(
    unit: &Unit<'_>,
    noise: &Noise,
    stretch: &Stretch,
    (errors, shown): (&mut [f64], &mut [(usize, Vec<f64>)]),
) {
    let count = stretch.components;
    let rows = &unit.rows[stretch.range()];
    let is_of_body = matches!(stretch.channel, Channel::Body | Channel::CommandedBody);
    if is_of_body {
        for (row, at) in rows.iter().enumerate().step_by(count) {
            let yaw_rad = at.regime.pose.map_or(0.0, |pose| pose.yaw_rad);
            let sigmas = [0, 1].map(|own| noise.scales[unit.scale_of[stretch.offset + row + own]]);
            turn(&mut errors[row..row + 2], sigmas, yaw_rad);
            for (_, part) in &mut *shown {
                turn(&mut part[row..row + 2], sigmas.map(|sigma| 1.0 / sigma), yaw_rad);
            }
        }
    }
    let times: Vec<f64> = rows.iter().step_by(count).map(|row| row.time_s).collect();
    let apart_s = APART * crate::track::median_step(times.iter().copied());
    let step_s = (apart_s / APART).max(f64::MIN_POSITIVE);
    let steps: Vec<f64> = times.windows(2).map(|pair| (pair[1] - pair[0]) / step_s).collect();
    let joins: Vec<bool> = times.windows(2).map(|pair| pair[1] - pair[0] < apart_s).collect();
    for component in 0..count {
        // What agitates a window is its own.
        let steady: Vec<f64> = (0..times.len())
            .map(|row| stretch.offset + row * count + component)
            .map(|element| noise.scales[unit.scale_of[element]] / noise.sigma[element])
            .collect();
        let links: Vec<f64> = joins
            .iter()
            .zip(steady.windows(2))
            .map(|(join, pair)| if *join { pair[0] * pair[1] } else { 0.0 })
            .collect();
        let of =
            |values: &[f64]| -> Vec<f64> { values.iter().skip(component).step_by(count).copied().collect() };
        let own = of(errors);
        // Of moves in a mesh nothing is left.
        if own.iter().all(|value| *value == 0.0) {
            continue;
        }
        let chain = Chain { steps: steps.clone(), links, steady };
        let Some((_, correlation)) = Correlation::likeliest(&own, &chain) else { continue };
        let freed = correlation.freed(&own);
        let scale = (freed.iter().map(|value| value * value).sum::<f64>() / freed.len() as f64).sqrt();
        for (row, value) in freed.into_iter().enumerate() {
            errors[row * count + component] = value / scale;
        }
        for (_, part) in &mut *shown {
            for (row, value) in correlation.gathered(&of(part)).into_iter().enumerate() {
                part[row * count + component] = value * scale;
            }
        }
    }
}

/// Turns forward and left, multiplied by factors, to the axes of the map.
fn turn(pair: &mut [f64], factors: [f64; 2], yaw_rad: f64) {
    let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
    let (forward, left) = (factors[0] * pair[0], factors[1] * pair[1]);
    pair[0] = cos * forward - sin * left;
    pair[1] = sin * forward + cos * left;
}

/// How many blocks that say as much as each other would make the variance of a parameter as sure as it is
/// (Satterthwaite, `bell2002`).
fn freedom(blocks: &[Block], inverse: &DMatrix<f64>, slot: usize) -> f64 {
    let direction = inverse.column(slot);
    let (mut sum, mut squares) = (0.0, 0.0);
    for block in blocks {
        let share = (direction.transpose() * &block.variance * direction)[(0, 0)];
        sum += share;
        squares += share * share;
    }
    sum * sum / squares
}

/// The 97.5 % quantile of Student's t, by its expansion about that of the normal (`abramowitz1964`, 26.7.5).
fn quantile(freedom: f64) -> f64 {
    let (z, n) = (Z_95, freedom.max(LEAST_FREEDOM));
    let q = z * z;
    let terms = [
        z * (q + 1.0) / 4.0,
        z * ((5.0 * q + 16.0) * q + 3.0) / 96.0,
        z * (((3.0 * q + 19.0) * q + 17.0) * q - 15.0) / 384.0,
        z * ((((79.0 * q + 776.0) * q + 1482.0) * q - 1920.0) * q - 945.0) / 92160.0,
    ];
    terms.iter().rev().fold(0.0, |sum, term| (sum + term) / n) + z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_blocks_are_as_many_as_say_as_much_as_each_other() {
        let block = |share: f64| Block {
            score: nalgebra::DVector::zeros(1),
            variance: DMatrix::from_element(1, 1, share),
        };
        let identity = DMatrix::from_element(1, 1, 1.0);
        let even: Vec<Block> = (0..10).map(|_| block(2.0)).collect();
        assert!((freedom(&even, &identity, 0) - 10.0).abs() < 1e-12);
        let two: Vec<Block> = [5.0, 5.0, 0.0, 0.0].map(block).to_vec();
        assert!((freedom(&two, &identity, 0) - 2.0).abs() < 1e-12);
        // Quantiles of tables.
        for (freedom, known) in [(4.0, 2.776_445), (10.0, 2.228_139), (60.0, 2.000_298), (1e9, 1.959_964)] {
            assert!((quantile(freedom) - known).abs() < 5e-3 / freedom.min(1e3), "{freedom}");
        }
    }
}

//! How unsure the parameters of a final fit are.
//!
//! A window ends at the reading with which the next one begins: its error counts in both, with opposite signs, and
//! cancels in whatever changes slowly. The errors of such a channel are a moving average of order one; its
//! parameter is that of greatest likelihood, and scores are formed of errors and columns that are freed of it
//! (prewhitening, `andrews1992`). What correlation is left counts by blocks (`liang1986`), whose residuals are too
//! small by what the block itself has pulled (CR2, `bell2002`). The variance is never below that of the moving
//! average alone. Where few blocks say all, quantiles are those of Student's t with as many degrees of freedom as
//! blocks that say as much as each other would be.
//!
//! The tests of a search keep the covariance of `white`, which is wider: a slow effect must not be found because
//! errors happen to cancel.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::Z_95;
use crate::diagnosis::noise::Noise;
use crate::diagnosis::select::whites;
use crate::diagnosis::unit::{Stretch, Unit};
use crate::diagnosis::white::{White, raised};

/// The parameter of a moving average is searched from this to zero, in so many steps. Near -1 all that a slow
/// effect shows cancels.
const MOST_SHARED: f64 = -0.98;
const SHARED_STEPS: u32 = 49;
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

/// Frees errors of their moving average, and changes columns such that their product with the errors stays: of
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
        let Some(average) = Average::likeliest(&own, &links) else { continue };
        let freed = average.freed(&own);
        let scale = (freed.iter().map(|value| value * value).sum::<f64>() / freed.len() as f64).sqrt();
        for (row, value) in freed.into_iter().enumerate() {
            errors[row * count + component] = value / scale;
        }
        for (_, part) in &mut *shown {
            for (row, value) in average.gathered(&of(part)).into_iter().enumerate() {
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

/// The factor `L` of the correlation of a moving average of order one: its diagonal, and below it what a value has
/// of the one before.
struct Average {
    diagonal: Vec<f64>,
    below: Vec<f64>,
}

impl Average {
    /// Of correlation `rho` between values next to each other, times how much they have to do with each other.
    fn new(rho: f64, links: &[f64]) -> Self {
        let (mut diagonal, mut below) = (vec![1.0], vec![0.0]);
        for link in links {
            let share = rho * link / diagonal[diagonal.len() - 1];
            below.push(share);
            diagonal.push((1.0 - share * share).sqrt());
        }
        Self { diagonal, below }
    }

    /// The one that makes values likeliest, their variance being what it then is.
    fn likeliest(values: &[f64], links: &[f64]) -> Option<Self> {
        if values.len() != links.len() + 1 {
            return None;
        }
        let mut best: Option<(f64, Self)> = None;
        for step in 0..=SHARED_STEPS {
            let theta = MOST_SHARED * f64::from(step) / f64::from(SHARED_STEPS);
            let average = Self::new(theta / (1.0 + theta * theta), links);
            let squares: f64 = average.freed(values).iter().map(|value| value * value).sum();
            let spread: f64 = average.diagonal.iter().map(|value| libm::log(*value)).sum();
            let likelihood = -0.5 * values.len() as f64 * libm::log(squares) - spread;
            if likelihood.is_finite() && best.as_ref().is_none_or(|(most, _)| likelihood > *most) {
                best = Some((likelihood, average));
            }
        }
        best.map(|(_, average)| average)
    }

    /// `L^-1 e`.
    fn freed(&self, values: &[f64]) -> Vec<f64> {
        let mut before = 0.0;
        let one = |((value, diagonal), below): ((&f64, &f64), &f64)| {
            before = (value - below * before) / diagonal;
            before
        };
        values.iter().zip(&self.diagonal).zip(&self.below).map(one).collect()
    }

    /// `L' a`.
    fn gathered(&self, values: &[f64]) -> Vec<f64> {
        let next =
            |index: usize| values.get(index + 1).zip(self.below.get(index + 1)).map_or(0.0, |(a, b)| a * b);
        values.iter().zip(&self.diagonal).enumerate().map(|(index, (a, d))| a * d + next(index)).collect()
    }
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
    fn what_windows_share_is_freed_and_products_stay() {
        let links = [1.0, 0.5, 0.0, 1.0];
        let average = Average::new(-0.4, &links);
        let (errors, column) = ([0.3, -1.2, 0.8, 2.0, -0.1], [1.0, 0.5, -2.0, 0.25, 3.0]);
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let freed = product(&average.freed(&errors), &average.gathered(&column));
        assert!((freed - product(&errors, &column)).abs() < 1e-12);
        // The variance of a product with a column: a' R a with the correlations written out.
        let squares =
            |column: &[f64]| average.gathered(column).iter().map(|value| value * value).sum::<f64>();
        let pairs: f64 = (0..4).map(|row| 2.0 * -0.4 * links[row] * column[row] * column[row + 1]).sum();
        assert!((squares(&column) - (product(&column, &column) + pairs)).abs() < 1e-12);
    }

    #[test]
    fn a_slow_effect_is_as_sure_as_the_readings_at_both_ends() {
        // Differences of readings with errors of one: of their mean only the first and the last are left.
        let mut state = 1_u64;
        let mut reading = || {
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        let readings: Vec<f64> = (0..401).map(|_| reading()).collect();
        let scale = 0.5_f64.sqrt();
        let errors: Vec<f64> = readings.windows(2).map(|pair| scale * (pair[1] - pair[0])).collect();
        let average = Average::likeliest(&errors, &[1.0; 399]).unwrap();
        let variance: f64 = average.gathered(&[1.0; 400]).iter().map(|value| value * value).sum();
        // One of all readings: 2 * scale^2 = 1, instead of 400 of independent errors.
        assert!((0.5..8.0).contains(&variance), "{variance}");
        // Readings that are not shared stay independent.
        let own = Average::likeliest(&readings[..400], &[1.0; 399]).unwrap();
        let variance: f64 = own.gathered(&[1.0; 400]).iter().map(|value| value * value).sum();
        assert!((280.0..=400.0 + 1e-9).contains(&variance), "{variance}");
    }

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

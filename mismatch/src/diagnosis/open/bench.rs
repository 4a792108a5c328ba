//! Scores of many columns beside the same picture.
//!
//! What the parameters of the picture explain is taken out of a column; what remains is multiplied with the
//! residuals and summed in blocks. The probability is that of Student's t with as many degrees of freedom as there
//! are blocks that really take part: a column that shows in few blocks has to be the clearer.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use crate::diagnosis::noise;
use crate::diagnosis::open::picture::Picture;
use crate::diagnosis::open::target::Target;
use crate::diagnosis::unit::Column;

/// The least variance of a score, as a share of that of independent errors.
const LEAST_SHARE: f64 = 0.5;
/// A column says something of its own if so much of it is left beside the parameters.
const LEAST_LEFT: f64 = 1e-3;
/// The fewest blocks.
const LEAST_BLOCKS: f64 = 8.0;

/// What one column, or a few together, would gain.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    pub(crate) change: f64,
    pub(crate) error: f64,
    /// Twice the log-likelihood gained, if errors were independent.
    pub(crate) gain: f64,
    pub(crate) inflation: f64,
    /// Probability of as much without it.
    pub(crate) p: f64,
}

impl Score {
    /// Twice the log-likelihood gained, deflated by how much errors are correlated.
    pub(crate) fn deflated(&self) -> f64 {
        self.gain / self.inflation.max(1.0)
    }
}

struct Part {
    unit: usize,
    which: usize,
    /// Residuals in sigmas, times the root of their weight, and what columns are multiplied by.
    errors: Vec<f64>,
    factors: Vec<f64>,
    /// Numbers of the blocks, those of one unit after those of another.
    blocks: Vec<usize>,
    /// Parameters that show here, in sigmas.
    active: Vec<(usize, Vec<f64>)>,
}

/// By block: information of a column, what it shares with each of the parameters, block by block, and its score.
struct Sums {
    own: Vec<f64>,
    shared: Vec<f64>,
    score: Vec<f64>,
}

/// A picture, prepared for columns of one target.
pub(crate) struct Bench {
    parts: Vec<Part>,
    blocks: usize,
    /// The inverse of the information of the parameters.
    inverse: DMatrix<f64>,
    /// By block: the scores of the parameters.
    scores: Vec<DVector<f64>>,
    /// Their sum.
    total_score: DVector<f64>,
    /// By block: the information of the parameters.
    information: Vec<DMatrix<f64>>,
}

impl Bench {
    pub(crate) fn new(picture: &Picture<'_, '_>, target: Target) -> Option<Self> {
        let size = picture.size();
        let blocks: usize = picture.units.iter().map(|unit| unit.blocks).sum();
        let mut bench = Self {
            parts: Vec::new(),
            blocks,
            inverse: DMatrix::zeros(size, size),
            scores: vec![DVector::zeros(size); blocks],
            total_score: DVector::zeros(size),
            information: vec![DMatrix::zeros(size, size); blocks],
        };
        let mut offset = 0;
        for (index, unit) in picture.units.iter().enumerate() {
            let state = &picture.states[index];
            for (which, stretch) in unit.stretches.iter().enumerate().filter(|(_, stretch)| stretch.rows > 0)
            {
                let range = stretch.range();
                let factors: Vec<f64> = range
                    .clone()
                    .map(|row| {
                        let sigma = state.noise.sigma[row];
                        noise::weight(state.residuals[row] / sigma).sqrt() / sigma
                    })
                    .collect();
                let errors: Vec<f64> =
                    range.clone().zip(&factors).map(|(row, factor)| state.residuals[row] * factor).collect();
                let active: Vec<(usize, Vec<f64>)> = picture.columns[index]
                    .iter()
                    .enumerate()
                    .filter_map(|(slot, column)| {
                        let part = column.parts[which].as_ref()?;
                        Some((
                            slot,
                            part.iter().zip(&factors).map(|(value, factor)| -value * factor).collect(),
                        ))
                    })
                    .collect();
                let numbers: Vec<usize> = range.map(|row| offset + unit.block_of[row]).collect();
                for (row, &block) in numbers.iter().enumerate() {
                    for (position, (slot, a)) in active.iter().enumerate() {
                        if a[row] == 0.0 {
                            continue;
                        }
                        bench.scores[block][*slot] += a[row] * errors[row];
                        for (other, b) in &active[..=position] {
                            let product = a[row] * b[row];
                            bench.information[block][(*slot, *other)] += product;
                            if slot != other {
                                bench.information[block][(*other, *slot)] += product;
                            }
                        }
                    }
                }
                if target.channels().iter().any(|(channel, _)| *channel == stretch.channel) {
                    let part = Part { unit: index, which, errors, factors, blocks: numbers, active };
                    bench.parts.push(part);
                }
            }
            offset += unit.blocks;
        }
        for own in &bench.scores {
            bench.total_score += own;
        }
        if size > 0 {
            let mut whole: DMatrix<f64> = DMatrix::zeros(size, size);
            for own in &bench.information {
                whole += own;
            }
            for slot in 0..size {
                let own = whole[(slot, slot)];
                whole[(slot, slot)] = if own > 0.0 { own * (1.0 + 1e-9) } else { 1.0 };
            }
            bench.inverse = whole.cholesky()?.inverse();
        }
        (!bench.parts.is_empty()).then_some(bench)
    }

    /// A column in sigmas, with what the parameters share with it.
    fn sums(&self, columns: &[Column]) -> Sums {
        let size = self.inverse.nrows();
        let mut sums = Sums {
            own: vec![0.0; self.blocks],
            shared: vec![0.0; self.blocks * size],
            score: vec![0.0; self.blocks],
        };
        for part in &self.parts {
            let Some(values) = &columns[part.unit].parts[part.which] else { continue };
            for (row, value) in values.iter().enumerate() {
                let a = -value * part.factors[row];
                if a == 0.0 {
                    continue;
                }
                let block = part.blocks[row];
                sums.own[block] += a * a;
                sums.score[block] += a * part.errors[row];
                let shared = &mut sums.shared[block * size..(block + 1) * size];
                for (slot, b) in &part.active {
                    shared[*slot] += a * b[row];
                }
            }
        }
        sums
    }

    /// What all blocks together share with the parameters.
    fn together(&self, sums: &Sums) -> DVector<f64> {
        let size = self.inverse.nrows();
        let mut together = DVector::zeros(size);
        for block in 0..self.blocks {
            for (slot, value) in together.iter_mut().enumerate() {
                *value += sums.shared[block * size + slot];
            }
        }
        together
    }

    /// What a column, one of each unit, would gain; `None` if it says nothing that the parameters do not, in too
    /// few blocks, or gains no more than `least`.
    pub(crate) fn score(&self, columns: &[Column], least: f64) -> Option<Score> {
        let size = self.inverse.nrows();
        let sums = self.sums(columns);
        let together = self.together(&sums);
        let by = &self.inverse * &together;
        let full: f64 = sums.own.iter().sum();
        // Deflating makes of a gain no greater one: what is small without blocks need not be looked at by block.
        let whole = full - together.dot(&by);
        let pull = sums.score.iter().sum::<f64>() - by.dot(&self.total_score);
        if pull * pull <= least * whole {
            return None;
        }
        let mut scores = vec![0.0; self.blocks];
        let mut informations = vec![0.0; self.blocks];
        for block in 0..self.blocks {
            let shared: f64 =
                by.iter().zip(&sums.shared[block * size..]).map(|(by, shared)| by * shared).sum();
            scores[block] = sums.score[block] - by.dot(&self.scores[block]);
            let mut among = 0.0;
            for (column, by_column) in self.information[block].column_iter().zip(by.iter()) {
                among += by_column * column.dot(&by);
            }
            informations[block] = (sums.own[block] - 2.0 * shared + among).max(0.0);
        }
        let information: f64 = informations.iter().sum();
        if information.partial_cmp(&(LEAST_LEFT * full)) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let squares: f64 = informations.iter().map(|own| own * own).sum();
        let effective = information * information / squares;
        if effective < LEAST_BLOCKS {
            return None;
        }
        let total: f64 = scores.iter().sum();
        let change = total / information;
        let left: f64 =
            scores.iter().zip(&informations).map(|(score, own)| (score - change * own).powi(2)).sum();
        let meat = left.max(LEAST_SHARE * information);
        let error = meat.sqrt() / information;
        let t = change / error;
        let p = StudentsT::new(0.0, 1.0, effective - 1.0).map_or(1.0, |own| 2.0 * own.sf(t.abs()));
        Some(Score { change, error, gain: total * change, inflation: meat / information, p })
    }

    /// What several columns together would gain; `None` if it is no more than `least`.
    pub(crate) fn score_together(&self, columns: &[Vec<Column>], least: f64) -> Option<Together> {
        let count = columns.len();
        let sums: Vec<Sums> = columns.iter().map(|own| self.sums(own)).collect();
        let size = self.inverse.nrows();
        let mut together = DMatrix::zeros(size, count);
        for (k, own) in sums.iter().enumerate() {
            together.set_column(k, &self.together(own));
        }
        let by = &self.inverse * &together;
        let cross = self.cross(columns);
        let whole = cross.iter().sum::<DMatrix<f64>>() - together.transpose() * &by;
        let pull = DVector::from_fn(count, |k, _| sums[k].score.iter().sum::<f64>())
            - by.transpose() * &self.total_score;
        // Deflating makes of a gain no greater one: what is small without blocks need not be looked at by block.
        if let Some(factor) = whole.cholesky()
            && factor.solve(&pull).dot(&pull) <= least
        {
            return None;
        }
        let mut scores = vec![DVector::zeros(count); self.blocks];
        let mut informations = vec![DMatrix::zeros(count, count); self.blocks];
        let mut information = DMatrix::zeros(count, count);
        let mut total = DVector::zeros(count);
        for block in 0..self.blocks {
            let shared = DMatrix::from_fn(size, count, |slot, k| sums[k].shared[block * size + slot]);
            scores[block] =
                DVector::from_fn(count, |k, _| sums[k].score[block]) - by.transpose() * &self.scores[block];
            let mixed = shared.transpose() * &by;
            informations[block] =
                &cross[block] - &mixed - mixed.transpose() + by.transpose() * &self.information[block] * &by;
            information += &informations[block];
            total += &scores[block];
        }
        let scale = DVector::from_fn(count, |k, _| 1.0 / information[(k, k)].max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(count, count, |i, j| information[(i, j)] * scale[i] * scale[j]);
        if scaled
            .symmetric_eigenvalues()
            .iter()
            .any(|value| value.partial_cmp(&1e-6) != Some(std::cmp::Ordering::Greater))
        {
            return None;
        }
        let inverse = information.clone().cholesky()?.inverse();
        let change = &inverse * &total;
        let mut meat = DMatrix::zeros(count, count);
        for block in 0..self.blocks {
            let left = &scores[block] - &informations[block] * &change;
            meat += &left * left.transpose();
        }
        let (meat, inflation) = crate::diagnosis::white::raised(&meat, &information, LEAST_SHARE)?;
        let covariance = &inverse * meat * &inverse;
        let wald = change.dot(&(covariance.clone().cholesky()?.solve(&change)));
        let traces: Vec<f64> = informations.iter().map(|own| (own * &inverse).trace()).collect();
        let effective = traces.iter().sum::<f64>().powi(2) / traces.iter().map(|own| own * own).sum::<f64>();
        let free = effective - count as f64;
        if free < LEAST_BLOCKS {
            return None;
        }
        let ratio = wald * free / (count as f64 * (effective - 1.0).max(1.0));
        let p = FisherSnedecor::new(count as f64, free).map_or(1.0, |own| own.sf(ratio.max(0.0)));
        Some(Together { gain: change.dot(&total), inflation, p, covariance })
    }

    /// By block, the products of columns.
    fn cross(&self, columns: &[Vec<Column>]) -> Vec<DMatrix<f64>> {
        let count = columns.len();
        let mut all = vec![DMatrix::zeros(count, count); self.blocks];
        for part in &self.parts {
            let own: Vec<(usize, &[f64])> = columns
                .iter()
                .enumerate()
                .filter_map(|(k, own)| Some((k, own[part.unit].parts[part.which].as_deref()?)))
                .collect();
            for (row, factor) in part.factors.iter().enumerate() {
                let square = factor * factor;
                let block = &mut all[part.blocks[row]];
                for (position, (k, a)) in own.iter().enumerate() {
                    if a[row] == 0.0 {
                        continue;
                    }
                    for (other, b) in &own[..=position] {
                        let product = a[row] * b[row] * square;
                        block[(*k, *other)] += product;
                        if k != other {
                            block[(*other, *k)] += product;
                        }
                    }
                }
            }
        }
        all
    }
}

/// What several columns together would gain.
#[derive(Clone, Debug)]
pub(crate) struct Together {
    pub(crate) gain: f64,
    pub(crate) inflation: f64,
    pub(crate) p: f64,
    pub(crate) covariance: DMatrix<f64>,
}

impl Together {
    pub(crate) fn deflated(&self) -> f64 {
        self.gain / self.inflation.max(1.0)
    }
}

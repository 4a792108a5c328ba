//! Whether what a likelihood leaves is structured: a name claims to be the whole of it.
//!
//! Under the right model what is left of a row, its error in sigmas or the log-density of that, has nothing to do
//! with when, where or of what the row was measured. One driver after the other is asked, by its ranks and by how far
//! these are from the middle, and one target after the other; scores are summed over blocks of time (`liang1986`) and
//! held against Student's t with as many degrees of freedom as blocks take part. Blur leaves bearings wide where the
//! robot turns, whatever tails are fitted to them.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::diagnosis::select::FAMILYWISE;

/// A statistic that differs by less than this between the least and the greatest of a driver is the same: of
/// log-densities, as by a third of the variance.
const LEAST_DIFFERENCE: f64 = 0.15;
/// The same for one target against the others.
pub(super) const LEAST_OF_TARGET: f64 = 0.3;
/// Fewer rows of a target than this say nothing.
const LEAST_ROWS: usize = 20;
/// The fewest blocks that say as much as each other would.
const LEAST_BLOCKS: f64 = 8.0;
/// The least variance of a score, as a share of that of independent errors.
const LEAST_SHARE: f64 = 0.5;

/// What is left of rows, and what it should have nothing to do with.
pub(super) struct Check {
    /// What it is of, in words.
    pub(super) of: &'static str,
    /// One per row that has any.
    pub(super) left: Vec<f64>,
    /// The block in time of each.
    pub(super) blocks: Vec<usize>,
    /// Numbers that each row was measured at.
    pub(super) drivers: Vec<(&'static str, Vec<f64>)>,
    /// What each row is of.
    pub(super) targets: Vec<usize>,
    /// By so much a target must differ from the others.
    pub(super) least_of_target: f64,
}

/// What stands out most among checks, in words; `None` if nothing does, with everything counted that was asked.
pub(super) fn stands_out(checks: &[Check]) -> Option<String> {
    let mut asked = 0_usize;
    let mut best: Option<(f64, String)> = None;
    let mut take = |found: Option<(f64, f64)>, least: f64, what: String| {
        asked += 1;
        if let Some((p, difference)) = found
            && difference.abs() > least
            && best.as_ref().is_none_or(|(known, _)| p < *known)
        {
            best = Some((p, what));
        }
    };
    for check in checks {
        for (name, values) in &check.drivers {
            let ranks = ranks(values);
            let far: Vec<f64> = ranks.iter().map(|rank| (2.0 * rank - 1.0).abs()).collect();
            for shape in [ranks, far] {
                take(check.with(&shape), LEAST_DIFFERENCE, format!("{} over {name}", check.of));
            }
        }
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for target in &check.targets {
            *counts.entry(*target).or_default() += 1;
        }
        let often = counts.iter().filter(|(_, count)| **count >= LEAST_ROWS && counts.len() > 1);
        for (&target, _) in often {
            let is: Vec<f64> = check.targets.iter().map(|own| f64::from(u8::from(*own == target))).collect();
            take(check.with(&is), check.least_of_target, format!("{} by target", check.of));
        }
    }
    best.filter(|(p, _)| p * (asked as f64) < FAMILYWISE).map(|(_, what)| what)
}

/// From 0 to 1; equal values have equal ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let last = values.len().saturating_sub(1).max(1) as f64;
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    while first < order.len() {
        let same =
            order[first..].iter().take_while(|&&own| values[own] <= values[order[first]]).count().max(1);
        let rank = (first as f64 + 0.5 * (same - 1) as f64) / last;
        for &own in &order[first..first + same] {
            ranks[own] = rank;
        }
        first += same;
    }
    ranks
}

impl Check {
    /// The probability of as much without anything, and by how much what is left differs from 0 to 1 of a regressor.
    fn with(&self, regressor: &[f64]) -> Option<(f64, f64)> {
        let count = self.left.len() as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
        let (middle, level) = (mean(regressor), mean(&self.left));
        let information: f64 = regressor.iter().map(|value| (value - middle).powi(2)).sum();
        let score: f64 = regressor.iter().zip(&self.left).map(|(x, y)| (x - middle) * (y - level)).sum();
        if information.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let slope = score / information;
        let blocks = self.blocks.iter().max().map_or(0, |last| last + 1);
        let (mut scores, mut informations) = (vec![0.0; blocks], vec![0.0; blocks]);
        let mut naive = 0.0;
        for ((x, y), &block) in regressor.iter().zip(&self.left).zip(&self.blocks) {
            let x = x - middle;
            let error = y - level - slope * x;
            scores[block] += x * error;
            informations[block] += x * x;
            naive += (x * error).powi(2);
        }
        let squares: f64 = informations.iter().map(|own| own * own).sum();
        let effective = information * information / squares;
        if effective < LEAST_BLOCKS {
            return None;
        }
        let variance = scores.iter().map(|own| own * own).sum::<f64>().max(LEAST_SHARE * naive);
        let t = score / variance.sqrt();
        let p = StudentsT::new(0.0, 1.0, effective - 1.0).map_or(1.0, |own| 2.0 * own.sf(t.abs()));
        p.is_finite().then_some((p, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws(seed: u64, count: usize) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count).map(|_| (0..12).fold(-6.0, |sum, _| sum + uniform())).collect()
    }

    /// Log-densities of errors as wide as `wide` says of a driver and a target.
    fn check(seed: u64, wide: impl Fn(f64, usize) -> f64) -> Check {
        let count = 1000;
        let driver: Vec<f64> = draws(seed + 1, count);
        let targets: Vec<usize> = (0..count).map(|row| (row * 7) % 11).collect();
        let errors = draws(seed, count);
        let left = errors.iter().zip(driver.iter().zip(&targets));
        let left = left.map(|(error, (at, target))| -0.5 * (error * wide(*at, *target)).powi(2)).collect();
        Check {
            of: "range",
            left,
            blocks: (0..count).map(|row| row / 10).collect(),
            drivers: vec![("speed", driver)],
            targets,
            least_of_target: LEAST_OF_TARGET,
        }
    }

    #[test]
    fn errors_that_grow_with_a_driver_or_belong_to_one_target_stand_out() {
        let grown = check(1, |at, _| 1.0 + 0.5 * at.abs());
        assert_eq!(stands_out(&[grown]).as_deref(), Some("range over speed"));
        let of_one = check(2, |_, target| if target == 3 { 3.0 } else { 1.0 });
        assert_eq!(stands_out(&[of_one]).as_deref(), Some("range by target"));
    }

    #[test]
    fn errors_that_are_alike_do_not_stand_out() {
        let found = (0..200).filter(|seed| stands_out(&[check(1000 + 10 * seed, |_, _| 1.0)]).is_some());
        // At 0.002, two or more of 200 are less likely than 7 %, three than 1 %.
        assert!(found.count() <= 2);
    }

    #[test]
    fn equal_values_have_equal_ranks() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [2.5 / 3.0, 0.0, 2.5 / 3.0, 1.0 / 3.0]);
        assert_eq!(ranks(&[]), Vec::<f64>::new());
    }
}

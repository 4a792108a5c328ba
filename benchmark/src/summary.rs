//! Results in numbers: each with how many cases it is of, and its interval.

use std::collections::BTreeMap;

use pleiad_physics::Effect;
use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF};

use crate::class::{Class, Noise};
use crate::results::CaseResult;
use crate::score::{Match, ParameterError, Scored};

mod curves;
mod metrics;

pub use curves::{Curve, Point};

/// Everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The hash of all answers.
    pub answers_sha256: String,
    /// How many recordings.
    pub recordings: usize,
    /// A row per class, noise, size and quantity.
    pub rows: Vec<Row>,
    /// Shares of found and of false alarms, by threshold, and shares found by size.
    pub curves: Vec<Curve>,
    /// Every identifiable effect that was not named, every name too many, every wrong one.
    pub losses: Vec<String>,
}

/// A quantity of a group of cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Which class.
    pub class: Class,
    /// Which noise.
    pub noise: Noise,
    /// Size over the typical one, where the class has sizes.
    pub size: Option<f64>,
    /// Who: `tool`, an ablation, or another method.
    pub method: String,
    /// What is counted or averaged.
    pub quantity: &'static str,
    /// A share, with how many it is of.
    pub share: Option<Share>,
    /// Or a mean.
    pub mean: Option<Mean>,
}

/// So many of so many.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// How many.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// 95 % interval of the probability (Clopper and Pearson).
    pub interval: [f64; 2],
}

impl Share {
    /// Of those for which something is known, how many it holds for; `None` of none.
    pub fn of(all: impl IntoIterator<Item = bool>) -> Option<Self> {
        let (mut count, mut of) = (0, 0);
        for holds in all {
            of += 1;
            count += usize::from(holds);
        }
        (of > 0).then(|| Self { count, of, interval: clopper_pearson(count, of) })
    }
}

/// A mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// The median.
    pub median: f64,
    /// Its standard error; `None` of one.
    pub standard_error: Option<f64>,
    /// Of how many.
    pub of: usize,
}

impl Mean {
    /// Of numbers; `None` of none.
    pub fn of(all: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut all: Vec<f64> = all.into_iter().filter(|value| value.is_finite()).collect();
        if all.is_empty() {
            return None;
        }
        all.sort_by(f64::total_cmp);
        let count = all.len() as f64;
        let mean = all.iter().sum::<f64>() / count;
        let square = all.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let middle = all.len() / 2;
        let median = if all.len() % 2 == 1 { all[middle] } else { 0.5 * (all[middle - 1] + all[middle]) };
        let standard_error = (all.len() > 1).then(|| (square / (count - 1.0) / count).sqrt());
        Some(Self { mean, median, standard_error, of: all.len() })
    }
}

/// The 95 % interval of a probability that was seen `count` times in `of` (`clopper1934`).
pub fn clopper_pearson(count: usize, of: usize) -> [f64; 2] {
    let quantile = |a: usize, b: usize, p: f64| {
        Beta::new(a as f64, b as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(p))
    };
    let low = if count == 0 { 0.0 } else { quantile(count, of - count + 1, 0.025) };
    let high = if count >= of { 1.0 } else { quantile(count + 1, of - count, 0.975) };
    [low, high]
}

/// Cases of one class, noise and size.
pub(crate) type Group<'r> = ((Class, Noise, Option<u64>), Vec<&'r CaseResult>);

/// Sums results up.
pub fn summary(sealed: &str, results: &[CaseResult]) -> Summary {
    let mut groups: BTreeMap<(Class, Noise, Option<u64>), Vec<&CaseResult>> = BTreeMap::new();
    for own in results {
        // Sizes are above zero: their bits are in their order.
        groups.entry((own.class, own.noise, own.size.map(f64::to_bits))).or_default().push(own);
    }
    let groups: Vec<Group<'_>> = groups.into_iter().collect();
    Summary {
        answers_sha256: sealed.to_owned(),
        recordings: results.len(),
        rows: groups.iter().flat_map(metrics::rows).collect(),
        curves: curves::curves(results),
        losses: results.iter().flat_map(losses).collect(),
    }
}

fn losses(own: &CaseResult) -> Vec<String> {
    let mut all = Vec::new();
    for (found, known) in own.tool.matches.iter().zip(&own.oracle.effects) {
        if known.identifiable && !found.top1 && own.class != Class::OutOfCatalogue {
            let what = if found.in_set { "only in a set" } else { "not found" };
            all.push(format!("`{}`: `{}` {what} (evidence {:.0})", own.id, found.effect, known.gain));
        }
    }
    all.extend(own.tool.extra.iter().map(|extra| format!("`{}`: besides, {extra}", own.id)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_published_tables() {
        // 0 of n: 1 - 0.025^(1/n); the rest from R's binom.test.
        let cases = [
            ((0, 100), [0.0, 1.0 - 0.025_f64.powf(0.01)]),
            ((2, 100), [0.002_431_337, 0.070_383_932]),
            ((5, 10), [0.187_086, 0.812_914]),
            ((3, 3), [0.025_f64.powf(1.0 / 3.0), 1.0]),
        ];
        for ((count, of), expected) in cases {
            for (end, expected) in clopper_pearson(count, of).into_iter().zip(expected) {
                assert!((end - expected).abs() < 1e-6, "{count} of {of}: {end}, not {expected}");
            }
        }
    }

    #[test]
    fn means_come_with_their_standard_error() {
        let own = Mean::of([1.0, 2.0, 3.0, f64::NAN, 6.0]).unwrap();
        // Variance 14/3 about the mean of 3; of four.
        assert!((own.mean - 3.0).abs() < 1e-15 && (own.median - 2.5).abs() < 1e-15 && own.of == 4);
        assert!((own.standard_error.unwrap() - (14.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        assert_eq!(Mean::of([]), None);
    }
}

//! How sure a reduction of errors is, where neighbouring errors are alike: whole blocks of time are drawn
//! (block bootstrap, `carlstein1986`).

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The same prediction by two models.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// When it begins, seconds.
    pub time_s: f64,
    /// Its error by the model that is to be beaten.
    pub before: f64,
    /// Its error by the model that is to beat it.
    pub after: f64,
}

/// A statistic with its 95 % interval.
#[derive(Clone, Copy, Debug)]
pub struct Reduction {
    /// The mean over the groups of the share by which the root mean square error falls.
    pub mean: f64,
    /// 95 % interval of the bootstrap: percentiles 2.5 and 97.5.
    pub ci95: [f64; 2],
}

/// The share by which the root mean square error falls.
pub fn reduction<'a>(pairs: impl IntoIterator<Item = &'a Pair>) -> f64 {
    let (mut before, mut after) = (0.0, 0.0);
    for pair in pairs {
        before += pair.before * pair.before;
        after += pair.after * pair.after;
    }
    1.0 - (after / before).sqrt()
}

/// The mean reduction over groups, each of which is resampled from its own blocks of `block_s` seconds.
pub fn mean_reduction(groups: &[Vec<Pair>], block_s: f64, resamples: usize, seed: u64) -> Reduction {
    let blocks: Vec<Vec<&[Pair]>> = groups.iter().map(|group| blocks(group, block_s)).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut resampled = || {
        let one = |blocks: &Vec<&[Pair]>| {
            let drawn: Vec<&[Pair]> =
                blocks.iter().map(|_| blocks[random.random_range(0..blocks.len())]).collect();
            reduction(drawn.into_iter().flatten())
        };
        mean(blocks.iter().filter(|blocks| !blocks.is_empty()).map(one))
    };
    let mut means: Vec<f64> = (0..resamples).map(|_| resampled()).collect();
    means.sort_by(f64::total_cmp);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a position among the resamples"
    )]
    let at = |share: f64| means[((means.len() - 1) as f64 * share).round() as usize];
    let ci95 = if means.is_empty() { [f64::NAN; 2] } else { [at(0.025), at(0.975)] };
    Reduction { mean: mean(groups.iter().filter(|group| !group.is_empty()).map(reduction)), ci95 }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// Pairs in the order of time, cut wherever another block of time begins.
#[allow(clippy::float_cmp, reason = "whole numbers")]
fn blocks(pairs: &[Pair], block_s: f64) -> Vec<&[Pair]> {
    let Some(first) = pairs.first() else { return Vec::new() };
    let number = |pair: &Pair| ((pair.time_s - first.time_s) / block_s).floor();
    pairs.chunk_by(|a, b| number(a) == number(b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors every 5 s for `count` predictions; every block of 60 s has its own size of error.
    fn group(count: u32, after: impl Fn(u32) -> f64) -> Vec<Pair> {
        (0..count)
            .map(|index| Pair { time_s: 5.0 * f64::from(index), before: 1.0, after: after(index) })
            .collect()
    }

    #[test]
    fn the_reduction_is_that_of_root_mean_squares() {
        let pairs = [(3.0, 0.0), (4.0, 2.5)].map(|(before, after)| Pair { time_s: 0.0, before, after });
        assert!((reduction(&pairs) - 0.5).abs() < 1e-15);
    }

    #[test]
    fn equal_blocks_leave_no_doubt() {
        let groups = [group(48, |_| 0.8), group(24, |_| 0.6)];
        let found = mean_reduction(&groups, 60.0, 100, 1);
        assert!((found.mean - 0.3).abs() < 1e-12);
        assert!(found.ci95.iter().all(|end| (end - 0.3).abs() < 1e-12));
    }

    /// The mean of 50 blocks of mean square error 0.5 and spread 0.4 has a standard error of 0.4 / sqrt(50); of
    /// `1 - sqrt(m)` it is half of that over `sqrt(0.5)`.
    #[test]
    fn the_interval_is_that_of_independent_blocks_and_not_of_predictions() {
        let groups = [group(600, |index| (0.5_f64 + if (index / 12) % 2 == 0 { 0.4 } else { -0.4 }).sqrt())];
        let found = mean_reduction(&groups, 60.0, 4000, 1);
        let half = 0.5 * (found.ci95[1] - found.ci95[0]);
        let expected = 1.96 * 0.4 / 50.0_f64.sqrt() / (2.0 * 0.5_f64.sqrt());
        assert!((half / expected - 1.0).abs() < 0.1, "{half} for {expected}");
        assert!(found.ci95[0] < found.mean && found.mean < found.ci95[1]);
    }
}

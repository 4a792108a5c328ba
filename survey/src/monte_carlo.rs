//! Many seeds side by side, and what they say together.

use std::sync::atomic::{AtomicUsize, Ordering};

use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF, StudentsT};

/// A mean over seeds with its 95 % interval (Student's t).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// The 95 % interval of the mean.
    pub interval: [f64; 2],
    /// Standard deviation of one run.
    pub spread: f64,
    /// Number of runs.
    pub runs: usize,
}

impl Estimate {
    /// Of one value per run; `None` for fewer than two.
    pub fn of(values: &[f64]) -> Option<Self> {
        let runs = values.len();
        if runs < 2 {
            return None;
        }
        let count = runs as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let half = StudentsT::new(0.0, 1.0, count - 1.0).ok()?.inverse_cdf(0.975) * (variance / count).sqrt();
        Some(Self { mean, interval: [mean - half, mean + half], spread: variance.sqrt(), runs })
    }
}

/// The exact 95 % interval of a share, `hits` of `of` (Clopper and Pearson 1934); `[0, 1]` of nothing.
pub fn share(hits: usize, of: usize) -> [f64; 2] {
    let (k, n) = (hits as f64, of as f64);
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
    let low = if hits == 0 { 0.0 } else { quantile(k, n - k + 1.0, 0.025) };
    let high = if hits >= of { 1.0 } else { quantile(k + 1.0, n - k, 0.975) };
    [low, high]
}

/// `run` for every seed, on as many threads as the machine has cores; results in the order of the seeds, and equal
/// whatever their number.
pub fn over_seeds<T: Send, E: Send>(
    seeds: &[u64],
    run: impl Fn(u64) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let threads =
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(seeds.len().max(1));
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&seed) = seeds.get(index) else { return done };
            done.push((index, run(seed)));
        }
    };
    let mut all: Vec<(usize, Result<T, E>)> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let join = |handle: std::thread::ScopedJoinHandle<'_, _>| match handle.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        handles.into_iter().flat_map(join).collect()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_of_a_mean_is_the_textbook_one() {
        // Of 1..=5: mean 3, s = sqrt(2.5), t(4, 0.975) = 2.776445.
        let estimate = Estimate::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert!((estimate.mean - 3.0).abs() < 1e-15);
        assert!((estimate.interval[1] - 3.0 - 2.776_445 * (2.5f64 / 5.0).sqrt()).abs() < 1e-5);
    }

    #[test]
    fn an_exact_interval_of_nothing_in_ten_ends_at_31_percent() {
        // 1 - 0.025^(1/10)
        let [low, high] = share(0, 10);
        assert!(low.abs() < 1e-15 && (high - (1.0 - 0.025f64.powf(0.1))).abs() < 1e-9);
    }

    #[test]
    fn results_are_in_the_order_of_the_seeds_and_an_error_is_passed_on() {
        let seeds: Vec<u64> = (0..100).collect();
        assert_eq!(over_seeds(&seeds, Ok::<u64, ()>), Ok(seeds.clone()));
        assert_eq!(over_seeds(&seeds, |seed| if seed == 40 { Err(seed) } else { Ok(seed) }), Err(40));
    }
}

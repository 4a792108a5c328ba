//! How well each effect of the catalogue is estimated where it is known to act: the benchmark behind
//! `docs/benchmarks/effects.md`.

#![allow(clippy::expect_used, clippy::missing_panics_doc, reason = "helpers of tests fail by panicking")]

mod cases;
mod exceptions;
mod outcome;
mod table;
mod wishes;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use pleiad_mismatch::{KnownFit, fit_known};
use pleiad_sim_peers::simulate;

pub use cases::{Case, ROBOT, cases, cases_named};
pub use exceptions::{EXCEPTIONS, Exception};
pub use outcome::{Outcome, Row};
pub use table::{rows, table};
pub use wishes::{COVERED, Shortfall, Wish, covered, shortfalls};

/// Seeds of the recordings of every effect; 1 to 20 are those that predictions and intervals were corrected on.
pub const SEEDS: std::ops::RangeInclusive<u64> = 101..=120;

/// Simulates a case from every seed and fits it, on all processors; the result does not depend on how many
/// there are.
pub fn run(case: &Case, seeds: &[u64]) -> Outcome {
    Outcome::new(case, fits(case, seeds))
}

/// The fits of a case in the order of the seeds; `None` where the effect is not found.
fn fits(case: &Case, seeds: &[u64]) -> Vec<Option<KnownFit>> {
    let next = AtomicUsize::new(0);
    let fitted = |seed: u64| -> Option<KnownFit> {
        let run = simulate(&case.scenario, seed).expect("a scenario that is valid");
        let fits = fit_known(&run.recording, ROBOT, &[case.effect]).expect("a recording with its nominal");
        fits.into_iter().next()
    };
    let work = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&seed) = seeds.get(index) else { return done };
            done.push((index, fitted(seed)));
        }
    };
    let mut all: Vec<(usize, Option<KnownFit>)> = thread::scope(|scope| {
        let workers = thread::available_parallelism().map_or(1, usize::from);
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|handle| handle.join().expect("no worker panics")).collect()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, fit)| fit).collect()
}

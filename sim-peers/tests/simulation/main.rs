//! The simulated world against closed forms, declared statistics and its own promises.

mod channels;
mod motion;
mod scenario_errors;
mod shipped;
mod sightings;
mod slip;
mod streams;

use pleiad_sim_peers::{Scenario, SimulatedRun, simulate};

/// A scenario from text that is known to be good.
fn scenario(text: &str) -> Scenario {
    Scenario::from_toml(text, "test.toml").unwrap()
}

/// One run of a scenario from text.
fn run(text: &str, seed: u64) -> SimulatedRun {
    simulate(&scenario(text), seed).unwrap()
}

/// Asserts that squared standard normals have the sum they should have: chi-square with as many degrees of
/// freedom has that mean and twice that variance. 4.5 standard deviations are exceeded by chance in
/// about one case of 100,000; seeds are fixed.
fn assert_standard(claim: &str, variates: &[f64]) {
    let count = variates.len() as f64;
    assert!(count >= 90.0, "{claim}: only {count} values");
    let sum: f64 = variates.iter().map(|z| z * z).sum();
    let bound = 4.5 * (2.0 * count).sqrt();
    assert!((sum - count).abs() < bound, "{claim}: chi-square {sum:.1} for {count}, bound {bound:.1}");
    let mean = variates.iter().sum::<f64>() / count;
    assert!(mean.abs() < 4.5 / count.sqrt(), "{claim}: mean {mean} of {count} standard normals");
}

/// Asserts that pairs are uncorrelated standard normals: the products have mean 0 and variance 1.
fn assert_uncorrelated(claim: &str, pairs: impl Iterator<Item = (f64, f64)>) {
    let products: Vec<f64> = pairs.map(|(a, b)| a * b).collect();
    let count = products.len() as f64;
    let mean = products.iter().sum::<f64>() / count;
    assert!(mean.abs() < 4.5 / count.sqrt(), "{claim}: correlation {mean} over {count} pairs");
}

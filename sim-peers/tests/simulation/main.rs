//! The simulated world against closed forms, declared statistics and its own promises.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests are tests")]

mod channels;
mod kidnap;
mod manoeuvres;
mod motion;
mod readings;
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

#[test]
#[should_panic(expected = "chi-square")]
fn a_sigma_off_by_a_tenth_is_caught() {
    let alternating: Vec<f64> = (0..2000).map(|k| if k % 2 == 0 { 1.1 } else { -1.1 }).collect();
    assert_standard("planted", &alternating);
}

#[test]
#[should_panic(expected = "mean")]
fn a_bias_of_a_fifth_of_a_sigma_is_caught() {
    let alternating: Vec<f64> = (0..2000).map(|k| if k % 2 == 0 { 1.2 } else { -0.8 }).collect();
    assert_standard("planted", &alternating);
}

#[test]
#[should_panic(expected = "correlation")]
fn a_correlation_of_a_fifth_is_caught() {
    // The pairs cancel in turn but for every tenth, which is of one sign and adds 2.25.
    let pairs = (0..2000).map(|k| {
        if k % 10 == 0 {
            (1.5, 1.5)
        } else if k % 2 == 0 {
            (1.0, 1.0)
        } else {
            (1.0, -1.0)
        }
    });
    assert_uncorrelated("planted", pairs);
}

//! Every effect of the catalogue is estimated as well as `docs/benchmarks/effects.md` says. Takes minutes, hence
//! the feature `slow`: `cargo test -p pleiad-tests --features slow --test effects`.

#![cfg(feature = "slow")]

use pleiad_physics::Effect;
use pleiad_tests::known_effects::{SEEDS, apart, cases, run};

#[test]
fn every_effect_is_in_the_benchmark_or_apart_with_a_reason() {
    assert_eq!(cases().len() + apart().len(), Effect::ALL.len());
    assert!(apart().iter().all(|own| !own.why.is_empty()));
}

#[test]
fn standard_errors_are_small_and_right() {
    let seeds: Vec<u64> = SEEDS.collect();
    let outcomes = run(&cases(), &seeds, |_| {});
    let mut failures = Vec::new();
    for outcome in &outcomes {
        let name = outcome.effect.name();
        for row in &outcome.rows {
            let ratio = row.sigma() / row.size;
            if !row.errors.is_empty() && ratio > 0.2 {
                failures.push(format!("{name} {}: sigma is {ratio:.2} of the size", row.label));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

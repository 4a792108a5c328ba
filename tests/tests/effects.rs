//! Every effect of the catalogue is estimated as well as `docs/benchmarks/effects.md` says. Takes minutes, hence
//! the feature `slow`: `cargo test -p pleiad-tests --features slow --test effects`.

#![cfg(feature = "slow")]

use pleiad_tests::known_effects::{SEEDS, cases, run};

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

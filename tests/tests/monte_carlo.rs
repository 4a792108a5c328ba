//! Consistency of the team's estimate over a hundred seeded runs. Takes minutes, hence the feature `slow`:
//! `cargo test -p pleiad-tests --features slow --test monte_carlo -- --nocapture`.

#![cfg(feature = "slow")]
#![allow(clippy::expect_used, reason = "helpers of tests fail by panicking")]
#![allow(clippy::print_stdout, reason = "the table is what the benchmark page quotes")]

use pleiad_estimation::Timestamp;
use pleiad_estimation::statistics::NeesSummary;
use pleiad_sim_peers::{FleetOptions, Scenario};
use pleiad_tests::team::{Team, Told};

const SEEDS: std::ops::Range<u64> = 1000..1100;
const TIMES_S: [f64; 6] = [10.0, 20.0, 30.0, 45.0, 60.0, 90.0];

/// Joint NEES per dimension at each time. 100 runs of dimension 15 give a standard deviation of
/// sqrt(2 / 1500) = 0.037, so the bounds are three of them below 1 and four above, where linearization
/// adds its share.
fn check(name: &str, text: &str) {
    let mut scenario = Scenario::from_toml(text, name).expect("a shipped scenario");
    scenario.duration_s = 90.5;
    let run = |seed| {
        let run = Team::new(&scenario, seed, Told::default())
            .run(&FleetOptions { seed, ..FleetOptions::default() });
        assert!(run.agreed, "seed {seed}");
        TIMES_S.map(|time| run.joint_error_at(Timestamp::from_seconds(time))).to_vec()
    };
    let runs: Vec<_> = SEEDS.map(run).collect();
    let summary = NeesSummary::from_runs(&runs, 0.01).expect("equal times");
    println!("{name}, {} runs, seeds {} to {}", runs.len(), SEEDS.start, SEEDS.end - 1);
    println!("| t, s | joint NEES per dimension | interval, corrected for {} times |", TIMES_S.len());
    println!("|---|---|---|");
    for (time, at) in TIMES_S.iter().zip(&summary.times) {
        let anees = at.anees.expect("defined");
        println!("| {time} | {anees:.3} | {:.3} to {:.3} |", at.interval.0, at.interval.1);
    }
    for (time, at) in TIMES_S.iter().zip(&summary.times) {
        let anees = at.anees.expect("defined");
        assert!(at.undefined == 0 && (0.88..=1.15).contains(&anees), "{name} at {time} s: {anees}");
    }
}

#[test]
fn joint_nees_over_a_hundred_runs_without_any_fix() {
    check("five_relative", include_str!("../../scenarios/five_relative.toml"));
}

#[test]
fn joint_nees_over_a_hundred_runs_with_gps_on_one_robot() {
    check("five_gps", include_str!("../../scenarios/five_gps.toml"));
}

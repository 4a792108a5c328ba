//! Sightings of nothing: any range and any bearing, as likely as any other.

#![allow(clippy::expect_used, reason = "a fixture")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use pleiad_estimation::fold::{Clutter, FoldConfig, Relinearization};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::statistics::chi_square_interval;
use support::wander::{World, Wrong, run};

const RUNS: u64 = 60;

/// Root mean square of the position errors of four robots after a minute, over the runs, and NEES of each robot's position.
fn judged(config: FoldConfig, world: World<'_>) -> (f64, f64) {
    let (mut square, mut nees) = (0.0, 0.0);
    for seed in 0..RUNS {
        let team = run(seed, 60, &config, world, &[(Wrong::default(), None); 4]);
        let mut ledger = team.ledger(config);
        let joint = ledger.settle();
        square += team.error_m(joint).powi(2) / RUNS as f64;
        nees += team.nees_of_positions(joint) / RUNS as f64;
    }
    (square.sqrt(), nees)
}

fn told() -> FoldConfig {
    FoldConfig { clutter: Some(Clutter { share: 0.3, reach_m: 8.0 }), ..FoldConfig::default() }
}

fn together(config: FoldConfig) -> FoldConfig {
    let how = Relinearization { block_ns: 5_000_000_000, ahead_ns: 5_000_000_000, passes: 4, cell_ns: 0 };
    FoldConfig { relinearize: Some(how), ..config }
}

/// Three sightings in ten are of nothing, and errors grow by less than a fifth. (Those that are left alone make up for
/// more than half of that: the information of each sighting is worth a share.)
#[test]
fn three_tenths_of_garbage_cost_less_than_a_fifth() {
    let usual = World::default();
    let slippery = World { slip: 8.0, ..usual };
    let adrift = World { gps: false, slip: 4.0, every: 10, ..usual };
    for world in [usual, slippery, adrift] {
        for config in [told(), together(told())] {
            // Clean is what the filter makes of clean data that is told of no garbage.
            let (clean, _) = judged(FoldConfig { clutter: None, ..config }, world);
            let (dirty, nees) = judged(config, World { garbage: 0.3, ..world });
            println!("{clean} {dirty} {} {nees}", dirty / clean);
            assert!(dirty < 1.2 * clean, "{dirty} {clean}");
        }
    }
}

/// Robots that are lost by half a metre between two sightings: much of what is of nothing passes a gate.
#[test]
fn where_a_gate_passes_garbage_its_probability_decides() {
    let world = World { slip: 8.0, every: 20, ..World::default() };
    let dirty = World { garbage: 0.3, ..world };
    let (clean, _) = judged(FoldConfig::default(), world);
    let (gated, gated_nees) = judged(FoldConfig::default(), dirty);
    let (weighed, nees) = judged(told(), dirty);
    let (smoothed, smoothed_nees) = judged(together(told()), dirty);
    println!("{clean}; {gated} {gated_nees}; {weighed} {nees}; {smoothed} {smoothed_nees}");
    assert!(gated > 2.0 * clean && gated_nees > 1.5, "garbage hurts: {gated} {clean} {gated_nees}");
    assert!(weighed < 0.7 * gated && smoothed < 0.7 * gated, "{weighed} {smoothed} {gated}");
    assert!(nees < 1.25 && smoothed_nees < 1.25, "{nees} {smoothed_nees}");
}

#[test]
fn to_be_told_of_garbage_costs_nothing_where_there_is_none() {
    let world = World { slip: 8.0, ..World::default() };
    let (untold, _) = judged(FoldConfig::default(), world);
    let (told, nees) = judged(told(), world);
    assert!(told < 1.02 * untold, "{told} {untold}");
    let dof = (RUNS * 8) as f64;
    let (low, high) = chi_square_interval(dof, 0.001);
    // Robots of one team err together: the interval is that of a quarter as many.
    assert!((low - (dof - low)..high + (high - dof)).contains(&(nees * dof)), "{nees}");
}

#[test]
fn the_order_of_arrival_leaves_no_trace() {
    for config in [told(), together(told())] {
        let world = World { garbage: 0.3, ..World::default() };
        let team = run(3, 30, &config, world, &[(Wrong::default(), None); 3]);
        let expected = team.ledger(config).settle().clone();
        let mut backwards: Vec<_> = team.entries().cloned().collect();
        backwards.reverse();
        let mut ledger = Ledger::new(config);
        for (count, entry) in backwards.into_iter().enumerate() {
            ledger.insert(entry);
            if count % 29 == 0 {
                ledger.settle();
            }
        }
        assert_eq!(ledger.settle(), &expected);
    }
}

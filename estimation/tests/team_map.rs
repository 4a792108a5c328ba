//! Landmarks whose places nobody knows, found by the team in the joint of its poses.

#![allow(clippy::expect_used, reason = "a fixture")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::LandmarkId;
use pleiad_estimation::fact::{Body, Entry, Noise, NoiseRef, Quantity};
use pleiad_estimation::fold::{Fact, FoldConfig, Outcome, Relinearization, SkipReason};
use pleiad_estimation::joint::{Block, ErrorForm, Joint};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::statistics::chi_square_interval;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::wander::{Run, World, Wrong, run};

const PLACES: [[f64; 2]; 6] = [[2.0, 2.0], [-2.0, 3.0], [-3.0, -1.0], [1.0, -3.0], [4.0, 0.0], [0.0, 5.0]];

fn open() -> FoldConfig {
    FoldConfig { gate: [f64::INFINITY; 3], ..FoldConfig::default() }
}

fn team(seed: u64, config: &FoldConfig, gps: bool) -> Run {
    run(
        seed,
        60,
        config,
        World { gps, landmarks: &PLACES, ..World::default() },
        &[(Wrong::default(), None); 3],
    )
}

/// Error of all places together against their covariance, and how many numbers that is.
fn nees(joint: &Joint) -> (f64, usize) {
    let mapped = joint.blocks().iter().enumerate().filter_map(|(index, block)| match block {
        Block::Landmark(mapped) => Some((index, *mapped)),
        _ => None,
    });
    let mapped: Vec<_> = mapped.collect();
    let mut error = DVector::zeros(2 * mapped.len());
    let mut by = DMatrix::zeros(2 * mapped.len(), 3 * joint.blocks().len());
    for (row, (index, mapped)) in mapped.iter().enumerate() {
        let place = mapped.pose.position();
        let truth = PLACES[mapped.landmark.0 as usize];
        error[2 * row] = truth[0] - place.x;
        error[2 * row + 1] = truth[1] - place.y;
        // A point moved by exp(xi) goes by [I, J p] xi.
        by[(2 * row, 3 * index)] = 1.0;
        by[(2 * row, 3 * index + 2)] = -place.y;
        by[(2 * row + 1, 3 * index + 1)] = 1.0;
        by[(2 * row + 1, 3 * index + 2)] = place.x;
    }
    let size = joint.covariance().size();
    let all = DMatrix::from_fn(size, size, |row, column| joint.covariance().entry(row, column));
    let p = &by * all * by.transpose();
    let solved = p.cholesky().expect("positive definite").solve(&error);
    (error.dot(&solved), error.len())
}

fn consistent(config: FoldConfig, gps: bool) {
    let (mut sum, mut dimension) = (0.0, 0);
    let (mut with, mut without) = (0.0, 0.0);
    for seed in 0..60 {
        let team = team(seed, &config, gps);
        let mut ledger = team.ledger(config);
        let joint = ledger.settle();
        let (found, rows) = nees(joint);
        assert!(rows >= 8, "{rows}: most landmarks are seen");
        sum += found;
        dimension += rows;
        with += team.error_m(joint).powi(2);
        let mut blind = Ledger::new(config);
        for entry in team.entries() {
            // Logs keep their numbers: what was seen of landmarks has noise beyond all use instead.
            let mut entry = entry.clone();
            if let Body::Observation(seen) = &mut entry.body
                && matches!(seen.quantity, Quantity::Feature { .. })
            {
                seen.noise = NoiseRef::Explicit(Noise::from_sigmas(&[1e6, 1e6]));
            }
            blind.insert(entry);
        }
        without += team.error_m(blind.settle()).powi(2);
    }
    let (low, high) = chi_square_interval(dimension as f64, 0.001);
    println!("gps {gps}: {sum} of {dimension}; errors {} and {}", with.sqrt(), without.sqrt());
    assert!((low..high).contains(&sum), "{sum} outside {low}..{high}");
    assert!(with < without, "{with} {without}");
}

#[test]
fn places_are_found_with_the_uncertainty_stated() {
    consistent(open(), true);
}

#[test]
fn and_without_any_absolute_fix() {
    consistent(open(), false);
}

#[test]
fn and_where_facts_are_linearized_together() {
    let together =
        Relinearization { block_ns: 5_000_000_000, ahead_ns: 5_000_000_000, passes: 3, cell_ns: 0 };
    consistent(FoldConfig { relinearize: Some(together), ..open() }, true);
}

#[test]
fn the_order_of_arrival_leaves_no_trace_in_the_map() {
    let config = FoldConfig::default();
    let team = team(5, &config, true);
    let expected = team.ledger(config).settle().clone();
    let mut entries: Vec<Entry> = team.entries().cloned().collect();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for index in (1..entries.len()).rev() {
        entries.swap(index, random.random_range(0..=index));
    }
    let mut ledger = Ledger::new(config);
    for (count, entry) in entries.into_iter().enumerate() {
        ledger.insert(entry);
        if count % 41 == 0 {
            ledger.settle();
        }
    }
    // Landmarks may have come to have other rows on the way, and have them no longer.
    assert_eq!(ledger.settle(), &expected);
}

#[test]
fn a_landmark_is_placed_by_who_saw_it_first_and_used_from_then_on() {
    let config = open();
    let mut ledger = team(2, &config, true).ledger(config);
    ledger.settle();
    let mut seen = std::collections::BTreeSet::new();
    for (_, record) in ledger.facts() {
        let Fact::Observation { quantity: Quantity::Feature { landmark, .. }, .. } = &record.fact else {
            continue;
        };
        let wanted = if seen.insert(*landmark) { Outcome::Placed } else { Outcome::Used };
        assert_eq!(record.residual.expect("folded").outcome, wanted, "{landmark:?}");
    }
    assert!(seen.len() >= 4);
}

#[test]
fn what_does_not_place_a_landmark_says_so() {
    let only_bearing = |entry: &Entry| {
        let mut entry = entry.clone();
        if let Body::Observation(seen) = &mut entry.body
            && let Quantity::Feature { landmark, relative: Relative::RangeBearing { bearing_rad, .. } } =
                seen.quantity
        {
            seen.quantity = Quantity::Feature { landmark, relative: Relative::Bearing { bearing_rad } };
            seen.noise = NoiseRef::Explicit(Noise::from_sigmas(&[0.01]));
        }
        entry
    };
    for (config, bearings) in [(open(), true), (FoldConfig { form: ErrorForm::Additive, ..open() }, false)] {
        let team = team(2, &config, true);
        let mut ledger = Ledger::new(config);
        for entry in team.entries() {
            ledger.insert(if bearings { only_bearing(entry) } else { entry.clone() });
        }
        ledger.settle();
        let mut skipped = 0;
        for (_, record) in ledger.facts() {
            let Fact::Observation { quantity: Quantity::Feature { landmark, .. }, .. } = &record.fact else {
                continue;
            };
            let why = SkipReason::NotMapped(LandmarkId(landmark.0));
            assert_eq!(record.residual.expect("folded").outcome, Outcome::Skipped(why));
            skipped += 1;
        }
        assert!(skipped > 20, "{skipped}");
    }
}

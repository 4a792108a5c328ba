//! What is uncertain besides poses, estimated with them: odometry that errs, sensors that sit elsewhere, clocks that are wrong.

#![allow(clippy::cast_possible_truncation, clippy::expect_used, reason = "a fixture")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Calibration, Entry};
use pleiad_estimation::fold::{FoldConfig, Relinearization};
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::joint::{Joint, ParameterKind};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::statistics::chi_square_interval;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::wander::{BEFORE, TICK_S, World, Wrong, gaussian, run};

fn true_parameters(wrong: &Wrong, kind: ParameterKind) -> Vector3 {
    match kind {
        ParameterKind::Motion => Vector3::from(wrong.motion),
        ParameterKind::Mount => Vector3::from(wrong.mount),
        ParameterKind::Clock => Vector3::new(wrong.late_ticks as f64 * TICK_S, 0.0, 0.0),
    }
}

const KINDS: [ParameterKind; 3] = [ParameterKind::Motion, ParameterKind::Mount, ParameterKind::Clock];

/// NEES of all parameters together, and how many there are.
fn nees_of_parameters(joint: &Joint, wrong: &BTreeMap<RobotId, Wrong>) -> (f64, usize) {
    let mut rows = Vec::new();
    for (robot, wrong) in wrong {
        for kind in KINDS {
            let Some(index) = joint.parameter_index(*robot, kind) else { continue };
            let (found, covariance) = joint.parameters(*robot, kind).expect("there");
            let error = true_parameters(wrong, kind) - found.value;
            for axis in 0..3 {
                if covariance[(axis, axis)] > 0.0 {
                    rows.push((3 * index + axis, error[axis]));
                }
            }
        }
    }
    let p = DMatrix::from_fn(rows.len(), rows.len(), |a, b| joint.covariance().entry(rows[a].0, rows[b].0));
    let error = DVector::from_iterator(rows.len(), rows.iter().map(|(_, error)| *error));
    let solved = p.cholesky().expect("positive definite").solve(&error);
    (error.dot(&solved), rows.len())
}

fn told() -> Calibration {
    Calibration { motion: [0.05, 0.05, 0.02], mount: [0.1, 0.1, 0.05], clock: [0.05, 0.001] }
}

/// Parameters drawn from what is told of them; clocks to whole ticks, which is a part of their spread.
fn drawn(seed: u64, what: ParameterKind) -> (Wrong, Calibration) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let told = told();
    let mut draw = |sigmas: [f64; 3]| sigmas.map(|sigma| sigma * gaussian(&mut random));
    let none = Calibration::default();
    match what {
        ParameterKind::Motion => (
            Wrong { motion: draw(told.motion), ..Wrong::default() },
            Calibration { motion: told.motion, ..none },
        ),
        ParameterKind::Mount => {
            (Wrong { mount: draw(told.mount), ..Wrong::default() }, Calibration { mount: told.mount, ..none })
        }
        ParameterKind::Clock => {
            let late_ticks = (draw([0.05, 0.0, 0.0])[0] / TICK_S).round() as i64;
            let late_ticks = late_ticks.clamp(-BEFORE, BEFORE);
            (Wrong { late_ticks, ..Wrong::default() }, Calibration { clock: [0.05, 0.0], ..none })
        }
    }
}

/// Over sixty runs the errors of the parameters are as stated, and those of the poses at most `share` of what they are when
/// nobody asks for parameters.
fn consistent(what: ParameterKind, together: Option<Relinearization>, share: f64) {
    let config = FoldConfig { gate: [f64::INFINITY; 3], relinearize: together, ..FoldConfig::default() };
    let (mut nees, mut dimension) = (0.0, 0);
    let (mut with, mut without) = (0.0, 0.0);
    for seed in 0..60 {
        let robots: Vec<_> = (0..3)
            .map(|robot| {
                let (wrong, told) = drawn(1000 * seed + robot, what);
                // Somebody's clock is the team's.
                if what == ParameterKind::Clock && robot == 0 {
                    (Wrong::default(), None)
                } else {
                    (wrong, Some(told))
                }
            })
            .collect();
        let run_of = run(seed, 60, &config, World::default(), &robots);
        let mut ledger = run_of.ledger(config);
        let joint = ledger.settle();
        let wrong = (1..).map(RobotId).zip(robots.iter().map(|(wrong, _)| *wrong)).collect();
        let (found, rows) = nees_of_parameters(joint, &wrong);
        nees += found;
        dimension += rows;
        with += run_of.error_m(joint).powi(2) / 60.0;
        let silent: Vec<_> = robots.iter().map(|(wrong, _)| (*wrong, None)).collect();
        let run_of = run(seed, 60, &config, World::default(), &silent);
        without += run_of.error_m(run_of.ledger(config).settle()).powi(2) / 60.0;
    }
    println!("{what:?}: NEES {} of {dimension}, error {} m, without {} m", nees, with.sqrt(), without.sqrt());
    let (low, high) = chi_square_interval(dimension as f64, 0.001);
    assert!((low..high).contains(&nees), "{what:?}: {nees} outside {low}..{high}");
    assert!(with.sqrt() < share * without.sqrt(), "{with} {without}");
}

#[test]
fn odometry_that_errs_is_found_with_the_uncertainty_stated() {
    consistent(ParameterKind::Motion, None, 0.4);
}

#[test]
fn a_sensor_that_sits_elsewhere_is_found_with_the_uncertainty_stated() {
    consistent(ParameterKind::Mount, None, 0.4);
}

#[test]
fn a_clock_that_is_wrong_is_found_with_the_uncertainty_stated() {
    consistent(ParameterKind::Clock, None, 0.95);
}

#[test]
fn and_so_they_are_where_facts_are_linearized_together() {
    let together =
        Relinearization { block_ns: 5_000_000_000, ahead_ns: 5_000_000_000, passes: 3, cell_ns: 0 };
    consistent(ParameterKind::Motion, Some(together), 0.4);
    consistent(ParameterKind::Mount, Some(together), 0.4);
}

#[test]
fn where_nothing_is_wrong_nothing_is_found() {
    let config = FoldConfig { gate: [f64::INFINITY; 3], ..FoldConfig::default() };
    let (mut nees, mut dimension) = (0.0, 0);
    for seed in 100..130 {
        // Much less is wrong than might be: the errors are smaller than stated, and shrink from what was told.
        let robots = [(Wrong::default(), Some(Calibration { clock: [0.0; 2], ..told() })); 3];
        let run = run(seed, 60, &config, World::default(), &robots);
        let mut ledger = run.ledger(config);
        let joint = ledger.settle();
        let wrong = (1..=3).map(|robot| (RobotId(robot), Wrong::default())).collect();
        let (found, rows) = nees_of_parameters(joint, &wrong);
        nees += found;
        dimension += rows;
        let (_, covariance) = joint.parameters(RobotId(2), ParameterKind::Motion).expect("told");
        for (axis, told) in told().motion.into_iter().enumerate() {
            assert!(covariance[(axis, axis)].sqrt() < 0.6 * told, "{axis}: {covariance}");
        }
    }
    assert!(nees < chi_square_interval(dimension as f64, 0.001).1, "{nees} of {dimension}");
}

#[test]
fn the_order_of_arrival_leaves_no_trace() {
    let config = FoldConfig::default();
    let robots = [(drawn(7, ParameterKind::Motion).0, Some(told())); 3];
    let run = run(3, 30, &config, World::default(), &robots);
    let mut whole = run.ledger(config);
    let expected = whole.settle().clone();
    let mut shuffled: Vec<Entry> = run.entries().cloned().collect();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for index in (1..shuffled.len()).rev() {
        shuffled.swap(index, random.random_range(0..=index));
    }
    let mut ledger = Ledger::new(config);
    for (count, entry) in shuffled.into_iter().enumerate() {
        ledger.insert(entry);
        if count % 37 == 0 {
            ledger.settle();
        }
    }
    assert_eq!(ledger.settle(), &expected);
}

//! Robots that do not know where they start, and find out from what they see of one another.

#![allow(clippy::expect_used, reason = "a fixture")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

mod support;

use pleiad_estimation::fact::Entry;
use pleiad_estimation::fold::{Clutter, FoldConfig, Outcome};
use pleiad_estimation::geometry::{Vector3, wrap_angle};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::statistics::chi_square_interval;
use pleiad_estimation::{RobotId, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::wander::{Kind, Run, TICK_NS, World, Wrong, run};

const RUNS: u64 = 24;

fn join() -> FoldConfig {
    FoldConfig { join: true, ..FoldConfig::default() }
}

fn team(seed: u64, config: &FoldConfig, world: World<'_>) -> Run {
    run(seed, 60, config, world, &[(Wrong::default(), None); 3])
}

/// NEES of the pose of every robot that has a place in the map.
fn nees(team: &Run, joint: &Joint) -> Vec<f64> {
    let time = Timestamp(team.ticks * TICK_NS);
    let of = |(robot, number): (&support::wander::Robot, u32)| {
        let state = robot.trajectory.at(time).expect("kept");
        let (pose, covariance) = joint.estimate(RobotId(number), time, &state)?;
        let truth = robot.at_label(team.ticks);
        let apart = truth.position() - pose.position();
        let error = Vector3::new(apart.x, apart.y, wrap_angle(truth.yaw_rad() - pose.yaw_rad()));
        let solved = covariance.to_matrix().cholesky()?.solve(&error);
        Some(error.dot(&solved))
    };
    team.robots.iter().zip(1..).filter_map(of).collect()
}

/// Most robots come to have a place, none a wrong one, and all are as sure as they should be.
fn finds_itself(config: FoldConfig, world: World<'_>, share: f64) {
    let mut all = Vec::new();
    for seed in 1000..1000 + RUNS {
        let run = team(seed, &config, world);
        let mut ledger = run.ledger(config);
        all.extend(nees(&run, ledger.settle()));
    }
    let placed = all.len() as f64 / (3 * RUNS) as f64;
    let worst = all.iter().copied().fold(0.0, f64::max);
    let dof = (3 * all.len()) as f64;
    let sum: f64 = all.iter().sum();
    println!(
        "{:?} {world_gps}: placed {placed}, ANEES {}, worst {worst}",
        world.kind,
        sum / dof,
        world_gps = world.gps
    );
    assert!(placed >= share, "{placed}");
    // 3 degrees of freedom: beyond 30 comes once in a million.
    assert!(worst < 30.0, "a robot is in a wrong place: {worst}");
    // Robots of one team err together: the interval is that of a third as many.
    let (low, high) = chi_square_interval(dof / 3.0, 0.001);
    assert!((3.0 * low..3.0 * high).contains(&sum), "{sum} of {dof}");
}

/// The first is told its start, the others are not.
fn one() -> World<'static> {
    World { told: 1, gps: false, ..World::default() }
}

/// Nobody is told; the first has GPS.
fn fixes() -> World<'static> {
    World { told: 0, ..World::default() }
}

#[test]
fn by_range_and_bearing() {
    finds_itself(join(), one(), 1.0);
    finds_itself(join(), fixes(), 1.0);
}

#[test]
fn by_full_poses_and_positions() {
    finds_itself(join(), World { kind: Kind::Pose, ..one() }, 1.0);
    finds_itself(join(), World { kind: Kind::Position, ..one() }, 1.0);
}

#[test]
fn by_bearings_alone() {
    finds_itself(join(), World { kind: Kind::Bearing, ..one() }, 1.0);
    finds_itself(join(), World { kind: Kind::Bearing, ..fixes() }, 1.0);
}

#[test]
fn by_ranges_alone() {
    // A range has two answers until the robots have moved; some are not told apart within a minute.
    finds_itself(join(), World { kind: Kind::Range, every: 10, ..fixes() }, 0.8);
}

#[test]
fn among_sightings_of_nothing() {
    let config = FoldConfig { clutter: Some(Clutter { share: 0.1, reach_m: 8.0 }), ..join() };
    finds_itself(config, World { garbage: 0.1, ..one() }, 0.9);
    finds_itself(config, World { garbage: 0.3, ..fixes() }, 0.7);
}

#[test]
fn by_landmarks_that_nobody_knows_but_both_have_seen() {
    let places = [[2.0, 2.0], [-2.0, 3.0], [-3.0, -1.0], [1.0, -3.0], [4.0, 0.0], [0.0, 5.0]];
    // Robots never see one another.
    finds_itself(join(), World { landmarks: &places, every: i64::MAX, ..one() }, 0.9);
}

#[test]
fn the_team_ends_as_one_that_knew() {
    let (mut found, mut knew) = (0.0, 0.0);
    for seed in 0..RUNS {
        let world = World { gps: true, ..World::default() };
        let lost = team(seed, &join(), World { told: 0, ..world });
        found += lost.error_m(lost.ledger(join()).settle()).powi(2);
        let told = team(seed, &join(), world);
        knew += told.error_m(told.ledger(join()).settle()).powi(2);
    }
    println!("{} {}", (found / RUNS as f64).sqrt(), (knew / RUNS as f64).sqrt());
    assert!(found.sqrt() < 1.1 * knew.sqrt(), "{found} {knew}");
}

#[test]
fn who_is_told_has_the_same_bits_as_without_joins() {
    let world = World::default();
    let without = team(4, &FoldConfig::default(), world).ledger(FoldConfig::default()).settle().clone();
    let with = team(4, &join(), world).ledger(join()).settle().clone();
    assert_eq!(with.covariance(), without.covariance());
    assert_eq!(with.blocks(), without.blocks());
}

#[test]
fn the_order_of_arrival_leaves_no_trace_in_joins() {
    for (seed, world) in [(1, one()), (2, fixes()), (3, World { kind: Kind::Bearing, ..one() })] {
        let team = team(seed, &join(), world);
        let expected = team.ledger(join()).settle().clone();
        let mut entries: Vec<Entry> = team.entries().cloned().collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for index in (1..entries.len()).rev() {
            entries.swap(index, random.random_range(0..=index));
        }
        let mut ledger = Ledger::new(join());
        for (count, entry) in entries.into_iter().enumerate() {
            ledger.insert(entry);
            if count % 149 == 0 {
                ledger.settle();
            }
        }
        assert_eq!(ledger.settle(), &expected);
    }
}

#[test]
fn until_it_is_known_a_robot_has_no_place_and_says_no_estimate() {
    // Two seconds of ranges: where the others may be is still a ring.
    let team = run(7, 2, &join(), World { kind: Kind::Range, ..one() }, &[(Wrong::default(), None); 3]);
    let mut ledger = team.ledger(join());
    let mut tied = 0;
    let joint = ledger.settle().clone();
    for (_, record) in ledger.facts() {
        tied += usize::from(record.residual.expect("folded").outcome == Outcome::Tied);
    }
    assert!(tied > 0 && tied == joint.ties().len(), "{tied}");
    assert!(joint.is_in_map(RobotId(1)) && !joint.is_in_map(RobotId(2)) && !joint.is_in_map(RobotId(3)));
    let time = Timestamp(team.ticks * TICK_NS);
    let state = team.robots[1].trajectory.at(time).expect("kept");
    assert!(joint.estimate(RobotId(2), time, &state).is_none());
}

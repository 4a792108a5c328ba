//! Robots that do not know where they start, and find out from what they see of one another.

#![allow(clippy::expect_used, reason = "a fixture")]

mod support;

use pleiad_estimation::fold::{FoldConfig, Outcome};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::{RobotId, Timestamp};
use support::wander::{Kind, Run, TICK_NS, World, Wrong, run};

const RUNS: u64 = 60;

fn config() -> FoldConfig {
    FoldConfig { join: true, ..FoldConfig::default() }
}

fn team(seed: u64, seconds: i64, world: World<'_>) -> Run {
    run(seed, seconds, &config(), world, &[(Wrong::default(), None); 3])
}

/// NEES of the pose of every robot that has a place in the map.
fn nees(team: &Run, joint: &Joint) -> Vec<f64> {
    let time = Timestamp(team.ticks * TICK_NS);
    let of = |(robot, number): (&support::wander::Robot, u32)| {
        let state = robot.trajectory.at(time).expect("kept");
        let (pose, covariance) = joint.estimate(RobotId(number), time, &state)?;
        let truth = robot.at_label(team.ticks);
        let apart = truth.position() - pose.position();
        let turned = pleiad_estimation::geometry::wrap_angle(truth.yaw_rad() - pose.yaw_rad());
        let error = pleiad_estimation::geometry::Vector3::new(apart.x, apart.y, turned);
        let solved = covariance.to_matrix().cholesky()?.solve(&error);
        Some(error.dot(&solved))
    };
    team.robots.iter().zip(1..).filter_map(of).collect()
}

#[test]
fn explore() {
    let gps_only = World { told: 0, ..World::default() };
    let one = World { told: 1, gps: false, ..World::default() };
    for (name, world, seconds) in [
        ("pose", World { kind: Kind::Pose, ..one }, 60),
        ("range and bearing", one, 60),
        ("position", World { kind: Kind::Position, ..one }, 60),
        ("range", World { kind: Kind::Range, ..one }, 60),
        ("bearing", World { kind: Kind::Bearing, ..one }, 60),
        ("gps", gps_only, 60),
        ("gps range", World { kind: Kind::Range, ..gps_only }, 60),
    ] {
        let (mut all, mut large, mut placed) = (Vec::new(), 0, 0);
        let (mut with, mut without) = (0.0, 0.0);
        let mut joins = std::collections::BTreeMap::new();
        let mut when = Vec::new();
        for seed in 0..RUNS {
            let run = team(seed, seconds, world);
            let mut ledger = run.ledger(config());
            let joint = ledger.settle().clone();
            let found = nees(&run, &joint);
            placed += found.len();
            large += found.iter().filter(|nees| **nees > 30.0).count();
            if found.len() == 3 {
                with += run.error_m(&joint).powi(2) / RUNS as f64;
            }
            all.extend(found);
            for (key, record) in ledger.facts() {
                if let Outcome::Joined { redundancy } = record.residual.expect("folded").outcome {
                    *joins.entry(redundancy).or_insert(0) += 1;
                    when.push(key.time.seconds());
                }
            }
            let known = team(seed, seconds, World { told: u32::MAX, ..world });
            without += known.error_m(known.ledger(config()).settle()).powi(2) / RUNS as f64;
        }
        when.sort_by(f64::total_cmp);
        let anees = all.iter().sum::<f64>() / (3 * all.len()) as f64;
        println!("{name}: placed {placed} of {}, ANEES {anees:.3}, wrong {large}, error {:.3} known {:.3}, when {:?} {:?}, joins {joins:?}", 3 * RUNS, with.sqrt(), without.sqrt(), when.get(when.len() / 2), when.last());
    }
}

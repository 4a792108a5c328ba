//! What is uncertain besides poses, estimated with them: odometry that errs, sensors that sit elsewhere, clocks that are wrong.
//! The truth, and how it becomes readings, is written here and knows nothing of derivatives.

#![allow(clippy::cast_possible_truncation, clippy::expect_used, reason = "a fixture")]

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::fact::{
    Absolute, Answer, Body, Boot, Calibration, Entry, EntryId, Half, Noise, NoiseRef, Observation, Quantity,
    extension_of_boot, extension_of_state,
};
use pleiad_estimation::fold::{FoldConfig, Relinearization};
use pleiad_estimation::geometry::{Vector3, wrap_angle};
use pleiad_estimation::joint::{Joint, ParameterKind};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::motion::Step;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::statistics::chi_square_interval;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Sequence, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const TICK_NS: i64 = 50_000_000;
const TICK_S: f64 = 0.05;
const NOISE: [f64; 3] = [0.01, 0.0, 0.01];
const PRIOR: [f64; 3] = [0.05, 0.05, 0.02];
const SIGHTING: [f64; 2] = [0.05, 0.01];
const GPS: f64 = 0.2;

/// What is wrong with a robot, in the units and order of [`Calibration`]; clocks are off by whole ticks.
#[derive(Clone, Copy, Default)]
struct Wrong {
    motion: [f64; 3],
    mount: [f64; 3],
    late_ticks: i64,
}

struct Robot {
    wrong: Wrong,
    told: Option<Calibration>,
    /// True poses by tick, from tick 0 at true time -20 ticks.
    truth: Vec<Pose2>,
    trajectory: NominalTrajectory,
    entries: Vec<Entry>,
}

const BEFORE: i64 = 20;

impl Robot {
    /// The true pose when its clock shows the end of a tick.
    fn at_label(&self, tick: i64) -> &Pose2 {
        &self.truth[(tick - self.wrong.late_ticks + BEFORE) as usize]
    }

    fn say(&mut self, robot: u32, body: Body, extension: Vec<u8>) -> EntryId {
        let sequence = Sequence(self.entries.len() as u64);
        let id = EntryId { robot: RobotId(robot), boot: BootIndex(0), sequence };
        self.entries.push(Entry { id, body, extension });
        id
    }

    fn extension(&self, tick: i64) -> Vec<u8> {
        let state = self.trajectory.at(Timestamp(tick * TICK_NS)).expect("kept");
        state.sensitivity.filter(|_| self.told.is_some()).map_or_else(Vec::new, |of| extension_of_state(&of))
    }
}

struct Run {
    robots: Vec<Robot>,
    ticks: i64,
}

fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Three robots that wander for `seconds`; the first has GPS.
fn run(seed: u64, seconds: i64, config: &FoldConfig, robots: &[(Wrong, Option<Calibration>)]) -> Run {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let ticks = seconds * 20;
    let mut run = Run { robots: Vec::new(), ticks };
    for (index, (wrong, told)) in robots.iter().enumerate() {
        let mut truth = vec![Pose2::new(3.0 * index as f64, 1.0, 0.5 * index as f64)];
        let (mut forward, mut rate): (f64, f64) = (0.5, 0.0);
        let mut steps = Vec::new();
        for _ in 0..ticks + 2 * BEFORE {
            // It keeps to the middle, and drives at changing speeds.
            let home = truth[truth.len() - 1];
            let wanted = wrap_angle((-home.y_m()).atan2(-home.x_m()) - home.yaw_rad());
            let pull = if home.position().norm() > 4.0 { 0.3 * wanted } else { 0.0 };
            rate = (0.95 * rate + 0.12 * gaussian(&mut random) + 0.1 * pull).clamp(-1.0, 1.0);
            forward = (forward + 0.05 * gaussian(&mut random)).clamp(0.1, 1.0);
            let noise = NOISE.map(|sigma| sigma * TICK_S.sqrt() * gaussian(&mut random));
            let said = Vector3::new(forward * TICK_S, 0.0, rate * TICK_S);
            let [scale, turn, bias] = wrong.motion;
            let moved = Vector3::new(said.x * (1.0 + scale), 0.0, said.z * (1.0 + turn) - bias * TICK_S);
            truth.push(home.compose(&Pose2::exp(moved)).compose(&Pose2::exp(Vector3::from(noise))));
            steps.push(said);
        }
        let nominal = NominalTrajectory::new(Timestamp(0), Pose2::identity(), usize::MAX).calibrated();
        let mut robot =
            Robot { wrong: *wrong, told: *told, truth, trajectory: nominal, entries: Vec::new() };
        let first = BEFORE - wrong.late_ticks;
        for tick in 0..ticks + 1 {
            let [x, y, yaw] = NOISE.map(|sigma| sigma * sigma * TICK_S);
            robot.trajectory.extend(&Step {
                from: Timestamp(tick * TICK_NS),
                to: Timestamp((tick + 1) * TICK_NS),
                motion: steps[(tick + first) as usize],
                covariance: Symmetric3::diagonal(x, y, yaw),
            });
        }
        let boot = Boot {
            time: Timestamp(0),
            nonce: 1,
            configuration: config.hash(),
            nominal: Pose2::identity(),
            continuation: None,
            calibration: None,
        };
        let extension = told.map_or_else(Vec::new, |told| extension_of_boot(&told, None));
        let number = index as u32 + 1;
        robot.say(number, Body::Boot(boot), extension);
        let error = PRIOR.map(|sigma| sigma * gaussian(&mut random));
        let prior = robot.at_label(0).compose(&Pose2::exp(Vector3::from(error)));
        let prior = Quantity::Absolute(Absolute::Pose(prior));
        observation(&mut robot, number, 0, prior, &PRIOR);
        run.robots.push(robot);
    }
    for tick in 1..ticks {
        let observer = random.random_range(0..robots.len());
        let other = (observer + random.random_range(1..robots.len())) % robots.len();
        if tick % 4 == 0 {
            sight(&mut run, observer, other, tick, &mut random);
        }
        if tick % 20 == 0 {
            let truth = run.robots[0].at_label(tick);
            let read = [truth.x_m(), truth.y_m()].map(|p| p + GPS * gaussian(&mut random));
            let gps = Quantity::Absolute(Absolute::Position(read));
            observation(&mut run.robots[0], 1, tick, gps, &[GPS; 2]);
        }
    }
    run
}

fn observation(robot: &mut Robot, number: u32, tick: i64, quantity: Quantity, sigmas: &[f64]) -> EntryId {
    let time = Timestamp(tick * TICK_NS);
    let observer = robot.trajectory.at(time).expect("kept");
    let noise = NoiseRef::Explicit(Noise::from_sigmas(sigmas));
    let extension = robot.extension(tick);
    robot.say(number, Body::Observation(Observation { time, quantity, noise, observer }), extension)
}

fn sight(run: &mut Run, observer: usize, other: usize, tick: i64, random: &mut ChaCha8Rng) {
    let [x, y, yaw] = run.robots[observer].wrong.mount;
    let from = run.robots[observer].at_label(tick).compose(&Pose2::new(x, y, yaw));
    // Where the other one is at that true instant.
    let late = run.robots[other].wrong.late_ticks - run.robots[observer].wrong.late_ticks;
    let seen = from.between(run.robots[other].at_label(tick + late)).position();
    let relative = Relative::RangeBearing {
        range_m: seen.norm() + SIGHTING[0] * gaussian(random),
        bearing_rad: seen.y.atan2(seen.x) + SIGHTING[1] * gaussian(random),
    };
    let quantity = Quantity::Robot { robot: RobotId(other as u32 + 1), relative };
    let id = observation(&mut run.robots[observer], observer as u32 + 1, tick, quantity, &SIGHTING);
    let state = run.robots[other].trajectory.at(Timestamp(tick * TICK_NS)).expect("kept");
    let answer = Answer::State { boot: BootIndex(0), state };
    let extension = run.robots[other].extension(tick);
    run.robots[other].say(other as u32 + 1, Body::Half(Half { observation: id, answer }), extension);
}

impl Run {
    fn ledger(&self, config: FoldConfig) -> Ledger {
        let mut ledger = Ledger::new(config);
        for entry in self.robots.iter().flat_map(|robot| &robot.entries) {
            ledger.insert(entry.clone());
        }
        ledger
    }

    /// Errors of position of all robots at the end, by what is published, root mean square in metres.
    fn error_m(&self, joint: &Joint) -> f64 {
        let square = self.robots.iter().zip(1..).map(|(robot, number)| {
            let time = Timestamp(self.ticks * TICK_NS);
            let state = robot.trajectory.at(time).expect("kept");
            let (pose, _) = joint.estimate(RobotId(number), time, &state).expect("placed");
            // Published is where the robot is when the time is what its clock shows, not when its clock shows it.
            let truth = &robot.truth[(self.ticks + BEFORE) as usize];
            (pose.position() - truth.position()).norm_squared()
        });
        (square.sum::<f64>() / self.robots.len() as f64).sqrt()
    }
}

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
        ParameterKind::Motion => {
            (Wrong { motion: draw(told.motion), ..Wrong::default() }, Calibration { motion: told.motion, ..none })
        }
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
        let run_of = run(seed, 60, &config, &robots);
        let mut ledger = run_of.ledger(config);
        let joint = ledger.settle();
        let wrong = (1..).map(RobotId).zip(robots.iter().map(|(wrong, _)| *wrong)).collect();
        let (found, rows) = nees_of_parameters(joint, &wrong);
        nees += found;
        dimension += rows;
        with += run_of.error_m(joint).powi(2) / 60.0;
        let silent: Vec<_> = robots.iter().map(|(wrong, _)| (*wrong, None)).collect();
        let run_of = run(seed, 60, &config, &silent);
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
        let run = run(seed, 60, &config, &robots);
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
    let run = run(3, 30, &config, &robots);
    let mut whole = run.ledger(config);
    let expected = whole.settle().clone();
    let mut shuffled: Vec<Entry> = run.robots.iter().flat_map(|robot| robot.entries.clone()).collect();
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

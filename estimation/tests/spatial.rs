//! The filter in space: the order of arrival, an oracle that steps every tick, the null space, and consistency.

#![allow(clippy::unwrap_used, reason = "a failed expectation is a failed test")]

#[path = "support/space.rs"]
mod space;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::RobotId;
use pleiad_estimation::geometry::{LieGroup, Pose3, Square, Tangent6, Vector3};
use pleiad_estimation::group_fold::{
    Fact, FactSet, FoldConfig, Insertion, Joint, Noise, NominalState, Outcome, Quantity, Symmetric,
};
use pleiad_estimation::reference::spatial::{Matrix, Seen, SpatialEkf, Target};
use pleiad_estimation::spatial::{Absolute3, Relative3};
use pleiad_estimation::statistics::NeesSummary;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use space::{Event, Fact3, Options, Run, errors, run};

const ACCEPT: FoldConfig<6> = FoldConfig { gate: [f64::INFINITY; 6] };

/// The joint of a run with every robot carried on to its end.
fn at_the_end(run: &Run, config: &FoldConfig<6>) -> Joint<Pose3, 6> {
    let (mut joint, _) = run.set().fold(config);
    for (state, robot) in run.ends.iter().zip(1..) {
        joint.carry_to(RobotId(robot), state);
    }
    joint
}

fn estimates(run: &Run, joint: &Joint<Pose3, 6>) -> Vec<Pose3> {
    let ends = run.ends.iter().zip(1..);
    ends.map(|(state, robot)| joint.estimate(RobotId(robot), state).unwrap().0).collect()
}

// The order of arrival.

fn check_order(seed: u64, robots: u32) {
    let run = run(seed, &Options { robots, ..Options::default() });
    let (straight, records) = run.set().fold(&FoldConfig::default());
    let used = records.iter().filter(|(_, record)| record.outcome == Outcome::Used).count();
    assert!(used > 50, "{used}");
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xA5A5);
    let mut shuffled = run.facts.clone();
    shuffled.extend(run.facts.iter().filter(|_| random.random::<f64>() < 0.3));
    for index in (1..shuffled.len()).rev() {
        shuffled.swap(index, random.random_range(0..=index));
    }
    let mut set = FactSet::new();
    for (key, fact) in shuffled {
        assert_ne!(set.insert(key, fact), Ok(Insertion::Contradicted));
    }
    let (joint, again) = set.fold(&FoldConfig::default());
    assert_eq!(joint.fingerprint(), straight.fingerprint(), "seed {seed}");
    assert_eq!((joint, again), (straight, records));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn any_order_and_repetition_gives_the_same_bits(seed in 0u64..1_000_000, robots in 2u32..=6) {
        check_order(seed, robots);
    }
}

#[test]
fn two_facts_of_one_key_cancel_whichever_comes_first() {
    let run = run(3, &Options::default());
    let (key, fact) = run.facts[20];
    let Fact::Observation { quantity, noise, mut observer, other } = fact else { panic!("an observation") };
    observer.nominal = observer.nominal.compose(&Pose3::exp(&Tangent6::repeat(1e-9)));
    let contradicting: Fact3 = Fact::Observation { quantity, noise, observer, other };
    let mut without = FactSet::new();
    for (other, fact) in run.facts.iter().filter(|(other, _)| *other != key) {
        without.insert(*other, *fact).unwrap();
    }
    let mut before = without.clone();
    let mut after = without.clone();
    let inserted = [fact, contradicting, fact].map(|fact| before.insert(key, fact).unwrap());
    assert_eq!(inserted, [Insertion::Added, Insertion::Contradicted, Insertion::Contradicted]);
    for fact in [contradicting, contradicting, fact] {
        after.insert(key, fact).unwrap();
    }
    assert_eq!(before, after);
    assert_eq!(before.contradicted().collect::<Vec<_>>(), [&key]);
    assert_eq!(before.fold(&ACCEPT).0.fingerprint(), without.fold(&ACCEPT).0.fingerprint());
}

#[test]
fn what_is_not_a_fact_is_refused_by_name() {
    let run = run(3, &Options::default());
    let (key, fact) = run.facts[20];
    let Fact::Observation { quantity, noise, observer, other } = fact else { panic!("an observation") };
    let refused = |fact: Fact3| FactSet::new().insert(key, fact).unwrap_err().to_string();
    let nowhere = Quantity::Absolute(Absolute3::Position(Vector3::new(f64::NAN, 0.0, 0.0)));
    let three = Noise::from_sigmas(&[1.0; 3]);
    let message = refused(Fact::Observation { quantity: nowhere, noise: three, observer, other });
    assert!(message.contains("the measurement"), "{message}");
    let negative = Noise { covariance: noise.covariance.scaled(-1.0), ..noise };
    let message = refused(Fact::Observation { quantity, noise: negative, observer, other });
    assert!(message.contains("the noise of the measurement"), "{message}");
    let other_size = Noise { dimension: noise.dimension + 1, ..noise };
    assert!(
        refused(Fact::Observation { quantity, noise: other_size, observer, other }).contains("dimension")
    );
    let infinite = NominalState { noise_sum: Symmetric::from_sigmas([f64::INFINITY; 6]), ..observer };
    let message = refused(Fact::Observation { quantity, noise, observer: infinite, other });
    assert!(message.contains("the observer's state"), "{message}");
}

// The oracle.

fn matrix(pose: &Pose3) -> Matrix {
    let mut matrix = Matrix::identity();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation());
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.position());
    matrix
}

fn dense(noise: &Symmetric<6>, dimension: usize) -> DMatrix<f64> {
    DMatrix::from_fn(dimension, dimension, |row, column| noise.entry(row, column))
}

fn seen(relative: &Relative3) -> Seen {
    match relative {
        Relative3::Pose(pose) => Seen::Pose(matrix(pose)),
        Relative3::Position(z) => Seen::Position(*z),
        Relative3::Range(range) => Seen::Range(*range),
        Relative3::Bearing(z) => Seen::Bearing(z.vector()),
        Relative3::RangeBearing(range, z) => Seen::RangeBearing(*range, z.vector()),
    }
}

fn oracle(run: &Run) -> SpatialEkf {
    let mut priors = BTreeMap::new();
    let mut filter = None;
    for event in &run.events {
        match event {
            Event::Observation(robot, Quantity::Absolute(Absolute3::Pose(z)), noise) => {
                priors.insert(*robot, (matrix(z), dense(&noise.covariance, 6)));
            }
            Event::Observation(robot, quantity, noise) => {
                let (target, seen) = match quantity {
                    Quantity::Robot { robot, relative } => (Target::Robot(*robot), seen(relative)),
                    Quantity::Landmark { position_m, relative, .. } => {
                        (Target::Point(*position_m), seen(relative))
                    }
                    Quantity::Absolute(Absolute3::Position(z)) => (Target::Map, Seen::Position(*z)),
                    Quantity::Absolute(Absolute3::Pose(z)) => (Target::Map, Seen::Pose(matrix(z))),
                };
                let filter = filter.get_or_insert_with(|| SpatialEkf::new(&priors));
                let noise = dense(&noise.covariance, noise.dimension);
                assert!(filter.observe(*robot, &target, &seen, &noise).is_some());
            }
            Event::Step(robot, step) => {
                let filter = filter.get_or_insert_with(|| SpatialEkf::new(&priors));
                filter.step(*robot, &step.motion, &dense(&step.covariance, 6));
            }
        }
    }
    filter.unwrap()
}

/// Largest difference of an estimate from the oracle's, over its sigma, and of the covariance, over its largest entry.
fn off_oracle(seed: u64, noise: f64) -> (f64, f64) {
    let options = Options { noise, between: false, seconds: 10, ..Options::default() };
    let run = run(seed, &options);
    let joint = at_the_end(&run, &ACCEPT);
    let filter = oracle(&run);
    let covariance = joint.covariance().to_dense();
    let mut most = 0.0f64;
    for (index, (estimate, robot)) in estimates(&run, &joint).iter().zip(1..).enumerate() {
        let theirs = filter.pose(RobotId(robot)).unwrap();
        let off = pleiad_estimation::reference::spatial::log(&(theirs * matrix(&estimate.inverse())));
        for axis in 0..6 {
            let sigma = covariance[(6 * index + axis, 6 * index + axis)].sqrt();
            most = most.max(off[axis].abs() / sigma);
        }
    }
    (most, (&covariance - filter.covariance()).amax() / covariance.amax())
}

#[test]
fn the_fold_is_the_filter_of_every_tick_to_second_order_in_corrections() {
    for seed in 0..4 {
        let (whole, p_whole) = off_oracle(seed, 1.0);
        let (tenth, p_tenth) = off_oracle(seed, 0.1);
        let (least, p_least) = off_oracle(seed, 0.01);
        println!(
            "seed {seed}: {whole:.2e} {tenth:.2e} {least:.2e} of sigma; P {p_whole:.2e} {p_tenth:.2e} {p_least:.2e}"
        );
        // Over a sigma that falls with the noise, what is of second order falls tenfold with a tenth of it.
        assert!(whole < 0.1 && p_whole < 0.05, "seed {seed}: {whole} {p_whole}");
        assert!((5.0..20.0).contains(&(whole / tenth)) || tenth < 1e-3, "seed {seed}: {whole} {tenth}");
        assert!(tenth < 0.01 && least < 0.001, "seed {seed}: {tenth} {least}");
        assert!(p_tenth < 0.005 && p_least < 0.0005, "seed {seed}: {p_tenth} {p_least}");
    }
}

// The null space.

/// `E^T P^-1 E` with `E = [I; I; ..]`: what is known of an error common to all.
fn common_information(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let common =
        DMatrix::from_fn(covariance.nrows(), 6, |row, column| f64::from(u8::from(row % 6 == column)));
    common.transpose() * covariance.clone().cholesky().unwrap().solve(&common)
}

/// What is known of an error common to all, and what the priors alone say of it, each in the frame of its robot; and the
/// traces of the covariance and of the priors.
fn known_in_common(absolute: bool) -> (DMatrix<f64>, DMatrix<f64>, [f64; 2]) {
    let run = run(8, &Options { absolute, walk: 0.0, ..Options::default() });
    let joint = at_the_end(&run, &ACCEPT);
    let covariance = joint.covariance().to_dense();
    let (mut priors, mut spread) = (DMatrix::zeros(6, 6), 0.0);
    for (_, fact) in &run.facts {
        if let Fact::Observation { quantity: Quantity::Absolute(Absolute3::Pose(z)), noise, .. } = fact {
            let block = dense(&noise.covariance.congruence(&LieGroup::adjoint(z)), 6);
            spread += block.trace();
            priors += block.cholesky().unwrap().inverse();
        }
    }
    (common_information(&covariance), priors, [covariance.trace(), spread])
}

#[test]
fn relative_measurements_say_nothing_of_an_error_common_to_all() {
    let (known, priors, [after, before]) = known_in_common(false);
    let off = (&known - &priors).amax() / priors.amax();
    // Rounding through two inversions of matrices with a condition of some 1e5.
    assert!(off < 1e-7, "{off}");
    // Of the rest they do say something.
    assert!(after < 0.5 * before, "{after} {before}");
}

#[test]
fn absolute_positions_of_one_robot_say_something_of_all_six_directions() {
    let (known, priors, _) = known_in_common(true);
    let gained = nalgebra::SymmetricEigen::new(known - priors).eigenvalues;
    // In every direction more than a position or an angle known to one unit would.
    assert!(gained.min() > 1.0, "{gained}");
}

// Consistency.

fn consistency(options: &Options, seeds: std::ops::Range<u64>) -> NeesSummary {
    let runs: Vec<_> = seeds
        .map(|seed| {
            let run = run(seed, options);
            let joint = at_the_end(&run, &ACCEPT);
            let errors = errors(&run.truth, &estimates(&run, &joint));
            vec![(DVector::from_vec(errors), joint.covariance().to_dense())]
        })
        .collect();
    NeesSummary::from_runs(&runs, 0.01).unwrap()
}

#[test]
fn a_team_with_one_absolute_position_is_consistent() {
    let summary = consistency(&Options::default(), 0..100);
    println!("{summary:?}");
    assert!(summary.is_consistent(), "{summary:?}");
}

#[test]
fn a_team_without_an_absolute_fix_is_consistent_while_its_drift_is_small() {
    let options = Options { absolute: false, seconds: 10, ..Options::default() };
    let summary = consistency(&options, 1000..1100);
    println!("{summary:?}");
    assert!(summary.is_consistent(), "{summary:?}");
}

#[test]
fn consistency_is_lost_if_the_process_noise_is_understated() {
    // The clean case is above; the planted fault: facts that claim a quarter of the process noise.
    let runs: Vec<_> = (0..30)
        .map(|seed| {
            let mut run = run(seed, &Options::default());
            for (_, fact) in &mut run.facts {
                if let Fact::Observation { observer, other, .. } = fact {
                    observer.noise_sum = observer.noise_sum.scaled(0.25);
                    if let Some((_, state)) = other {
                        state.noise_sum = state.noise_sum.scaled(0.25);
                    }
                }
            }
            for state in &mut run.ends {
                state.noise_sum = state.noise_sum.scaled(0.25);
            }
            let joint = at_the_end(&run, &ACCEPT);
            let errors = errors(&run.truth, &estimates(&run, &joint));
            vec![(DVector::from_vec(errors), joint.covariance().to_dense())]
        })
        .collect();
    let summary = NeesSummary::from_runs(&runs, 0.01).unwrap();
    assert!(!summary.is_consistent() && summary.overall.unwrap() > 1.2, "{summary:?}");
}

/// Mean over runs of the squared error of the middle of the team, and what the filter says of it, m^2.
fn drift(absolute: bool, seconds: i64) -> (f64, f64) {
    let runs = 100;
    let (mut found, mut stated) = (0.0, 0.0);
    for seed in 0..runs {
        let run = run(seed, &Options { seconds, absolute, ..Options::default() });
        let joint = at_the_end(&run, &ACCEPT);
        let estimates = estimates(&run, &joint);
        let share = 1.0 / estimates.len() as f64;
        let mut middle = Vector3::zeros();
        let mut rows = DMatrix::zeros(3, 6 * estimates.len());
        for (index, (truth, estimate)) in run.truth.iter().zip(&estimates).enumerate() {
            middle += (truth.position() - estimate.position()) * share;
            let additive: Square<6> = estimate.additive_from_invariant();
            for row in 0..3 {
                for column in 0..6 {
                    rows[(row, 6 * index + column)] = share * additive[(row, column)];
                }
            }
        }
        found += middle.norm_squared() / runs as f64;
        stated += (&rows * joint.covariance().to_dense() * rows.transpose()).trace() / runs as f64;
    }
    (found, stated)
}

#[test]
fn without_an_absolute_fix_the_common_drift_grows_and_with_one_it_does_not() {
    let (early, early_stated) = drift(false, 5);
    let (late, late_stated) = drift(false, 60);
    let (fixed, fixed_stated) = drift(true, 60);
    println!(
        "found {early:.4} {late:.4} {fixed:.4}, stated {early_stated:.4} {late_stated:.4} {fixed_stated:.4}"
    );
    assert!(
        late > 2.0 * early && late_stated > 2.0 * early_stated,
        "{early} {late} {early_stated} {late_stated}"
    );
    assert!(
        fixed < 0.5 * late && fixed_stated < 0.5 * late_stated,
        "{fixed} {late} {fixed_stated} {late_stated}"
    );
    // Mean of 100 squares of one to three parts: a standard deviation of 8 to 14 %.
    for (found, stated) in [(early, early_stated), (late, late_stated), (fixed, fixed_stated)] {
        assert!((0.65..1.4).contains(&(found / stated)), "{found} {stated}");
    }
}

//! The likelihood of noise levels, against what is known without a filter: the density of all readings of a linear problem
//! at once, noise sums of trajectories that were integrated under the levels, and the innovations of the fold itself.

#![allow(clippy::unwrap_used, reason = "a failed expectation is a failed test")]

mod support;

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::fact::{Absolute, Boot, EntryId, Noise, NominalState, Quantity};
use pleiad_estimation::fold::{Clutter, Fact, FactKey, FoldConfig, Outcome, fold};
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::joint::Joint;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::likelihood::{Level, Levels, TunableFact, UnitTrajectory, scores};
use pleiad_estimation::motion::{MotionNoise, Step};
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Sequence, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{Kinds, Options, gaussian, team};

const TICK_NS: i64 = 50_000_000;

fn open() -> FoldConfig {
    FoldConfig { gate: [f64::INFINITY; 3], ..FoldConfig::default() }
}

/// A trajectory of random arcs, with a rest in the middle, integrated with its noise sum under `noise`.
fn driven(seed: u64, ticks: i64, noise: &MotionNoise) -> NominalTrajectory {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut trajectory = NominalTrajectory::new(Timestamp(0), Pose2::new(1.0, -2.0, 0.7), 10_000);
    let (mut speed, mut rate) = (0.5, 0.0);
    for tick in 0..ticks {
        if tick % 40 == 0 {
            (speed, rate) = (random.random_range(0.1..0.9), random.random_range(-1.0..1.0));
        }
        let rests = (ticks / 3..ticks / 2).contains(&tick);
        let motion = if rests { Vector3::zeros() } else { Vector3::new(speed, 0.0, rate) * 0.05 };
        let (from, to) = (Timestamp(tick * TICK_NS), Timestamp((tick + 1) * TICK_NS));
        let covariance = noise.covariance(&motion, 0.05);
        trajectory.extend(&Step { from, to, motion, covariance });
    }
    trajectory
}

fn motion_noise(levels: &Levels, quiet_at_standstill: bool) -> MotionNoise {
    MotionNoise {
        forward_m_per_sqrt_s: levels[Level::Forward],
        lateral_m_per_sqrt_s: levels[Level::Lateral],
        yaw_rad_per_sqrt_s: levels[Level::Yaw],
        forward_m_per_sqrt_m: levels[Level::ForwardPerMetre],
        yaw_rad_per_sqrt_m: levels[Level::YawPerMetre],
        yaw_rad_per_sqrt_rad: levels[Level::YawPerRadian],
        quiet_at_standstill,
    }
}

#[test]
fn noise_sums_from_units_are_those_of_a_trajectory_driven_under_the_levels() {
    for (seed, quiet) in [(1, false), (2, true)] {
        let mut levels = Levels::default();
        for (level, value) in Level::ALL.into_iter().zip([0.04, 0.01, 0.03, 0.05, 0.02, 0.1]) {
            levels[level] = value;
        }
        let own = driven(seed, 600, &motion_noise(&levels, quiet));
        // Units are summed along a trajectory driven under no noise at all.
        let units = UnitTrajectory::new(driven(seed, 600, &MotionNoise::default()).ticks(), quiet);
        for nanoseconds in [0, TICK_NS, 7_123_456_789, 12_000_000_000, 600 * TICK_NS] {
            let time = Timestamp(nanoseconds);
            let expected = own.at(time).unwrap().noise_sum.to_matrix();
            let found = levels.noise_sum(&units.at(time).unwrap()).to_matrix();
            // Motions are taken from poses again, which costs some digits.
            let off = (found - expected).norm();
            assert!(off < 1e-10 * (1e-3 + expected.norm()), "seed {seed} at {nanoseconds}: {off}");
        }
        assert!(units.at(Timestamp(600 * TICK_NS + 1)).is_none());
    }
}

/// Facts of one robot: its boot, its prior, and an absolute reading every `every` ticks.
fn alone(
    trajectory: &NominalTrajectory,
    prior: (Pose2, Noise),
    every: usize,
    read: &mut dyn FnMut(&NominalState) -> Absolute,
) -> Vec<TunableFact> {
    let units = UnitTrajectory::new(trajectory.ticks(), false);
    let id = |sequence| EntryId { robot: RobotId(1), boot: BootIndex(0), sequence: Sequence(sequence) };
    let (first, state) = trajectory.ticks().next().unwrap();
    let boot = Boot {
        time: first,
        nonce: 1,
        configuration: 0,
        nominal: state.nominal,
        continuation: None,
        calibration: None,
    };
    let observed = |quantity, noise, observer| Fact::Observation { quantity, noise, observer, other: None };
    let mut facts = vec![
        (FactKey::boot(first, id(0)), Fact::Boot(boot)),
        (
            FactKey::observation(first, id(1)),
            observed(Quantity::Absolute(Absolute::Pose(prior.0)), Some(prior.1), state),
        ),
    ];
    for (sequence, (time, state)) in (2..).zip(trajectory.ticks().skip(every).step_by(every)) {
        let quantity = Quantity::Absolute(read(&state));
        // Whatever is stated here, the levels say otherwise.
        let noise = Some(Noise::from_sigmas(
            &[1.0; 2][..if matches!(quantity, Quantity::Absolute(Absolute::Heading(_))) { 1 } else { 2 }],
        ));
        facts.push((FactKey::observation(time, id(sequence)), observed(quantity, noise, state)));
    }
    let tunable = |(key, fact)| TunableFact::new(key, fact, |_, _, time| units.at(time)).unwrap();
    facts.into_iter().map(tunable).collect()
}

/// Logarithm of the density of a centred Gaussian.
fn log_normal(values: &DVector<f64>, covariance: DMatrix<f64>) -> f64 {
    let factor = covariance.cholesky().unwrap();
    let half_log_determinant: f64 = factor.l().diagonal().iter().map(|x| x.ln()).sum();
    let nis = values.dot(&factor.solve(values));
    -0.5 * nis - half_log_determinant - 0.5 * values.len() as f64 * std::f64::consts::TAU.ln()
}

fn log_likelihood(facts: &[TunableFact], levels: &Levels) -> f64 {
    scores(facts, levels, &open()).into_iter().flatten().map(|score| score.log_density).sum()
}

#[test]
fn the_likelihood_of_headings_is_their_joint_density() {
    let trajectory = driven(3, 400, &MotionNoise::default());
    let (every, prior_sigma) = (20, 0.05);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut errors = Vec::new();
    let (_, start) = trajectory.ticks().next().unwrap();
    let mut read = |state: &NominalState| {
        errors.push(0.1 * gaussian(&mut random));
        Absolute::Heading(state.nominal.yaw_rad() + errors[errors.len() - 1])
    };
    let prior = (start.nominal, Noise::from_sigmas(&[0.1, 0.1, prior_sigma]));
    let facts = alone(&trajectory, prior, every, &mut read);
    for (yaw, sigma) in [(0.03, 0.1), (0.2, 0.02), (0.001, 0.5)] {
        let mut levels = Levels::default();
        (levels[Level::Yaw], levels[Level::Heading]) = (yaw, sigma);
        // A random walk from the prior, read with noise: the covariance of readings i and j is that of the walk at the earlier.
        let walked = |k: usize| prior_sigma.powi(2) + yaw.powi(2) * 0.05 * ((k + 1) * every) as f64;
        let covariance = DMatrix::from_fn(errors.len(), errors.len(), |i, j| {
            walked(i.min(j)) + if i == j { sigma * sigma } else { 0.0 }
        });
        let expected = log_normal(&DVector::from_vec(errors.clone()), covariance);
        let found = log_likelihood(&facts, &levels);
        // Rounding alone: the problem is linear.
        assert!(
            (found - expected).abs() < 1e-8 * expected.abs().max(1.0),
            "{yaw} {sigma}: {found} {expected}"
        );
    }
}

#[test]
fn the_likelihood_of_fixes_is_their_joint_density_where_the_heading_is_sure() {
    let trajectory = driven(4, 400, &MotionNoise::default());
    let (every, prior_sigma) = (20, 0.3);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut errors = Vec::new();
    let (_, start) = trajectory.ticks().next().unwrap();
    let mut read = |state: &NominalState| {
        let [x, y] = [0.4 * gaussian(&mut random), 0.4 * gaussian(&mut random)];
        errors.extend([x, y]);
        Absolute::Position([state.nominal.x_m() + x, state.nominal.y_m() + y])
    };
    // As sure as does no harm to the factorization.
    let prior = (start.nominal, Noise::from_sigmas(&[prior_sigma, prior_sigma, 1e-9]));
    let facts = alone(&trajectory, prior, every, &mut read);
    for [forward, lateral, per_metre, sigma] in [[0.1, 0.03, 0.0, 0.4], [0.02, 0.2, 0.1, 0.2]] {
        let mut levels = Levels::default();
        (levels[Level::Forward], levels[Level::Lateral]) = (forward, lateral);
        (levels[Level::ForwardPerMetre], levels[Level::Gps]) = (per_metre, sigma);
        // Each step's noise, turned to the map at the pose after it, is in all later positions.
        let mut walked = vec![DMatrix::identity(2, 2) * prior_sigma.powi(2)];
        let states: Vec<NominalState> = trajectory.ticks().map(|(_, state)| state).collect();
        for step in states.windows(2) {
            let moved = step[0].nominal.between(&step[1].nominal).log();
            let (sine, cosine) = step[1].nominal.yaw_rad().sin_cos();
            let turn = DMatrix::from_row_slice(2, 2, &[cosine, -sine, sine, cosine]);
            let along = forward.powi(2) * 0.05 + per_metre.powi(2) * moved.x.hypot(moved.y);
            let own = DMatrix::from_diagonal(&DVector::from_vec(vec![along, lateral.powi(2) * 0.05]));
            walked.push(&walked[walked.len() - 1] + &turn * own * turn.transpose());
        }
        let covariance = DMatrix::from_fn(errors.len(), errors.len(), |i, j| {
            let earlier = (i.min(j) / 2 + 1) * every;
            walked[earlier][(i % 2, j % 2)] + if i == j { sigma * sigma } else { 0.0 }
        });
        let expected = log_normal(&DVector::from_vec(errors.clone()), covariance);
        let found = log_likelihood(&facts, &levels);
        // The heading that is sure to 1e-9 leaves some 1e-9 of a position at a few metres.
        assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} {expected}");
    }
}

#[test]
fn every_innovation_is_the_folds_own() {
    let clutter = Some(Clutter { share: 0.05, reach_m: 30.0 });
    for (seed, config) in [(5, open()), (6, FoldConfig::default()), (7, FoldConfig { clutter, ..open() })] {
        let team = team(seed, &Options { kinds: Kinds::All, seconds: 60, ..Options::default() });
        let mut ledger = Ledger::new(FoldConfig::default());
        for entry in &team.entries {
            ledger.insert(entry.clone());
        }
        ledger.settle();
        let mut levels = Levels::default();
        for (level, value) in Level::ALL.into_iter().zip([0.02, 0.01, 0.01].into_iter().chain([0.05; 14])) {
            levels[level] = value;
        }
        let facts: Vec<TunableFact> = ledger
            .facts()
            .map(|(key, record)| {
                // Any sums that grow do.
                let units = |_, _, time: Timestamp| {
                    let seconds = time.seconds();
                    Some(std::array::from_fn(|_| Symmetric3::diagonal(seconds, 2.0 * seconds, 0.5 * seconds)))
                };
                TunableFact::new(*key, record.fact, units).unwrap()
            })
            .collect();
        let found = scores(&facts, &levels, &config);
        let mut joint = Joint::new(config.form);
        let mut measured = 0;
        for (fact, score) in facts.iter().zip(found) {
            let residual = fold(&mut joint, &config, fact.key(), &fact.under(&levels));
            let Some(score) = score else {
                assert!(
                    !matches!(residual.outcome, Outcome::Used | Outcome::Rejected { .. }),
                    "{residual:?}"
                );
                continue;
            };
            measured += 1;
            let off = (score.nis - residual.nis).abs();
            // Two factorizations of one covariance.
            assert!(off < 1e-8 * (1.0 + residual.nis), "{:?}: {} {}", fact.key(), score.nis, residual.nis);
            assert_eq!(score.dimension, residual.dimension);
            assert_eq!(score.used, residual.outcome == Outcome::Used);
            assert!((0.0..=1.0).contains(&score.weight) && score.log_density.is_finite());
        }
        assert!(measured > 200, "{measured}");
    }
}

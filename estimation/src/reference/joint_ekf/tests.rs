use nalgebra::DVector;
use rand::SeedableRng;
use rand::seq::SliceRandom;

use super::super::facts_from_entries;
use super::super::simulation::{Kinds, Logs, Scenario, additive_error};
use super::*;
use crate::fact::{Answer, Body, Continuation, Half, Noise, NoiseRef, Observation, VoidReason};
use crate::sample::Relative;
use crate::statistics::{NeesSummary, NisSummary};

const FORMS: [ErrorForm; 2] = [ErrorForm::Invariant, ErrorForm::Additive];
const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);

fn still(nominal: Pose2) -> NominalState {
    NominalState::new(nominal, Symmetric3::zero())
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_seconds(seconds)
}

fn explicit(sigmas: &[f64]) -> NoiseRef {
    NoiseRef::Explicit(Noise::from_sigmas(sigmas))
}

/// Boots a robot at time 0 and places it.
fn place(logs: &mut Logs, robot: RobotId, pose: Pose2, sigmas: &[f64]) -> EntryId {
    logs.first_boot(robot);
    let prior = Quantity::Absolute(Absolute::Pose(pose));
    logs.observation(robot, at(0.0), prior, explicit(sigmas), still(Pose2::identity()), None)
}

fn fold(form: ErrorForm, logs: &Logs) -> JointEstimate {
    JointEkf::new(form).fold(&facts_from_entries(&logs.entries))
}

/// Two robots that know their heading: the x coordinates are a linear problem in two numbers.
#[test]
fn two_robots_on_a_line_get_the_closed_form_kalman_update() {
    // x1 = 0 (var 0.04), x2 = 5 (var 0.09), d = 4.6 (var 0.01): S = 0.14, r = -0.4, K = (-2/7, 9/14).
    for form in FORMS {
        let mut logs = Logs::default();
        place(&mut logs, ONE, Pose2::identity(), &[0.2, 0.2, 0.0]);
        place(&mut logs, TWO, Pose2::new(5.0, 0.0, 0.0), &[0.3, 0.3, 0.0]);
        let seen = Quantity::Robot { robot: TWO, relative: Relative::Position { x_m: 4.6, y_m: 0.0 } };
        let origin = still(Pose2::identity());
        let id = logs.observation(ONE, at(1.0), seen, explicit(&[0.1, 0.1]), origin, Some(origin));
        let estimate = fold(form, &logs);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{form:?}: {a} instead of {b}");
        close(estimate.robot(ONE).unwrap().pose().x_m(), 0.4 * 2.0 / 7.0);
        close(estimate.robot(TWO).unwrap().pose().x_m(), 5.0 - 0.4 * 9.0 / 14.0);
        let p = estimate.additive_covariance();
        close(p[(0, 0)], 0.04 - 0.04 * 0.04 / 0.14);
        close(p[(3, 3)], 0.09 - 0.09 * 0.09 / 0.14);
        close(p[(0, 3)], 0.04 * 0.09 / 0.14);
        assert_eq!(
            estimate.outcome(id).map(|outcome| match outcome {
                Outcome::Used { nis, dimension: 2 } => (nis - 0.16 / 0.14).abs() < 1e-12,
                _ => false,
            }),
            Some(true)
        );
    }
}

#[test]
fn a_prior_has_its_body_noise_turned_into_the_map() {
    let pose = Pose2::new(30.0, -10.0, std::f64::consts::FRAC_PI_2);
    for form in FORMS {
        let mut logs = Logs::default();
        let id = place(&mut logs, ONE, pose, &[0.3, 0.1, 0.02]);
        let estimate = fold(form, &logs);
        // A quarter turn swaps along and across.
        let expected = DMatrix::from_diagonal(&DVector::from_vec(vec![0.01, 0.09, 0.0004]));
        assert!((estimate.additive_covariance() - expected).amax() < 1e-12);
        assert!(estimate.robot(ONE).unwrap().correction.between(&pose).log().norm() < 1e-12);
        assert_eq!(estimate.outcome(id), Some(Outcome::Placed));
    }
}

#[test]
fn the_estimate_is_a_function_of_the_set_of_entries() {
    let run = Scenario::default().run();
    for form in FORMS {
        let filter = JointEkf::new(form);
        let expected = filter.fold(&facts_from_entries(&run.entries));
        let mut entries = run.entries.clone();
        entries.extend(run.entries.iter().step_by(3).cloned());
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for _ in 0..3 {
            entries.shuffle(&mut random);
            let mut facts = facts_from_entries(&entries);
            facts.extend(facts.clone());
            facts.shuffle(&mut random);
            assert_eq!(filter.fold(&facts), expected);
        }
    }
}

#[test]
fn the_covariance_stays_symmetric_and_positive_semidefinite() {
    let run = Scenario { robots: 4, ..Scenario::default() }.run();
    let facts = facts_from_entries(&run.entries);
    for form in FORMS {
        for count in (10..facts.len()).step_by(17) {
            let matrix = JointEkf::new(form).fold(&facts[..count]).covariance.matrix().clone();
            assert_eq!(matrix, matrix.transpose());
            let eigenvalues = matrix.symmetric_eigenvalues();
            assert!(eigenvalues.min() >= -1e-12 * eigenvalues.max(), "{form:?} after {count}");
        }
    }
}

#[test]
fn invariant_errors_across_runs_are_as_large_as_the_covariance_says() {
    let runs: Vec<_> = (0..40)
        .map(|seed| {
            let run = Scenario { seed, ticks: 400, ..Scenario::default() }.run();
            let estimate = JointEkf::new(ErrorForm::Invariant).fold(&facts_from_entries(&run.entries));
            let error_of = |robot: &RobotEstimate| {
                let (pose, _) = estimate.predict(robot.robot, &run.nominal[&robot.robot]).unwrap();
                let error = run.truth[&robot.robot].compose(&pose.inverse()).log();
                (error, robot.robot)
            };
            let mut errors = Vec::new();
            let mut covariance = estimate.covariance.matrix().clone();
            for (index, robot) in estimate.robots.iter().enumerate() {
                let (error, robot) = error_of(robot);
                errors.extend_from_slice(error.as_slice());
                let (_, block) = estimate.predict(robot, &run.nominal[&robot]).unwrap();
                covariance.view_mut((3 * index, 3 * index), (3, 3)).copy_from(&block);
            }
            vec![(DVector::from_vec(errors), covariance)]
        })
        .collect();
    let summary = NeesSummary::from_runs(&runs, 0.01).unwrap();
    assert!(summary.is_consistent(), "{summary:?}");
}

/// `E^T P^-1 E` over the common directions `E = [I; I; ...]`.
fn common_information(estimate: &JointEstimate) -> DMatrix<f64> {
    let team = estimate.robots.len();
    let common = DMatrix::from_fn(3 * team, 3, |row, column| f64::from(u8::from(row % 3 == column)));
    let solved = estimate.covariance.matrix().clone().cholesky().unwrap().solve(&common);
    common.transpose() * solved
}

#[test]
fn relative_measurements_inform_about_the_common_pose_in_the_additive_form_only() {
    // Perfect odometry, vague priors: P^-1 only ever gains H^T R^-1 H, in which common errors vanish.
    let scenario =
        Scenario { kinds: Kinds::RelativeOnly, odometry: 0.0, prior: [0.6, 0.6, 0.3], ..Scenario::default() };
    let run = scenario.run();
    let facts = facts_from_entries(&run.entries);
    let placed = facts.iter().filter(|fact| fact.time == at(0.0)).cloned().collect::<Vec<_>>();
    let invariant = JointEkf { form: ErrorForm::Invariant, gate: [f64::INFINITY; 3] };
    let before = common_information(&invariant.fold(&placed));
    let after = common_information(&invariant.fold(&facts));
    assert!((&after - &before).amax() < 1e-6 * before.amax(), "{before} {after}");

    // The textbook filter believes to learn the common heading: its variance shrinks below what the
    // priors of three robots can give, 0.3^2 / 3.
    let additive = JointEkf { form: ErrorForm::Additive, ..invariant }.fold(&facts);
    let consistent = invariant.fold(&facts).additive_covariance();
    let claimed = additive.additive_covariance();
    assert!(claimed[(2, 2)] < 0.5 * consistent[(2, 2)], "{} {}", claimed[(2, 2)], consistent[(2, 2)]);
}

#[test]
fn an_outlier_is_rejected_and_leaves_only_the_noise_of_its_participants() {
    for form in FORMS {
        let mut logs = Logs::default();
        place(&mut logs, ONE, Pose2::identity(), &[0.1, 0.1, 0.05]);
        let moved = NominalState::new(Pose2::new(2.0, 0.0, 0.0), Symmetric3::diagonal(0.01, 0.02, 0.0));
        let far = Quantity::Absolute(Absolute::Position([9.0, 0.0]));
        let id = logs.observation(ONE, at(1.0), far, explicit(&[0.1, 0.1]), moved, None);
        let estimate = fold(form, &logs);
        // x: (9 - 2)^2 / (0.01 + 0.01 + 0.01).
        let Some(Outcome::Rejected { nis, dimension: 2, threshold }) = estimate.outcome(id) else {
            panic!("{estimate:?}")
        };
        assert!((nis - 49.0 / 0.03).abs() < 1e-8);
        assert!((threshold - 13.816).abs() < 1e-12);
        let p = estimate.additive_covariance();
        assert!((p[(0, 0)] - 0.02).abs() < 1e-12);
        // y: prior, heading times lever, noise.
        assert!((p[(1, 1)] - (0.01 + 0.0025 * 4.0 + 0.02)).abs() < 1e-12);
        assert_eq!(estimate.robot(ONE).unwrap().pose(), moved.nominal);
    }
}

#[test]
fn facts_whose_decision_hangs_by_a_hair_are_named() {
    // NIS 0.03^2 / (0.01 + 0.01) = 0.045 against gates just there and far away.
    let mut logs = Logs::default();
    place(&mut logs, ONE, Pose2::identity(), &[0.1, 0.1, 0.1]);
    let heading = Quantity::Absolute(Absolute::Heading(0.03));
    let id = logs.observation(ONE, at(1.0), heading, explicit(&[0.1]), still(Pose2::identity()), None);
    let facts = facts_from_entries(&logs.entries);
    for (threshold, near) in
        [(0.045 * (1.0 + 1e-8), vec![id]), (0.045 * (1.0 - 1e-8), vec![id]), (0.05, vec![])]
    {
        let filter = JointEkf { form: ErrorForm::Invariant, gate: [threshold, 1.0, 1.0] };
        assert_eq!(filter.fold(&facts).near_gate(&filter.gate, 1e-6), near);
    }
}

#[test]
fn innovations_of_a_run_pass_the_chi_square_test() {
    let run = Scenario { seed: 8, robots: 4, ..Scenario::default() }.run();
    let filter = JointEkf { form: ErrorForm::Invariant, gate: [f64::INFINITY; 3] };
    let summary = NisSummary::from_values(filter.fold(&facts_from_entries(&run.entries)).nis()).unwrap();
    assert_eq!(summary.count, run.measurements.len());
    assert!(summary.is_consistent(0.01), "{summary:?}");
}

#[test]
fn facts_of_robots_without_a_place_or_of_another_boot_are_skipped() {
    let mut logs = Logs::default();
    place(&mut logs, ONE, Pose2::identity(), &[0.1, 0.1, 0.05]);
    logs.first_boot(TWO);
    let origin = still(Pose2::identity());
    let range = |robot| Quantity::Robot { robot, relative: Relative::Range { range_m: 1.0 } };
    let unplaced = logs.observation(ONE, at(1.0), range(TWO), explicit(&[0.1]), origin, Some(origin));
    let unknown = logs.observation(ONE, at(1.0), range(RobotId(9)), explicit(&[0.1]), origin, Some(origin));
    let itself = logs.observation(ONE, at(1.5), range(ONE), explicit(&[0.1]), origin, Some(origin));
    let heading = Quantity::Absolute(Absolute::Heading(0.0));
    let misfit = logs.observation(ONE, at(1.6), heading, explicit(&[0.1, 0.1]), origin, None);
    let restart = Boot {
        time: at(2.0),
        nonce: 2,
        configuration: 0,
        nominal: Pose2::identity(),
        continuation: None,
        calibration: None,
    };
    logs.boot(ONE, &restart, 1);
    let stale = logs.observation(ONE, at(3.0), heading, explicit(&[0.1]), origin, None);
    let estimate = fold(ErrorForm::Invariant, &logs);
    for (id, reason) in [
        (unplaced, SkipReason::Unplaced),
        (unknown, SkipReason::Unplaced),
        (itself, SkipReason::Malformed),
        (misfit, SkipReason::NoiseDimension),
        (stale, SkipReason::OtherBoot),
    ] {
        assert_eq!(estimate.outcome(id), Some(Outcome::Skipped(reason)));
    }
    assert!(estimate.robots.is_empty() && estimate.covariance.robots().is_empty());
}

#[test]
fn observations_without_a_usable_half_or_profile_are_left_out() {
    let mut logs = Logs::default();
    let origin = still(Pose2::identity());
    let range = Quantity::Robot { robot: TWO, relative: Relative::Range { range_m: 1.0 } };
    let unanswered = logs.observation(ONE, at(1.0), range, explicit(&[0.1]), origin, None);
    let void = logs.observation(ONE, at(1.1), range, explicit(&[0.1]), origin, None);
    let answer = Answer::Void(VoidReason::OdometryGap);
    logs.push(TWO, BootIndex(0), Body::Half(Half { observation: void, answer }));
    let by_other = logs.observation(ONE, at(1.2), range, explicit(&[0.1]), origin, None);
    let answer = Answer::State { boot: BootIndex(0), state: origin };
    logs.push(RobotId(3), BootIndex(0), Body::Half(Half { observation: by_other, answer }));
    logs.observation(ONE, at(1.3), range, NoiseRef::Profile(7), origin, Some(origin));
    let good = logs.observation(ONE, at(1.4), range, explicit(&[0.1]), origin, Some(origin));
    let ids: Vec<EntryId> = facts_from_entries(&logs.entries).iter().map(|fact| fact.id).collect();
    assert_eq!(ids, [good], "neither {unanswered}, {void} nor {by_other}");
}

/// A run in one boot, and the same with a continued boot in the middle, the nominal trajectory starting
/// again elsewhere.
fn split_run(gap: Symmetric3) -> (Logs, Logs) {
    let shift = Pose2::new(-3.0, 8.0, 2.0);
    let seen =
        Quantity::Robot { robot: TWO, relative: Relative::RangeBearing { range_m: 4.1, bearing_rad: 0.3 } };
    let fix = Quantity::Absolute(Absolute::Position([2.3, 0.6]));
    // N and C of robot one at 1 s, at the break, and at 3 s; robot two stands still.
    let state = |x: f64, y: f64, yaw: f64, c: f64| {
        NominalState::new(
            Pose2::new(x, y, yaw),
            Symmetric3([c, 0.1 * c, 1.5 * c, 0.05 * c, -0.1 * c, 0.2 * c]),
        )
    };
    let (early, broken, late) =
        (state(0.8, 0.1, 0.2, 0.01), state(1.5, 0.4, 0.5, 0.02), state(2.2, 0.9, 0.8, 0.035));
    let begin = || {
        let mut logs = Logs::default();
        place(&mut logs, ONE, Pose2::new(0.1, 0.0, -0.2), &[0.2, 0.2, 0.1]);
        place(&mut logs, TWO, Pose2::new(5.0, 0.0, 0.5), &[0.2, 0.2, 0.1]);
        let two = still(Pose2::identity());
        logs.observation(ONE, at(1.0), seen, explicit(&[0.1, 0.05]), early, Some(two));
        logs
    };
    let mut whole = begin();
    whole.observation(ONE, at(3.0), fix, explicit(&[0.1, 0.1]), late, None);

    let mut split = begin();
    let continuation = Continuation { previous: BootIndex(0), time: at(2.0), last: broken, gap };
    let nominal = shift.compose(&broken.nominal);
    split.boot(
        ONE,
        &Boot {
            time: at(2.0),
            nonce: 2,
            configuration: 0,
            nominal,
            continuation: Some(continuation),
            calibration: None,
        },
        1,
    );
    let ad = adjoint(&shift);
    let observer = NominalState::new(
        shift.compose(&late.nominal),
        late.noise_sum.minus(broken.noise_sum).congruence(&ad),
    );
    let observation = Observation { time: at(3.0), quantity: fix, noise: explicit(&[0.1, 0.1]), observer };
    split.push(ONE, BootIndex(1), Body::Observation(observation));
    (whole, split)
}

#[test]
fn a_continued_boot_without_a_gap_changes_nothing() {
    for form in FORMS {
        let (whole, split) = split_run(Symmetric3::zero());
        let (whole, split) = (fold(form, &whole), fold(form, &split));
        assert_eq!(split.robot(ONE).unwrap().boot, BootIndex(1));
        for robot in [ONE, TWO] {
            let (a, b) = (whole.robot(robot).unwrap().pose(), split.robot(robot).unwrap().pose());
            assert!(a.between(&b).log().norm() < 1e-12, "{form:?} {a:?} {b:?}");
        }
        let difference = whole.covariance.matrix() - split.covariance.matrix();
        assert!(difference.amax() < 1e-13, "{form:?} {difference}");
    }
}

#[test]
fn the_gap_of_a_continued_boot_widens_that_robot_in_its_body_frame_and_keeps_cross_terms() {
    for form in FORMS {
        let fold_to_boot = |gap: Symmetric3| {
            let mut split = split_run(gap).1;
            split.entries.pop();
            fold(form, &split)
        };
        let (none, some) =
            (fold_to_boot(Symmetric3::zero()), fold_to_boot(Symmetric3::diagonal(0.3, 0.0, 0.01)));
        let heading = some.robot(ONE).unwrap().pose().yaw_rad();
        let mut expected = DMatrix::zeros(6, 6);
        let (sin, cos) = heading.sin_cos();
        expected[(0, 0)] = 0.3 * cos * cos;
        expected[(1, 1)] = 0.3 * sin * sin;
        expected[(0, 1)] = 0.3 * sin * cos;
        expected[(1, 0)] = 0.3 * sin * cos;
        expected[(2, 2)] = 0.01;
        let widened = some.additive_covariance() - none.additive_covariance();
        assert!((widened - expected).amax() < 1e-12, "{form:?}");
        assert!(some.covariance.block(ONE, TWO).unwrap().amax() > 1e-4);
    }
}

#[test]
fn a_lost_boot_forgets_that_robot_and_keeps_the_marginal_of_the_others() {
    for form in FORMS {
        let mut logs = split_run(Symmetric3::zero()).0;
        let before = fold(form, &logs);
        let restart = Boot {
            time: at(4.0),
            nonce: 2,
            configuration: 0,
            nominal: Pose2::identity(),
            continuation: None,
            calibration: None,
        };
        logs.boot(ONE, &restart, 1);
        let after = fold(form, &logs);
        assert_eq!(after.covariance.robots(), [TWO]);
        assert_eq!(after.covariance.block(TWO, TWO), before.covariance.block(TWO, TWO));
        assert_eq!(after.robot(TWO), before.robot(TWO));
        assert!(after.robot(ONE).is_none());
    }
}

#[test]
fn additive_and_invariant_forms_agree_where_corrections_are_small() {
    let run = Scenario { prior: [0.01, 0.01, 0.005], odometry: 0.2, ..Scenario::default() }.run();
    let facts = facts_from_entries(&run.entries);
    let [invariant, additive] = FORMS.map(|form| JointEkf::new(form).fold(&facts));
    for robot in [1, 2, 3].map(RobotId) {
        let sigma = additive.covariance.block(robot, robot).unwrap().diagonal().map(f64::sqrt);
        let difference =
            additive_error(&additive.robot(robot).unwrap().pose(), &invariant.robot(robot).unwrap().pose());
        assert!(difference.component_div(&sigma).amax() < 0.1, "{difference} {sigma}");
    }
}

use super::super::joint_ekf::{DEFAULT_GATE, JointEkf};
use super::super::simulation::{Kinds, Scenario, Simulated, additive_error};
use super::super::{JointEstimate, facts_from_entries};
use super::*;

fn stepped(form: ErrorForm, run: &Simulated, gate: [f64; 3]) -> (PerTickEkf, Vec<Outcome>) {
    let mut filter = PerTickEkf::new(form, gate);
    for (robot, (pose, covariance)) in &run.priors {
        filter.add_robot(*robot, Timestamp(0), *pose, covariance, run.ticks[robot].iter().copied());
    }
    let measurements: Vec<TimedMeasurement> = run.measurements.iter().map(|(_, m)| *m).collect();
    let outcomes = filter.run(&measurements);
    let end = run.ticks.values().flatten().map(|tick| tick.time).max().unwrap();
    filter.advance_to(end);
    (filter, outcomes)
}

fn folded(form: ErrorForm, run: &Simulated, gate: [f64; 3]) -> JointEstimate {
    JointEkf { form, gate }.fold(&facts_from_entries(&run.entries))
}

#[test]
fn the_fold_of_facts_gives_the_filter_that_steps_every_tick_within_a_hundredth_of_a_sigma() {
    for seed in 0..6 {
        let run = Scenario { seed, robots: 4, ..Scenario::default() }.run();
        let (ticked, outcomes) = stepped(ErrorForm::Invariant, &run, DEFAULT_GATE);
        let facts = folded(ErrorForm::Invariant, &run, DEFAULT_GATE);
        for ((id, _), outcome) in run.measurements.iter().zip(outcomes) {
            let same = matches!(
                (facts.outcome(*id), outcome),
                (Some(Outcome::Used { .. }), Outcome::Used { .. })
                    | (Some(Outcome::Rejected { .. }), Outcome::Rejected { .. })
            );
            assert!(same, "seed {seed}: {id}");
        }
        for (robot, nominal) in &run.nominal {
            let (pose, covariance) = facts.predict(*robot, nominal).unwrap();
            let difference = additive_error(&ticked.pose(*robot).unwrap(), &pose);
            let m = super::super::models::additive_from_invariant(&pose);
            let sigma = (m * covariance * m.transpose()).diagonal().map(f64::sqrt);
            let share = difference.component_div(&sigma).amax();
            assert!(share < 0.01, "seed {seed}, robot {robot}: {share}");
            let other = ticked.covariance().block(*robot, *robot).unwrap();
            let relative = (other - covariance).amax() / covariance.amax();
            assert!(relative < 0.01, "seed {seed}, robot {robot}: {relative}");
        }
    }
}

#[test]
fn without_measurements_both_forms_spread_alike_and_as_the_nominal_sum_says() {
    let mut run = Scenario { every: 10_000, ..Scenario::default() }.run();
    run.measurements.clear();
    let [(invariant, _), (additive, _)] =
        [ErrorForm::Invariant, ErrorForm::Additive].map(|form| stepped(form, &run, DEFAULT_GATE));
    let facts = folded(ErrorForm::Invariant, &run, DEFAULT_GATE);
    for (robot, nominal) in &run.nominal {
        let (pose, expected) = facts.predict(*robot, nominal).unwrap();
        let block = invariant.covariance().block(*robot, *robot).unwrap();
        assert!((block - expected).amax() < 1e-9 * expected.amax());
        let m = super::super::models::additive_from_invariant(&pose);
        let turned = m * block * m.transpose();
        let difference = turned - additive.covariance().block(*robot, *robot).unwrap();
        assert!(difference.amax() < 1e-9 * turned.amax());
        assert!(pose.between(&additive.pose(*robot).unwrap()).log().norm() < 1e-9);
    }
}

#[test]
fn the_textbook_filter_claims_a_common_heading_that_relative_measurements_cannot_give() {
    let scenario =
        Scenario { kinds: Kinds::RelativeOnly, odometry: 0.0, prior: [0.6, 0.6, 0.3], ..Scenario::default() };
    let run = scenario.run();
    let heading_variance = |form| {
        let (filter, _) = stepped(form, &run, [f64::INFINITY; 3]);
        filter.covariance().block(RobotId(1), RobotId(1)).unwrap()[(2, 2)]
    };
    // The invariant form keeps the information on common errors that the priors hold, no more; the textbook
    // form ends at less than half its variance.
    let consistent = heading_variance(ErrorForm::Invariant);
    let claimed = heading_variance(ErrorForm::Additive);
    assert!(claimed < 0.5 * consistent, "{claimed} against {consistent}");
}

#[test]
fn a_tick_may_be_taken_in_parts() {
    let tick = Tick {
        time: Timestamp::from_seconds(1.0),
        increment: Pose2::new(0.1, 0.02, 0.05),
        covariance: Matrix3::from_diagonal(&Vector3::new(1e-3, 2e-3, 1e-4)),
    };
    for form in [ErrorForm::Invariant, ErrorForm::Additive] {
        let team = || {
            let mut team = PerTickEkf::new(form, DEFAULT_GATE);
            let pose = Pose2::new(1.0, 2.0, 0.5);
            team.add_robot(RobotId(1), Timestamp(0), pose, &(Matrix3::identity() * 1e-2), [tick]);
            team
        };
        let (mut once, mut parts) = (team(), team());
        once.advance_to(tick.time);
        for seconds in [0.25, 0.3, 0.9, 1.0, 2.0] {
            parts.advance_to(Timestamp::from_seconds(seconds));
        }
        let robot = RobotId(1);
        assert!(once.pose(robot).unwrap().between(&parts.pose(robot).unwrap()).log().norm() < 1e-12);
        // The parts carry their noise through the rest of the step: second order in the increment.
        let (a, b) = (once.covariance().block(robot, robot), parts.covariance().block(robot, robot));
        assert!((a.unwrap() - b.unwrap()).amax() < 0.2 * 2e-3);
    }
}

#[test]
fn robots_that_are_not_there_are_skipped() {
    let mut filter = PerTickEkf::new(ErrorForm::Invariant, DEFAULT_GATE);
    filter.add_robot(RobotId(1), Timestamp(0), Pose2::identity(), &Matrix3::identity(), []);
    let range = |robot| Quantity::Robot { robot, relative: crate::sample::Relative::Range { range_m: 1.0 } };
    let measure = |observer, quantity| TimedMeasurement {
        time: Timestamp(1),
        observer,
        quantity,
        noise: Noise::from_sigmas(&[0.1]),
    };
    let outcomes = filter.run(&[
        measure(RobotId(1), range(RobotId(2))),
        measure(RobotId(2), range(RobotId(1))),
        measure(RobotId(1), range(RobotId(1))),
    ]);
    assert_eq!(
        outcomes,
        [SkipReason::Unplaced, SkipReason::Unplaced, SkipReason::Malformed].map(Outcome::Skipped)
    );
}

//! The equations of Roumeliotis & Bekey 2000, and the general case against the joint filter.

use super::super::facts::noise_matrix;
use super::super::models::{
    ErrorForm, Outcome, additive_from_invariant, adjoint, blocks, linearize, quarter_turn, wrapped,
};
use super::super::simulation::Scenario;
use super::super::{FactContent, JointEkf, facts_from_entries};
use super::*;
use crate::Pose2;
use crate::fact::{Absolute, NominalState, Quantity};

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);
const THREE: RobotId = RobotId(3);
const TEAM: [RobotId; 3] = [ONE, TWO, THREE];

fn close(a: &Matrix3, b: &Matrix3, what: &str) {
    assert!((a - b).amax() < 1e-12, "{what}: {a} {b}");
}

/// Positive definite, different for every robot.
fn block(seed: f64) -> Matrix3 {
    let a = Matrix3::new(1.0 + seed, 0.3, -0.2, 0.1 * seed, 0.8, 0.25, 0.2, -0.3, 0.6 + 0.2 * seed);
    a * a.transpose()
}

fn invert(m: &Matrix3) -> Matrix3 {
    m.cholesky().map_or_else(|| m.lu().solve(&Matrix3::identity()).unwrap(), |cholesky| cholesky.inverse())
}

fn noise() -> Matrix3 {
    Matrix3::new(0.2, 0.05, 0.0, 0.05, 0.3, 0.02, 0.0, 0.02, 0.1)
}

fn team() -> RoumeliotisBekey {
    let mut team = RoumeliotisBekey::new();
    for robot in TEAM {
        team.add(robot, Vector3::repeat(f64::from(robot.0)), block(f64::from(robot.0)));
    }
    team
}

fn p(team: &RoumeliotisBekey, i: RobotId, j: RobotId) -> Matrix3 {
    team.covariance(i, j).unwrap()
}

/// `H = [I -I]` and a fixed residual.
fn meet(team: &mut RoumeliotisBekey, a: RobotId, b: RobotId) -> Vector3 {
    let residual = Vector3::new(0.4, -0.3, 0.2);
    let identity = DMatrix::identity(3, 3);
    let r = DVector::from_column_slice(residual.as_slice());
    let noise = DMatrix::from_column_slice(3, 3, noise().as_slice());
    team.meet((a, &identity), (b, &-&identity), &r, &noise).unwrap();
    residual
}

fn transition(x: f64, y: f64) -> Matrix3 {
    Matrix3::new(1.0, 0.0, -y, 0.0, 1.0, x, 0.0, 0.0, 1.0)
}

#[test]
fn a_first_meeting_has_the_published_closed_form() {
    let mut team = team();
    let (p1, p2, p3) = (block(1.0), block(2.0), block(3.0));
    meet(&mut team, ONE, TWO);
    let s = invert(&(p1 + p2 + noise()));
    close(&p(&team, ONE, ONE), &(p1 - p1 * s * p1), "P_11");
    close(&p(&team, TWO, TWO), &(p2 - p2 * s * p2), "P_22");
    close(&p(&team, ONE, TWO), &(p1 * s * p2), "P_12");
    close(&p(&team, TWO, ONE), &(p2 * s * p1), "P_21");
    close(&p(&team, THREE, THREE), &p3, "P_33");
    close(&p(&team, ONE, THREE), &Matrix3::zeros(), "P_13");
    assert_eq!(team.state(THREE), Some(Vector3::repeat(3.0)));
}

#[test]
fn the_cross_covariance_after_a_first_meeting_has_the_published_inverse() {
    let mut team = team();
    meet(&mut team, ONE, TWO);
    let (p1, p2) = (invert(&block(1.0)), invert(&block(2.0)));
    let inverse = p(&team, ONE, TWO).lu().solve(&Matrix3::identity()).unwrap();
    let expected = p2 + p1 + p2 * noise() * p1;
    // Entries of the inverse are about 10: relative 1e-12.
    assert!((inverse - expected).amax() < 1e-12 * expected.amax().max(1.0), "{inverse} {expected}");
}

#[test]
fn later_meetings_have_the_published_gains_and_downdates() {
    let mut team = team();
    meet(&mut team, ONE, TWO);
    meet(&mut team, ONE, THREE);
    for robot in TEAM {
        let x = f64::from(robot.0);
        team.step(robot, Vector3::repeat(x), &transition(x, -0.5 * x), &(block(0.1 * x) * 0.01)).unwrap();
    }
    let before = team.clone();
    let q = |i, j| p(&before, i, j);
    let residual = meet(&mut team, TWO, THREE);
    let s = q(TWO, TWO) - q(TWO, THREE) - q(THREE, TWO) + q(THREE, THREE) + noise();
    let gain = |i| (q(i, TWO) - q(i, THREE)) * invert(&s);
    for i in TEAM {
        for j in TEAM {
            let expected = q(i, j) - gain(i) * s * gain(j).transpose();
            close(&p(&team, i, j), &expected, &format!("P_{i}{j}"));
        }
        let expected = before.state(i).unwrap() + gain(i) * residual;
        assert!((team.state(i).unwrap() - expected).amax() < 1e-12);
    }
}

#[test]
fn in_motion_a_robot_changes_its_own_factors_only() {
    let mut team = team();
    meet(&mut team, ONE, TWO);
    meet(&mut team, TWO, THREE);
    let before = team.clone();
    let (phi, q) = (transition(0.7, -1.2), block(0.5) * 0.1);
    team.step(TWO, Vector3::zeros(), &phi, &q).unwrap();
    close(&p(&team, TWO, TWO), &(phi * p(&before, TWO, TWO) * phi.transpose() + q), "P_22");
    for other in [ONE, THREE] {
        let factor = team.factor(TWO, other).unwrap();
        close(&factor, &(phi * before.factor(TWO, other).unwrap()), "s_2j");
        assert_eq!(team.factor(other, TWO), before.factor(other, TWO));
        close(&p(&team, TWO, other), &(phi * p(&before, TWO, other)), "P_2j");
        close(&p(&team, TWO, other), &(factor * team.factor(other, TWO).unwrap().transpose()), "s s^T");
    }
    assert_eq!(p(&team, ONE, THREE), p(&before, ONE, THREE));
}

/// The state of one robot at its last event, as the joint filter in additive form defines it.
struct Track {
    last: NominalState,
}

fn pose(state: &Vector3) -> Pose2 {
    Pose2::new(state.x, state.y, state.z)
}

#[test]
fn with_general_jacobians_it_is_the_joint_filter_in_additive_form() {
    for seed in [3, 4] {
        let run = Scenario { seed, robots: 4, ..Scenario::default() }.run();
        let facts = facts_from_entries(&run.entries);
        let oracle = JointEkf { form: ErrorForm::Additive, gate: [f64::INFINITY; 3] }.fold(&facts);

        let mut team = RoumeliotisBekey::new();
        let mut tracks: BTreeMap<RobotId, Track> = BTreeMap::new();
        for fact in &facts {
            let FactContent::Measurement(measurement) = &fact.content else { continue };
            let own = measurement.observer;
            let noise = noise_matrix(&measurement.noise).unwrap();
            if let (Quantity::Absolute(Absolute::Pose(z)), false) =
                (&measurement.quantity, tracks.contains_key(&own.robot))
            {
                let turned = additive_from_invariant(z) * adjoint(z);
                let covariance = turned * noise.fixed_view::<3, 3>(0, 0) * turned.transpose();
                team.add(own.robot, Vector3::new(z.x_m(), z.y_m(), z.yaw_rad()), covariance);
                tracks.insert(own.robot, Track { last: own.nominal });
                continue;
            }
            for state in std::iter::once(own).chain(measurement.observed) {
                let track = tracks.get_mut(&state.robot).unwrap();
                let from = pose(&team.state(state.robot).unwrap());
                let to = from.compose(&track.last.nominal.between(&state.nominal.nominal));
                let correction = from.compose(&track.last.nominal.inverse());
                let gained = state.nominal.noise_sum.minus(track.last.noise_sum).to_matrix();
                let map = additive_from_invariant(&to) * adjoint(&correction);
                let lever = quarter_turn() * (to.position() - from.position());
                team.step(
                    state.robot,
                    Vector3::new(to.x_m(), to.y_m(), to.yaw_rad()),
                    &blocks(&nalgebra::Matrix2::identity(), &lever),
                    &(map * gained * map.transpose()),
                )
                .unwrap();
                track.last = state.nominal;
            }
            let observer = pose(&team.state(own.robot).unwrap());
            let observed = measurement.observed.map(|state| pose(&team.state(state.robot).unwrap()));
            let linearized =
                linearize(ErrorForm::Additive, &measurement.quantity, &observer, observed.as_ref()).unwrap();
            let own_part = (own.robot, &linearized.d_measurement_d_observer);
            match (measurement.observed, &linearized.d_measurement_d_observed) {
                (Some(state), Some(h)) => {
                    team.meet(own_part, (state.robot, h), &linearized.residual, &noise).unwrap()
                }
                _ => team.fix(own_part, &linearized.residual, &noise).unwrap(),
            };
        }

        assert!(oracle.records.iter().all(|record| !matches!(record.outcome, Outcome::Skipped(_))));
        for (index, estimate) in oracle.robots.iter().enumerate() {
            let state = team.state(estimate.robot).unwrap();
            let expected = estimate.pose();
            let difference =
                [state.x - expected.x_m(), state.y - expected.y_m(), wrapped(state.z - expected.yaw_rad())];
            assert!(difference.iter().all(|d| d.abs() < 1e-9), "{difference:?}");
            for (column, other) in oracle.robots.iter().enumerate() {
                let expected =
                    oracle.covariance.matrix().fixed_view::<3, 3>(3 * index, 3 * column).into_owned();
                let block = team.covariance(estimate.robot, other.robot).unwrap();
                assert!((block - expected).amax() < 1e-9);
            }
        }
    }
}

#[test]
fn a_broadcast_grows_with_the_team_and_needs_two_rows_only() {
    let mut team = team();
    meet(&mut team, ONE, TWO);
    meet(&mut team, TWO, THREE);
    // The rows of robot 1 play no part in a meeting of 2 and 3.
    let mut blind = team.clone();
    blind.members.get_mut(&ONE).unwrap().row.clear();
    let identity = DMatrix::identity(3, 3);
    let (r, n) = (DVector::from_element(3, 0.1), DMatrix::identity(3, 3));
    let full = team.meet((TWO, &identity), (THREE, &-&identity), &r, &n).unwrap();
    let same = blind.meet((TWO, &identity), (THREE, &-&identity), &r, &n).unwrap();
    assert_eq!(full, same);
    assert_eq!(full.gains.len(), 3);
}

#[test]
fn misuse_is_an_error_that_says_what_was_wrong() {
    let mut team = team();
    let identity = DMatrix::identity(3, 3);
    let (r, n) = (DVector::zeros(3), DMatrix::identity(3, 3));
    let one = (ONE, &identity);
    assert_eq!(team.meet(one, one, &r, &n), Err(ReferenceError::SelfMeeting(ONE)));
    let stranger = RobotId(9);
    assert_eq!(team.meet(one, (stranger, &identity), &r, &n), Err(ReferenceError::UnknownRobot(stranger)));
    assert_eq!(team.fix(one, &DVector::zeros(2), &n), Err(ReferenceError::Shape { rows: 2 }));
    let negative = -10.0 * &identity;
    let outcome = team.fix(one, &r, &negative);
    assert_eq!(outcome, Err(ReferenceError::Singular { what: "the innovation covariance" }));
    let step = team.step(stranger, Vector3::zeros(), &Matrix3::identity(), &Matrix3::zeros());
    assert_eq!(step, Err(ReferenceError::UnknownRobot(stranger)));
}

//! Values against closed forms, derivatives against central differences, and the null space of a common motion.

use super::*;
use crate::geometry::{Tangent, ordered};
use proptest::prelude::*;

const STEP: f64 = 1e-6;

fn every_relative(observer: &Pose3, target: &Pose3, error: &Tangent6) -> Vec<Relative3> {
    // A measurement that is a little, or a lot, off what is predicted.
    let truth = observer.between(&target.compose(&Pose3::exp(error)));
    let direction = Direction::new(truth.position()).unwrap();
    let range_m = libm::sqrt(truth.position().dot(&truth.position()));
    vec![
        Relative3::Pose(truth),
        Relative3::Position(truth.position()),
        Relative3::Range(range_m),
        Relative3::Bearing(direction),
        Relative3::RangeBearing(range_m, direction),
    ]
}

fn moved(pose: &Pose3, axis: usize, by: f64) -> Pose3 {
    let mut step = Tangent6::zeros();
    step[axis] = by;
    Pose3::exp(&step).compose(pose)
}

/// The innovation falls by what the prediction grows: column by column by central differences.
fn differences(innovation: impl Fn(usize, f64) -> Tangent<6>) -> [Tangent6; 6] {
    [0, 1, 2, 3, 4, 5].map(|axis| (innovation(axis, -STEP) - innovation(axis, STEP)) / (2.0 * STEP))
}

fn check_columns(linearization: &Linearization<6>, sign: f64, found: &[Tangent6; 6], what: &str) {
    for (axis, column) in found.iter().enumerate() {
        for row in 0..6 {
            let stated = sign * linearization.jacobian[(row, axis)];
            let tolerance = 1e-7 * (1.0 + column.norm());
            assert!(
                (stated - column[row]).abs() < tolerance,
                "{what}: d row {row} d axis {axis}: {stated} {column}"
            );
        }
    }
}

/// Relative kinds: both robots. With an innovation of zero the derivative of a relative pose is exact, else to first order.
fn check_relative(observer: &Pose3, target: &Pose3, error: &Tangent6) {
    for relative in every_relative(observer, target, error) {
        let of = |a: &Pose3, b: &Pose3| Pose3::of_robot(&relative, a, b).unwrap();
        let at = of(observer, target);
        assert_eq!(at.dimension, relative.dimension());
        if matches!(relative, Relative3::Pose(_)) && error.norm() > 0.0 {
            continue;
        }
        let what = format!("{relative:?}");
        check_columns(
            &at,
            1.0,
            &differences(|axis, by| of(observer, &moved(target, axis, by)).innovation),
            &what,
        );
        check_columns(
            &at,
            -1.0,
            &differences(|axis, by| of(&moved(observer, axis, by), target).innovation),
            &what,
        );
        // A motion common to both changes nothing, whatever its size: not to first order only.
        let common = Pose3::exp(&Tangent6::new(3.0, -2.0, 1.0, 0.7, -1.1, 0.4));
        let both = of(&common.compose(observer), &common.compose(target));
        assert!(
            (both.innovation - at.innovation).norm() < 1e-12 * (1.0 + 10.0 * at.innovation.norm()),
            "{what}"
        );
        if matches!(relative, Relative3::Pose(_)) {
            continue;
        }
        // A landmark is a robot of whom the orientation is of no matter.
        assert_eq!(Pose3::of_point(&relative, observer, &target.position()).unwrap(), at);
    }
}

fn check_absolute(robot: &Pose3, error: &Tangent6) {
    let truth = robot.compose(&Pose3::exp(error));
    for absolute in [Absolute3::Pose(truth), Absolute3::Position(truth.position())] {
        if matches!(absolute, Absolute3::Pose(_)) && error.norm() > 0.0 {
            continue;
        }
        let at = Pose3::of_map(&absolute, robot);
        assert_eq!(at.dimension, absolute.dimension());
        let found = differences(|axis, by| Pose3::of_map(&absolute, &moved(robot, axis, by)).innovation);
        check_columns(&at, 1.0, &found, &format!("{absolute:?}"));
    }
}

#[test]
fn values_are_those_of_the_drawing() {
    // The observer at (1, 2, 3) looks along the map's y; the target is 2 ahead, 1 to the left and 2 up.
    let quarter = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let observer = Pose3::from_rotation_vector(Vector3::new(1.0, 2.0, 3.0), quarter);
    let target = Pose3::from_rotation_vector(Vector3::new(0.0, 4.0, 5.0), Vector3::new(0.3, 0.1, -0.2));
    let predicted = |relative| -Pose3::of_robot(&relative, &observer, &target).unwrap().innovation;
    let position = predicted(Relative3::Position(Vector3::zeros()));
    assert!((position - Tangent6::new(2.0, 1.0, 2.0, 0.0, 0.0, 0.0)).norm() < 1e-15);
    assert!((predicted(Relative3::Range(0.0))[0] - 3.0).abs() < 1e-15);
    // 90 degrees from the left-behind horizontal direction (1, -2, 0) to the line of sight (2, 1, 2).
    let side = Direction::new(Vector3::new(1.0, -2.0, 0.0)).unwrap();
    assert!((predicted(Relative3::Bearing(side)).norm() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    let position = Pose3::of_map(&Absolute3::Position(Vector3::new(1.5, 2.0, 3.0)), &observer).innovation;
    assert!((position - Tangent6::new(0.5, 0.0, 0.0, 0.0, 0.0, 0.0)).norm() < 1e-15);
}

#[test]
fn innovations_of_poses_are_their_noise() {
    let (a, b) = (
        Pose3::exp(&Tangent6::new(1.0, 2.0, 3.0, 0.5, -0.3, 0.9)),
        Pose3::exp(&Tangent6::new(-4.0, 0.0, 1.0, -1.5, 0.2, 0.4)),
    );
    let noise = Tangent6::new(0.1, -0.2, 0.05, 0.02, 0.01, -0.03);
    let relative = Relative3::Pose(a.between(&b).compose(&Pose3::exp(&noise)));
    assert!((Pose3::of_robot(&relative, &a, &b).unwrap().innovation - noise).norm() < 1e-14);
    let absolute = Absolute3::Pose(a.compose(&Pose3::exp(&noise)));
    assert!((Pose3::of_map(&absolute, &a).innovation - noise).norm() < 1e-14);
}

#[test]
fn a_pose_is_linear_to_second_order_in_errors_of_both() {
    // r = H_b (xi_b - xi_a) to first order: half the errors, a quarter of the remainder.
    let (a, b) = (
        Pose3::exp(&Tangent6::new(1.0, 2.0, 3.0, 0.5, -0.3, 0.9)),
        Pose3::exp(&Tangent6::new(-4.0, 0.0, 1.0, -1.5, 0.2, 0.4)),
    );
    let (xa, xb) =
        (Tangent6::new(0.2, 0.1, -0.1, 0.05, 0.1, -0.08), Tangent6::new(-0.1, 0.2, 0.15, -0.1, 0.02, 0.09));
    let remainder = |share: f64| {
        let truth = Pose3::exp(&(xa * share)).compose(&a).between(&Pose3::exp(&(xb * share)).compose(&b));
        let at = Pose3::of_robot(&Relative3::Pose(truth), &a, &b).unwrap();
        (at.innovation - ordered::times(&at.jacobian, &((xb - xa) * share))).norm()
    };
    let quotient = remainder(0.1) / remainder(0.05);
    assert!((3.7..4.3).contains(&quotient), "{quotient}");
}

#[test]
fn what_has_no_derivative_is_said_so() {
    let (a, close) = (Pose3::identity(), Pose3::new(Vector3::new(5e-4, 0.0, 0.0), [1.0, 0.0, 0.0, 0.0]));
    let bearing = Relative3::Bearing(Direction::new(Vector3::x()).unwrap());
    assert!(matches!(Pose3::of_robot(&Relative3::Range(1.0), &a, &close), Err(Unusable::TooClose { .. })));
    assert!(matches!(Pose3::of_robot(&bearing, &a, &close), Err(Unusable::TooClose { .. })));
    assert!(Pose3::of_robot(&Relative3::Position(Vector3::zeros()), &a, &close).is_ok());
    assert!(Pose3::of_robot(&Relative3::Position(Vector3::zeros()), &a, &a).is_ok());
    let behind = Vector3::new(-3.0, 0.0, 0.0);
    assert_eq!(Pose3::of_point(&bearing, &a, &behind), Err(Unusable::Opposite));
    assert_eq!(Pose3::of_point(&Relative3::Pose(a), &a, &behind), Err(Unusable::PointHasNoOrientation));
    for v in [Vector3::zeros(), Vector3::new(f64::NAN, 1.0, 0.0), Vector3::new(1.0, f64::INFINITY, 0.0)] {
        assert!(Direction::new(v).is_err());
    }
    assert!((Direction::new(Vector3::new(3e200, 0.0, -4e200)).unwrap().vector().x - 0.6).abs() < 1e-15);
}

fn pose() -> impl Strategy<Value = Pose3> {
    let (p, a) = (-10.0..10.0f64, -1.7..1.7f64);
    (p.clone(), p.clone(), p, a.clone(), a.clone(), a)
        .prop_map(|(x, y, z, a, b, c)| Pose3::exp(&Tangent6::new(x, y, z, a, b, c)))
}

proptest! {
    #[test]
    fn jacobians_match_central_differences(a in pose(), b in pose(), off in -0.4..0.4f64) {
        prop_assume!((a.position() - b.position()).norm() > 1.5);
        check_relative(&a, &b, &Tangent6::zeros());
        check_relative(&a, &b, &Tangent6::new(off, -off, 0.5 * off, 0.3 * off, off, -0.2 * off));
        check_absolute(&a, &Tangent6::zeros());
        check_absolute(&a, &Tangent6::new(off, 0.2, -off, 0.3, off, 0.1));
    }
}

//! Every Jacobian against central differences of the innovation under `X = exp(xi) X_hat`.

use super::*;
use proptest::prelude::*;

const STEP: f64 = 1e-6;

fn kinds() -> Vec<Relative> {
    vec![
        Relative::Pose(Pose2::new(1.0, 0.3, 0.4)),
        Relative::Position { x_m: 1.0, y_m: 0.3 },
        Relative::Range { range_m: 1.1 },
        Relative::Bearing { bearing_rad: 0.2 },
        Relative::RangeBearing { range_m: 1.1, bearing_rad: 0.2 },
    ]
}

/// What a perfect sensor would read.
fn perfect(kind: &Relative, observer: &Pose2, target: &Pose2) -> Relative {
    let seen = observer.between(target);
    let (range_m, bearing_rad) = (seen.position().norm(), seen.y_m().atan2(seen.x_m()));
    match kind {
        Relative::Pose(_) => Relative::Pose(seen),
        Relative::Position { .. } => Relative::Position { x_m: seen.x_m(), y_m: seen.y_m() },
        Relative::Range { .. } => Relative::Range { range_m },
        Relative::Bearing { .. } => Relative::Bearing { bearing_rad },
        Relative::RangeBearing { .. } => Relative::RangeBearing { range_m, bearing_rad },
    }
}

fn perturbed(pose: &Pose2, axis: usize, by: f64) -> Pose2 {
    let mut xi = Vector3::zeros();
    xi[axis] = by;
    Pose2::exp(xi).compose(pose)
}

/// Central difference of the innovation when the true pose moves by `xi` and the sensor is perfect.
fn check(jacobian: &Matrix3, innovation: impl Fn(usize, f64) -> Vector3, scale: f64) {
    for axis in 0..3 {
        let numeric = (innovation(axis, STEP) - innovation(axis, -STEP)) / (2.0 * STEP);
        let analytic = jacobian.column(axis).into_owned();
        assert!((numeric - analytic).norm() < 1e-6 * scale, "axis {axis}: {numeric} against {analytic}");
    }
}

fn check_all(a: &Pose2, b: &Pose2) {
    let distance = (a.position() - b.position()).norm();
    let scale = (1.0 + a.position().norm() + b.position().norm()) * (1.0 + 1.0 / distance.powi(3));
    for kind in kinds() {
        let z0 = perfect(&kind, a, b);
        let at = of_robot(&z0, a, b).unwrap();
        assert!(at.innovation.norm() < 1e-9 * scale);
        assert_eq!(at.dimension, dimension(&kind));
        let seen = |axis, by| of_robot(&perfect(&kind, a, &perturbed(b, axis, by)), a, b).unwrap().innovation;
        check(&at.jacobian, seen, scale);
        let observer =
            |axis, by| of_robot(&perfect(&kind, &perturbed(a, axis, by), b), a, b).unwrap().innovation;
        check(&(-at.jacobian), observer, scale);
        if !matches!(kind, Relative::Pose(_)) {
            let landmark = of_point(&z0, a, b.position()).unwrap();
            let by_landmark = |axis, by| {
                of_point(&perfect(&kind, &perturbed(a, axis, by), b), a, b.position()).unwrap().innovation
            };
            check(&(-landmark.jacobian), by_landmark, scale);
        }
    }
    let absolutes: [fn(&Pose2) -> Absolute; 3] = [
        |x| Absolute::Pose(*x),
        |x| Absolute::Position([x.x_m(), x.y_m()]),
        |x| Absolute::Heading(x.yaw_rad()),
    ];
    for measure in absolutes {
        let at = of_map(&measure(a), a);
        assert!(at.innovation.norm() < 1e-9);
        check(&at.jacobian, |axis, by| of_map(&measure(&perturbed(a, axis, by)), a).innovation, scale);
    }
}

#[test]
fn a_target_closer_than_a_millimetre_is_refused_except_by_position_and_pose() {
    let (a, b) = (Pose2::new(1.0, 1.0, 0.3), Pose2::new(1.0005, 1.0, 2.0));
    for kind in kinds() {
        let refused = of_robot(&kind, &a, &b).is_err();
        assert_eq!(refused, !matches!(kind, Relative::Pose(_) | Relative::Position { .. }), "{kind:?}");
    }
}

proptest! {
    #[test]
    fn jacobians_match_central_differences(ax in -20.0..20.0f64, ay in -20.0..20.0f64, at in -3.1..3.1f64,
                                           distance in 0.3..12.0f64, bearing in -3.1..3.1f64, bt in -3.1..3.1f64) {
        let a = Pose2::new(ax, ay, at);
        let b = Pose2::new(ax + distance * bearing.cos(), ay + distance * bearing.sin(), bt);
        check_all(&a, &b);
    }
}

//! One law suite, run at the identity, near the small-angle branch and at random.

use super::*;
use proptest::prelude::*;

fn close(a: &Pose2, b: &Pose2, tolerance: f64) -> bool {
    (a.position() - b.position()).norm() < tolerance
        && wrap_angle(a.yaw_rad() - b.yaw_rad()).abs() < tolerance
}

fn check_laws(v: Vector3, w: Vector3) {
    let (x, y) = (Pose2::exp(v), Pose2::exp(w));
    let scale = 1.0 + v.norm() + w.norm();
    assert!(close(&x.compose(&x.inverse()), &Pose2::identity(), 1e-13 * scale));
    assert!(close(&x.between(&y), &x.inverse().compose(&y), 1e-13 * scale));
    assert!((x.log() - v).norm() < 1e-12 * scale, "log(exp(v)) = {} for {v}", x.log());
    let conjugated = x.compose(&y).compose(&x.inverse());
    let through_adjoint = Pose2::exp(x.adjoint() * w);
    assert!(close(&conjugated, &through_adjoint, 1e-11 * scale * scale));
    let identity = x.additive_from_invariant() * x.invariant_from_additive();
    assert!((identity - Matrix3::identity()).norm() < 1e-13 * scale * scale);
    // J_l(v) = Ad(exp v) J_r(v), eq. 75.
    let right = Pose2::right_jacobian(v);
    assert!((Pose2::left_jacobian(v) - x.adjoint() * right).norm() < 1e-11 * scale);
}

/// Central differences of `exp(v + dv) exp(v)^-1` (left) and `exp(v)^-1 exp(v + dv)` (right).
fn check_jacobians(v: Vector3) {
    let h = 1e-6;
    let x = Pose2::exp(v);
    for column in 0..3 {
        let mut step = Vector3::zeros();
        step[column] = h;
        let (plus, minus) = (Pose2::exp(v + step), Pose2::exp(v - step));
        let left = (plus.compose(&x.inverse()).log() - minus.compose(&x.inverse()).log()) / (2.0 * h);
        let right = (x.between(&plus).log() - x.between(&minus).log()) / (2.0 * h);
        let scale = 1.0 + v.norm();
        assert!((Pose2::left_jacobian(v).column(column) - left).norm() < 1e-8 * scale);
        assert!((Pose2::right_jacobian(v).column(column) - right).norm() < 1e-8 * scale);
    }
}

#[test]
fn laws_hold_at_the_identity_and_around_the_small_angle_branch() {
    let w = Vector3::new(0.3, -0.2, 1.1);
    for angle in [0.0, 1e-12, 1e-8, 0.99e-4, 1e-4, 1.01e-4, 1e-3, -1e-8, -1e-4] {
        for (x, y) in [(0.0, 0.0), (1.0, 2.0), (-40.0, 7.0)] {
            check_laws(Vector3::new(x, y, angle), w);
            check_jacobians(Vector3::new(x, y, angle));
        }
    }
}

#[test]
fn exp_agrees_with_its_power_series() {
    // exp(hat v) by the Taylor series of the 3x3 matrix exponential: an independent route.
    for v in [Vector3::new(1.0, -2.0, 0.7), Vector3::new(0.1, 0.2, 1e-5), Vector3::new(-3.0, 0.5, -2.9)] {
        let hat = Matrix3::new(0.0, -v.z, v.x, v.z, 0.0, v.y, 0.0, 0.0, 0.0);
        let (mut sum, mut term) = (Matrix3::identity(), Matrix3::identity());
        for n in 1..60 {
            term = term * hat / f64::from(n);
            sum += term;
        }
        let x = Pose2::exp(v);
        assert!((x.x_m() - sum[(0, 2)]).abs() < 1e-13 && (x.y_m() - sum[(1, 2)]).abs() < 1e-13);
        assert!((x.yaw_rad().cos() - sum[(0, 0)]).abs() < 1e-13);
    }
}

#[test]
fn yaw_is_wrapped_to_the_half_open_interval() {
    for (angle, expected) in
        [(PI, PI), (-PI, PI), (3.0 * PI, PI), (-3.0 * PI, PI), (TAU, 0.0), (PI + 0.1, 0.1 - PI)]
    {
        assert!((wrap_angle(angle) - expected).abs() < 1e-12, "{angle} -> {}", wrap_angle(angle));
    }
}

proptest! {
    #[test]
    fn laws_hold_at_random(x in -50.0..50.0f64, y in -50.0..50.0f64, a in -3.1..3.1f64,
                           u in -5.0..5.0f64, v in -5.0..5.0f64, b in -3.0..3.0f64) {
        check_laws(Vector3::new(x, y, a), Vector3::new(u, v, b));
        check_jacobians(Vector3::new(x, y, a));
    }
}

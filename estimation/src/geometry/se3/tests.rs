//! What is particular to SE(3); the laws of a group are in `geometry::laws`.

use std::f64::consts::PI;

use super::*;
use proptest::prelude::*;

/// exp(hat v) by scaling, the Taylor series of the 4x4 matrix exponential, and squaring: an independent route.
fn by_power_series(v: &Tangent6) -> nalgebra::Matrix4<f64> {
    let (rho, phi) = parts(v);
    let mut hat = nalgebra::Matrix4::zeros();
    hat.fixed_view_mut::<3, 3>(0, 0).copy_from(&phi.cross_matrix());
    hat.fixed_view_mut::<3, 1>(0, 3).copy_from(&rho);
    hat /= 256.0;
    let (mut sum, mut term) = (nalgebra::Matrix4::identity(), nalgebra::Matrix4::identity());
    for n in 1..20 {
        term = term * hat / f64::from(n);
        sum += term;
    }
    for _ in 0..8 {
        sum *= sum;
    }
    sum
}

fn check_against_series(v: &Tangent6) {
    let (x, matrix) = (Pose3::exp(v), by_power_series(v));
    let tolerance = 1e-12 * (1.0 + v.norm());
    assert!((x.rotation() - matrix.fixed_view::<3, 3>(0, 0)).norm() < tolerance, "{v}");
    assert!((x.position() - matrix.fixed_view::<3, 1>(0, 3)).norm() < tolerance, "{v}");
}

#[test]
fn a_quarter_turn_about_z_takes_x_to_y() {
    let x = Pose3::from_rotation_vector(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.0, 0.0, PI / 2.0));
    assert!((x.act(&Vector3::x()) - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-15);
    assert!((x.rotate_back(&Vector3::y()) - Vector3::x()).norm() < 1e-15);
    assert!((x.rotation() * Vector3::x() - Vector3::y()).norm() < 1e-15);
}

#[test]
fn a_screw_about_z_climbs_its_helix() {
    // exp of (forward, 0, climb, 0, 0, turn) in closed form: a circle of radius forward/turn and a line.
    let (forward, climb, turn) = (2.0, 0.7, 1.3);
    let x = Pose3::exp(&Tangent6::new(forward, 0.0, climb, 0.0, 0.0, turn));
    let radius = forward / turn;
    let expected = Vector3::new(radius * libm::sin(turn), radius * (1.0 - libm::cos(turn)), climb);
    assert!((x.position() - expected).norm() < 1e-15);
}

#[test]
fn logarithm_at_a_half_turn_is_exact_and_its_axis_has_one_sign() {
    for axis in [Vector3::x(), -Vector3::y(), Vector3::new(-1.0, 2.0, 2.0) / 3.0] {
        let x = Pose3::from_rotation_vector(Vector3::new(1.0, -2.0, 0.5), axis * PI);
        let [w, ..] = x.quaternion();
        assert!((0.0..1e-15).contains(&w));
        let v = x.log();
        let phi = parts(&v).1;
        assert!((phi.norm() - PI).abs() < 1e-15 && phi.cross(&axis).norm() < 1e-15);
        check_against_series(&v);
    }
    // Both quaternions of a half turn with w = 0 give one pose.
    let (a, b) = ([0.0, 0.6, -0.8, 0.0], [0.0, -0.6, 0.8, 0.0]);
    assert_eq!(Pose3::new(Vector3::zeros(), a), Pose3::new(Vector3::zeros(), b));
}

#[test]
fn angles_beyond_a_half_turn_come_back_as_the_shorter_way() {
    let long = Vector3::new(0.0, 0.0, 1.5 * PI);
    let phi = Pose3::from_rotation_vector(Vector3::zeros(), long).rotation_vector();
    assert!((phi - Vector3::new(0.0, 0.0, -0.5 * PI)).norm() < 1e-15);
}

#[test]
fn quaternions_keep_length_and_sign_over_a_hundred_thousand_compositions() {
    let step = Pose3::exp(&Tangent6::new(1e-3, 2e-3, -1e-3, 0.01, -0.02, 0.015));
    let mut x = Pose3::identity();
    for _ in 0..100_000 {
        x = x.compose(&step);
        let [w, a, b, c] = x.quaternion();
        // Three roundings of half a unit in the last place each.
        assert!((w * w + a * a + b * b + c * c - 1.0).abs() < 1e-15 && w >= 0.0);
    }
    let r = x.rotation();
    assert!((r * r.transpose() - Matrix3::identity()).norm() < 4e-15);
}

#[test]
fn components_come_back_bit_for_bit_and_others_are_refused() {
    let x = Pose3::exp(&Tangent6::new(1.0, 2.0, 3.0, 0.4, -0.5, 2.6));
    assert_eq!(Pose3::from_components(x.components()), Some(x));
    let mut wrong = x.components();
    wrong[3] += 1e-9;
    assert_eq!(Pose3::from_components(wrong), None);
    let negative = x.components().map(|component| -component);
    assert_eq!(Pose3::from_components(negative), None);
    assert_eq!(Pose3::from_components([f64::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), None);
}

#[test]
fn no_angle_at_all_is_handled() {
    // Squares of these lengths underflow.
    for tiny in [0.0, 1e-200, 1e-300] {
        let v = Tangent6::new(1.0, 2.0, 3.0, tiny, -tiny, tiny);
        assert_eq!(Pose3::exp(&v).log(), v);
    }
}

#[test]
fn planar_motion_is_the_same_in_space() {
    let (v, w) = (Vector3::new(1.0, -0.4, 2.2), Vector3::new(-3.0, 0.7, -1.9));
    let in_space = |v: &Vector3| Pose3::exp(&Tangent6::new(v.x, v.y, 0.0, 0.0, 0.0, v.z));
    let planar = Pose2::exp(v).compose(&Pose2::exp(w));
    let spatial = in_space(&v).compose(&in_space(&w));
    assert!(spatial.between(&Pose3::from_planar(&planar)).log().norm() < 1e-14);
    let (ad2, ad3) = (planar.adjoint(), spatial.adjoint());
    for (row, i) in [0, 1, 5].into_iter().enumerate() {
        for (column, j) in [0, 1, 5].into_iter().enumerate() {
            assert!((ad2[(row, column)] - ad3[(i, j)]).abs() < 1e-14);
        }
    }
}

#[test]
fn published_errors_are_those_of_position_and_orientation() {
    let x = Pose3::exp(&Tangent6::new(3.0, -2.0, 1.0, 0.3, 0.2, -1.0));
    let h = 1e-6;
    for column in 0..6 {
        let mut step = Tangent6::zeros();
        step[column] = h;
        let moved = [step, -step].map(|step| Pose3::exp(&step).compose(&x));
        let position = (moved[0].position() - moved[1].position()) / (2.0 * h);
        let turned = moved.map(|moved| moved.compose(&x.inverse()).rotation_vector());
        let orientation = (turned[0] - turned[1]) / (2.0 * h);
        let stated = x.additive_from_invariant();
        for row in 0..3 {
            assert!((stated[(row, column)] - position[row]).abs() < 1e-9);
            assert!((stated[(3 + row, column)] - orientation[row]).abs() < 1e-9);
        }
    }
}

proptest! {
    #[test]
    fn exp_agrees_with_its_power_series(x in -9.0..9.0f64, y in -9.0..9.0f64, z in -9.0..9.0f64,
                                        a in -2.5..2.5f64, b in -2.5..2.5f64, c in -2.5..2.5f64, small in 0..9i32) {
        let shrunk = libm::pow(10.0, -f64::from(small));
        check_against_series(&Tangent6::new(x, y, z, a * shrunk, b * shrunk, c * shrunk));
    }
}

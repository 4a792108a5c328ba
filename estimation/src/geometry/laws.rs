//! The laws of a Lie group, written once and run for every group.

use std::f64::consts::PI;

use proptest::prelude::*;

use super::{LieGroup, Pose2, Pose3, Tangent, ordered};

/// How far apart two elements are, in the units of the tangent.
fn apart<G: LieGroup<D>, const D: usize>(a: &G, b: &G) -> f64 {
    a.between(b).log().norm()
}

/// A tangent of the group from six numbers, translation first, with the given angle.
trait FromSix<const D: usize> {
    fn tangent(six: &[f64; 6], angle: f64) -> Tangent<D>;
}

impl FromSix<3> for Pose2 {
    fn tangent(six: &[f64; 6], angle: f64) -> Tangent<3> {
        Tangent::<3>::new(six[0], six[1], angle)
    }
}

impl FromSix<6> for Pose3 {
    fn tangent(six: &[f64; 6], angle: f64) -> Tangent<6> {
        let axis = nalgebra::Vector3::new(six[3], six[4], six[5] + 1e-3).normalize() * angle;
        Tangent::<6>::new(six[0], six[1], six[2], axis.x, axis.y, axis.z)
    }
}

/// Every law at `X = exp(v)`, `Y = exp(w)`, `Z = exp(u)`. The angle of `v` is below pi.
///
/// Tolerances: rounding is relative to the lengths that enter, and once more to them where an adjoint carries a lever.
fn check<G: LieGroup<D>, const D: usize>(v: &Tangent<D>, w: &Tangent<D>, u: &Tangent<D>) {
    let (x, y, z) = (G::exp(v), G::exp(w), G::exp(u));
    let scale = 1.0 + v.norm() + w.norm() + u.norm();
    let (round, lever) = (1e-14 * scale, 1e-14 * scale * scale);

    // Axioms.
    let identity = G::identity();
    assert!(apart(&x.compose(&identity), &x) < round && apart(&identity.compose(&x), &x) < round);
    assert!(apart(&x.compose(&x.inverse()), &identity) < round);
    assert!(apart(&x.inverse().compose(&x), &identity) < round);
    assert!(apart(&x.compose(&y).compose(&z), &x.compose(&y.compose(&z))) < 2.0 * round);
    assert!(apart(&x.compose(&y).inverse(), &y.inverse().compose(&x.inverse())) < 2.0 * round);
    assert!(apart(&x.between(&y), &x.inverse().compose(&y)) < 2.0 * round);

    // exp and log.
    let back = x.log();
    assert!((back - v).norm() < 10.0 * round, "log(exp(v)) = {back} for {v}");
    assert!(apart(&G::exp(&back), &x) < 10.0 * round);
    assert!(apart(&G::exp(&-v), &x.inverse()) < 2.0 * round);
    assert!(apart(&G::exp(&(v * 0.3)).compose(&G::exp(&(v * 0.7))), &x) < 10.0 * round);

    // The adjoint: its definition, of a product, of an inverse.
    let ad = x.adjoint();
    let conjugated = x.compose(&y).compose(&x.inverse());
    assert!(apart(&conjugated, &G::exp(&ordered::times(&ad, w))) < 10.0 * lever);
    let of_product = x.compose(&y).adjoint();
    assert!((of_product - ordered::product(&ad, &y.adjoint())).norm() < 10.0 * lever);
    let inverse = ordered::product(&ad, &x.inverse().adjoint());
    assert!((inverse - super::Square::<D>::identity()).norm() < 10.0 * lever);

    // Bits.
    assert!(x.is_finite());
    assert!(x.words().eq(G::exp(v).words()) && (x == y) == x.words().eq(y.words()));
}

fn check_around_special_angles<G: LieGroup<D> + FromSix<D>, const D: usize>() {
    let (w, u) = ([0.3, -0.2, 0.8, 0.6, -0.5, 0.1], [-1.0, 0.4, 0.7, 0.1, 0.9, -0.3]);
    let (w, u) = (G::tangent(&w, 1.1), G::tangent(&u, -2.3));
    let near_pi = [1e-12, 1e-8, 1e-4, 1e-3].map(|below| PI - below);
    let small =
        [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 0.99e-4, 1e-4, 1.01e-4, 2e-4, 0.2, 0.299, 0.301, 0.499, 0.501];
    for angle in small.into_iter().chain(near_pi).flat_map(|angle| [angle, -angle]) {
        for six in
            [[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0, 1.0, 1.0, 1.0], [-40.0, 7.0, 2.0, 1.0, 0.0, 0.0]]
        {
            check::<G, D>(&G::tangent(&six, angle), &w, &u);
        }
    }
}

/// 1e5 steps along one screw motion, against the screw motion as a whole.
fn check_many_compositions<G: LieGroup<D> + FromSix<D>, const D: usize>() {
    let step = G::tangent(&[2e-4, 1e-4, -1e-4, 1.0, -2.0, 0.5], 1.7e-3);
    let mut x = G::identity();
    for _ in 0..100_000 {
        x = x.compose(&G::exp(&step));
    }
    // Rounding of 1e5 angles adds up to some 1e-12, with a lever of the screw's radius.
    let whole = G::exp(&(step * 1e5));
    assert!(apart(&x, &whole) < 1e-9, "{}", apart(&x, &whole));
    assert!(apart(&x.compose(&x.inverse()), &G::identity()) < 1e-13);
    // A rotation it still is: the adjoint keeps its determinant.
    assert!((x.adjoint().lu_determinant() - 1.0).abs() < 1e-12);
}

/// The determinant by elimination, whatever the size.
trait LuDeterminant {
    fn lu_determinant(&self) -> f64;
}

impl<const D: usize> LuDeterminant for super::Square<D> {
    fn lu_determinant(&self) -> f64 {
        nalgebra::DMatrix::from_column_slice(D, D, self.as_slice()).determinant()
    }
}

#[test]
fn laws_hold_in_the_plane_around_special_angles() {
    check_around_special_angles::<Pose2, 3>();
}

#[test]
fn laws_hold_in_space_around_special_angles() {
    check_around_special_angles::<Pose3, 6>();
}

#[test]
fn a_hundred_thousand_compositions_in_the_plane_stay_a_rigid_motion() {
    check_many_compositions::<Pose2, 3>();
}

#[test]
fn a_hundred_thousand_compositions_in_space_stay_a_rigid_motion() {
    check_many_compositions::<Pose3, 6>();
}

fn six(reach: f64) -> impl Strategy<Value = [f64; 6]> {
    let (p, a) = (-reach..reach, -1.0..1.0f64);
    (p.clone(), p.clone(), p, a.clone(), a.clone(), a).prop_map(|(x, y, z, a, b, c)| [x, y, z, a, b, c])
}

proptest! {
    #[test]
    fn laws_hold_at_random(v in six(50.0), w in six(5.0), u in six(20.0),
                           a in -3.13..3.13f64, b in -3.1..3.1f64, c in -3.1..3.1f64) {
        check::<Pose2, 3>(&Pose2::tangent(&v, a), &Pose2::tangent(&w, b), &Pose2::tangent(&u, c));
        check::<Pose3, 6>(&Pose3::tangent(&v, a), &Pose3::tangent(&w, b), &Pose3::tangent(&u, c));
    }
}

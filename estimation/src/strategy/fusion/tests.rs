//! Covariance intersection against closed forms, and its bound against the worst correlation found.

use super::*;

fn spd(seed: f64) -> Matrix3 {
    let a = Matrix3::new(1.0 + seed, 0.3, -0.2, 0.1 * seed, 0.8, 0.25, 0.2, -0.3, 0.6 + 0.2 * seed);
    a * a.transpose()
}

/// Another ellipsoid of about the same size: the axes exchanged.
fn turned(m: &Matrix3) -> Matrix3 {
    let exchange = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    0.9 * exchange * m * exchange.transpose()
}

fn inverse(m: &Matrix3) -> Matrix3 {
    m.cholesky().unwrap().inverse()
}

fn direct(correlated: Matrix3, independent: Matrix3) -> Measured {
    Measured {
        dimension: 3,
        innovation: Vector3::new(0.3, -0.2, 0.1),
        jacobian: Matrix3::identity(),
        correlated,
        independent: Matrix3::zeros(),
        noise: independent,
    }
}

#[test]
fn without_an_independent_part_it_is_covariance_intersection() {
    // Julier & Uhlmann 1997: P^-1 = w A^-1 + (1 - w) B^-1, x = P (w A^-1 a + (1 - w) B^-1 b).
    let (a, b) = (spd(0.5), spd(1.5));
    for weight in [0.1, 0.5, 0.8] {
        let prior = Split { correlated: a, independent: Matrix3::zeros() };
        let fused = fuse(&prior, &direct(b, Matrix3::zeros()), weight).unwrap();
        let expected = inverse(&(weight * inverse(&a) + (1.0 - weight) * inverse(&b)));
        assert!((fused.covariance - expected).amax() < 1e-12);
        let correction = expected * (1.0 - weight) * inverse(&b) * Vector3::new(0.3, -0.2, 0.1);
        assert!((fused.correction - correction).amax() < 1e-12);
        assert_eq!(fused.independent, Matrix3::zeros());
    }
}

#[test]
fn without_a_correlated_part_it_is_the_kalman_update_whatever_the_weight() {
    let (a, b) = (spd(0.5), spd(1.5));
    let expected = inverse(&(inverse(&a) + inverse(&b)));
    for weight in [0.1, 0.5, 0.9] {
        let prior = Split { correlated: Matrix3::zeros(), independent: a };
        let fused = fuse(&prior, &direct(Matrix3::zeros(), b), weight).unwrap();
        assert!((fused.covariance - expected).amax() < 1e-12);
        assert!((fused.independent - expected).amax() < 1e-12);
        assert!((fused.correction - expected * inverse(&b) * Vector3::new(0.3, -0.2, 0.1)).amax() < 1e-12);
    }
}

#[test]
fn two_scalars_of_equal_variance_and_perfect_ellipses_have_the_published_optimum() {
    // diag(4, 1) and diag(1, 4): by symmetry w = 1/2 and P = diag(1.6, 1.6), the closed form
    // 1 / (0.5/4 + 0.5/1). The third axis is alike in both, and stays.
    let (a, b) = (Vector3::new(4.0, 1.0, 2.0), Vector3::new(1.0, 4.0, 2.0));
    let prior = Split { correlated: Matrix3::from_diagonal(&a), independent: Matrix3::zeros() };
    let fused = fuse_best(&prior, &direct(Matrix3::from_diagonal(&b), Matrix3::zeros())).unwrap();
    assert!((fused.weight - 0.5).abs() < 1e-6, "{}", fused.weight);
    assert!((fused.covariance - Matrix3::from_diagonal(&Vector3::new(1.6, 1.6, 2.0))).amax() < 1e-6);
}

#[test]
fn what_is_worse_in_every_direction_says_nothing() {
    let prior = Split { correlated: spd(0.5), independent: Matrix3::zeros() };
    assert_eq!(fuse_best(&prior, &direct(3.0 * spd(0.5), Matrix3::zeros())), None);
}

#[test]
fn the_weight_has_the_least_determinant_of_a_fine_grid() {
    let prior = Split { correlated: spd(0.5), independent: 0.1 * spd(2.0) };
    let mut measured = direct(0.5 * spd(1.5), 0.05 * spd(1.0));
    measured.dimension = 2;
    measured.jacobian.set_row(2, &Vector3::zeros().transpose());
    for matrix in [&mut measured.correlated, &mut measured.noise] {
        for k in 0..3 {
            (matrix[(2, k)], matrix[(k, 2)]) = (0.0, 0.0);
        }
    }
    let best = fuse_best(&prior, &measured).unwrap().covariance.determinant();
    for step in 1..1000 {
        let other = fuse(&prior, &measured, f64::from(step) / 1000.0).unwrap().covariance.determinant();
        assert!(best <= other * (1.0 + 1e-9), "{step}: {best} {other}");
    }
}

/// The true covariance of the fused error `(I - K H) e + K n` for a given cross-covariance `E[e n^T]`.
fn truth(a: &Matrix3, b: &Matrix3, cross: &Matrix3, gain: &Matrix3) -> Matrix3 {
    let keep = Matrix3::identity() - gain;
    keep * a * keep.transpose()
        + gain * b * gain.transpose()
        + keep * cross * gain.transpose()
        + gain * cross.transpose() * keep.transpose()
}

fn least_eigenvalue(m: &Matrix3) -> f64 {
    m.symmetric_eigen().eigenvalues.min()
}

/// Cross-covariances `L_a W L_b^T` with `W` orthogonal: the extreme ones, of which all others are
/// averages.
fn extremes(a: &Matrix3, b: &Matrix3) -> Vec<Matrix3> {
    let (la, lb) = (a.cholesky().unwrap().l(), b.cholesky().unwrap().l());
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    };
    (0..4000).map(|_| la * Matrix3::from_fn(|_, _| random()).qr().q() * lb.transpose()).collect()
}

#[test]
fn the_fused_covariance_bounds_the_worst_correlation_and_the_naive_one_does_not() {
    let (a, b) = (spd(0.5), turned(&spd(0.5)));
    let prior = Split { correlated: a, independent: Matrix3::zeros() };
    let fused = fuse_best(&prior, &direct(b, Matrix3::zeros())).unwrap();
    let naive =
        fuse(&Split { correlated: Matrix3::zeros(), independent: a }, &direct(Matrix3::zeros(), b), 0.5);
    let naive = naive.unwrap();
    let (mut worst, mut worst_naive) = (f64::INFINITY, f64::INFINITY);
    for cross in extremes(&a, &b) {
        worst = worst.min(least_eigenvalue(&(fused.covariance - truth(&a, &b, &cross, &fused.gain))));
        worst_naive =
            worst_naive.min(least_eigenvalue(&(naive.covariance - truth(&a, &b, &cross, &naive.gain))));
    }
    assert!(worst > -1e-12, "{worst}");
    // The bound is tight: some correlation comes near it. Without intersection it is far exceeded.
    assert!(worst < 0.05 * fused.covariance.amax(), "{worst}");
    assert!(worst_naive < -0.1 * naive.covariance.amax(), "{worst_naive}");
}

#[test]
fn the_split_form_bounds_the_worst_correlation_of_the_parts_that_may_have_one_and_is_tighter() {
    let (a, b) = (spd(0.5), turned(&spd(0.5)));
    let (own, theirs) = (0.3 * spd(1.2), 0.4 * spd(0.7));
    let prior = Split { correlated: a, independent: own };
    let fused = fuse_best(&prior, &direct(b, theirs)).unwrap();
    let plain_prior = Split { correlated: a + own, independent: Matrix3::zeros() };
    let plain = fuse_best(&plain_prior, &direct(b + theirs, Matrix3::zeros())).unwrap();
    assert!(fused.covariance.determinant() < plain.covariance.determinant());
    for cross in extremes(&a, &b) {
        let truth = truth(&(a + own), &(b + theirs), &cross, &fused.gain);
        assert!(least_eigenvalue(&(fused.covariance - truth)) > -1e-12);
    }
    // The parts add up, and what is left of the independent one is a covariance.
    assert!(least_eigenvalue(&(fused.covariance - fused.independent)) > -1e-12);
    assert!(least_eigenvalue(&fused.independent) > 0.0);
}

#[test]
fn a_difference_that_is_indefinite_by_rounding_becomes_a_covariance() {
    let m = Matrix3::new(1.0, 1.0, 0.0, 1.0, 1.0 - 1e-9, 0.0, 0.0, 0.0, 1.0);
    let fixed = positive(&m);
    assert!((fixed - m).amax() < 1e-8);
    assert!(Symmetric3::from_lower(&fixed).is_positive_semidefinite());
}

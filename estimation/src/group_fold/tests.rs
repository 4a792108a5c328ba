//! Parts of the fold, for both groups where they do not depend on what is measured.

use nalgebra::{DMatrix, SymmetricEigen};
use proptest::prelude::*;

use super::*;
use crate::Timestamp;
use crate::geometry::{LieGroup, Pose2, Pose3, Square, Tangent, ordered};
use crate::symmetric::Symmetric3;

/// Numbers between -1 and 1 from a congruential generator: enough to fill matrices.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }
}

fn random_symmetric<const D: usize>(next: &mut impl FnMut() -> f64, lift: f64) -> Symmetric<D> {
    let packed: Vec<f64> = (0..D)
        .flat_map(|row| (0..=row).map(move |column| row == column))
        .map(|diagonal| if diagonal { next() + lift } else { next() })
        .collect();
    Symmetric::from_packed(&packed).unwrap()
}

#[test]
fn definiteness_agrees_with_the_eigenvalues() {
    let mut next = numbers(5);
    let (mut definite, mut indefinite) = (0, 0);
    for _ in 0..2000 {
        let matrix = random_symmetric::<6>(&mut next, 2.2);
        let least = SymmetricEigen::new(matrix.to_matrix()).eigenvalues.min();
        if least.abs() < 1e-9 {
            continue;
        }
        assert_eq!(matrix.is_positive_semidefinite(), least > 0.0, "{matrix:?}");
        if least > 0.0 { definite += 1 } else { indefinite += 1 }
    }
    assert!(definite > 100 && indefinite > 100, "{definite} {indefinite}");
    assert!(Symmetric::<6>::zero().is_positive_semidefinite());
    assert!(Symmetric::diagonal([1.0, 0.0, 0.0, 2.0, 0.0, 0.0]).is_positive_semidefinite());
    assert!(!Symmetric::diagonal([1.0, 0.0, -1e-6, 2.0, 0.0, 0.0]).is_positive_semidefinite());
    assert!(!Symmetric::diagonal([f64::NAN, 1.0, 1.0]).is_positive_semidefinite());
}

#[test]
fn congruence_is_that_of_whole_matrices_and_keeps_the_packing() {
    let mut next = numbers(6);
    let s = random_symmetric::<6>(&mut next, 0.0);
    let a = Square::<6>::from_fn(|_, _| next());
    // The independent route: nalgebra's own products.
    let expected = a * s.to_matrix() * a.transpose();
    assert!((s.congruence(&a).to_matrix() - expected).norm() < 1e-13);
    let packed: Vec<f64> = s.packed().collect();
    assert_eq!((packed.len(), Symmetric::<6>::PACKED), (21, 21));
    assert_eq!(Symmetric::from_packed(&packed), Some(s));
    assert_eq!(Symmetric::<6>::from_packed(&packed[1..]), None);
}

#[test]
fn in_the_plane_the_bits_are_those_of_the_planar_type() {
    let mut next = numbers(7);
    for _ in 0..200 {
        let s = random_symmetric::<3>(&mut next, 1.0);
        let planar = Symmetric3(std::array::from_fn(|index| s.packed().nth(index).unwrap()));
        let a = Pose2::new(next() * 9.0, next() * 9.0, next() * 3.0).adjoint();
        assert!(s.congruence(&a).packed().eq(planar.congruence(&a).0));
        assert_eq!(s.is_positive_semidefinite(), planar.is_positive_semidefinite());
    }
}

/// A screw motion with process noise: interpolation, and the noise sum by an independent route.
fn check_trajectory<G: LieGroup<D>, const D: usize>(motion: &Tangent<D>, covariance: &Symmetric<D>) {
    let start = G::exp(&(motion * -17.0));
    let mut trajectory = Trajectory::new(Timestamp(0), start, 1000);
    let tick = |k: i64| Timestamp(k * 10_000_000);
    for k in 0..300 {
        let step = Step { from: tick(k), to: tick(k + 1), motion: *motion, covariance: *covariance };
        trajectory.extend(&step).unwrap();
    }
    // P <- F P F^T + Q in the body frame of the moving robot, F = Ad(exp(-u)).
    let f = G::exp(&-motion).adjoint();
    let mut body = Square::<D>::zeros();
    for _ in 0..300 {
        body = f * body * f.transpose() + covariance.to_matrix();
    }
    let (_, end) = trajectory.end();
    let carried = end.noise_sum.congruence(&end.nominal.inverse().adjoint()).to_matrix();
    assert!((carried - body).norm() < 1e-11 * body.norm());
    // Interpolation lies on the screw, the noise between its neighbours.
    let state = trajectory.at(Timestamp(1_503_700_000)).unwrap();
    let expected = start.compose(&G::exp(&(motion * 150.37)));
    assert!(state.nominal.between(&expected).log().norm() < 1e-11);
    let (before, after) = (trajectory.at(tick(150)).unwrap(), trajectory.at(tick(151)).unwrap());
    assert!(state.noise_sum.minus(&before.noise_sum).is_positive_semidefinite());
    assert!(after.noise_sum.minus(&state.noise_sum).is_positive_semidefinite());
    assert_eq!(trajectory.at(tick(300)), Ok(end));
    check_refusals(trajectory, motion, covariance);
}

fn check_refusals<G: LieGroup<D>, const D: usize>(
    mut trajectory: Trajectory<G, D>,
    motion: &Tangent<D>,
    covariance: &Symmetric<D>,
) {
    assert_eq!(trajectory.at(Timestamp(-1)), Err(Outside::Before));
    assert_eq!(trajectory.at(Timestamp(3_000_000_001)), Err(Outside::After));
    let (end, before) = trajectory.end();
    let good = Step { from: end, to: Timestamp(end.0 + 1), motion: *motion, covariance: *covariance };
    let late = Step { from: Timestamp(end.0 + 1), to: Timestamp(end.0 + 2), ..good };
    assert!(matches!(trajectory.extend(&late), Err(StepRefused::Gap { .. })));
    assert!(matches!(trajectory.extend(&Step { to: end, ..good }), Err(StepRefused::NoTime { .. })));
    let infinite = Step { motion: motion / 0.0, ..good };
    assert_eq!(trajectory.extend(&infinite), Err(StepRefused::Motion));
    let negative = Step { covariance: covariance.scaled(-1.0), ..good };
    assert_eq!(trajectory.extend(&negative), Err(StepRefused::Covariance));
    assert_eq!(trajectory.end(), (end, before));
    for k in 0..2000 {
        let at = |k: i64| Timestamp(end.0 + k);
        trajectory.extend(&Step { from: at(k), to: at(k + 1), ..good }).unwrap();
    }
    assert_eq!(trajectory.at(Timestamp(5_000)), Err(Outside::Forgotten));
}

#[test]
fn trajectories_in_the_plane_and_in_space_interpolate_and_accumulate() {
    let planar = Tangent::<3>::new(0.008, 0.001, 0.004);
    check_trajectory::<Pose2, 3>(&planar, &Symmetric::diagonal([1e-4, 1e-6, 4e-5]));
    let spatial = Tangent::<6>::new(0.008, 0.001, -0.002, 0.002, -0.003, 0.005);
    let covariance = Symmetric::diagonal([1e-4, 2e-5, 1e-6, 4e-5, 3e-6, 1e-5]);
    check_trajectory::<Pose3, 6>(&spatial, &covariance);
}

/// A covariance with cross terms, as after many updates: `A A^T` of random numbers.
fn filled<const D: usize>(
    blocks: usize,
    next: &mut impl FnMut() -> f64,
) -> (TeamCovariance<D>, DMatrix<f64>) {
    let size = D * blocks;
    let factor = DMatrix::from_fn(size, size, |_, _| next());
    let dense = &factor * factor.transpose();
    let mut covariance = TeamCovariance::<D>::default();
    for _ in 0..blocks {
        covariance.grow();
    }
    for column in factor.column_iter() {
        covariance.add_outer_for_tests(column.as_slice());
    }
    (covariance, dense)
}

fn check_update<const D: usize>(dimension: usize, seed: u64) {
    let mut next = numbers(seed);
    let (mut covariance, dense) = filled::<D>(4, &mut next);
    let jacobian = Square::<D>::from_fn(|row, _| if row < dimension { next() } else { 0.0 });
    let other = Square::<D>::from_fn(|row, _| if row < dimension { next() } else { 0.0 });
    let innovation = Tangent::<D>::from_fn(|row, _| if row < dimension { next() } else { 0.0 });
    let noise = Symmetric::<D>::from_sigmas([0.3; D]);
    let participants = [
        covariance::Participant { index: 2, jacobian },
        covariance::Participant { index: 0, jacobian: other },
    ];
    let prepared = covariance.prepare(dimension, &innovation, &noise, &participants).unwrap();
    covariance.downdate(&prepared);
    // The independent route: dense gain and the Joseph form.
    let mut h = DMatrix::zeros(dimension, 4 * D);
    h.view_mut((0, 2 * D), (dimension, D)).copy_from(&jacobian.view((0, 0), (dimension, D)));
    h.view_mut((0, 0), (dimension, D)).copy_from(&other.view((0, 0), (dimension, D)));
    let r = DMatrix::identity(dimension, dimension) * 0.09;
    let s = &h * &dense * h.transpose() + &r;
    let inverse = s.cholesky().unwrap().inverse();
    let gain = &dense * h.transpose() * &inverse;
    let keep = DMatrix::identity(4 * D, 4 * D) - &gain * &h;
    let expected = &keep * &dense * keep.transpose() + &gain * r * gain.transpose();
    assert!((covariance.to_dense() - &expected).amax() < 1e-11 * dense.amax());
    let innovation = nalgebra::DVector::from_iterator(dimension, innovation.iter().copied().take(dimension));
    assert!((prepared.nis() - innovation.dot(&(&inverse * &innovation))).abs() < 1e-10);
    let correction = gain * innovation;
    for index in 0..4 {
        let part = correction.rows(D * index, D).into_owned();
        let found = DMatrix::from_column_slice(D, 1, prepared.correction(index).as_slice());
        assert!((found - part).amax() < 1e-10);
    }
}

#[test]
fn updates_of_every_dimension_agree_with_the_dense_joseph_form() {
    for dimension in 1..=6 {
        check_update::<6>(dimension, dimension as u64);
    }
    for dimension in 1..=3 {
        check_update::<3>(dimension, 40 + dimension as u64);
    }
}

proptest! {
    #[test]
    fn the_ordered_cholesky_solves(seed in 0u64..1_000_000) {
        let mut next = numbers(seed);
        let factor = Square::<6>::from_fn(|_, _| next());
        let s = factor * factor.transpose() + Square::<6>::identity() * 0.1;
        let v = Tangent::<6>::from_fn(|_, _| next());
        let l = ordered::cholesky(6, &s).unwrap();
        prop_assert!((l * l.transpose() - s).norm() < 1e-13);
        prop_assert!((l * ordered::forward(6, &l, &v) - v).norm() < 1e-12);
    }
}

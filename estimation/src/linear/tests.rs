use nalgebra::{Matrix1, Matrix2, Matrix3, Vector1, Vector2, Vector3};

use super::*;

/// A belief about three correlated states.
fn belief() -> Gaussian<3> {
    let factor = Matrix3::new(0.5, 0.0, 0.0, 0.2, 0.4, 0.0, -0.3, 0.1, 0.6);
    Gaussian::new(Vector3::new(1.0, -2.0, 0.5), factor * factor.transpose())
}

fn close<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, b: &SMatrix<f64, R, C>, within: f64) {
    assert!((a - b).abs().max() < within, "{a} {b}");
}

#[test]
fn an_update_agrees_with_the_information_form() {
    // P+^-1 = P^-1 + H^T R^-1 H and P+^-1 x+ = P^-1 x + H^T R^-1 z: another route to the same posterior.
    let observation = SMatrix::<f64, 2, 3>::new(1.0, 0.5, 0.0, 0.0, -1.0, 2.0);
    let noise = Matrix2::new(0.3, 0.1, 0.1, 0.2);
    let measured = Vector2::new(0.2, 3.0);
    let before = belief();
    let mut after = before;
    let correction = after.update(&measured, &observation, &noise).unwrap();

    let inverse = |m: Matrix3<f64>| Cholesky::new(m).unwrap().inverse();
    let information = inverse(before.covariance);
    let weight = Cholesky::new(noise).unwrap().inverse();
    let covariance = inverse(information + observation.transpose() * weight * observation);
    let mean = covariance * (information * before.mean + observation.transpose() * weight * measured);
    close(&after.covariance, &covariance, 1e-13);
    close(&after.mean, &mean, 1e-13);
    // The gain is the weight of the measurement in the posterior: P+ H^T R^-1.
    close(&correction.gain, &(covariance * observation.transpose() * weight), 1e-13);
}

#[test]
fn scalars_one_after_the_other_do_what_all_at_once_do() {
    let observation = SMatrix::<f64, 2, 3>::new(1.0, 0.5, 0.0, 0.0, -1.0, 2.0);
    let measured = Vector2::new(0.2, 3.0);
    let mut at_once = belief();
    let joint = at_once.update(&measured, &observation, &Matrix2::new(0.3, 0.0, 0.0, 0.2)).unwrap();
    let mut one_by_one = belief();
    let mut nis = 0.0;
    for (k, variance) in [0.3, 0.2].into_iter().enumerate() {
        let row = observation.row(k).transpose();
        let innovation = measured[k] - row.dot(&one_by_one.mean);
        nis += one_by_one.correct_scalar(innovation, &row, variance).unwrap().nis;
    }
    close(&at_once.mean, &one_by_one.mean, 1e-14);
    close(&at_once.covariance, &one_by_one.covariance, 1e-14);
    // The likelihood factors, so the sums of squares agree as well.
    assert!((joint.nis - nis).abs() < 1e-12);
}

#[test]
fn josephs_form_stays_positive_where_the_short_form_does_not() {
    // A sensor 1e8 times better than the prior: P - K S K^T loses the posterior's seven digits.
    let mut belief = Gaussian::from_sigmas([0.0, 0.0], [1.0, 1.0]);
    belief.covariance[(0, 1)] = 1.0 - 1e-12;
    belief.covariance[(1, 0)] = 1.0 - 1e-12;
    for _ in 0..50 {
        belief.correct_scalar(0.1, &Vector2::new(1.0, 1.0), 1e-16).unwrap();
        belief.correct_scalar(0.1, &Vector2::new(1.0, 0.0), 1e-16).unwrap();
        assert!(belief.covariance[(0, 0)] > 0.0 && belief.covariance[(1, 1)] > 0.0);
        assert!(belief.covariance.determinant() >= 0.0, "{}", belief.covariance);
    }
}

#[test]
fn a_constant_measured_k_times_is_the_mean_of_the_measurements() {
    // Q = 0 and a vague prior: the filter is the running mean, with gain 1/k up to R/(k P0).
    let mut belief = Gaussian::from_sigmas([0.0], [1e6]);
    let values = [0.3, 0.9, -0.2, 0.4, 1.1];
    for (k, value) in values.iter().enumerate() {
        let correction =
            belief.update(&Vector1::new(*value), &Matrix1::new(1.0), &Matrix1::new(0.25)).unwrap();
        assert!((correction.gain[0] - 1.0 / (k + 1) as f64).abs() < 1e-11);
    }
    assert!((belief.mean[0] - 0.5).abs() < 1e-11);
    assert!((belief.covariance[(0, 0)] - 0.25 / 5.0).abs() < 1e-11);
}

#[test]
fn what_cannot_be_used_leaves_the_belief_as_it_was() {
    let mut used = belief();
    let row = Vector3::new(1.0, 0.0, 0.0);
    assert_eq!(used.correct_scalar(f64::NAN, &row, 1.0).unwrap_err(), LinearError::NotFinite);
    assert_eq!(used.correct_scalar(1.0, &row, -9.0).unwrap_err(), LinearError::NotPositiveDefinite);
    let indefinite = Matrix2::new(-9.0, 0.0, 0.0, 1.0);
    let observation = SMatrix::<f64, 2, 3>::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let refused = used.update(&Vector2::zeros(), &observation, &indefinite);
    assert_eq!(refused.unwrap_err(), LinearError::NotPositiveDefinite);
    assert_eq!(used, belief());
}

use super::super::simulation::{disturbed, observe, relative_templates, sigmas, templates};
use super::*;
use crate::geometry::Vector3;
use crate::{LandmarkId, RobotId};

const FORMS: [ErrorForm; 2] = [ErrorForm::Invariant, ErrorForm::Additive];

fn poses() -> [(Pose2, Pose2); 4] {
    [
        (Pose2::new(1.0, -2.0, 0.4), Pose2::new(3.5, 1.0, -2.0)),
        (Pose2::new(-20.0, 7.0, 3.1), Pose2::new(-18.0, 7.5, -3.0)),
        (Pose2::identity(), Pose2::new(0.0, 4.0, 1.0)),
        (Pose2::new(100.0, 50.0, -1.5), Pose2::new(95.0, 51.0, 1.5)),
    ]
}

/// The pose whose error from `pose` is `error`.
fn moved(form: ErrorForm, pose: &Pose2, error: Vector3) -> Pose2 {
    match form {
        ErrorForm::Invariant => Pose2::exp(error).compose(pose),
        ErrorForm::Additive => {
            Pose2::new(pose.x_m() + error.x, pose.y_m() + error.y, pose.yaw_rad() + error.z)
        }
    }
}

/// Derivative of the residual by the true state, the estimate held fixed.
fn numerical(
    form: ErrorForm,
    template: &Quantity,
    a: &Pose2,
    b: &Pose2,
    step: impl Fn(Vector3) -> (Pose2, Pose2),
) -> DMatrix<f64> {
    const STEP: f64 = 1e-6;
    let residual = |error: Vector3| {
        let (true_a, true_b) = step(error);
        linearize(form, &observe(template, &true_a, Some(&true_b)), a, Some(b)).unwrap().residual
    };
    let columns: Vec<DVector<f64>> = (0..3)
        .map(|axis| {
            let mut error = Vector3::zeros();
            error[axis] = STEP;
            (residual(error) - residual(-error)) / (2.0 * STEP)
        })
        .collect();
    DMatrix::from_columns(&columns)
}

#[test]
fn jacobians_of_every_kind_match_central_differences_in_both_forms() {
    for form in FORMS {
        for (a, b) in poses() {
            for template in templates(RobotId(2)) {
                let exact = observe(&template, &a, Some(&b));
                let linearized = linearize(form, &exact, &a, Some(&b)).unwrap();
                assert!(linearized.residual.amax() < 1e-12, "{form:?} {template:?}");
                assert_eq!(linearized.residual.len(), sigmas(&template).len());
                // Truncation of central differences is about 1e-12 relative, rounding 1e-16 / 1e-6 times
                // coordinates of 100 m.
                let tolerance = 1e-7;
                let by_a = numerical(form, &template, &a, &b, |error| (moved(form, &a, error), b));
                let difference = (by_a - &linearized.d_measurement_d_observer).amax();
                assert!(difference < tolerance, "{form:?} {template:?} observer: {difference:e}");
                let by_b = numerical(form, &template, &a, &b, |error| (a, moved(form, &b, error)));
                match &linearized.d_measurement_d_observed {
                    Some(jacobian) => assert!((by_b - jacobian).amax() < tolerance, "{form:?} {template:?}"),
                    None => assert!(by_b.amax() < 1e-12),
                }
            }
        }
    }
}

#[test]
fn invariant_jacobians_are_the_additive_ones_times_the_change_of_coordinates() {
    for (a, b) in poses() {
        for template in templates(RobotId(2)) {
            let exact = observe(&template, &a, Some(&b));
            let invariant = linearize(ErrorForm::Invariant, &exact, &a, Some(&b)).unwrap();
            let additive = linearize(ErrorForm::Additive, &exact, &a, Some(&b)).unwrap();
            let changed = additive.d_measurement_d_observer * dynamic(&additive_from_invariant(&a));
            assert!((changed - invariant.d_measurement_d_observer).amax() < 1e-11, "{template:?}");
            if let (Some(add), Some(inv)) =
                (additive.d_measurement_d_observed, invariant.d_measurement_d_observed)
            {
                assert!((add * dynamic(&additive_from_invariant(&b)) - inv).amax() < 1e-11);
            }
        }
    }
}

#[test]
fn a_common_invariant_error_is_invisible_to_every_relative_measurement() {
    for (a, b) in poses() {
        for relative in relative_templates() {
            let quantity = observe(&Quantity::Robot { robot: RobotId(2), relative }, &a, Some(&b));
            let linearized = linearize(ErrorForm::Invariant, &quantity, &a, Some(&b)).unwrap();
            let sum = linearized.d_measurement_d_observer + linearized.d_measurement_d_observed.unwrap();
            assert!(sum.amax() < 1e-12);
        }
    }
}

#[test]
fn residuals_are_the_noise_and_angles_are_wrapped() {
    for (a, b) in poses() {
        for template in templates(RobotId(2)) {
            let noise: Vec<f64> = [0.01, -0.02, 0.015][..sigmas(&template).len()].to_vec();
            let read = disturbed(&observe(&template, &a, Some(&b)), &noise);
            let residual = linearize(ErrorForm::Invariant, &read, &a, Some(&b)).unwrap().residual;
            assert!((residual - DVector::from_vec(noise)).amax() < 1e-12, "{template:?}");
        }
    }
    let behind = Pose2::new(-2.0, -1.0, 0.0);
    let read = Quantity::Robot { robot: RobotId(2), relative: Relative::Bearing { bearing_rad: 3.0 } };
    let residual =
        linearize(ErrorForm::Invariant, &read, &Pose2::identity(), Some(&behind)).unwrap().residual;
    // The bearing is atan(1/2) - pi.
    assert!((residual[0] - (3.0 - 0.5_f64.atan() - std::f64::consts::PI)).abs() < 1e-12);
    let read = Quantity::Absolute(Absolute::Heading(3.1));
    let residual = linearize(ErrorForm::Additive, &read, &Pose2::new(0.0, 0.0, -3.1), None).unwrap().residual;
    assert!((residual[0] - (6.2 - std::f64::consts::TAU)).abs() < 1e-12);
}

#[test]
fn what_cannot_be_linearized_says_why() {
    let here = Pose2::new(1.0, 1.0, 0.3);
    let near = Pose2::new(1.0 + 5e-4, 1.0, 0.0);
    for relative in relative_templates() {
        let quantity = Quantity::Robot { robot: RobotId(2), relative };
        let outcome = linearize(ErrorForm::Invariant, &quantity, &here, Some(&near)).map(|_| ());
        let polar = !matches!(relative, Relative::Pose(_) | Relative::Position { .. });
        assert_eq!(outcome, if polar { Err(SkipReason::TooClose) } else { Ok(()) });
        assert_eq!(linearize(ErrorForm::Invariant, &quantity, &here, None), Err(SkipReason::Malformed));
    }
    let landmark = Quantity::Landmark {
        landmark: LandmarkId(1),
        position_m: [4.0, 4.0],
        relative: Relative::Pose(Pose2::identity()),
    };
    assert_eq!(linearize(ErrorForm::Additive, &landmark, &here, None), Err(SkipReason::LandmarkHasNoHeading));
}

use super::*;
use crate::geometry::Pose3;
use crate::group_fold::Trajectory;

fn at(time_ns: i64, velocity_m_s: [f64; 3], angular_rad_s: [f64; 3]) -> BodyRates {
    BodyRates { time: Timestamp(time_ns), velocity_m_s, angular_rad_s }
}

#[test]
fn constant_rates_follow_the_helix() {
    let mut reckoning = DeadReckoning::new(RateNoise::default(), 1.0);
    let mut trajectory = Trajectory::new(Timestamp(0), Pose3::identity(), 10);
    let (forward, climb, turn) = (1.5, 0.3, 0.8);
    for k in 0..=400 {
        let sample = at(k * 10_000_000, [forward, 0.0, climb], [0.0, 0.0, turn]);
        if let Some(step) = reckoning.sample(sample).unwrap() {
            trajectory.extend(&step).unwrap();
        }
    }
    let (time, state) = trajectory.end();
    let (t, radius) = (time.seconds(), forward / turn);
    let expected =
        Vector3::new(radius * libm::sin(turn * t), radius * (1.0 - libm::cos(turn * t)), climb * t);
    assert!((state.nominal.position() - expected).norm() < 1e-12);
}

/// The motion of a body whose twist goes linearly from `a` to `b`, by many steps at midpoints.
fn finely(a: &Tangent6, b: &Tangent6, h: f64) -> Pose3 {
    let steps = 20_000;
    (0..steps).fold(Pose3::identity(), |pose, k| {
        let middle = (f64::from(k) + 0.5) / f64::from(steps);
        pose.compose(&Pose3::exp(&((a + (b - a) * middle) * (h / f64::from(steps)))))
    })
}

#[test]
fn an_increment_is_the_motion_to_fourth_order_of_its_duration() {
    // Half the step, a thirty-second of the error; the mean rate alone would leave an eighth.
    let a = Tangent6::new(1.0, -0.5, 0.3, 0.9, 0.2, -0.4);
    let b = Tangent6::new(0.4, 0.8, -0.2, -0.3, 1.0, 0.5);
    let change = b - a;
    let error = |h: f64| {
        let end = a + change * h;
        Pose3::exp(&increment(&a, &end, h)).between(&finely(&a, &end, h)).log().norm()
    };
    let (whole, half) = (error(0.8), error(0.4));
    assert!((25.0..40.0).contains(&(whole / half)), "{whole} {half}");
    let mean = Pose3::exp(&((a + a + change * 0.4) * 0.2)).between(&finely(&a, &(a + change * 0.4), 0.4));
    assert!(mean.log().norm() > 5.0 * half);
}

#[test]
fn noise_grows_with_time_in_its_units() {
    let noise =
        RateNoise { velocity_m_per_sqrt_s: [0.1, 0.2, 0.3], angular_rad_per_sqrt_s: [0.01, 0.02, 0.03] };
    let mut reckoning = DeadReckoning::new(noise, 1.0);
    assert_eq!(reckoning.sample(at(0, [0.0; 3], [0.0; 3])), Ok(None));
    let step = reckoning.sample(at(250_000_000, [0.0; 3], [0.0; 3])).unwrap().unwrap();
    for (axis, sigma) in [0.1, 0.2, 0.3, 0.01, 0.02, 0.03].into_iter().enumerate() {
        assert!((step.covariance.entry(axis, axis) - 0.25 * sigma * sigma).abs() < 1e-18);
    }
}

#[test]
fn samples_that_are_late_missing_or_not_numbers_are_refused() {
    let mut reckoning = DeadReckoning::new(RateNoise::default(), 0.1);
    let zero = |time_ns| at(time_ns, [0.0; 3], [0.0; 3]);
    assert_eq!(reckoning.sample(zero(0)), Ok(None));
    assert!(matches!(reckoning.sample(zero(0)), Err(SampleRefused::NotLater { .. })));
    assert_eq!(reckoning.sample(at(1, [f64::NAN, 0.0, 0.0], [0.0; 3])), Err(SampleRefused::NotFinite));
    assert!(matches!(reckoning.sample(zero(200_000_000)), Err(SampleRefused::Gap { .. })));
    // What follows a gap begins anew.
    let step = reckoning.sample(zero(250_000_000)).unwrap().unwrap();
    assert_eq!(step.from, Timestamp(200_000_000));
}

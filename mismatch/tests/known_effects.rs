//! Residuals of recordings whose one departure from the nominal model is known in closed form.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use common::{RADIUS_M, SIGMAS, TRACK_M, recorded};
use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_mismatch::{
    Channel, ChannelResiduals, Evidence, MismatchError, Omission, RobotComparison, compare, nominal_models,
    residuals,
};
use pleiad_physics::{ActiveEffect, Effect, Scalar, Variable};
use pleiad_recording::Recording;

fn robot_1(recording: &Recording) -> RobotComparison {
    compare(recording).expect("has a nominal model").remove(0)
}

fn residuals_of(compared: &RobotComparison, channel: Channel) -> &ChannelResiduals<f64> {
    &compared.channel(channel).expect("every channel is there").residuals
}

fn mean(compared: &RobotComparison, channel: Channel, component: usize) -> f64 {
    compared.channel(channel).and_then(|own| own.summary.as_ref()).expect("summarized")[component].mean
}

#[test]
fn a_clean_recording_has_residuals_of_the_size_of_its_noise_and_none_on_average() {
    let compared = robot_1(&recorded(None));
    let [truth, gyro, gps, heading, range, bearing] = SIGMAS;
    // A body residual has two truth samples in it, and forward and left the heading of one over up to 0.7 m.
    let body = truth * 2.0_f64.sqrt();
    // The mean of 25 readings.
    let gyro = gyro / 5.0;
    let expected = [
        (Channel::Body, 0, body),
        (Channel::Body, 1, body * 1.05),
        (Channel::Body, 2, body),
        (Channel::Gyro, 0, gyro),
        (Channel::Gps, 0, gps),
        (Channel::Gps, 1, gps),
        (Channel::Heading, 0, heading),
        (Channel::RangeToLandmark, 0, range),
        (Channel::BearingToLandmark, 0, bearing),
    ];
    for (channel, component, sigma) in expected {
        let own = compared.channel(channel).and_then(|own| own.summary.as_ref()).expect("summarized");
        let summary = own[component];
        let error = summary.rms / (summary.count as f64).sqrt();
        assert!(summary.mean.abs() < 3.0 * error, "{channel} {component}: {summary:?}");
        assert!((summary.rms / sigma - 1.0).abs() < 0.2, "{channel} {component}: {summary:?}, sigma {sigma}");
    }
    // Commands and encoders have no noise here: the servo is integrated exactly.
    for row in &residuals_of(&compared, Channel::Actuator).rows {
        assert!(row.values().iter().all(|value| value.abs() < 1e-9), "{row:?}");
    }
    assert_eq!(
        residuals_of(&compared, Channel::RangeToRobot).omissions[..],
        [Omission::NotRecorded("ranges to robots")]
    );
}

#[test]
fn unequal_wheels_turn_the_body_by_the_distance_over_the_track() {
    let ratio = 0.01;
    let compared = robot_1(&recorded(Some((Effect::UnequalWheelRadii, &[ratio]))));
    let rows = &residuals_of(&compared, Channel::Body).rows;
    let yaw: f64 = rows.iter().map(|row| row.values()[2]).sum();
    // The speed swings by up to 0.2 of itself within a window; its mean over all is that of the middles.
    let distance: f64 = rows.iter().map(|row| row.regime.speed_m_s).sum();
    assert!((yaw / distance + ratio / TRACK_M).abs() < 0.03 * ratio / TRACK_M, "{}", yaw / distance);
    assert!(mean(&compared, Channel::Actuator, 0).abs() < 1e-9, "the wheels turn as commanded");
}

#[test]
fn an_antenna_off_its_mount_is_a_constant_in_the_robots_frame() {
    let compared = robot_1(&recorded(Some((Effect::GpsLeverArm, &[0.22, -0.1]))));
    for (component, offset) in [(0, 0.22), (1, -0.1)] {
        let found = mean(&compared, Channel::Gps, component);
        assert!((found - offset).abs() < 4.0 * SIGMAS[2] / 480.0_f64.sqrt(), "{found}");
    }
}

#[test]
fn a_misaligned_sensor_sees_everything_on_the_other_side() {
    let compared = robot_1(&recorded(Some((Effect::SensorYawMisalignment, &[0.045]))));
    let found = mean(&compared, Channel::BearingToLandmark, 0);
    assert!((found + 0.045).abs() < 4.0 * SIGMAS[5] / 1200.0_f64.sqrt(), "{found}");
    let rows = &residuals_of(&compared, Channel::BearingToLandmark).rows;
    assert!(rows.iter().all(|row| row.values()[0].abs() < 0.2), "wrapped also behind the robot");
    assert!(rows.iter().all(|row| matches!(row.target, Some(Target::Landmark(_)))));
    assert!(mean(&compared, Channel::RangeToLandmark, 0).abs() < 4.0 * SIGMAS[4] / 1200.0_f64.sqrt());
}

#[test]
fn a_command_delay_lacks_the_distance_gained_in_it() {
    let delay_s = 0.1;
    let compared = robot_1(&recorded(Some((Effect::CommandDelay, &[delay_s]))));
    // The wheels are where they would have been a delay earlier: -D dv/dt T / r over a window of T, to
    // second order in the delay. Regressed on the acceleration, which swings by 0.27 m/s^2.
    let rows = &residuals_of(&compared, Channel::Actuator).rows;
    let (mut product, mut square) = (0.0, 0.0);
    for row in rows {
        product += row.values()[0] * row.regime.acceleration_m_s2;
        square += row.regime.acceleration_m_s2.powi(2);
    }
    let slope = product / square;
    let expected = -delay_s * 0.2 / RADIUS_M;
    assert!((slope / expected - 1.0).abs() < 0.05, "{slope} for {expected}");
}

#[test]
fn the_derivative_of_a_residual_is_the_change_it_has_with_the_parameter() {
    let recording = recorded(None);
    let models = nominal_models(&recording).expect("has a nominal model");
    let evidence = Evidence::new(&recording, &models);
    let with = |yaw| {
        let effect = ActiveEffect::new(Effect::SensorYawMisalignment, &[yaw]).expect("a number");
        models[&RobotId(1)].clone().with(effect)
    };
    let dual = with(0.0).differentiated(&[Variable::Effect { index: 0, parameter: 0 }]);
    let (at_zero, moved) =
        (residuals(&evidence, RobotId(1), &dual), residuals(&evidence, RobotId(1), &with(0.01)));
    for (with_slope, moved) in at_zero.iter().zip(&moved) {
        assert_eq!(with_slope.rows.len(), moved.rows.len(), "{}", moved.channel);
        for (own, moved) in with_slope.rows.iter().zip(&moved.rows) {
            for (value, moved) in own.values().iter().zip(moved.values()) {
                let predicted = value.value() + 0.01 * value.derivatives()[0];
                assert!((predicted - moved).wrapped().abs() < 1e-9);
            }
        }
    }
    // Measured minus predicted, where the prediction falls with the sensor's yaw: +1.
    let bearing =
        at_zero.iter().find(|own| own.channel == Channel::BearingToLandmark).expect("every channel is there");
    assert!((bearing.rows[0].values()[0].derivatives()[0] - 1.0).abs() < 1e-12);
}

#[test]
fn what_is_missing_stuck_or_wild_is_said_and_never_nan() {
    let mut recording = recorded(None);
    let own = recording.robots.get_mut(&RobotId(1)).expect("recorded");
    own.gps.clear();
    let stuck = own.gyro[0].reading;
    own.gyro.iter_mut().for_each(|sample| sample.reading = stuck);
    own.heading.truncate(4);
    own.truth.retain(|sample| !(40.0..60.0).contains(&sample.time.seconds()));
    recording.landmarks.pop_last();
    let compared = robot_1(&recording);
    let said = |channel| residuals_of(&compared, channel).omissions.clone();
    assert_eq!(said(Channel::Gps), [Omission::NotRecorded("GPS positions")]);
    assert_eq!(said(Channel::Gyro), [Omission::Constant("readings of the gyro", 6000)]);
    assert_eq!(said(Channel::Heading), [Omission::TooFew(4, 10)]);
    assert!(matches!(said(Channel::Body)[..], [Omission::NoTruth(RobotId(1), 19..=22)]), "{compared:?}");
    // 5 Hz for 120 s: 600 sightings of the landmark that is gone, and of the other those without truth.
    let bearings = said(Channel::BearingToLandmark);
    assert!(
        bearings.iter().any(|omission| matches!(omission, Omission::NotInMap(499..=501))),
        "{bearings:?}"
    );

    recording.robots.get_mut(&RobotId(1)).expect("recorded").truth.clear();
    let blind = robot_1(&recording);
    assert_eq!(residuals_of(&blind, Channel::Body).omissions, [Omission::NotRecorded("truth")]);
    assert!(blind.channel(Channel::Actuator).is_some_and(|own| own.summary.is_some()), "needs no truth");

    recording.nominal = None;
    let error = compare(&recording).expect_err("nothing to compare with");
    assert_eq!(error, MismatchError::NoNominal { recording: "made".to_owned() });
}

//! One effect at a time, against what pencil and paper say.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use pleiad_physics::correct::{Correction, OdometryCorrection, OdometryReading, Place, Polar};
use pleiad_physics::signal::Target;
use pleiad_physics::{ActiveEffect, Drive, Effect, Nominal, Pose, RobotModel, Scope};

use super::{at, ideal, with};

const LANDMARK: Target = Target::Landmark(4);

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
}

fn near(found: Polar, range_m: f64, bearing_rad: f64) {
    close(found.range_m, range_m);
    close(found.bearing_rad, bearing_rad);
}

/// The motion between two readings, 0.1 s apart, of a robot at the origin that faces along x.
fn moved(correction: &Correction, first: OdometryReading, second: OdometryReading) -> Pose<f64> {
    let mut odometry = OdometryCorrection::default();
    odometry.restart(correction, 5.0, first);
    odometry.step(correction, Pose::identity(), 5.1, second)
}

fn wheels(left: f64, right: f64) -> OdometryReading {
    OdometryReading::Wheels([left, right])
}

#[test]
fn larger_wheels_roll_farther_and_turn_more() {
    let correction = with(Effect::WheelRadiusError, &[0.02]);
    let straight = moved(&correction, wheels(1.0, 7.0), wheels(1.4, 7.4));
    close(straight.x_m, 1.02 * 0.05 * 0.4);
    let spin = moved(&correction, wheels(0.0, 0.0), wheels(-0.6, 0.6));
    close(spin.yaw_rad, 1.02 * 0.05 * 1.2 / 0.3);
}

#[test]
fn a_nominal_parameter_that_was_fitted_again_acts_like_the_effect() {
    let fitted = Nominal { wheel_radius: 0.051, track_width: 0.33, ..ideal() };
    let correction = Correction::new(RobotModel::nominal(Drive::Differential, fitted), ideal());
    let spin = moved(&correction, wheels(0.0, 0.0), wheels(-0.6, 0.6));
    close(spin.yaw_rad, 0.051 * 1.2 / 0.33);
    // The same motion, told as what the believed geometry makes of it.
    let told = OdometryReading::Motion([0.0, 0.0, 0.05 * 1.2 / 0.3]);
    close(moved(&correction, told, told).yaw_rad, 0.051 * 1.2 / 0.33);
    // And as a velocity that was measured, over 0.1 s.
    let told = OdometryReading::Measured { speed_m_s: 0.0, yaw_rate_rad_s: 0.05 * 12.0 / 0.3 };
    close(moved(&correction, told, told).yaw_rad, 0.051 * 1.2 / 0.33);
}

#[test]
fn a_motion_that_nothing_acts_on_is_the_exponential_of_what_was_measured() {
    let correction = Correction::new(RobotModel::nominal(Drive::Differential, ideal()), ideal());
    let told = OdometryReading::Motion([0.4, 0.1, FRAC_PI_2]);
    let (found, expected) = (moved(&correction, told, told), Pose::exp(0.4, 0.1, FRAC_PI_2));
    close(found.x_m, expected.x_m);
    close(found.y_m, expected.y_m);
    close(found.yaw_rad, expected.yaw_rad);
}

#[test]
fn a_wider_track_and_skidding_wheels_turn_less() {
    let model = RobotModel::nominal(Drive::SkidSteer { track_ratio: 1.6 }, ideal());
    let spin = moved(&Correction::new(model, ideal()), wheels(0.0, 0.0), wheels(-0.6, 0.6));
    close(spin.yaw_rad, 0.05 * 1.2 / (1.6 * 0.3));
}

#[test]
fn a_car_with_a_steer_trim_turns_more_than_its_odometry_says() {
    let model = RobotModel::nominal(Drive::CarLike { wheelbase_m: 0.5 }, ideal());
    let trim = ActiveEffect::new(Effect::SteerTrim, &[0.05]).expect("one value");
    let told = OdometryReading::Motion([0.2, 0.0, 0.1]);
    let untrimmed = moved(&Correction::new(model.clone(), ideal()), told, told);
    close(untrimmed.yaw_rad, 0.1);
    let trimmed = moved(&Correction::new(model.with(trim), ideal()), told, told);
    // tan(steer) = L yaw / forward = 0.25.
    close(trimmed.yaw_rad, 0.2 * (0.25_f64.atan() + 0.05).tan() / 0.5);
}

/// A robot that is told to start: a step of 0.2 m/s at 1 s, and what it has covered by 2 s.
fn covered(correction: &Correction, rate_hz: u32) -> f64 {
    let command = |speed_m_s| OdometryReading::Commanded { speed_m_s, yaw_rate_rad_s: 0.0 };
    let mut odometry = OdometryCorrection::default();
    odometry.restart(correction, 0.0, command(0.0));
    let mut pose = Pose::identity();
    for tick in 1..=2 * rate_hz {
        let speed = if tick >= rate_hz { 0.2 } else { 0.0 };
        let time_s = f64::from(tick) / f64::from(rate_hz);
        pose = pose.compose(&odometry.step(correction, pose, time_s, command(speed)));
    }
    pose.x_m
}

#[test]
fn a_command_is_followed_late_and_slowly() {
    for rate_hz in [1, 7, 25, 200] {
        close(covered(&with(Effect::CommandDelay, &[0.13]), rate_hz), 0.2 * (1.0 - 0.13));
        let lag = 0.2 * (1.0 - 0.1 * (1.0 - (-10.0_f64).exp()));
        close(covered(&with(Effect::ActuatorLag, &[0.1]), rate_hz), lag);
        close(covered(&with(Effect::ActuatorGain, &[0.05, 0.0]), rate_hz), 0.2 * 1.05);
    }
}

#[test]
fn a_first_command_has_been_followed_for_long() {
    let correction = with(Effect::ActuatorLag, &[0.3]);
    let told = OdometryReading::Commanded { speed_m_s: 0.2, yaw_rate_rad_s: 0.0 };
    close(moved(&correction, told, told).x_m, 0.2 * 0.1);
}

#[test]
fn a_current_adds_to_the_motion_in_the_map() {
    let correction = with(Effect::WorldDrift, &[0.0, 0.3]);
    let mut odometry = OdometryCorrection::default();
    odometry.restart(&correction, 0.0, wheels(0.0, 0.0));
    let facing_north = Pose::new(2.0, 1.0, FRAC_PI_2);
    let step = odometry.step(&correction, facing_north, 0.5, wheels(2.0, 2.0));
    close(step.x_m, 0.05 * 2.0 + 0.3 * 0.5);
    close(step.y_m, 0.0);
}

#[test]
fn odometry_of_another_kind_or_out_of_order_gives_no_motion() {
    let correction = with(Effect::WheelRadiusError, &[0.02]);
    let told = OdometryReading::Motion([0.2, 0.0, 0.1]);
    assert_eq!(moved(&correction, wheels(0.0, 0.0), told), Pose::identity());
    let mut odometry = OdometryCorrection::default();
    odometry.restart(&correction, 5.0, told);
    for time_s in [5.0, 4.0, f64::NAN] {
        assert_eq!(odometry.step(&correction, Pose::identity(), time_s, told), Pose::identity());
        odometry.restart(&correction, 5.0, told);
    }
}

#[test]
fn a_clock_that_is_ahead_and_fast_is_set_right() {
    let nominal = Nominal { clock_offset_s: 0.5, clock_drift_ppm: 100.0, ..ideal() };
    let model = RobotModel::nominal(Drive::Differential, nominal);
    let drift = ActiveEffect::new(Effect::ClockDrift, &[50.0]).expect("one value");
    let correction = Correction::new(model.with(drift), ideal());
    // At 1000 s of common time it shows 0.5 + 1000 (1 + 150e-6).
    close(correction.clock_error_s(1000.65), 0.65);
    let exact = Correction::new(RobotModel::nominal(Drive::Differential, ideal()), ideal());
    assert_eq!(exact.clock_error_s(1.248e9).to_bits(), 0.0_f64.to_bits());
}

#[test]
fn the_antenna_is_brought_back_to_the_axle() {
    let correction = with(Effect::GpsLeverArm, &[0.2, -0.1]);
    let [x, y] = correction.gps(&at(7.0, 7.0, FRAC_PI_2), [1.1, 2.2]);
    close(x, 1.0);
    close(y, 2.0);
    close(correction.gps_latency_s(&at(0.0, 0.0, 0.0)), 0.0);
    close(with(Effect::GpsLatency, &[0.15]).gps_latency_s(&at(0.0, 0.0, 0.0)), 0.15);
}

#[test]
fn headings_are_freed_of_iron() {
    // Facing east: the body's field adds f along x and l along y to a unit field along y.
    let (f, l) = (0.2_f64, -0.1);
    let read = f.atan2(1.0 + l);
    close(with(Effect::CompassHardIron, &[f, l]).heading(&at(0.0, 0.0, 2.0), read), 0.0);
    // A quarter of its period after the phase, soft iron errs by its amplitude.
    let soft = with(Effect::CompassSoftIron, &[0.05, 0.4]);
    close(soft.heading(&at(0.0, 0.0, 0.0), 0.4 + FRAC_PI_4 + 0.05), 0.4 + FRAC_PI_4);
    close(with(Effect::HeadingOffset, &[0.3]).heading(&at(0.0, 0.0, 0.0), PI), PI - 0.3);
}

#[test]
fn a_gyro_is_freed_of_scale_and_bias() {
    let nominal = Nominal { gyro_bias_rad_s: 0.01, ..ideal() };
    let scale = ActiveEffect::new(Effect::GyroScale, &[0.5]).expect("one value");
    let correction = Correction::new(RobotModel::nominal(Drive::Differential, nominal).with(scale), ideal());
    close(correction.gyro(&at(0.0, 0.0, 0.0), 1.5 * 0.4 + 0.01), 0.4);
}

#[test]
fn a_mounted_sensor_is_moved_to_the_body() {
    let correction = with(Effect::SensorLeverArm, &[0.3, 0.0]);
    // The sensor sits 0.3 m ahead; the target is 0.4 m to its left.
    let read = Polar { range_m: 0.4, bearing_rad: FRAC_PI_2 };
    near(correction.sighting(&at(5.0, 6.0, 1.0), LANDMARK, read), 0.5, (0.4_f64).atan2(0.3));
    let yawed = with(Effect::SensorYawMisalignment, &[0.04]);
    near(yawed.sighting(&at(0.0, 0.0, 0.0), LANDMARK, read), 0.4, FRAC_PI_2 + 0.04);
    close(yawed.relative_yaw(&at(0.0, 0.0, 0.0), Target::Robot(2), 0.1), 0.14);
}

#[test]
fn ranges_and_bearings_are_undistorted() {
    let read = |range_m, bearing_rad| Polar { range_m, bearing_rad };
    let place = at(0.0, 0.0, 0.0);
    near(with(Effect::RangeScale, &[0.02]).sighting(&place, LANDMARK, read(2.04, 0.3)), 2.0, 0.3);
    near(with(Effect::RangeBias, &[0.05]).sighting(&place, LANDMARK, read(2.05, 0.3)), 2.0, 0.3);
    let bent = 0.5 + 0.03 * 0.5 + 0.05 * 0.125;
    near(
        with(Effect::BearingDistortion, &[0.03, 0.05]).sighting(&place, LANDMARK, read(2.0, bent)),
        2.0,
        0.5,
    );
    close(with(Effect::CameraLatency, &[0.05]).sighting_latency_s(&place, LANDMARK), 0.05);
}

#[test]
fn a_landmark_that_stands_elsewhere_is_seen_where_the_map_has_it() {
    let correction = with(Effect::LandmarkSurveyError, &[4.0, 0.3, 0.0]);
    // Facing north at the origin; on the map the landmark is at (0, 0.4), in truth at (0.3, 0.4).
    let read = Polar { range_m: 0.5, bearing_rad: -(0.3_f64).atan2(0.4) };
    near(correction.sighting(&at(0.0, 0.0, FRAC_PI_2), LANDMARK, read), 0.4, 0.0);
    let other = correction.sighting(&at(0.0, 0.0, FRAC_PI_2), Target::Landmark(5), read);
    near(other, read.range_m, read.bearing_rad);
}

#[test]
fn a_range_or_a_bearing_alone_is_corrected_with_what_the_map_tells() {
    let lever = with(Effect::SensorLeverArm, &[0.3, 0.0]);
    let place = at(1.0, 1.0, FRAC_PI_2);
    // To the left of the robot, at (0.6, 1.3): 0.5 m away, at 53 degrees; 0.4 m to the left of the sensor.
    close(lever.range(&place, LANDMARK, Some([0.6, 1.3]), 0.4), 0.5);
    close(lever.bearing(&place, LANDMARK, Some([0.6, 1.3]), FRAC_PI_2), (0.4_f64).atan2(0.3));
    // Of a robot, whose direction is not known, only what does not need it.
    close(lever.range(&place, Target::Robot(2), None, 0.4), 0.4);
    close(with(Effect::RangeScale, &[0.25]).range(&place, Target::Robot(2), None, 2.0), 1.6);
    close(with(Effect::SensorYawMisalignment, &[0.04]).bearing(&place, Target::Robot(2), None, 0.1), 0.14);
}

#[test]
fn swapped_landmarks_get_their_numbers_back() {
    let swap = with(Effect::LandmarkIdentitySwap, &[4.0, 9.0]);
    let place = at(0.0, 0.0, 0.0);
    assert_eq!(swap.target(&place, LANDMARK), Target::Landmark(9));
    assert_eq!(swap.target(&place, Target::Landmark(9)), LANDMARK);
    assert_eq!(swap.target(&place, Target::Robot(4)), Target::Robot(4));
}

#[test]
fn an_effect_is_taken_out_only_where_and_when_it_acts() {
    let early = Scope { window_s: Some((0.0, 2.0)), region: None };
    let active = ActiveEffect::new(Effect::RangeBias, &[0.05]).expect("one value").within(early);
    let correction = Correction::new(RobotModel::nominal(Drive::Differential, ideal()).with(active), ideal());
    let read = Polar { range_m: 2.05, bearing_rad: 0.0 };
    let found = |time_s| {
        let place = Place { time_s, pose: Pose::identity() };
        correction.sighting(&place, LANDMARK, read).range_m
    };
    close(found(1.0), 2.0);
    close(found(2.0), 2.05);
}

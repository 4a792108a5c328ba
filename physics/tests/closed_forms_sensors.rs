//! What each effect between state and reading does, against its closed form.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use std::f64::consts::FRAC_PI_2;

use pleiad_physics::chain::body::BodyState;
use pleiad_physics::chain::sensors::{self, Seen};
use pleiad_physics::predict::{BodyWindow, EncoderSample, truth_change};
use pleiad_physics::signal::{Noise, Target};
use pleiad_physics::{
    ActiveEffect, Chance, Context, Drive, Effect, Motion, Nominal, Pose, RobotModel, Surroundings,
};

/// One effect on an ideal robot, and the state it is in.
struct Case {
    model: RobotModel<f64>,
    motion: Motion<f64>,
    time_s: f64,
    step_s: f64,
    chance: Chance,
}

fn case(effect: Effect, values: &[f64]) -> Case {
    let mut nominal = Nominal::ideal(0.05, 0.4);
    nominal.encoder_ticks_per_rev = 1000.0;
    (nominal.range_sigma_m, nominal.bearing_sigma_rad, nominal.detection_probability) = (0.02, 0.01, 0.9);
    let effect = ActiveEffect::new(effect, values).unwrap();
    let mut motion = Motion::at_rest(Pose::new(1.0, 2.0, 0.3));
    (motion.speed_m_s, motion.yaw_rate_rad_s) = (0.5, 0.8);
    Case {
        model: RobotModel::nominal(Drive::Differential, nominal).with(effect),
        motion,
        time_s: 10.0,
        step_s: 0.04,
        chance: Chance::EXPECTED,
    }
}

impl Case {
    fn context(&self) -> Context<'_, f64> {
        let context = Context::new(&self.model.nominal, self.time_s, self.motion).over(self.step_s);
        Context { chance: self.chance, ..context }
    }
    fn gyro(&self) -> f64 {
        sensors::gyro(&self.model, &self.context(), &mut 0.0)
    }
    fn gps(&self) -> [f64; 2] {
        sensors::gps(&self.model, &self.context())
    }
    fn heading(&self) -> f64 {
        sensors::heading(&self.model, &self.context())
    }
    fn truth(&self) -> Pose<f64> {
        sensors::truth(&self.model, &self.context())
    }
    /// Range and bearing of landmark 7, which truly is 2 m away at this bearing.
    fn seen(&self, bearing_rad: f64) -> [f64; 2] {
        let [x, y] = self.motion.pose.rotate([2.0 * bearing_rad.cos(), 2.0 * bearing_rad.sin()]);
        let landmark = Seen::landmark(7, [self.motion.pose.x_m + x, self.motion.pose.y_m + y]);
        let sighting = sensors::sighting(&self.model, &self.context(), &landmark);
        [sighting.range_m, sighting.bearing_rad]
    }
    fn noise(&self) -> Noise<f64> {
        sensors::noise(&self.model, &self.context(), 2.0, 0.4)
    }
}

fn close<const N: usize>(found: [f64; N], expected: [f64; N]) {
    let gap = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(gap < 1e-12, "{found:?} {expected:?}");
}

#[test]
fn a_clock_offset_shifts_stamps_and_makes_readings_older() {
    let case = case(Effect::ClockOffset, &[0.2]);
    close([sensors::stamp(&case.model, &case.context())], [10.2]);
    let before = case.motion.carried(-0.2);
    close(case.gps(), before.position());
}

#[test]
fn a_clock_drift_grows_with_time() {
    let case = case(Effect::ClockDrift, &[100.0]);
    close([sensors::stamp(&case.model, &case.context())], [10.001]);
}

#[test]
fn clock_offset_and_truth_latency_are_opposite_for_one_robot() {
    let rate = |i: i32| if i < 10 { [6.0, 9.0] } else { [11.0, 5.0] };
    let mut samples = vec![EncoderSample { time_s: 0.0, angle_rad: [0.0; 2], steer_rad: 0.0 }];
    for i in 0..20 {
        let last = samples[samples.len() - 1];
        let angle_rad = [0, 1].map(|wheel: usize| last.angle_rad[wheel] + 0.05 * rate(i)[wheel]);
        samples.push(EncoderSample { time_s: last.time_s + 0.05, angle_rad, ..last });
    }
    let window = BodyWindow::whole(&samples, Pose::identity(), Surroundings::default());
    let change = |effect, value: f64| {
        let pose = truth_change(
            &case(effect, &[value]).model,
            &window,
            window.stamps_s(),
            &mut BodyState::default(),
        );
        [pose.x_m, pose.y_m, pose.yaw_rad]
    };
    close(change(Effect::ClockOffset, 0.03), change(Effect::TruthLatency, -0.03));
    // One latency shows as tau times the change of both rates: w went from 0.375 to -0.75 rad/s.
    let yaw = 0.5 * (0.375 - 0.75);
    assert!((change(Effect::ClockOffset, 0.03)[2] - (yaw + 0.03 * (-0.75 - 0.375))).abs() < 1e-12);
}

#[test]
fn a_coarse_encoder_rounds_down_to_its_own_ticks() {
    let mut case = case(Effect::EncoderCoarse, &[36.0]);
    case.motion.wheel_angle_rad = [25.0_f64.to_radians(), 31.0_f64.to_radians()];
    let read = sensors::encoders(&case.model, &case.context());
    close(read, [20.0_f64.to_radians(), 30.0_f64.to_radians()]);
}

#[test]
fn gyro_effects_add_bias_scale_and_warm_up() {
    close([case(Effect::GyroBias, &[0.01]).gyro()], [0.81]);
    close([case(Effect::GyroScale, &[0.05]).gyro()], [0.84]);
    let warming = case(Effect::GyroThermalDrift, &[0.02, 20.0]).gyro();
    close([warming], [0.8 + 0.02 * (1.0 - (-0.5_f64).exp())]);
}

#[test]
fn a_walking_gyro_bias_steps_by_its_density_and_remembers() {
    let mut case = case(Effect::GyroRandomWalk, &[0.01]);
    case.chance.normal = 1.5;
    let mut walk = 0.0;
    for steps in 1..=3 {
        let reading = sensors::gyro(&case.model, &case.context(), &mut walk);
        close([reading], [0.8 + f64::from(steps) * 0.01 * 0.2 * 1.5]);
    }
    close([case.noise().gyro_walk_variance], [1e-4]);
}

#[test]
fn hard_iron_turns_the_compass_by_the_angle_of_the_summed_field() {
    let mut case = case(Effect::CompassHardIron, &[0.2, 0.1]);
    for heading in [0.0_f64, 1.1, -2.5] {
        case.motion.pose.yaw_rad = heading;
        // North along y, seen from the body, plus the body's own field; read back as a heading.
        let (forward, left) = (heading.sin() + 0.2, heading.cos() + 0.1);
        let error = case.heading() - forward.atan2(left);
        close([error.sin()], [0.0]);
        assert!(error.cos() > 0.0);
    }
    // To first order f cos h - l sin h: facing east a field forward of the robot turns the reading by f.
    let small = self::case(Effect::CompassHardIron, &[1e-4, 0.0]);
    assert!((small.heading() - 0.3 - 1e-4 * 0.3_f64.cos()).abs() < 1e-8);
}

#[test]
fn other_heading_effects_add_their_angle() {
    close([case(Effect::CompassSoftIron, &[0.1, 0.05]).heading()], [0.3 + 0.1 * 0.5_f64.sin()]);
    close([case(Effect::SunSensorMisalignment, &[0.04]).heading()], [0.34]);
    close([case(Effect::HeadingOffset, &[-0.1]).heading()], [0.2]);
    for (region, expected) in [([0.0, 2.0, 1.0, 3.0], 0.5), ([0.0, 2.0, 3.0, 4.0], 0.3)] {
        let values = [region[0], region[1], region[2], region[3], 0.2];
        close([case(Effect::LocalMagneticField, &values).heading()], [expected]);
    }
}

#[test]
fn gps_effects_shift_the_position_in_body_in_time_and_in_the_map() {
    let mut lever = case(Effect::GpsLeverArm, &[0.22, -0.1]);
    lever.motion.pose.yaw_rad = FRAC_PI_2;
    close(lever.gps(), [1.1, 2.22]);
    let mut latency = case(Effect::GpsLatency, &[0.2]);
    latency.motion.yaw_rate_rad_s = 0.0;
    close(latency.gps(), [1.0 - 0.1 * 0.3_f64.cos(), 2.0 - 0.1 * 0.3_f64.sin()]);
    close(case(Effect::GpsMultipathPatch, &[0.0, 2.0, 1.0, 3.0, 0.5, -0.3]).gps(), [1.5, 1.7]);
    close(case(Effect::GpsMultipathPatch, &[0.0, 0.9, 1.0, 3.0, 0.5, -0.3]).gps(), [1.0, 2.0]);
}

#[test]
fn a_sensor_lever_arm_and_yaw_are_seen_in_range_and_bearing() {
    close(case(Effect::SensorLeverArm, &[0.5, 0.0]).seen(0.0), [1.5, 0.0]);
    close(case(Effect::SensorLeverArm, &[0.0, 0.5]).seen(0.0), [2.0_f64.hypot(0.5), (-0.25_f64).atan()]);
    close(case(Effect::SensorYawMisalignment, &[0.045]).seen(0.3), [2.0, 0.255]);
}

#[test]
fn range_and_bearing_errors_are_their_polynomials() {
    close(case(Effect::RangeBias, &[0.1]).seen(0.3), [2.1, 0.3]);
    close(case(Effect::RangeScale, &[0.1]).seen(0.3), [2.2, 0.3]);
    close(case(Effect::BearingDistortion, &[0.1, 0.5]).seen(-0.4), [2.0, -0.44 - 0.5 * 0.064]);
    close(case(Effect::BearingDependentRangeBias, &[0.5]).seen(-0.4), [2.08, -0.4]);
}

#[test]
fn camera_latency_is_one_time_constant_in_range_and_bearing() {
    let tau = 1e-4;
    for bearing in [-0.7_f64, 0.0, 0.5] {
        let [range, seen] = case(Effect::CameraLatency, &[tau]).seen(bearing);
        // First order; the second is below 1e-8.
        assert!((range - 2.0 - tau * 0.5 * bearing.cos()).abs() < 1e-8);
        assert!((seen - bearing - tau * (0.8 - 0.5 * bearing.sin() / 2.0)).abs() < 1e-8);
    }
}

#[test]
fn a_marker_offset_moves_and_turns_the_reference_pose() {
    let mut case = case(Effect::TruthMarkerOffset, &[0.1, 0.2, 0.05]);
    case.motion.pose.yaw_rad = FRAC_PI_2;
    let pose = case.truth();
    close([pose.x_m, pose.y_m, pose.yaw_rad], [0.8, 2.1, FRAC_PI_2 + 0.05]);
}

#[test]
fn a_late_reference_shows_an_earlier_pose() {
    let pose = case(Effect::TruthLatency, &[0.1]).truth();
    close([pose.yaw_rad], [0.3 - 0.08]);
}

#[test]
fn a_landmark_that_was_surveyed_wrong_is_seen_where_it_is() {
    let mut case = case(Effect::LandmarkSurveyError, &[7.0, 0.5, 0.0]);
    case.motion.pose = Pose::identity();
    close(case.seen(0.0), [2.5, 0.0]);
    let other = sensors::sighting(&case.model, &case.context(), &Seen::landmark(8, [2.0, 0.0]));
    close([other.range_m], [2.0]);
}

#[test]
fn swapped_landmarks_bear_each_others_number() {
    let case = case(Effect::LandmarkIdentitySwap, &[3.0, 5.0]);
    let named = |target| sensors::identity(&case.model, &case.context(), target, &[]);
    assert_eq!(named(Target::Landmark(3)), Target::Landmark(5));
    assert_eq!(named(Target::Landmark(5)), Target::Landmark(3));
    assert_eq!(named(Target::Landmark(4)), Target::Landmark(4));
    assert_eq!(named(Target::Robot(3)), Target::Robot(3));
}

#[test]
fn identity_mix_up_draws_among_the_others_with_its_probability() {
    let mut case = case(Effect::IdentityMixUp, &[0.2]);
    let others = [Target::Landmark(1), Target::Robot(2)];
    for (uniform, choice, expected) in
        [(0.3, 0.9, Target::Landmark(9)), (0.1, 0.4, Target::Landmark(1)), (0.1, 0.6, Target::Robot(2))]
    {
        case.chance = Chance { uniform, choice, normal: 0.0 };
        let named = sensors::identity(&case.model, &case.context(), Target::Landmark(9), &others);
        assert_eq!(named, expected);
    }
    close([case.noise().wrong_identity_probability], [0.2]);
}

#[test]
fn missed_detections_follow_a_logistic_curve() {
    let case = case(Effect::MissedDetections, &[0.5, 0.4, 2.0]);
    let [x, y] = case.motion.pose.rotate([2.0 * 0.3_f64.cos(), 2.0 * 0.3_f64.sin()]);
    let seen = Seen::landmark(1, [1.0 + x, 2.0 + y]);
    let detected = sensors::sighting(&case.model, &case.context(), &seen).detection_probability;
    // Declared: odds of a miss 1 to 9; raised by exp(0.5 + 0.4 * 2 + 2 * 0.09).
    close([detected], [1.0 / (1.0 + 1.48_f64.exp() / 9.0)]);
}

#[test]
fn variance_effects_add_to_standard_deviations() {
    let ranging = case(Effect::RangeDependentNoise, &[0.01, 0.02, 0.005]).noise();
    close([ranging.range_sigma_m, ranging.bearing_sigma_rad], [0.02 + 0.01 + 0.04 + 0.02, 0.01]);
    close([case(Effect::MotionBlur, &[0.02]).noise().bearing_sigma_rad], [0.026]);
    close([case(Effect::HeavyTails, &[3.0]).noise().degrees_of_freedom], [3.0]);
    close([case(Effect::CommandLoss, &[0.05]).noise().command_loss_probability], [0.05]);
    close([case(Effect::CommandJitter, &[0.12]).noise().command_delay_sigma_s], [0.12 / 12.0_f64.sqrt()]);
}

//! What each effect between command and wheel does, against its closed form.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use pleiad_physics::chain::actuator::{ActuatorState, Command, schedule};
use pleiad_physics::predict::{CommandWindow, wheel_turns};
use pleiad_physics::{ActiveEffect, Chance, Drive, Effect, Motion, Nominal, Pose, RobotModel, Surroundings};

const RADIUS_M: f64 = 0.05;
const TRACK_M: f64 = 0.4;

/// A robot facing `heading_rad` whose servo has this time constant, and what is commanded from when.
struct Case<'a> {
    effect: Effect,
    values: &'a [f64],
    time_constant_s: f64,
    heading_rad: f64,
    voltage_change_v: f64,
    chance: Chance,
    commands: &'a [(f64, f64, f64)],
}

impl Default for Case<'_> {
    fn default() -> Self {
        Self {
            effect: Effect::ActuatorLag,
            values: &[],
            time_constant_s: 0.0,
            heading_rad: 0.0,
            voltage_change_v: 0.0,
            chance: Chance::EXPECTED,
            commands: &[(0.0, 0.5, 0.0)],
        }
    }
}

impl Case<'_> {
    /// Angles turned in each window, radians.
    fn turned<const N: usize>(&self, windows: [(f64, f64); N]) -> [[f64; 2]; N] {
        let mut nominal = Nominal::ideal(RADIUS_M, TRACK_M);
        nominal.servo_time_constant_s = self.time_constant_s;
        nominal.servo_time_constant_turn_s = self.time_constant_s;
        let effect = ActiveEffect::new(self.effect, self.values).unwrap();
        let model = RobotModel::nominal(Drive::Differential, nominal).with(effect);
        let of = |&(time_s, speed_m_s, yaw_rate_rad_s)| Command { time_s, speed_m_s, yaw_rate_rad_s };
        let commands: Vec<_> = self.commands.iter().map(of).collect();
        let scheduled = schedule(&model, &commands, |_| self.chance);
        let mut state = ActuatorState::default();
        let surroundings =
            Surroundings { voltage_change_v: self.voltage_change_v, ..Surroundings::default() };
        let motion = Motion::at_rest(Pose::new(0.0, 0.0, self.heading_rad));
        windows.map(|(from_s, to_s)| {
            let window = CommandWindow { from_s, to_s, motion, surroundings };
            wheel_turns(&model, &scheduled, &window, &mut state)
        })
    }

    /// Distance and turned angle in one window, by nominal kinematics.
    fn moved(&self, window: (f64, f64)) -> (f64, f64) {
        let [[left, right]] = self.turned([window]);
        (RADIUS_M * f64::midpoint(left, right), RADIUS_M * (right - left) / TRACK_M)
    }
}

fn close(found: (f64, f64), expected: (f64, f64)) {
    assert!(
        (found.0 - expected.0).abs() < 1e-12 && (found.1 - expected.1).abs() < 1e-12,
        "{found:?} {expected:?}"
    );
}

#[test]
fn actuator_lag_adds_to_the_time_constant_of_the_exponential() {
    let case = Case {
        effect: Effect::ActuatorLag,
        values: &[0.2],
        time_constant_s: 0.1,
        commands: &[(0.0, 0.5, 1.0)],
        ..Case::default()
    };
    let integral = 1.0 - 0.3 * (1.0 - (-1.0 / 0.3_f64).exp());
    close(case.moved((0.0, 1.0)), (0.5 * integral, integral));
}

#[test]
fn command_delay_costs_the_distance_of_its_duration() {
    let case = Case {
        effect: Effect::CommandDelay,
        values: &[0.12],
        commands: &[(0.0, 0.5, 1.0)],
        ..Case::default()
    };
    close(case.moved((0.0, 1.0)), (0.5 * 0.88, 0.88));
}

#[test]
fn motor_deadband_stops_set_points_below_it_and_passes_those_above() {
    for (values, commanded, expected) in [
        ([0.05, 0.0], (0.049, 1.0), (0.0, 1.0)),
        ([0.05, 0.0], (0.051, 1.0), (0.051, 1.0)),
        // Wheels at 8 and 12 rad/s: the slower one stops, the other pushes alone.
        ([0.0, 9.0], (0.5, 0.5), (0.5 * 12.0 * 0.05, 12.0 * 0.05 / 0.4)),
    ] {
        let commands = [(0.0, commanded.0, commanded.1)];
        let case =
            Case { effect: Effect::MotorDeadband, values: &values, commands: &commands, ..Case::default() };
        close(case.moved((0.0, 1.0)), expected);
    }
}

#[test]
fn stiction_holds_a_wheel_at_rest_but_not_one_that_moves() {
    let case = |commands| Case { effect: Effect::Stiction, values: &[0.1], commands, ..Case::default() };
    close(case(&[(0.0, 0.09, 0.0)]).moved((0.0, 1.0)), (0.0, 0.0));
    let moving = case(&[(0.0, 0.5, 0.0), (1.0, 0.09, 0.0)]).turned([(0.0, 1.0), (1.0, 2.0)]);
    assert!((moving[1][0] * RADIUS_M - 0.09).abs() < 1e-12, "{moving:?}");
}

#[test]
fn a_sticky_wheel_turns_slower_by_its_droop_from_its_onset_on() {
    let case = Case { effect: Effect::StickyWheel, values: &[1.0, 1.0, 0.5], ..Case::default() };
    let [before, after] = case.turned([(0.0, 1.0), (1.0, 2.0)]);
    assert!((before[1] - 10.0).abs() < 1e-12 && (after[0] - 10.0).abs() < 1e-12);
    assert!((after[1] - 9.5).abs() < 1e-12, "{after:?}");
}

#[test]
fn speed_saturation_clips_each_wheel() {
    // Wheels at 8 and 12 rad/s.
    let case = Case {
        effect: Effect::SpeedSaturation,
        values: &[11.0],
        commands: &[(0.0, 0.5, 0.5)],
        ..Case::default()
    };
    let [[left, right]] = case.turned([(0.0, 1.0)]);
    assert!((left - 8.0).abs() < 1e-12 && (right - 11.0).abs() < 1e-12);
}

#[test]
fn an_acceleration_limit_makes_a_ramp() {
    let case = Case { effect: Effect::AccelerationLimit, values: &[0.8], ..Case::default() };
    close(case.moved((0.0, 0.5)), (0.5 * 0.8 * 0.25, 0.0));
}

#[test]
fn quadratic_drag_droops_with_the_square_of_the_speed_both_ways() {
    for sign in [1.0, -1.0] {
        let commands = [(0.0, 0.5 * sign, 0.0)];
        let case =
            Case { effect: Effect::QuadraticDrag, values: &[0.1], commands: &commands, ..Case::default() };
        close(case.moved((0.0, 1.0)), (sign * (0.5 - 0.1 * 0.25), 0.0));
    }
}

#[test]
fn payload_slows_the_servo_from_its_onset_on() {
    let case = |t_on_s: f64| {
        let values = [t_on_s, 0.0, 0.1];
        let case =
            Case { effect: Effect::PayloadAdded, values: &values, time_constant_s: 0.1, ..Case::default() };
        case.moved((0.0, 1.0)).0
    };
    let distance = |tau: f64| 0.5 * (1.0 - tau * (1.0 - (-1.0 / tau).exp()));
    assert!((case(0.0) - distance(0.2)).abs() < 1e-12 && (case(2.0) - distance(0.1)).abs() < 1e-12);
}

#[test]
fn battery_sag_scales_speed_and_yaw_rate_by_voltage_and_time() {
    let case = |values| Case {
        effect: Effect::BatterySag,
        values,
        voltage_change_v: -2.0,
        commands: &[(0.0, 0.5, 1.0)],
        ..Case::default()
    };
    close(case(&[0.05, 0.0]).moved((9.5, 10.5)), (0.45, 0.9));
    // The window's middle is at 10 s.
    close(case(&[0.0, -0.01]).moved((9.5, 10.5)), (0.45, 0.9));
}

#[test]
fn floor_tilt_droops_by_time_constant_times_gravity_along_the_heading() {
    let values = [0.04, 0.5];
    for (heading_rad, along) in [(0.5, 1.0), (0.5 + std::f64::consts::PI, -1.0), (0.5 - 1.0, 1.0_f64.cos())] {
        let case = Case {
            effect: Effect::FloorTilt,
            values: &values,
            time_constant_s: 0.02,
            heading_rad,
            ..Case::default()
        };
        let [_, settled] = case.turned([(0.0, 2.0), (2.0, 3.0)]);
        let droop = 0.02 * 9.806_65 * 0.04_f64.sin() * along;
        assert!((settled[0] * RADIUS_M - 0.5 - droop).abs() < 1e-12, "{settled:?}");
    }
}

#[test]
fn world_force_droops_with_the_cosine_to_its_azimuth() {
    let case = Case { effect: Effect::WorldForce, values: &[0.03, 0.5], heading_rad: 1.5, ..Case::default() };
    close(case.moved((0.0, 1.0)), (0.5 + 0.03 * 1.0_f64.cos(), 0.0));
}

#[test]
fn backlash_swallows_half_its_angle_at_the_start_and_all_of_it_at_a_reversal() {
    let case = Case {
        effect: Effect::Backlash,
        values: &[0.1],
        commands: &[(0.0, 0.05, 0.0), (1.0, -0.05, 0.0)],
        ..Case::default()
    };
    let [forward, back] = case.turned([(0.0, 1.0), (1.0, 2.0)]);
    assert!((forward[0] - 0.95).abs() < 1e-12 && (back[0] + 0.9).abs() < 1e-12, "{forward:?} {back:?}");
}

#[test]
fn actuator_gain_scales_speed_and_yaw_rate_apart() {
    let case = Case {
        effect: Effect::ActuatorGain,
        values: &[0.04, -0.1],
        commands: &[(0.0, 0.5, 1.0)],
        ..Case::default()
    };
    close(case.moved((0.0, 1.0)), (0.52, 0.9));
}

#[test]
fn a_lost_command_leaves_nothing_to_follow_and_a_likely_one_is_expected_to_arrive() {
    let drawn = Chance { uniform: 0.04, ..Chance::EXPECTED };
    let case = |chance| Case { effect: Effect::CommandLoss, values: &[0.05], chance, ..Case::default() };
    close(case(drawn).moved((0.0, 1.0)), (0.0, 0.0));
    close(case(Chance::EXPECTED).moved((0.0, 1.0)), (0.5, 0.0));
}

#[test]
fn command_jitter_delays_by_the_share_that_was_drawn() {
    let drawn = Chance { uniform: 0.25, ..Chance::EXPECTED };
    let case = |chance| Case { effect: Effect::CommandJitter, values: &[0.2], chance, ..Case::default() };
    close(case(drawn).moved((0.0, 1.0)), (0.475, 0.0));
    close(case(Chance::EXPECTED).moved((0.0, 1.0)), (0.45, 0.0));
}

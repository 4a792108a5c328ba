//! What each effect between wheel and pose does, against its closed form.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

use std::f64::consts::{FRAC_PI_2, PI};

use pleiad_physics::chain::body::BodyState;
use pleiad_physics::predict::{BodyWindow, EncoderSample, body_motion};
use pleiad_physics::{ActiveEffect, Drive, Effect, Nominal, Pose, RobotModel, Surroundings};

const RADIUS_M: f64 = 0.05;
const TRACK_M: f64 = 0.4;
const STEP_S: f64 = 0.01;

struct Case<'a> {
    effect: Effect,
    values: &'a [f64],
    drive: Drive,
    start: Pose<f64>,
    surroundings: Surroundings,
}

fn case(effect: Effect, values: &[f64]) -> Case<'_> {
    let (start, surroundings) = (Pose::identity(), Surroundings::default());
    Case { effect, values, drive: Drive::Differential, start, surroundings }
}

impl Case<'_> {
    /// The motion where encoders saw each `(v, w)` for a second.
    fn moved(&self, seconds: &[(f64, f64)]) -> Pose<f64> {
        let mut samples =
            vec![EncoderSample { time_s: 0.0, angle_rad: [0.0; 2], steer_rad: self.surroundings.steer_rad }];
        for &(speed, yaw_rate) in seconds {
            for _ in 0..100 {
                let last = samples[samples.len() - 1];
                let turn = yaw_rate * TRACK_M / 2.0;
                let rates = [(speed - turn) / RADIUS_M, (speed + turn) / RADIUS_M];
                let angle_rad = [0, 1].map(|wheel| last.angle_rad[wheel] + rates[wheel] * STEP_S);
                samples.push(EncoderSample { time_s: last.time_s + STEP_S, angle_rad, ..last });
            }
        }
        let effect = ActiveEffect::new(self.effect, self.values).unwrap();
        let model = RobotModel::nominal(self.drive, Nominal::ideal(RADIUS_M, TRACK_M)).with(effect);
        let window = BodyWindow::whole(&samples, self.start, self.surroundings);
        body_motion(&model, &window, &mut BodyState::default())
    }

    /// Asserts the body velocity residual `(dx, dy, dw)` at a steady `(v, w)` over a second.
    fn adds(&self, (speed, yaw_rate): (f64, f64), (dx, dy, dw): (f64, f64, f64)) {
        close(self.moved(&[(speed, yaw_rate)]), Pose::exp(speed + dx, dy, yaw_rate + dw));
    }
}

/// To rounding in a sum of a hundred steps.
fn close(found: Pose<f64>, expected: Pose<f64>) {
    let gap = (found.x_m - expected.x_m).abs().max((found.y_m - expected.y_m).abs());
    assert!(gap.max((found.yaw_rad - expected.yaw_rad).abs()) < 1e-10, "{found:?} {expected:?}");
}

#[test]
fn unequal_wheel_radii_turn_a_straight_line_by_the_ratio_over_the_track() {
    let case = case(Effect::UnequalWheelRadii, &[0.01]);
    case.adds((0.5, 0.0), (0.0, 0.0, -0.01 * 0.5 / TRACK_M));
    // In place the turn stays and the centre shifts.
    case.adds((0.0, 1.0), (-0.01 * TRACK_M / 4.0, 0.0, 0.0));
}

#[test]
fn track_width_error_divides_the_yaw_rate() {
    case(Effect::TrackWidthError, &[0.25]).adds((0.5, 1.0), (0.0, 0.0, 1.0 / 1.25 - 1.0));
}

#[test]
fn wheel_radius_error_scales_both_rates() {
    case(Effect::WheelRadiusError, &[0.02]).adds((0.5, 1.0), (0.01, 0.0, 0.02));
}

#[test]
fn longitudinal_slip_costs_the_speed_gained() {
    let end = case(Effect::LongitudinalSlip, &[0.05]).moved(&[(0.2, 0.0), (0.6, 0.0)]);
    close(end, Pose::new(0.8 - 0.05 * 0.4, 0.0, 0.0));
}

#[test]
fn lateral_skid_is_outwards_in_proportion_to_speed_and_yaw_rate() {
    let case = case(Effect::LateralSkid, &[0.1]);
    case.adds((0.5, 0.8), (0.0, -0.1 * 0.5 * 0.8, 0.0));
    case.adds((0.5, -0.8), (0.0, 0.1 * 0.5 * 0.8, 0.0));
}

#[test]
fn icr_offset_moves_the_midpoint_sideways_in_turns() {
    case(Effect::IcrOffset, &[0.1]).adds((0.0, 0.8), (0.0, -0.08, 0.0));
}

#[test]
fn a_castor_kicks_after_a_reversal_and_dies_out_with_the_path() {
    let case = case(Effect::CastorFriction, &[0.1, 0.2]);
    close(case.moved(&[(0.3, 0.0)]), Pose::new(0.3, 0.0, 0.0));
    let yaw = case.moved(&[(0.3, 0.0), (-0.3, 0.0)]).yaw_rad;
    // It begins to swing after the first millimetre.
    assert!((yaw + 0.1 * (1.0 - (-0.299 / 0.2_f64).exp())).abs() < 1e-12, "{yaw}");
}

#[test]
fn speed_dependent_scale_loses_the_square_of_the_speed_both_ways() {
    let case = case(Effect::SpeedDependentScale, &[0.1]);
    case.adds((0.5, 0.3), (-0.025, 0.0, 0.0));
    case.adds((-0.5, 0.3), (0.025, 0.0, 0.0));
}

#[test]
fn turn_loss_costs_distance_in_turns_of_either_sense() {
    let case = case(Effect::TurnLoss, &[0.1]);
    case.adds((0.5, 0.8), (-0.04, 0.0, 0.0));
    case.adds((0.5, -0.8), (-0.04, 0.0, 0.0));
}

#[test]
fn a_payload_shrinks_the_radius_from_its_onset_on() {
    let end = case(Effect::PayloadAdded, &[0.995, -0.01, 0.0]).moved(&[(0.5, 0.0), (0.5, 0.0)]);
    close(end, Pose::new(0.5 + 0.495, 0.0, 0.0));
}

#[test]
fn an_off_centre_payload_changes_ratio_and_track() {
    let case = case(Effect::PayloadOffset, &[0.01, 0.25]);
    case.adds((0.5, 0.0), (0.0, 0.0, -0.01 * 0.5 / (1.25 * TRACK_M)));
}

#[test]
fn a_low_friction_patch_acts_inside_its_region_only() {
    let values = [1.0, 2.0, -1.0, 1.0, 0.05, 0.1];
    let mut case = case(Effect::LowFrictionPatch, &values);
    case.adds((0.4, 0.5), (0.0, 0.0, 0.0));
    case.start = Pose::new(1.2, 0.0, 0.0);
    case.adds((0.4, 0.5), (0.0, -0.1 * 0.2, 0.0));
    case.start = Pose::new(1.1, 0.0, 0.0);
    close(case.moved(&[(0.1, 0.0), (0.3, 0.0)]), Pose::new(0.4 - 0.05 * 0.2, 0.0, 0.0));
}

#[test]
fn a_slippery_floor_acts_everywhere() {
    let case = case(Effect::LowFrictionOverall, &[0.05, 0.1]);
    case.adds((0.4, 0.5), (0.0, -0.02, 0.0));
    close(case.moved(&[(0.1, 0.0), (0.3, 0.0)]), Pose::new(0.39, 0.0, 0.0));
}

#[test]
fn a_push_moves_the_pose_once_in_the_map() {
    let mut case = case(Effect::Push, &[0.505, 0.2, -0.1, 0.3]);
    case.start = Pose::new(0.0, 0.0, FRAC_PI_2);
    // Along x of the map is to the right of a robot that faces along y.
    close(case.moved(&[(0.0, 0.0)]), Pose::new(-0.1, -0.2, 0.3));
}

#[test]
fn a_drift_carries_the_robot_along_the_map() {
    let mut case = case(Effect::WorldDrift, &[0.1, 0.05]);
    case.start = Pose::new(0.0, 0.0, FRAC_PI_2);
    close(case.moved(&[(0.5, 0.0)]), Pose::new(0.55, -0.1, 0.0));
}

#[test]
fn an_eccentric_wheel_repeats_every_turn() {
    let case = case(Effect::WheelEccentricity, &[0.0, 0.001, 0.4]);
    // A second at this speed is one turn of the wheels; half of it sums to -2 A sin(p) on the left wheel.
    let turn = 2.0 * PI * RADIUS_M;
    let full = case.moved(&[(turn, 0.0)]);
    assert!(full.yaw_rad.abs() < 1e-12, "{full:?}");
    let half = case.moved(&[(turn / 2.0, 0.0)]);
    assert!((half.yaw_rad - 2.0 * 0.001 * 0.4_f64.sin() / TRACK_M).abs() < 1e-12, "{half:?}");
}

#[test]
fn steer_trim_adds_to_the_steering_angle_of_a_car() {
    let mut case = case(Effect::SteerTrim, &[0.05]);
    case.drive = Drive::CarLike { wheelbase_m: 0.5 };
    case.surroundings.steer_rad = 0.2;
    close(case.moved(&[(0.4, 0.0)]), Pose::exp(0.4, 0.0, 0.4 * 0.25_f64.tan() / 0.5));
}

#[test]
fn understeer_halves_the_curvature_at_the_characteristic_speed() {
    let mut case = case(Effect::Understeer, &[4.0]);
    case.drive = Drive::CarLike { wheelbase_m: 0.5 };
    case.surroundings.steer_rad = 0.2;
    close(case.moved(&[(0.5, 0.0)]), Pose::exp(0.5, 0.0, 0.5 * 0.2_f64.tan() / 0.5 / 2.0));
}

#[test]
fn a_near_partner_pushes_away_with_a_range() {
    let mut case = case(Effect::PartnerInfluence, &[0.1, 0.5]);
    case.surroundings.partner_m = Some([1.0, 0.0]);
    // Along the line to the partner: ds/dt = A exp(-(1 + s)/R), so exp(s/R) = 1 + A/R exp(-1/R) t.
    let pushed = 0.5 * (1.0 + 0.2 * (-2.0_f64).exp()).ln();
    let found = case.moved(&[(0.0, 0.0)]);
    // Taken at the beginning of steps of 10 ms: an error of a few 1e-6.
    assert!((found.x_m + pushed).abs() < 5e-6 && found.y_m.abs() < 1e-15, "{found:?} {pushed}");
}

#[test]
fn a_crabbing_robot_moves_sideways_in_proportion_to_its_speed() {
    case(Effect::Crab, &[0.02]).adds((-0.5, 0.3), (0.0, -0.01, 0.0));
}

#[test]
fn reverse_asymmetry_scales_both_rates_while_backing_up() {
    let case = case(Effect::ReverseAsymmetry, &[0.02]);
    case.adds((0.5, 0.3), (0.0, 0.0, 0.0));
    case.adds((-0.5, 0.3), (-0.01, 0.0, 0.006));
    // In a spin one wheel turns backwards: half of the excess, and a shift of the centre backwards.
    case.adds((0.0, 2.0), (-0.01 * 2.0 * 0.5 * TRACK_M, 0.0, 0.02));
}

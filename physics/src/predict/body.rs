//! The motion of the body, predicted from encoders.

use std::f64::consts::PI;

use crate::chain::actuator::{Scheduled, turn};
use crate::chain::body::{
    BodyIncrement, BodyState, added, advance, driven_from, driven_to, increment, nominal_motion,
};
use crate::chain::robot::Robot;
use crate::chain::sensors;
use crate::context::{Context, Motion, Surroundings};
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::predict::actuator::CommandWindow;
use crate::scalar::Scalar;

/// The longest step of a window driven by commands, seconds. State-dependent effects are taken from the
/// beginning of a step, those of the actuator at the heading in its middle.
const COMMANDED_STEP_S: f64 = 0.05;

/// A sample of the wheels' cumulative angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderSample {
    /// Seconds by the robot's clock.
    pub time_s: f64,
    /// Left and right, radians.
    pub angle_rad: [f64; 2],
    /// Steering angle, radians, left positive; 0 unless car-like.
    pub steer_rad: f64,
}

/// A window between two encoder samples.
#[derive(Clone, Copy, Debug)]
pub struct BodyWindow<'a> {
    /// Samples at increasing times without a pause: those of the window, and those around it along which
    /// reference poses are carried to its ends.
    pub track: &'a [EncoderSample],
    /// Positions of the first and the last sample of the window.
    pub ends: [usize; 2],
    /// `map_from_robot` at the beginning, for effects that depend on heading or place: from truth, or from
    /// the filter.
    pub start: Pose<f64>,
    /// Neighbours; the steering angle is that of the samples.
    pub surroundings: Surroundings,
    /// Where the nearest robot is in the map at each sample of the window, metres; without it, it stands where
    /// the surroundings have it.
    pub partner_m: &'a [Option<[f64; 2]>],
}

impl<'a> BodyWindow<'a> {
    /// From the first to the last of these samples, with nothing known around them.
    pub fn whole(samples: &'a [EncoderSample], start: Pose<f64>, surroundings: Surroundings) -> Self {
        let ends = [0, samples.len().saturating_sub(1)];
        Self { track: samples, ends, start, surroundings, partner_m: &[] }
    }

    /// The stamps of the first and the last sample, seconds.
    pub fn stamps_s(&self) -> [f64; 2] {
        self.ends.map(|end| self.track.get(end).map_or(0.0, |sample| sample.time_s))
    }

    fn duration_s(&self) -> f64 {
        let [from_s, to_s] = self.stamps_s();
        to_s - from_s
    }

    fn middle_s(&self) -> f64 {
        self.stamps_s()[0] + 0.5 * self.duration_s()
    }

    /// The robot at a pose, as its wheels begin a step. Its pose matters where the model `places` the body.
    fn step<S: Scalar>(
        &self,
        model: &RobotModel<S>,
        from: usize,
        (pose, places): (Pose<S>, bool),
        state: &mut BodyState<S>,
    ) -> BodyIncrement<S> {
        let (before, after) = (&self.track[from], &self.track[from + 1]);
        let turned = [0, 1].map(|wheel| S::constant(after.angle_rad[wheel] - before.angle_rad[wheel]));
        let mut context = self.context(model, from, pose);
        if places {
            // Effects of heading and place act as in the middle of the step.
            let (forward_m, yaw_rad) = nominal_motion(model, &context, turned);
            context.motion.pose = pose.compose(&Pose::exp(forward_m * 0.5, S::zero(), yaw_rad * 0.5));
        }
        increment(model, &context, turned, state)
    }

    /// The step from a sample of the track to the next.
    fn context<'m, S: Scalar>(&self, model: &'m RobotModel<S>, from: usize, pose: Pose<S>) -> Context<'m, S> {
        let partner_m = self.partner_at(from);
        let (from, to) = (&self.track[from], &self.track[from + 1]);
        let mut motion = Motion::at_rest(pose);
        // An encoder shows the last tick passed: the wheel is half a tick beyond, on average.
        let ticks = model.nominal.encoder_ticks_per_rev;
        let half_tick_rad = if ticks > 0.0 { S::constant(PI) / ticks } else { S::zero() };
        motion.wheel_angle_rad = from.angle_rad.map(|angle_rad| half_tick_rad + angle_rad);
        let steer_rad = f64::midpoint(from.steer_rad, to.steer_rad);
        Context {
            surroundings: Surroundings { steer_rad, partner_m, ..self.surroundings },
            ..Context::new(&model.nominal, from.time_s, motion).over(S::constant(to.time_s - from.time_s))
        }
    }

    /// Where the nearest robot is in the middle of the step that begins at a sample of the track.
    fn partner_at(&self, from: usize) -> Option<[f64; 2]> {
        let Some(last) = self.partner_m.len().checked_sub(1) else { return self.surroundings.partner_m };
        let at = |index: usize| self.partner_m[index.saturating_sub(self.ends[0]).min(last)];
        let (from, to) = (at(from)?, at(from + 1)?);
        Some([0, 1].map(|axis| f64::midpoint(from[axis], to[axis])))
    }

    /// By how much more than evenly the robot has driven in the middle of the step that begins at a sample,
    /// times four: forward, left (metres), yaw (radians). The wheels speed up as from the step before to the
    /// step after; without those they do not.
    fn bend<S: Scalar>(&self, model: &RobotModel<S>, index: usize) -> [S; 3] {
        let none = [S::zero(); 3];
        let samples = index.checked_sub(1).and_then(|first| self.track.get(first..index + 3));
        let Some([before, from, to, after]) = samples else { return none };
        let spans_s = [from.time_s - before.time_s, to.time_s - from.time_s, after.time_s - to.time_s];
        if spans_s.iter().any(|span_s| *span_s <= 0.0) {
            return none;
        }
        let reach_s = 0.5 * (spans_s[0] + spans_s[2]) + spans_s[1];
        let bent = [0, 1].map(|wheel| {
            let rate_before = (from.angle_rad[wheel] - before.angle_rad[wheel]) / spans_s[0];
            let rate_after = (after.angle_rad[wheel] - to.angle_rad[wheel]) / spans_s[2];
            S::constant(-0.5 * spans_s[1] * spans_s[1] * (rate_after - rate_before) / reach_s)
        });
        let context = self.context(model, index, Pose::identity());
        let (forward_m, yaw_rad) = nominal_motion(model, &context, bent);
        [forward_m, S::zero(), yaw_rad]
    }
}

/// What a window was rolled out to.
struct Rollout<S> {
    start: Pose<S>,
    end: Pose<S>,
    /// Of the last step.
    motion: Motion<S>,
    /// The state of the body at the beginning.
    before: BodyState<S>,
}

/// Rolls a window out; if nobody asks for `positions`, the yaw alone unless the model needs them itself.
fn roll_out<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    state: &mut BodyState<S>,
    positions: bool,
) -> Rollout<S> {
    let places = model.places_body();
    let start: Pose<S> = Pose::constant(window.start.x_m, window.start.y_m, window.start.yaw_rad);
    let before = *state;
    let mut motion = Motion::at_rest(start);
    let last = window.ends[1].min(window.track.len().saturating_sub(1));
    for from in window.ends[0]..last {
        if window.track[from + 1].time_s <= window.track[from].time_s {
            continue;
        }
        let step = window.step(model, from, (motion.pose, places), state);
        if positions || places {
            motion.pose = step.applied_to(&motion.pose);
        } else {
            motion.pose.yaw_rad += step.driven[2];
            motion.pose.yaw_rad += step.added.yaw_rad;
        }
        motion.speed_m_s = step.speed_m_s;
        motion.yaw_rate_rad_s = step.yaw_rate_rad_s;
        motion.acceleration_m_s2 = step.acceleration_m_s2;
    }
    Rollout { start, end: motion.pose, motion, before }
}

/// The motion of the axle midpoint over the window, in the frame of its beginning. Run windows in order:
/// the body's state goes from one to the next.
pub fn body_motion<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    state: &mut BodyState<S>,
) -> Pose<S> {
    let rollout = roll_out(model, window, state, true);
    rollout.start.between(&rollout.end)
}

/// What the body remembers after the window.
pub fn body_state<S: Scalar>(model: &RobotModel<S>, window: &BodyWindow<'_>, state: &mut BodyState<S>) {
    roll_out(model, window, state, false);
}

/// The motion that the reference system sees between two reference poses with these stamps, near the ends
/// of the window: of its marker, as late as it is, and by its own clock.
///
/// A robot's clock that is ahead by `e` stamps a sample `e` too late, and a reference pose is `L` older than
/// its stamp: a reference pose stamped `s` is of the robot's stamp `s + e - L`. To there the window's ends are
/// carried along the encoders, so that the derivative by `e - L` is the velocity then.
pub fn truth_change<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    stamps_s: [f64; 2],
    state: &mut BodyState<S>,
) -> Pose<S> {
    let rollout = roll_out(model, window, state, true);
    let first = seen_after(model, window, (0, rollout.start, &rollout.before), stamps_s[0]);
    let last = seen_after(model, window, (1, rollout.end, state), stamps_s[1]);
    first.between(&last)
}

/// The reference pose stamped `stamp_s`, from the pose at one end of a window.
fn seen_after<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    (end, pose, state): (usize, Pose<S>, &BodyState<S>),
    stamp_s: f64,
) -> Pose<S> {
    let at_s = window.stamps_s()[end];
    let context = Context::new(&model.nominal, at_s, Motion::at_rest(pose));
    let reading = sensors::truth_reading(model, &context);
    let ahead_s = sensors::clock_error_s(model, &context) - reading.latency_s + (stamp_s - at_s);
    let then = carried(model, window, (window.ends[end], pose, state), ahead_s);
    then.compose(&sensors::marker(&reading))
}

/// Where the robot is `ahead_s` after a sample of the encoders (before it, if negative): along them as far
/// as they go, then at the velocity of the last step, which may be the other way.
fn carried<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    (mut at, mut pose, state): (usize, Pose<S>, &BodyState<S>),
    ahead_s: S,
) -> Pose<S> {
    let places = model.places_body();
    let mut state = *state;
    let mut rest_s = ahead_s;
    let forth = ahead_s.value() >= 0.0;
    let sense = if forth { 1.0 } else { -1.0 };
    // The first sample of the step taken last.
    let mut last: Option<usize> = None;
    loop {
        let next = if forth { at.checked_add(1) } else { at.checked_sub(1) };
        let Some((next, there)) = next.and_then(|next| Some((next, window.track.get(next)?))) else {
            let from = last.or(if forth { at.checked_sub(1) } else { Some(at) });
            let lasted_s = |from: usize| {
                Some((from, window.track.get(from + 1)?.time_s - window.track.get(from)?.time_s))
            };
            return match from.and_then(lasted_s) {
                Some((from, lasted_s)) if lasted_s > 0.0 => {
                    let step = window.step(model, from, (pose, places), &mut state);
                    let share = rest_s / lasted_s;
                    let driven = step.driven.map(|part| part * share);
                    driven_from(&pose, driven, &step.added.share(share))
                }
                _ => pose,
            };
        };
        let here = &window.track[at];
        let step_s = (there.time_s - here.time_s).abs();
        if step_s > 0.0 {
            let from = at.min(next);
            let step = window.step(model, from, (pose, places), &mut state);
            let part_s = rest_s * sense;
            if part_s.value() < step_s {
                let share = part_s / step_s;
                let bend = window.bend(model, from);
                let curve = share * (S::one() - share) * sense;
                let driven = [0, 1, 2].map(|part| step.driven[part] * share + bend[part] * curve);
                // What happens at an instant is in this part of the step or not.
                let mut context = window.context(model, from, pose);
                context.time_s = if forth { here.time_s } else { here.time_s - part_s.value() };
                context.step_s = part_s;
                let added = added(model, &context);
                return if forth {
                    driven_from(&pose, driven, &added)
                } else {
                    driven_to(&pose, driven, &added)
                };
            }
            pose = if forth {
                driven_from(&pose, step.driven, &step.added)
            } else {
                driven_to(&pose, step.driven, &step.added)
            };
            last = Some(from);
            rest_s -= S::constant(sense * step_s);
        }
        at = next;
    }
}

/// The reference pose whose stamp equals the robot's stamp `time_s` of this motion.
fn seen_by_truth<S: Scalar>(model: &RobotModel<S>, motion: Motion<S>, time_s: f64) -> Pose<S> {
    let context = Context::new(&model.nominal, time_s, motion);
    let reading = sensors::truth_reading(model, &context);
    let ahead_s = sensors::clock_error_s(model, &context) - reading.latency_s;
    motion.carried(ahead_s).compose(&sensors::marker(&reading))
}

/// The motion that the reference system sees over a window that is driven by commands alone, for
/// recordings without encoders. `robot` keeps servo and body from window to window; it is put to the
/// window's beginning and driven in steps of about 50 ms.
pub fn commanded_truth_change<S: Scalar>(
    model: &RobotModel<S>,
    scheduled: &[Scheduled<S>],
    window: &CommandWindow,
    robot: &mut Robot<S>,
) -> Pose<S> {
    let start = window.motion.lift();
    robot.time_s = window.from_s;
    robot.motion.pose = start.pose;
    robot.motion.speed_m_s = robot.actuator.speed_m_s;
    robot.motion.yaw_rate_rad_s = robot.actuator.yaw_rate_rad_s;
    let first = seen_by_truth(model, robot.motion, window.from_s);
    let duration_s = window.to_s - window.from_s;
    let steps = libm::ceil(duration_s / COMMANDED_STEP_S).max(1.0);
    // The cast saturates: a window is never that long.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for _ in 0..steps as u32 {
        drive(model, scheduled, window.surroundings, duration_s / steps, robot);
    }
    first.between(&seen_by_truth(model, robot.motion, window.to_s))
}

/// A coarse step: like [`Robot::drive`], with the loads on the servo at the heading in the step's middle.
fn drive<S: Scalar>(
    model: &RobotModel<S>,
    scheduled: &[Scheduled<S>],
    surroundings: Surroundings,
    step_s: f64,
    robot: &mut Robot<S>,
) {
    let until_s = robot.time_s + step_s;
    let mut context = Context {
        surroundings,
        ..Context::new(&model.nominal, robot.time_s, robot.motion).over(S::constant(step_s))
    };
    context.motion.pose.yaw_rad += robot.motion.yaw_rate_rad_s * (0.5 * step_s);
    let turned = turn(model, &context, scheduled, (robot.time_s, until_s), &mut robot.actuator);
    context.motion.pose = robot.motion.pose;
    let step = advance(model, &context, turned, &mut robot.body);
    robot.motion.pose = step.pose;
    robot.motion.speed_m_s = step.speed_m_s;
    robot.motion.yaw_rate_rad_s = step.yaw_rate_rad_s;
    robot.motion.acceleration_m_s2 = step.acceleration_m_s2;
    for (angle, wheel) in robot.motion.wheel_angle_rad.iter_mut().zip(turned) {
        *angle += wheel;
    }
    robot.time_s = until_s;
}

/// The mean yaw rate that the gyro reads over the window, rad/s.
pub fn mean_gyro<S: Scalar>(model: &RobotModel<S>, window: &BodyWindow<'_>, state: &mut BodyState<S>) -> S {
    let rollout = roll_out(model, window, state, false);
    let mut motion = rollout.motion;
    let duration_s = window.duration_s();
    if duration_s > 0.0 {
        motion.yaw_rate_rad_s = (rollout.end.yaw_rad - rollout.start.yaw_rad) / duration_s;
    }
    let context = Context::new(&model.nominal, window.middle_s(), motion);
    sensors::gyro(model, &context, &mut S::zero())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::actuator::{Command, schedule};
    use crate::{Chance, Drive, Nominal, NominalParameter, Variable};

    fn circle() -> [EncoderSample; 11] {
        // Radius 0.05 m, track 0.3 m: 0.5 m/s and 1 rad/s.
        std::array::from_fn(|i| {
            let time_s = 0.1 * i as f64;
            let angle_rad = [(0.5 - 0.15) / 0.05 * time_s, (0.5 + 0.15) / 0.05 * time_s];
            EncoderSample { time_s, angle_rad, steer_rad: 0.0 }
        })
    }

    fn model() -> RobotModel<f64> {
        RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3))
    }

    #[test]
    fn a_nominal_window_is_an_arc() {
        let samples = circle();
        let window = BodyWindow::whole(&samples, Pose::new(3.0, 1.0, 2.0), Surroundings::default());
        let change = truth_change(&model(), &window, window.stamps_s(), &mut BodyState::default());
        assert!((change.x_m - 0.5 * 1.0_f64.sin()).abs() < 1e-12);
        assert!((change.y_m - 0.5 * (1.0 - 1.0_f64.cos())).abs() < 1e-12);
        assert!((change.yaw_rad - 1.0).abs() < 1e-12);
        assert!((mean_gyro(&model(), &window, &mut BodyState::default()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn without_encoders_a_command_makes_the_same_arc() {
        let model = model();
        let command = Command { time_s: 0.0, speed_m_s: 0.5, yaw_rate_rad_s: 1.0 };
        let scheduled = schedule(&model, &[command], |_| Chance::EXPECTED);
        let motion = Motion::at_rest(Pose::new(3.0, 1.0, 2.0));
        let window = CommandWindow { from_s: 0.5, to_s: 1.5, motion, surroundings: Surroundings::default() };
        let mut robot = Robot::at_rest(Pose::identity());
        let change = commanded_truth_change(&model, &scheduled, &window, &mut robot);
        assert!((change.x_m - 0.5 * 1.0_f64.sin()).abs() < 1e-12, "{change:?}");
        assert!((change.yaw_rad - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nominal_parameters_are_differentiated_like_effects() {
        let samples = circle();
        let window = BodyWindow::whole(&samples, Pose::identity(), Surroundings::default());
        let variables = [NominalParameter::WheelRadius, NominalParameter::TrackWidth].map(Variable::Nominal);
        let model = model().differentiated(&variables);
        let yaw = body_motion(&model, &window, &mut BodyState::default()).yaw_rad;
        // yaw = r (right - left) / b.
        assert!((yaw.derivatives()[0] - 1.0 / 0.05).abs() < 1e-9);
        assert!((yaw.derivatives()[1] + 1.0 / 0.3).abs() < 1e-9);
    }
}

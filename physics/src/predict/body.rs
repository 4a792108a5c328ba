//! The motion of the body, predicted from encoders.

use crate::chain::actuator::{Scheduled, turn};
use crate::chain::body::{BodyState, advance};
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

/// Encoder samples from the beginning to the end of a window.
#[derive(Clone, Copy, Debug)]
pub struct BodyWindow<'a> {
    /// At least two, at increasing times.
    pub samples: &'a [EncoderSample],
    /// `map_from_robot` at the beginning, for effects that depend on heading or place: from truth, or from
    /// the filter.
    pub start: Pose<f64>,
    /// Neighbours; the steering angle is that of the samples.
    pub surroundings: Surroundings,
}

impl BodyWindow<'_> {
    fn duration_s(&self) -> f64 {
        match (self.samples.first(), self.samples.last()) {
            (Some(first), Some(last)) => last.time_s - first.time_s,
            _ => 0.0,
        }
    }

    fn middle_s(&self) -> f64 {
        self.samples.first().map_or(0.0, |first| first.time_s) + 0.5 * self.duration_s()
    }
}

/// What a window was rolled out to.
struct Rollout<S> {
    end: Pose<S>,
    first: Motion<S>,
    last: Motion<S>,
}

fn roll_out<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    state: &mut BodyState<S>,
) -> Rollout<S> {
    let start: Pose<S> = Pose::constant(window.start.x_m, window.start.y_m, window.start.yaw_rad);
    let mut motion = Motion::at_rest(start);
    let mut first = None;
    for pair in window.samples.windows(2) {
        let step_s = pair[1].time_s - pair[0].time_s;
        if step_s <= 0.0 {
            continue;
        }
        motion.wheel_angle_rad = pair[0].angle_rad.map(S::constant);
        let turned = [0, 1].map(|wheel| S::constant(pair[1].angle_rad[wheel] - pair[0].angle_rad[wheel]));
        let steer_rad = f64::midpoint(pair[0].steer_rad, pair[1].steer_rad);
        let context = Context {
            surroundings: Surroundings { steer_rad, ..window.surroundings },
            ..Context::new(&model.nominal, pair[0].time_s, motion).over(S::constant(step_s))
        };
        let step = advance(model, &context, turned, state);
        motion.pose = step.pose;
        motion.speed_m_s = step.speed_m_s;
        motion.yaw_rate_rad_s = step.yaw_rate_rad_s;
        motion.acceleration_m_s2 = step.acceleration_m_s2;
        first.get_or_insert(Motion { pose: start, ..motion });
    }
    Rollout { end: motion.pose, first: first.unwrap_or(motion), last: motion }
}

/// The motion of the axle midpoint over the window, in the frame of its beginning. Run windows in order:
/// the body's state goes from one to the next.
pub fn body_motion<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    state: &mut BodyState<S>,
) -> Pose<S> {
    let rollout = roll_out(model, window, state);
    rollout.first.pose.between(&rollout.end)
}

/// The motion that the reference system sees between the window's stamps: of its marker, as late as it is,
/// and by its own clock.
///
/// The encoders' window is `e` (the clock error) earlier in common time than its stamps say, and a reference
/// pose is `L` older than its stamp; both ends are carried by `e - L` with the motion measured there.
pub fn truth_change<S: Scalar>(
    model: &RobotModel<S>,
    window: &BodyWindow<'_>,
    state: &mut BodyState<S>,
) -> Pose<S> {
    let rollout = roll_out(model, window, state);
    let [first_s, last_s] =
        [window.samples.first(), window.samples.last()].map(|sample| sample.map_or(0.0, |own| own.time_s));
    seen_by_truth(model, rollout.first, first_s).between(&seen_by_truth(model, rollout.last, last_s))
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
    let rollout = roll_out(model, window, state);
    let mut motion = rollout.last;
    let duration_s = window.duration_s();
    if duration_s > 0.0 {
        motion.yaw_rate_rad_s = (rollout.end.yaw_rad - rollout.first.pose.yaw_rad) / duration_s;
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
        let window = BodyWindow {
            samples: &samples,
            start: Pose::new(3.0, 1.0, 2.0),
            surroundings: Surroundings::default(),
        };
        let change = truth_change(&model(), &window, &mut BodyState::default());
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
        let window =
            BodyWindow { samples: &samples, start: Pose::identity(), surroundings: Surroundings::default() };
        let variables = [NominalParameter::WheelRadius, NominalParameter::TrackWidth].map(Variable::Nominal);
        let model = model().differentiated(&variables);
        let yaw = body_motion(&model, &window, &mut BodyState::default()).yaw_rad;
        // yaw = r (right - left) / b.
        assert!((yaw.derivatives()[0] - 1.0 / 0.05).abs() < 1e-9);
        assert!((yaw.derivatives()[1] + 1.0 / 0.3).abs() < 1e-9);
    }
}

//! From commands to the turning of the wheels.

use crate::chain::servo::follow;
use crate::context::{Chance, Context, Motion};
use crate::model::{Drive, RobotModel};
use crate::pose::Pose;
use crate::scalar::Scalar;
use crate::signal::{CommandTiming, Servo, SetPoint, Transmission, WheelSetPoint};

/// A command as it was recorded. It holds until the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Its stamp, seconds.
    pub time_s: f64,
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
}

/// A command with the instant from which it acts.
#[derive(Clone, Copy, Debug)]
pub struct Scheduled<S> {
    /// Seconds. Differentiable: this is how a delay acts on predictions.
    pub from_s: S,
    /// What was commanded.
    pub command: Command,
}

/// What the servo and the transmission remember.
#[derive(Clone, Copy, Debug)]
pub struct ActuatorState<S> {
    /// Forward speed that the servo has reached, m/s.
    pub speed_m_s: S,
    /// Yaw rate that the servo has reached, rad/s.
    pub yaw_rate_rad_s: S,
    /// Where in its play each shaft is, radians from the middle.
    pub play_rad: [S; 2],
}

impl<S: Scalar> Default for ActuatorState<S> {
    /// At rest, in the middle of the play.
    fn default() -> Self {
        let zero = S::zero();
        Self { speed_m_s: zero, yaw_rate_rad_s: zero, play_rad: [zero, zero] }
    }
}

/// When each command takes effect. Commands that are lost are left out; one that would overtake its
/// predecessor waits for it.
///
/// `chance` gives the draws for a command by its position: [`Chance::EXPECTED`] for a prediction.
pub fn schedule<S: Scalar>(
    model: &RobotModel<S>,
    commands: &[Command],
    mut chance: impl FnMut(usize) -> Chance,
) -> Vec<Scheduled<S>> {
    let mut scheduled: Vec<Scheduled<S>> = Vec::with_capacity(commands.len());
    for (position, &command) in commands.iter().enumerate() {
        let mut context = Context::new(&model.nominal, command.time_s, Motion::at_rest(Pose::identity()));
        context.chance = chance(position);
        schedule_next(model, &context, command, &mut scheduled);
    }
    scheduled
}

/// Appends one command to those that are scheduled, unless it is lost. The context is that of the instant at
/// which it was given.
pub fn schedule_next<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    command: Command,
    scheduled: &mut Vec<Scheduled<S>>,
) {
    let mut timing = CommandTiming { delay_s: model.nominal.command_latency_s, lost: false };
    model.apply(context, |effect, values| effect.command_timing(values, context, &mut timing));
    if !timing.lost {
        let own = timing.delay_s + command.time_s;
        let from_s = scheduled.last().map_or(own, |last| own.max(last.from_s));
        scheduled.push(Scheduled { from_s, command });
    }
}

/// The angles in radians by which the left and right wheel turn from `from_s` to `to_s`.
///
/// The scheduled commands are held in between and the servo is integrated exactly; `context` gives what
/// changes slowly, such as the heading on a slope. The state goes from window to window.
pub fn turn<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    scheduled: &[Scheduled<S>],
    (from_s, to_s): (f64, f64),
    state: &mut ActuatorState<S>,
) -> [S; 2] {
    let begun = scheduled.partition_point(|command| command.from_s <= from_s);
    let mut current = begun.checked_sub(1).map(|last| scheduled[last].command);
    let mut now_s = S::constant(from_s);
    let mut turned = [S::zero(); 2];
    let within = scheduled[begun..].iter().take_while(|command| command.from_s < to_s);
    let changes = within.map(|next| (next.from_s, Some(next.command)));
    for (until_s, next) in changes.chain([(S::constant(to_s), None)]) {
        let step = hold(model, &context.over(until_s - now_s), current, state);
        for (sum, wheel) in turned.iter_mut().zip(step) {
            *sum += wheel;
        }
        now_s = until_s;
        current = next;
    }
    turned
}

/// Holds one command for the length of the context's step.
fn hold<S: Scalar>(
    model: &RobotModel<S>,
    context: &Context<S>,
    command: Option<Command>,
    state: &mut ActuatorState<S>,
) -> [S; 2] {
    let mut context = *context;
    context.motion.speed_m_s = state.speed_m_s;
    context.motion.yaw_rate_rad_s = state.yaw_rate_rad_s;
    let (speed, yaw_rate) = command.map_or((0.0, 0.0), |held| (held.speed_m_s, held.yaw_rate_rad_s));
    let mut set_point = SetPoint { speed_m_s: S::constant(speed), yaw_rate_rad_s: S::constant(yaw_rate) };
    model.apply(&context, |effect, values| effect.set_point(values, &context, &mut set_point));

    let kinematics = Firmware::of(model);
    let mut wheels =
        WheelSetPoint { speed_rad_s: kinematics.wheels(set_point.speed_m_s, set_point.yaw_rate_rad_s) };
    model.apply(&context, |effect, values| effect.wheel_set_point(values, &context, &mut wheels));
    let (speed, yaw_rate) = kinematics.body(wheels.speed_rad_s);

    let servo = servo(model, &context);
    let unlimited = S::constant(f64::INFINITY);
    let along = follow(
        state.speed_m_s,
        speed + servo.droop_m_s,
        servo.time_constant_s,
        servo.acceleration_limit_m_s2,
        context.step_s,
    );
    let turning =
        follow(state.yaw_rate_rad_s, yaw_rate, servo.time_constant_turn_s, unlimited, context.step_s);
    state.speed_m_s = along.speed;
    state.yaw_rate_rad_s = turning.speed;

    let turned_rad = kinematics.wheels(along.distance, turning.distance);
    let mut transmission = Transmission { turned_rad, play_rad: state.play_rad };
    model.apply(&context, |effect, values| effect.transmission(values, &context, &mut transmission));
    state.play_rad = transmission.play_rad;
    transmission.turned_rad
}

/// How the servo follows its set-point.
pub fn servo<S: Scalar>(model: &RobotModel<S>, context: &Context<S>) -> Servo<S> {
    let mut servo = Servo {
        time_constant_s: model.nominal.servo_time_constant_s,
        time_constant_turn_s: model.nominal.servo_time_constant_turn_s,
        acceleration_limit_m_s2: S::constant(f64::INFINITY),
        droop_m_s: S::zero(),
    };
    model.apply(context, |effect, values| effect.servo(values, context, &mut servo));
    servo
}

/// The kinematics that the firmware believes: always those of the nominal robot.
struct Firmware<S> {
    radius_m: S,
    half_track_m: S,
}

impl<S: Scalar> Firmware<S> {
    fn of(model: &RobotModel<S>) -> Self {
        let ratio = match model.drive {
            Drive::SkidSteer { track_ratio } => track_ratio,
            Drive::Differential | Drive::CarLike { .. } => 1.0,
        };
        Self { radius_m: model.nominal.wheel_radius, half_track_m: model.nominal.track_width * (0.5 * ratio) }
    }

    /// `w_left = (v - w b/2)/r`, `w_right = (v + w b/2)/r`.
    fn wheels(&self, speed: S, yaw_rate: S) -> [S; 2] {
        let turn = yaw_rate * self.half_track_m;
        [(speed - turn) / self.radius_m, (speed + turn) / self.radius_m]
    }

    fn body(&self, [left, right]: [S; 2]) -> (S, S) {
        let half = self.radius_m * 0.5;
        ((left + right) * half, (right - left) * half / self.half_track_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dual, Nominal, NominalParameter, Variable};

    fn model() -> RobotModel<f64> {
        let mut nominal = Nominal::ideal(0.05, 0.4);
        (nominal.servo_time_constant_s, nominal.servo_time_constant_turn_s) = (0.1, 0.05);
        RobotModel::nominal(Drive::Differential, nominal)
    }

    fn step_command() -> [Command; 2] {
        [
            Command { time_s: 0.0, speed_m_s: 0.0, yaw_rate_rad_s: 0.0 },
            Command { time_s: 1.0, speed_m_s: 0.5, yaw_rate_rad_s: 1.0 },
        ]
    }

    fn turned<S: Scalar>(model: &RobotModel<S>, window: (f64, f64), from: &mut ActuatorState<S>) -> [S; 2] {
        let scheduled = schedule(model, &step_command(), |_| Chance::EXPECTED);
        let context = Context::new(&model.nominal, window.0, Motion::at_rest(Pose::identity()));
        turn(model, &context, &scheduled, window, from)
    }

    #[test]
    fn a_step_turns_the_wheels_by_the_integral_of_its_exponential() {
        let [left, right] = turned(&model(), (0.5, 1.5), &mut ActuatorState::default());
        let distance = 0.5 * (0.5 - 0.1 * (1.0 - (-5.0_f64).exp()));
        let yaw = 1.0 * (0.5 - 0.05 * (1.0 - (-10.0_f64).exp()));
        assert!((f64::midpoint(left, right) * 0.05 - distance).abs() < 1e-12);
        assert!(((right - left) / 0.4 * 0.05 - yaw).abs() < 1e-12);
    }

    #[test]
    fn the_state_makes_windows_join() {
        let mut state = ActuatorState::default();
        let whole = turned(&model(), (0.5, 1.5), &mut ActuatorState::default());
        let first = turned(&model(), (0.5, 1.03), &mut state);
        let second = turned(&model(), (1.03, 1.5), &mut state);
        assert!((whole[0] - first[0] - second[0]).abs() < 1e-12);
    }

    #[test]
    fn the_slope_in_the_latency_is_minus_the_speed_gained() {
        let model = model().differentiated(&[Variable::Nominal(NominalParameter::CommandLatency)]);
        let mut state = ActuatorState::<Dual<1>>::default();
        let [left, right] = turned(&model, (0.5, 1.5), &mut state);
        // A later start shifts the whole response: d distance / d delay = -v(end).
        let speed = 0.5 * (1.0 - (-5.0_f64).exp());
        let found = f64::midpoint(left.derivatives()[0], right.derivatives()[0]) * 0.05;
        assert!((found + speed).abs() < 1e-12, "{found}");
    }
}

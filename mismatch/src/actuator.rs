//! The wheels against the servo that follows the commands.

use pleiad_estimation::RobotId;
use pleiad_physics::chain::actuator::ActuatorState;
use pleiad_physics::predict::{CommandWindow, wheel_turns};
use pleiad_physics::{Pose, RobotModel, Scalar};

use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::schedule::Schedule;
use crate::track::{Track, motion};
use crate::windows::windows;

/// Length of a window, seconds.
const WINDOW_S: f64 = 0.2;
/// After this long a servo has forgotten how it stood at the first command, seconds.
pub(crate) const SETTLING_S: f64 = 0.6;
/// In a part of a window the robot turns no more than this, radians: loads that depend on the heading are
/// right to `0.05^2/24`, a ten-thousandth.
const MOST_TURN_RAD: f64 = 0.05;
/// A window has no more parts.
const MOST_PARTS: f64 = 16.0;

/// A window of the wheels.
pub(crate) struct Turning {
    /// From where the window before ended to where this begins: nothing is compared, the servo goes on.
    before: Option<CommandWindow>,
    pub(crate) window: CommandWindow,
    /// The window, in parts in which the heading hardly changes.
    parts: Vec<CommandWindow>,
    regime: Regime,
    /// By how much the wheels turned, left and right, radians; `None` where the prediction is not known.
    pub(crate) measured: Option<[f64; 2]>,
}

/// Commands are held to the next, through pauses of the encoders too. Where there is no truth, loads that
/// depend on place or heading act as at the origin.
pub(crate) fn plan(evidence: &Evidence<'_>, robot: RobotId) -> Plan<Turning> {
    let Some((_, track)) = evidence.robot(robot) else {
        return Plan::without(Omission::NotRecorded("robot"));
    };
    if let Some(omission) = track.wheels_missing() {
        return Plan::without(omission);
    }
    let (Some(&(first_s, _)), Some(&(_, known_until_s))) =
        (track.commanded_s.first(), track.commanded_s.last())
    else {
        return Plan::without(Omission::NotRecorded("commands"));
    };
    let (found, interrupted) = windows(&track.encoders, |sample| sample.time_s, WINDOW_S, track.pause_s);
    let mut plan = Plan::new();
    plan.count_many(interrupted, |count| Omission::NoWheels(robot, count));
    let mut reached_s = first_s;
    for window in found {
        let (from, to) = (track.encoders[window.first], track.encoders[window.last]);
        if to.time_s <= reached_s {
            plan.count(Omission::NoCommand);
            continue;
        }
        let middle_s = f64::midpoint(from.time_s, to.time_s);
        let Some(regime) = track.regime_at(middle_s) else {
            plan.count(|count| Omission::NoWheels(robot, count));
            continue;
        };
        let between = |from_s, to_s| {
            let middle_s = f64::midpoint(from_s, to_s);
            let regime = track.regime_at(middle_s).unwrap_or(regime);
            let place = regime.pose.map(|pose| pose.position());
            CommandWindow {
                from_s,
                to_s,
                motion: motion(&regime, regime.pose.unwrap_or(Pose::identity())),
                surroundings: evidence.surroundings(robot, middle_s, place),
            }
        };
        let known = from.time_s >= first_s + SETTLING_S && to.time_s <= known_until_s;
        if !known {
            plan.count(Omission::NoCommand);
        }
        plan.items.push(Turning {
            before: (from.time_s > reached_s).then(|| between(reached_s, from.time_s)),
            window: between(from.time_s.max(reached_s), to.time_s),
            parts: parts(from.time_s.max(reached_s), to.time_s, &regime)
                .map(|(from_s, to_s)| between(from_s, to_s))
                .collect(),
            regime,
            measured: known.then(|| [0, 1].map(|wheel| to.angle_rad[wheel] - from.angle_rad[wheel])),
        });
        reached_s = to.time_s;
    }
    plan
}

/// Parts of a window, as many as it takes that the robot turns little in each.
fn parts(from_s: f64, to_s: f64, regime: &Regime) -> impl Iterator<Item = (f64, f64)> {
    let turned_rad = regime.yaw_rate_rad_s.abs() * (to_s - from_s);
    // A window is short: there are never many.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (turned_rad / MOST_TURN_RAD).ceil().clamp(1.0, MOST_PARTS) as u32;
    let edge = move |index: u32| from_s + (to_s - from_s) * f64::from(index) / f64::from(count);
    (0..count).map(move |index| (edge(index), if index + 1 == count { to_s } else { edge(index + 1) }))
}

/// Turning of the wheels, measured minus predicted: their mean, and right minus left. The servo is
/// integrated exactly.
pub(crate) fn residuals<S: Scalar>(
    track: &Track,
    plan: &Plan<Turning>,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Actuator, plan);
    let mut schedule = Schedule::new(model, &track.commands);
    let mut state = ActuatorState::default();
    for own in &plan.items {
        if let Some(before) = &own.before {
            wheel_turns(model, schedule.within(before), before, &mut state);
        }
        let mut predicted = [S::zero(); 2];
        for part in &own.parts {
            let turned = wheel_turns(model, schedule.within(part), part, &mut state);
            for (sum, wheel) in predicted.iter_mut().zip(turned) {
                *sum += wheel;
            }
        }
        let Some(measured) = own.measured else { continue };
        let [left, right] = [0, 1].map(|wheel| -predicted[wheel] + measured[wheel]);
        let middle_s = f64::midpoint(own.window.from_s, own.window.to_s);
        let values = [(left + right) * 0.5, right - left];
        channel.push(Residual::new(middle_s, own.regime, None, &values, &[]));
    }
    channel
}

//! The wheels against the servo that follows the commands.

use pleiad_estimation::RobotId;
use pleiad_physics::chain::actuator::{ActuatorState, Command, schedule};
use pleiad_physics::predict::{CommandWindow, wheel_turns};
use pleiad_physics::{Chance, Pose, RobotModel, Scalar};

use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::residual::{ChannelResiduals, Omission};
use crate::track::{median_step, motion};
use crate::windows::windows;

/// Length of a window, seconds.
const WINDOW_S: f64 = 0.2;
/// After this long a servo has forgotten how it stood at the first command, seconds.
const SETTLING_S: f64 = 0.6;

/// Turning of the wheels, measured minus predicted: their mean, and right minus left.
///
/// Commands are held to the next and the servo is integrated exactly, through pauses of the encoders too.
/// Where there is no truth, loads that depend on place or heading act as at the origin.
pub(crate) fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::new(Channel::Actuator);
    let Some((recording, track)) = evidence.robot(robot) else { return channel };
    let commands: Vec<Command> = recording
        .commands
        .iter()
        .map(|command| Command {
            time_s: command.time.seconds(),
            speed_m_s: command.forward_m_s,
            yaw_rate_rad_s: command.yaw_rate_rad_s,
        })
        .collect();
    let (Some(first), Some(last)) = (commands.first(), commands.last()) else {
        return ChannelResiduals::without(Channel::Actuator, Omission::NotRecorded("commands"));
    };
    // How long the last command held nobody knows; a period is sure.
    let known_until_s = last.time_s + median_step(commands.iter().map(|command| command.time_s));
    let scheduled = schedule(model, &commands, |_| Chance::EXPECTED);

    let (found, interrupted) = windows(&track.encoders, WINDOW_S, track.pause_s);
    channel.count_many(interrupted, |count| Omission::NoWheels(robot, count));
    let mut state = ActuatorState::default();
    let mut reached_s = first.time_s;
    for window in found {
        let (from, to) = (track.encoders[window.first], track.encoders[window.last]);
        if to.time_s <= reached_s {
            channel.count(Omission::NoCommand);
            continue;
        }
        let middle_s = f64::midpoint(from.time_s, to.time_s);
        let Some(regime) = track.regime_at(middle_s) else {
            channel.count(|count| Omission::NoWheels(robot, count));
            continue;
        };
        let place = regime.pose.map(|pose| pose.position());
        let mut window = CommandWindow {
            from_s: reached_s,
            to_s: from.time_s,
            motion: motion(&regime, regime.pose.unwrap_or(Pose::identity())),
            surroundings: evidence.surroundings(robot, middle_s, place),
        };
        if window.to_s > window.from_s {
            wheel_turns(model, &scheduled, &window, &mut state);
        }
        (window.from_s, window.to_s) = (from.time_s.max(reached_s), to.time_s);
        let predicted = wheel_turns(model, &scheduled, &window, &mut state);
        reached_s = to.time_s;
        if from.time_s < first.time_s + SETTLING_S || to.time_s > known_until_s {
            channel.count(Omission::NoCommand);
            continue;
        }
        let [left, right] =
            [0, 1].map(|wheel| -predicted[wheel] + (to.angle_rad[wheel] - from.angle_rad[wheel]));
        channel.push(middle_s, regime, None, &[(left + right) * 0.5, right - left]);
    }
    channel
}

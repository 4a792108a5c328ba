//! What a robot recorded, as a track has it: samples of the wheels, commands, and steps of dead reckoning.

use pleiad_estimation::Timestamp;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_physics::Pose;
use pleiad_physics::chain::actuator::Command;
use pleiad_physics::predict::EncoderSample;
use pleiad_recording::{RobotRecording, TruthSample};

use super::{PAUSE_FACTOR, SHORTEST_GAP_S, VELOCITY_STEP_S};
use crate::reckoning::Step;

pub(super) fn encoder_sample(sample: &Sample, origin: Timestamp) -> Option<EncoderSample> {
    match sample.reading {
        Reading::Wheels { left_rad, right_rad } => Some(EncoderSample {
            time_s: sample.time.seconds_since(origin),
            angle_rad: [left_rad, right_rad],
            steer_rad: 0.0,
        }),
        _ => None,
    }
}

/// Gives every sample of the wheels its steering angle: interpolated between `(time, angle)`, and beyond the
/// ends the nearest.
pub(super) fn steer_wheels(encoders: &mut [EncoderSample], steer: &[(f64, f64)]) {
    for sample in encoders {
        let after = steer.partition_point(|(time_s, _)| *time_s <= sample.time_s);
        let before = after.checked_sub(1).and_then(|index| steer.get(index));
        sample.steer_rad = match (before, steer.get(after)) {
            (Some((from_s, from)), Some((to_s, to))) => {
                from + (to - from) * (sample.time_s - from_s) / (to_s - from_s)
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => 0.0,
        };
    }
}

pub(super) fn truth_pose(sample: &TruthSample, origin: Timestamp) -> (f64, Pose<f64>) {
    let pose = &sample.pose;
    (sample.time.seconds_since(origin), Pose::new(pose.x_m(), pose.y_m(), pose.yaw_rad()))
}

pub(super) fn commands(recording: &RobotRecording, origin: Timestamp) -> Vec<Command> {
    let command = |own: &pleiad_recording::Command| Command {
        time_s: own.time.seconds_since(origin),
        speed_m_s: own.forward_m_s,
        yaw_rate_rad_s: own.yaw_rate_rad_s,
    };
    recording.commands.iter().map(command).collect()
}

pub(super) fn velocities(recording: &RobotRecording, origin: Timestamp) -> Vec<Command> {
    let velocity = |sample: &Sample| match sample.reading {
        Reading::Velocity { forward_m_s, yaw_rate_rad_s } => Some(Command {
            time_s: sample.time.seconds_since(origin),
            speed_m_s: forward_m_s,
            yaw_rate_rad_s,
        }),
        _ => None,
    };
    recording.odometry.iter().filter_map(velocity).collect()
}

/// What the body does by the wheels, each step an arc.
pub(super) fn wheel_steps(
    encoders: &[EncoderSample],
    [radius_m, axle_m]: [f64; 2],
) -> impl Iterator<Item = Step> + '_ {
    encoders.iter().enumerate().map(move |(index, sample)| {
        let next = encoders.get(index + 1).unwrap_or(sample);
        let [left, right] = [0, 1].map(|wheel| radius_m * (next.angle_rad[wheel] - sample.angle_rad[wheel]));
        Step {
            time_s: sample.time_s,
            forward_m: f64::midpoint(left, right),
            yaw_rad: (right - left) / axle_m,
        }
    })
}

/// How truth moved, by samples [`VELOCITY_STEP_S`] apart: forward in the heading that it has in the middle. `None` if
/// truth is too rare for velocities.
pub(super) fn seen_steps(truth: &[(f64, Pose<f64>)]) -> Option<Vec<Step>> {
    if median_step(truth.iter().map(|(time_s, _)| *time_s)) > VELOCITY_STEP_S {
        return None;
    }
    // A stamp that is a rounding error early is not early.
    let least_s = VELOCITY_STEP_S * (1.0 - 1e-6);
    let mut kept: Vec<(f64, Pose<f64>)> = Vec::new();
    for &(time_s, pose) in truth {
        if kept.last().is_none_or(|(last_s, _)| time_s - last_s >= least_s) {
            kept.push((time_s, pose));
        }
    }
    let step = |(index, (time_s, pose)): (usize, &(f64, Pose<f64>))| {
        let moved = kept.get(index + 1).map_or_else(Pose::identity, |(_, next)| pose.between(next));
        let [forward_m, _] = Pose::new(0.0, 0.0, 0.5 * moved.yaw_rad).rotate_back([moved.x_m, moved.y_m]);
        Step { time_s: *time_s, forward_m, yaw_rad: moved.yaw_rad }
    };
    Some(kept.iter().enumerate().map(step).collect())
}

/// What the body does if each velocity holds to the next.
pub(super) fn held_steps(commands: &[Command]) -> impl Iterator<Item = Step> + '_ {
    commands.iter().enumerate().map(|(index, command)| {
        let held_s = commands.get(index + 1).map_or(0.0, |next| next.time_s - command.time_s);
        Step {
            time_s: command.time_s,
            forward_m: held_s * command.speed_m_s,
            yaw_rad: held_s * command.yaw_rate_rad_s,
        }
    })
}

/// A longer step between commands is a gap, seconds.
pub(super) fn gap_s(commands: &[Command]) -> f64 {
    (PAUSE_FACTOR * median_step(commands.iter().map(|command| command.time_s))).max(SHORTEST_GAP_S)
}

/// The stretches without gaps. How long the last command held nobody knows; a period is sure.
pub(super) fn stretches(commands: &[Command]) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (commands.first(), commands.last()) else { return Vec::new() };
    let gap_s = gap_s(commands);
    let mut found = Vec::new();
    let mut from_s = first.time_s;
    for pair in commands.windows(2) {
        if pair[1].time_s - pair[0].time_s > gap_s {
            found.push((from_s, pair[0].time_s));
            from_s = pair[1].time_s;
        }
    }
    let period_s = median_step(commands.iter().map(|command| command.time_s));
    found.push((from_s, last.time_s + if period_s.is_finite() { period_s } else { 0.0 }));
    found
}

/// The commands that differ from the one before: a command holds to the next, so the rest say nothing.
#[allow(clippy::float_cmp, reason = "a command that is repeated repeats exactly")]
pub(super) fn changes(mut commands: Vec<Command>) -> Vec<Command> {
    commands.dedup_by(|next, kept| {
        next.speed_m_s == kept.speed_m_s && next.yaw_rate_rad_s == kept.yaw_rate_rad_s
    });
    commands
}

/// The median step between increasing times, seconds; infinite below two.
pub(crate) fn median_step(times_s: impl Iterator<Item = f64>) -> f64 {
    let times: Vec<f64> = times_s.collect();
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY)
}

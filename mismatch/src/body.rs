//! The true motion and the gyro against the roll-out of the encoders.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::predict::{BodyWindow, EncoderSample, mean_gyro, truth_change};
use pleiad_physics::{Pose, RobotModel, Scalar};

use crate::channel::Channel;
use crate::evidence::{Evidence, is_constant};
use crate::residual::{ChannelResiduals, Omission};
use crate::track::Track;
use crate::windows::windows;

/// Length of a window of the body, seconds.
const BODY_WINDOW_S: f64 = 1.0;
/// Length of a window of the gyro, seconds.
const GYRO_WINDOW_S: f64 = 0.5;
/// The fewest readings whose mean is taken.
const MIN_GYRO_READINGS: usize = 3;

/// Change of the true pose over a window minus the roll-out of the encoders, in the frame that the robot
/// has in the middle of the window.
pub(crate) fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::new(Channel::Body);
    let Some((_, track)) = evidence.robot(robot) else { return channel };
    let (found, interrupted) = windows(&track.encoders, BODY_WINDOW_S, track.pause_s);
    channel.count_many(interrupted, |count| Omission::NoWheels(robot, count));
    let mut state = BodyState::default();
    let mut joined = 0;
    for window in found {
        let samples = &track.encoders[window.first..=window.last];
        if window.first != joined {
            state = BodyState::default();
        }
        joined = window.last;
        let (from_s, to_s) = (samples[0].time_s, samples[samples.len() - 1].time_s);
        let ends = track.truth_at(from_s).zip(track.truth_at(to_s));
        let middle_s = f64::midpoint(from_s, to_s);
        let (Some((start, end)), Some(regime)) = (ends, track.regime_at(middle_s)) else {
            channel.count(|count| Omission::NoTruth(robot, count));
            // The state of the body is unknown after a window that was not rolled out.
            state = BodyState::default();
            continue;
        };
        let surroundings = evidence.surroundings(robot, middle_s, Some(start.position()));
        let predicted = truth_change(model, &BodyWindow { samples, start, surroundings }, &mut state);
        let measured = start.between(&end);
        let difference = [-predicted.x_m + measured.x_m, -predicted.y_m + measured.y_m];
        let middle = Pose::new(S::zero(), S::zero(), predicted.yaw_rad * 0.5);
        let [forward, left] = middle.rotate_back(difference);
        let yaw = (-predicted.yaw_rad + measured.yaw_rad).wrapped();
        channel.push(middle_s, regime, None, &[forward, left, yaw]);
    }
    channel
}

/// Mean of the gyro over a window minus what it would read at the yaw rate of the encoders.
pub(crate) fn gyro<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::new(Channel::Gyro);
    let Some((recording, track)) = evidence.robot(robot) else { return channel };
    let samples = &recording.gyro;
    if samples.is_empty() {
        return ChannelResiduals::without(Channel::Gyro, Omission::NotRecorded("gyro"));
    }
    if is_constant(samples) {
        return ChannelResiduals::without(
            Channel::Gyro,
            Omission::Constant("readings of the gyro", samples.len()),
        );
    }
    let readings: Vec<(f64, f64)> = samples
        .iter()
        .filter_map(|sample| match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => Some((sample.time.seconds(), yaw_rate_rad_s)),
            _ => None,
        })
        .collect();
    let mut rest = readings.as_slice();
    while let Some(&(start_s, _)) = rest.first() {
        let length = rest.partition_point(|(time_s, _)| *time_s < start_s + GYRO_WINDOW_S);
        let (window, later) = rest.split_at(length);
        rest = later;
        let Some(measured) = time_mean(window) else {
            channel.count(Omission::SparseWindow);
            continue;
        };
        let end_s = window[window.len() - 1].0;
        let middle_s = f64::midpoint(start_s, end_s);
        let (Some(wheels), Some(regime)) = (stretch(track, start_s, end_s), track.regime_at(middle_s)) else {
            channel.count(|count| Omission::NoWheels(robot, count));
            continue;
        };
        let start = track.truth_at(start_s);
        let surroundings = evidence.surroundings(robot, middle_s, start.map(|pose| pose.position()));
        let window = BodyWindow { samples: &wheels, start: start.unwrap_or(Pose::identity()), surroundings };
        let predicted = mean_gyro(model, &window, &mut BodyState::default());
        channel.push(middle_s, regime, None, &[-predicted + measured]);
    }
    channel
}

/// The mean over the time between the first and the last reading, by trapezoids: the encoders' turn over
/// the same time is its prediction, whatever the phases of the two.
fn time_mean(readings: &[(f64, f64)]) -> Option<f64> {
    if readings.len() < MIN_GYRO_READINGS {
        return None;
    }
    let lasted_s = readings[readings.len() - 1].0 - readings[0].0;
    let turned: f64 =
        readings.windows(2).map(|pair| (pair[1].0 - pair[0].0) * f64::midpoint(pair[0].1, pair[1].1)).sum();
    (lasted_s > 0.0).then(|| turned / lasted_s)
}

/// The wheels from one instant to another, if they were recorded without a pause.
fn stretch(track: &Track, from_s: f64, to_s: f64) -> Option<Vec<EncoderSample>> {
    let begin = track.encoders.partition_point(|sample| sample.time_s <= from_s);
    let end = track.encoders.partition_point(|sample| sample.time_s < to_s);
    let mut samples = vec![track.wheels_at(from_s)?];
    samples.extend(track.encoders.get(begin..end)?);
    samples.push(track.wheels_at(to_s)?);
    let whole = samples.windows(2).all(|pair| pair[1].time_s - pair[0].time_s <= track.pause_s);
    whole.then_some(samples)
}

//! The gyro against the yaw rate of the encoders.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::chain::sensors;
use pleiad_physics::predict::{BodyWindow, EncoderSample, body_motion, mean_gyro};
use pleiad_physics::{Context, Motion, Pose, RobotModel, Scalar, Surroundings};

use crate::channel::Channel;
use crate::evidence::{Evidence, is_constant};
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::track::Track;

/// Length of a window, seconds.
const WINDOW_S: f64 = 0.5;
/// The fewest readings whose mean is taken.
const MIN_READINGS: usize = 3;

/// A window of the gyro.
pub(crate) struct Stretch {
    middle_s: f64,
    /// Since the first reading of all, seconds.
    age_s: f64,
    regime: Regime,
    /// The wheels since the window before ended, if they are known: the body's state goes on.
    before: Option<Vec<EncoderSample>>,
    /// The wheels over the same time.
    wheels: Vec<EncoderSample>,
    start: Pose<f64>,
    surroundings: Surroundings,
    /// Mean of the readings, rad/s.
    measured: f64,
    /// The mean's variance over that of a reading.
    variance_share: f64,
}

pub(crate) fn plan(evidence: &Evidence<'_>, robot: RobotId) -> Plan<Stretch> {
    let Some((recording, track)) = evidence.robot(robot) else {
        return Plan::without(Omission::NotRecorded("robot"));
    };
    if let Some(omission) = track.wheels_missing() {
        return Plan::without(omission);
    }
    let samples = &recording.gyro;
    if samples.is_empty() {
        return Plan::without(Omission::NotRecorded("gyro"));
    }
    if is_constant(samples) {
        return Plan::without(Omission::Constant("readings of the gyro", samples.len()));
    }
    let readings: Vec<(f64, f64)> = samples
        .iter()
        .filter_map(|sample| match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => Some((evidence.seconds(sample.time), yaw_rate_rad_s)),
            _ => None,
        })
        .collect();
    let mut plan = Plan::new();
    let mut rest = readings.as_slice();
    // Where the window before ended.
    let mut ended_s = None;
    while let Some(&(start_s, _)) = rest.first() {
        let length = rest.partition_point(|(time_s, _)| *time_s < start_s + WINDOW_S);
        let (window, later) = rest.split_at(length);
        rest = later;
        let Some(measured) = time_mean(window) else {
            plan.count(Omission::SparseWindow);
            continue;
        };
        let end_s = window[window.len() - 1].0;
        let middle_s = f64::midpoint(start_s, end_s);
        let (Some(wheels), Some(regime)) = (stretch(track, start_s, end_s), track.regime_at(middle_s)) else {
            plan.count(|count| Omission::NoWheels(robot, count));
            continue;
        };
        let start = track.truth_at(start_s);
        let before = ended_s.and_then(|ended_s| stretch(track, ended_s, start_s));
        ended_s = Some(end_s);
        plan.items.push(Stretch {
            middle_s,
            age_s: middle_s - readings[0].0,
            regime,
            before,
            wheels,
            start: start.unwrap_or(Pose::identity()),
            surroundings: evidence.surroundings(robot, middle_s, start.map(|pose| pose.position())),
            measured,
            variance_share: variance_share(window.len()),
        });
    }
    plan
}

/// Mean of the gyro over a window minus what it would read at the yaw rate of the encoders.
pub(crate) fn residuals<S: Scalar>(plan: &Plan<Stretch>, model: &RobotModel<S>) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Gyro, plan);
    let mut state = BodyState::default();
    for own in &plan.items {
        let window = |samples| BodyWindow::whole(samples, own.start, own.surroundings);
        match &own.before {
            Some(before) => {
                body_motion(model, &window(before), &mut state);
            }
            None => state = BodyState::default(),
        }
        let predicted = mean_gyro(model, &window(&own.wheels), &mut state);
        let sigma = sigma(model, own);
        channel.push(Residual::new(own.middle_s, own.regime, None, &[-predicted + own.measured], &[sigma]));
    }
    channel
}

/// That of the mean: the white noise of the readings, and what a walking bias has gained since the first.
fn sigma<S: Scalar>(model: &RobotModel<S>, own: &Stretch) -> S {
    let context = Context::new(&model.nominal, own.middle_s, Motion::at_rest(Pose::identity()));
    let noise = sensors::noise(model, &context, S::zero(), S::zero());
    (noise.gyro_sigma_rad_s.square() * own.variance_share + noise.gyro_walk_variance * own.age_s).sqrt()
}

/// The mean over the time between the first and the last reading, by trapezoids: the encoders' turn over
/// the same time is its prediction, whatever the phases of the two.
fn time_mean(readings: &[(f64, f64)]) -> Option<f64> {
    if readings.len() < MIN_READINGS {
        return None;
    }
    let lasted_s = readings[readings.len() - 1].0 - readings[0].0;
    let turned: f64 =
        readings.windows(2).map(|pair| (pair[1].0 - pair[0].0) * f64::midpoint(pair[0].1, pair[1].1)).sum();
    (lasted_s > 0.0).then(|| turned / lasted_s)
}

/// Of equally spaced readings by trapezoids: the two at the ends count half, so `n - 3/2` of `(n - 1)^2`.
fn variance_share(readings: usize) -> f64 {
    let count = readings as f64;
    (count - 1.5) / (count - 1.0).powi(2)
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

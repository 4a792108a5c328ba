//! The gyro against the yaw rate of the encoders.

use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::chain::sensors;
use pleiad_physics::predict::{BodyWindow, EncoderSample, body_state, mean_gyro};
use pleiad_physics::{Context, Effect, Motion, Pose, RobotModel, Scalar, Surroundings};

use crate::body::push_s;
use crate::channel::Channel;
use crate::evidence::{Evidence, is_constant};
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::track::{Track, median_step};

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
    let cells = Cells::new(&readings);
    let mut plan = Plan::new();
    let mut begin = 0;
    // Where the window before ended.
    let mut ended_s = None;
    while begin < readings.len() {
        let window = begin..cells.end(begin);
        begin = window.end;
        let Some((measured, variance_share)) = cells.mean(window.clone()) else {
            plan.count(Omission::SparseWindow);
            continue;
        };
        let (start_s, end_s) = (cells.edge_before(window.start), cells.edge_after(window.end - 1));
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
            variance_share,
        });
    }
    plan
}

/// Mean of the gyro over a window minus what it would read at the yaw rate of the encoders.
///
/// A gyro that samples sees a push not at all, once or twice, by where between its readings the push is: it is
/// compared with what is nearest.
pub(crate) fn residuals<S: Scalar>(plan: &Plan<Stretch>, model: &RobotModel<S>) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Gyro, plan);
    let mut state = BodyState::default();
    let unpushed = unpushed(model);
    for own in &plan.items {
        own.begin(model, &mut state);
        let value = own.residual(model, unpushed.as_ref(), &mut state);
        let sigma = sigma(model, own);
        channel.push(Residual::new(own.middle_s, own.regime, None, &[value], &[sigma]));
    }
    channel
}

/// The model without pushes, if it has any.
fn unpushed<S: Scalar>(model: &RobotModel<S>) -> Option<RobotModel<S>> {
    push_s(model).map(|_| {
        let mut unpushed = model.clone();
        unpushed.effects.retain(|active| active.effect() != Effect::Push);
        unpushed
    })
}

impl Stretch {
    fn window<'w>(&self, samples: &'w [EncoderSample]) -> BodyWindow<'w> {
        BodyWindow::whole(samples, self.start, self.surroundings)
    }

    /// Takes the state of the body from the window before to this one.
    fn begin<S: Scalar>(&self, model: &RobotModel<S>, state: &mut BodyState<S>) {
        match &self.before {
            Some(before) => body_state(model, &self.window(before), state),
            None => *state = BodyState::default(),
        }
    }

    fn residual<S: Scalar>(
        &self,
        model: &RobotModel<S>,
        unpushed: Option<&RobotModel<S>>,
        state: &mut BodyState<S>,
    ) -> S {
        let mut begun = *state;
        let mut value = -mean_gyro(model, &self.window(&self.wheels), state) + self.measured;
        if let Some(unpushed) = unpushed {
            let without = -mean_gyro(unpushed, &self.window(&self.wheels), &mut begun) + self.measured;
            let pushed = value - without;
            for seen in [without, without + pushed * 2.0] {
                if pushed.value() != 0.0 && seen.value().abs() < value.value().abs() {
                    value = seen;
                }
            }
        }
        value
    }
}

/// The states of the body in which the windows of a plan begin.
pub(crate) fn begun(plan: &Plan<Stretch>, model: &RobotModel<f64>) -> Vec<BodyState<f64>> {
    let mut state = BodyState::default();
    let one = |own: &Stretch| {
        own.begin(model, &mut state);
        let begun = state;
        body_state(model, &own.window(&own.wheels), &mut state);
        begun
    };
    plan.items.iter().map(one).collect()
}

/// The residuals of the windows that a push falls into, which are all that it shows in, with their positions; `begun`
/// are the states in which windows begin.
pub(crate) fn around<S: Scalar>(
    plan: &Plan<Stretch>,
    begun: &[BodyState<f64>],
    model: &RobotModel<S>,
    push_s: f64,
) -> Vec<(usize, [S; 1])> {
    let unpushed = unpushed(model);
    let near = |own: &Stretch| {
        let ends = own.wheels.first().zip(own.wheels.last());
        ends.is_some_and(|(first, last)| (first.time_s..=last.time_s).contains(&push_s))
    };
    let one = |(index, own): (usize, &Stretch)| {
        (index, [own.residual(model, unpushed.as_ref(), &mut begun[index].lift())])
    };
    let windows = plan.items.iter().take(begun.len()).enumerate();
    windows.filter(|(_, own)| near(own)).map(one).collect()
}

/// That of the mean: the white noise of the readings, and what a walking bias has gained since the first.
fn sigma<S: Scalar>(model: &RobotModel<S>, own: &Stretch) -> S {
    let context = Context::new(&model.nominal, own.middle_s, Motion::at_rest(Pose::identity()));
    let noise = sensors::noise(model, &context, S::zero(), S::zero());
    (noise.gyro_sigma_rad_s.square() * own.variance_share + noise.gyro_walk_variance * own.age_s).sqrt()
}

/// Readings, each of which stands for the time around its stamp: to the middle between it and the next. A
/// gyro reads the mean over its period or an instant in its middle; the encoders' turn over the same time is
/// its prediction, whatever the phases of the two.
struct Cells<'a> {
    readings: &'a [(f64, f64)],
    period_s: f64,
}

impl<'a> Cells<'a> {
    fn new(readings: &'a [(f64, f64)]) -> Self {
        Self { readings, period_s: median_step(readings.iter().map(|reading| reading.0)) }
    }

    /// Whether no reading lacks between this one and the next.
    fn joins(&self, index: usize) -> bool {
        self.readings
            .get(index + 1)
            .is_some_and(|next| next.0 - self.readings[index].0 <= 2.0 * self.period_s)
    }

    fn edge_after(&self, index: usize) -> f64 {
        let time_s = self.readings[index].0;
        if self.joins(index) {
            f64::midpoint(time_s, self.readings[index + 1].0)
        } else {
            time_s + 0.5 * self.period_s
        }
    }

    fn edge_before(&self, index: usize) -> f64 {
        match index.checked_sub(1) {
            Some(before) if self.joins(before) => self.edge_after(before),
            _ => self.readings[index].0 - 0.5 * self.period_s,
        }
    }

    /// Past the last reading of the window that begins with one.
    fn end(&self, begin: usize) -> usize {
        let until_s = self.readings[begin].0 + WINDOW_S;
        let mut end = begin + 1;
        while self.joins(end - 1) && self.readings[end].0 < until_s {
            end += 1;
        }
        end
    }

    /// The mean of a window and its variance over that of a reading; `None` of too few readings.
    fn mean(&self, window: Range<usize>) -> Option<(f64, f64)> {
        if window.len() < MIN_READINGS {
            return None;
        }
        let (mut sum, mut whole, mut squares) = (0.0, 0.0, 0.0);
        for index in window {
            let lasted_s = self.edge_after(index) - self.edge_before(index);
            sum += lasted_s * self.readings[index].1;
            whole += lasted_s;
            squares += lasted_s * lasted_s;
        }
        (whole > 0.0).then(|| (sum / whole, squares / (whole * whole)))
    }
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

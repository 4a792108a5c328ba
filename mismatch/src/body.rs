//! The true motion against the roll-out of the encoders.

use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::predict::{BodyWindow, body_state, truth_change};
use pleiad_physics::{ActiveEffect, Effect, Pose, RobotModel, Scalar, Surroundings};

use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::track::Track;
use crate::windows::{Window, windows};

/// Length of a window, seconds.
const WINDOW_S: f64 = 1.0;
/// A push lasts so long, seconds: of one that a reference pose is taken in the midst of, the window before shows a
/// part and the window after the rest.
pub(crate) const PUSH_S: f64 = 0.04;
/// A push this far from all that a window is made of, seconds, does not show in it: farther than a reference pose that
/// it is split between is from the end of the window.
const AROUND_S: f64 = 0.5;

/// A window of the body.
pub(crate) struct Motion {
    /// Positions of the first and last encoder sample.
    pub(crate) window: Window,
    /// Whether the window before ends where this begins, so that the body's state is known.
    pub(crate) joined: bool,
    pub(crate) middle_s: f64,
    pub(crate) regime: Regime,
    /// The encoder samples along which truth is carried.
    reach: Range<usize>,
    /// The stamps of the reference poses nearest to its ends, seconds.
    stamps_s: [f64; 2],
    /// The true pose at the beginning.
    pub(crate) start: Pose<f64>,
    pub(crate) surroundings: Surroundings,
    /// The last of those reference poses, seen from the first.
    pub(crate) measured: Pose<f64>,
}

impl Motion {
    /// The stamps of the reference poses at its ends, seconds.
    pub(crate) fn stamps_s(&self) -> [f64; 2] {
        self.stamps_s
    }

    /// What the model expects the reference system to see. The state goes from window to window.
    pub(crate) fn predicted<S: Scalar>(
        &self,
        track: &Track,
        model: &RobotModel<S>,
        state: &mut BodyState<S>,
    ) -> Pose<S> {
        if !self.joined {
            *state = BodyState::default();
        }
        if let Some((stamp_s, share)) = self.split_push(model) {
            let [before, after] = [-PUSH_S, PUSH_S].map(|shift_s| moved_push(model, stamp_s + shift_s));
            let first = self.rolled_out(track, &before, &mut state.clone());
            let last = self.rolled_out(track, &after, state);
            let mix = |first: S, last: S| first * share + last * (1.0 - share);
            let turned = mix(S::zero(), last.yaw_rad - first.yaw_rad);
            return Pose::new(mix(first.x_m, last.x_m), mix(first.y_m, last.y_m), first.yaw_rad + turned);
        }
        self.rolled_out(track, model, state)
    }

    /// The stamp of the reference pose that a push of a model happens at, and the share of the push before it.
    fn split_push<S: Scalar>(&self, model: &RobotModel<S>) -> Option<(f64, f64)> {
        let onset_s = push_s(model)?;
        let shares = self.stamps_s.map(|stamp_s| (stamp_s, 0.5 + (stamp_s - onset_s) / PUSH_S));
        shares.into_iter().find(|(_, share)| *share > 0.0 && *share < 1.0)
    }

    fn rolled_out<S: Scalar>(
        &self,
        track: &Track,
        model: &RobotModel<S>,
        state: &mut BodyState<S>,
    ) -> Pose<S> {
        truth_change(model, &self.body_window(track), self.stamps_s, state)
    }

    /// Takes the state through the window.
    pub(crate) fn pass<S: Scalar>(&self, track: &Track, model: &RobotModel<S>, state: &mut BodyState<S>) {
        if !self.joined {
            *state = BodyState::default();
        }
        body_state(model, &self.body_window(track), state);
    }

    fn body_window<'t>(&self, track: &'t Track) -> BodyWindow<'t> {
        BodyWindow {
            track: &track.encoders[self.reach.clone()],
            ends: [self.window.first, self.window.last].map(|end| end - self.reach.start),
            start: self.start,
            surroundings: self.surroundings,
            partner_m: track.partner_m.get(self.window.first..=self.window.last).unwrap_or_default(),
        }
    }
}

/// When a model is pushed.
pub(crate) fn push_s<S: Scalar>(model: &RobotModel<S>) -> Option<f64> {
    let push = model.effects.iter().find(|active| active.effect() == Effect::Push)?;
    push.values().first().map(|onset_s| onset_s.value())
}

/// The model, pushed at another instant.
fn moved_push<S: Scalar>(model: &RobotModel<S>, onset_s: f64) -> RobotModel<S> {
    let mut moved = model.clone();
    for active in moved.effects.iter_mut().filter(|active| active.effect() == Effect::Push) {
        let mut values = active.values().to_vec();
        values[0] = S::constant(onset_s);
        if let Ok(next) = ActiveEffect::new(Effect::Push, &values) {
            *active = next;
        }
    }
    moved
}

pub(crate) fn plan(evidence: &Evidence<'_>, robot: RobotId) -> Plan<Motion> {
    plan_of_length(evidence, robot, if evidence.is_by_reference() { 0.0 } else { WINDOW_S })
}

/// Windows of any length between encoder samples; of none, from each reference pose to the next.
pub(crate) fn plan_of_length(evidence: &Evidence<'_>, robot: RobotId, length_s: f64) -> Plan<Motion> {
    let Some((_, track)) = evidence.robot(robot) else {
        return Plan::without(Omission::NotRecorded("robot"));
    };
    if let Some(omission) = track.wheels_missing().or_else(|| track.truth_missing()) {
        return Plan::without(omission);
    }
    let (found, interrupted) = if length_s > 0.0 {
        windows(&track.encoders, |sample| sample.time_s, length_s, track.pause_s)
    } else {
        between_references(track)
    };
    let mut plan = Plan::new();
    plan.count_many(interrupted, |count| Omission::NoWheels(robot, count));
    // After a window that was not rolled out the state of the body is unknown.
    let mut joined = None;
    for window in found {
        let [from_s, to_s] = [window.first, window.last].map(|index| track.encoders[index].time_s);
        let ends = track.truth_near(from_s).zip(track.truth_near(to_s)).zip(track.truth_at(from_s));
        let middle_s = f64::midpoint(from_s, to_s);
        let (Some(((first, last), start)), Some(regime)) = (ends, track.regime_at(middle_s)) else {
            plan.count(|count| Omission::NoTruth(robot, count));
            continue;
        };
        plan.items.push(Motion {
            window,
            joined: joined == Some(window.first),
            middle_s,
            regime,
            reach: track.reach(&window),
            stamps_s: [first.0, last.0],
            start,
            surroundings: evidence.surroundings(robot, middle_s, Some(start.position())),
            measured: first.1.between(&last.1),
        });
        joined = Some(window.last);
    }
    plan
}

/// From each reference pose that has the stamp of an encoder sample to the next, and how many were given up because a
/// pause interrupts them.
fn between_references(track: &Track) -> (Vec<Window>, usize) {
    let (mut found, mut interrupted) = (Vec::new(), 0);
    let mut before: Option<usize> = None;
    for (stamp_s, _) in &track.truth {
        let sample = track.encoders.partition_point(|sample| sample.time_s < *stamp_s);
        let Some(last) = (sample < track.encoders.len()).then_some(sample) else { continue };
        if let Some(first) = before.filter(|first| *first < last) {
            let steps = track.encoders[first..=last].windows(2);
            if steps.into_iter().any(|pair| pair[1].time_s - pair[0].time_s > track.pause_s) {
                interrupted += 1;
            } else {
                found.push(Window { first, last });
            }
        }
        before = Some(last);
    }
    (found, interrupted)
}

/// Change of the true pose over a window minus the roll-out of the encoders.
pub(crate) fn residuals<S: Scalar>(
    track: &Track,
    plan: &Plan<Motion>,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Body, plan);
    let mut state = BodyState::default();
    for own in &plan.items {
        let predicted = own.predicted(track, model, &mut state);
        let values = difference(&own.measured, &predicted);
        channel.push(Residual::new(own.middle_s, own.regime, None, &values, &[]));
    }
    channel
}

/// The states of the body in which the windows of a plan begin.
pub(crate) fn begun(track: &Track, plan: &Plan<Motion>, model: &RobotModel<f64>) -> Vec<BodyState<f64>> {
    let mut state = BodyState::default();
    let one = |own: &Motion| {
        let begun = if own.joined { state } else { BodyState::default() };
        own.pass(track, model, &mut state);
        begun
    };
    plan.items.iter().map(one).collect()
}

/// The residuals of the windows around a push, which are all that it shows in, with their positions; `begun` are the
/// states in which windows begin.
pub(crate) fn around<S: Scalar>(
    track: &Track,
    plan: &Plan<Motion>,
    begun: &[BodyState<f64>],
    model: &RobotModel<S>,
    push_s: f64,
) -> Vec<(usize, [S; 3])> {
    let near = |own: &Motion| {
        let [from_s, to_s] = [own.reach.start, own.reach.end - 1].map(|end| track.encoders[end].time_s);
        (from_s - AROUND_S..=to_s + AROUND_S).contains(&push_s)
    };
    let one = |(index, own): (usize, &Motion)| {
        let predicted = own.predicted(track, model, &mut begun[index].lift());
        (index, difference(&own.measured, &predicted))
    };
    let windows = plan.items.iter().take(begun.len()).enumerate();
    windows.filter(|(_, own)| near(own)).map(one).collect()
}

/// Measured minus predicted: forward, left and yaw, in the frame that the robot has in the middle.
pub(crate) fn difference<S: Scalar>(measured: &Pose<f64>, predicted: &Pose<S>) -> [S; 3] {
    let middle = Pose::new(S::zero(), S::zero(), predicted.yaw_rad * 0.5);
    let shift = [-predicted.x_m + measured.x_m, -predicted.y_m + measured.y_m];
    let [forward, left] = middle.rotate_back(shift);
    [forward, left, (-predicted.yaw_rad + measured.yaw_rad).wrapped()]
}

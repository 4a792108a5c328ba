//! The true motion against the whole chain driven by the commands, for recordings without encoders.

use pleiad_estimation::RobotId;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::chain::robot::Robot;
use pleiad_physics::predict::{CommandWindow, commanded_truth_change, wheel_turns};
use pleiad_physics::{Pose, RobotModel, Scalar};

use crate::actuator::SETTLING_S;
use crate::body::difference;
use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::schedule::Schedule;
use crate::track::{Track, motion};
use crate::windows::windows;

/// Length of a window of residuals, seconds.
pub(crate) const WINDOW_S: f64 = 1.0;
/// A longer step between truth samples interrupts a window, seconds.
const TRUTH_GAP_S: f64 = 0.2;
/// The same where references take the place of truth, which are as far apart as what the filter was told.
const REFERENCE_GAP_S: f64 = 2.0;
/// After a gap of the commands the servo's state is unknown for so long, seconds.
const UNKNOWN_S: f64 = 1.0;

/// A window that begins and ends at truth samples' own stamps.
pub(crate) struct Motion {
    /// From where the window before ended to where this begins: nothing is compared, the servo goes on.
    before: Option<CommandWindow>,
    pub(crate) window: CommandWindow,
    pub(crate) middle_s: f64,
    regime: Regime,
    /// The true pose at the end, seen from the start.
    pub(crate) measured: Pose<f64>,
}

/// Windows in the stretches where the commands are known and the servo has settled to them.
pub(crate) fn plan(evidence: &Evidence<'_>, robot: RobotId, length_s: f64) -> Plan<Motion> {
    let Some((_, track)) = evidence.robot(robot) else {
        return Plan::without(Omission::NotRecorded("robot"));
    };
    let Some(&(first_s, _)) = track.commanded_s.first() else {
        return Plan::without(Omission::NotRecorded("commands"));
    };
    if let Some(omission) = track.truth_missing() {
        return Plan::without(omission);
    }
    let mut plan = Plan::new();
    // How far the servo has been followed, and the truth sample where the window before ended.
    let (mut followed_s, mut ended) = (first_s, None);
    for (from_s, to_s) in settled(track, length_s, &mut plan) {
        let begin = track.truth.partition_point(|(stamp_s, _)| *stamp_s < from_s);
        let end = track.truth.partition_point(|(stamp_s, _)| *stamp_s <= to_s).max(begin);
        let truth = &track.truth[begin..end];
        let gap_s = if evidence.is_by_reference() { REFERENCE_GAP_S } else { TRUTH_GAP_S };
        let (found, interrupted) = windows(truth, |(stamp_s, _)| *stamp_s, length_s, gap_s);
        plan.count_many(interrupted, |count| Omission::NoTruth(robot, count));
        for window in found {
            let ((from_s, start), (to_s, end)) = (truth[window.first], truth[window.last]);
            let middle_s = f64::midpoint(from_s, to_s);
            let Some(regime) = track.regime_at(middle_s) else {
                plan.count(|count| Omission::NoWheels(robot, count));
                continue;
            };
            let between = |from_s, to_s| CommandWindow {
                from_s,
                to_s,
                motion: motion(&regime, start),
                surroundings: evidence.surroundings(robot, middle_s, Some(start.position())),
            };
            let joined = ended == Some(begin + window.first);
            plan.items.push(Motion {
                before: (!joined).then(|| between(followed_s, from_s)),
                window: between(from_s, to_s),
                middle_s,
                regime,
                measured: start.between(&end),
            });
            (followed_s, ended) = (to_s, Some(begin + window.last));
        }
    }
    plan
}

/// From when to when the servo's state follows from the commands. The windows that truth has elsewhere are
/// counted in the plan.
fn settled(track: &Track, length_s: f64, plan: &mut Plan<Motion>) -> Vec<(f64, f64)> {
    let (begun_s, ended_s) = (track.truth[0].0, track.truth[track.truth.len() - 1].0);
    let lost = |from_s: f64, to_s: f64| whole_windows(to_s.min(ended_s) - from_s.max(begun_s), length_s);
    let mut found: Vec<(f64, f64)> = Vec::with_capacity(track.commanded_s.len());
    for &(from_s, to_s) in &track.commanded_s {
        let settled_s = if let Some((_, until_s)) = found.last() {
            plan.count_many(lost(*until_s, from_s + UNKNOWN_S), Omission::CommandGap);
            from_s + UNKNOWN_S
        } else {
            plan.count_many(lost(begun_s, from_s + SETTLING_S), Omission::NoCommand);
            from_s + SETTLING_S
        };
        found.push((settled_s, to_s));
    }
    if let Some((_, until_s)) = found.last() {
        plan.count_many(lost(*until_s, ended_s), Omission::NoCommand);
    }
    found
}

/// As many windows as it takes to cover a time.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
fn whole_windows(lasted_s: f64, length_s: f64) -> usize {
    let length_s = if length_s > 0.0 { length_s } else { WINDOW_S };
    (lasted_s / length_s).ceil().max(0.0) as usize
}

/// Rolls windows out in order, so that servo and body know how they stand.
pub(crate) struct Driver<S> {
    schedule: Schedule<S>,
    robot: Robot<S>,
}

impl<S: Scalar> Driver<S> {
    pub(crate) fn new(track: &Track, model: &RobotModel<S>) -> Self {
        Self { schedule: Schedule::new(model, &track.commands), robot: Robot::at_rest(Pose::identity()) }
    }

    /// What the model expects the reference system to see of a window.
    pub(crate) fn predicted(&mut self, model: &RobotModel<S>, own: &Motion) -> Pose<S> {
        if let Some(before) = &own.before {
            wheel_turns(model, self.schedule.within(before), before, &mut self.robot.actuator);
            self.robot.body = BodyState::default();
        }
        commanded_truth_change(model, self.schedule.within(&own.window), &own.window, &mut self.robot)
    }
}

/// Change of the true pose over a window minus that of the chain driven by the commands.
pub(crate) fn residuals<S: Scalar>(
    track: &Track,
    plan: &Plan<Motion>,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::CommandedBody, plan);
    let mut driver = Driver::new(track, model);
    for own in &plan.items {
        let predicted = driver.predicted(model, own);
        let values = difference(&own.measured, &predicted);
        channel.push(Residual::new(own.middle_s, own.regime, None, &values, &[]));
    }
    channel
}

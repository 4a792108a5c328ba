//! A recording against its nominal model, or the one that its odometry implies.

use pleiad_estimation::RobotId;
use pleiad_physics::{RobotModel, Scalar};
use pleiad_recording::Recording;

use crate::agitation::agitation;
use crate::builtin;
use crate::channel::Channel;
use crate::error::MismatchError;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission};
use crate::sightings;
use crate::summary::{MIN_RESIDUALS, Summary, summarize};
use crate::{actuator, body, commanded, gyro, sensors};

/// The residuals of every channel of a robot under a model, in the order of [`Channel::ALL`].
///
/// A robot that the evidence does not have gives channels that were not recorded.
pub fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> Vec<ChannelResiduals<S>> {
    Channel::ALL.iter().map(|&channel| residuals_of(evidence, robot, model, channel)).collect()
}

/// The residuals of several channels of a robot under a model, in their order. Range and bearing of a sighting are
/// predicted together.
pub(crate) fn residuals_of_several<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
    channels: &[Channel],
) -> Vec<ChannelResiduals<S>> {
    let mut bearings = None;
    let one = |&channel: &Channel| match bearings.take() {
        Some(ChannelResiduals { channel: own, rows, omissions }) if own == channel => {
            ChannelResiduals { channel, rows, omissions }
        }
        _ => {
            let pair = Channel::SIGHTINGS.into_iter().find(|pair| pair[0] == channel);
            let pair = pair.filter(|pair| channels.contains(&pair[1]));
            let Some((pair, (track, plans))) = pair.zip(evidence.prepared(robot)) else {
                return residuals_of(evidence, robot, model, channel);
            };
            let [own, other] = sightings::residuals(
                evidence,
                pair,
                (track, pair.map(|channel| plans.of_sightings(channel))),
                model,
            );
            bearings = Some(other);
            own
        }
    };
    channels.iter().map(one).collect()
}

/// The residuals of one channel of a robot under a model.
pub fn residuals_of<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
    channel: Channel,
) -> ChannelResiduals<S> {
    let Some((track, plans)) = evidence.prepared(robot) else {
        return ChannelResiduals::without(channel, Omission::NotRecorded("robot"));
    };
    match channel {
        Channel::Actuator => actuator::residuals(track, &plans.actuator, model),
        Channel::Body => body::residuals(track, &plans.body, model),
        Channel::CommandedBody if !track.encoders.is_empty() => {
            ChannelResiduals::without(channel, Omission::ByStages)
        }
        Channel::CommandedBody => commanded::residuals(track, &plans.commanded, model),
        Channel::Gyro => gyro::residuals(&plans.gyro, model),
        Channel::Gps => sensors::gps(track, &plans.gps, model),
        Channel::Heading => sensors::heading(track, &plans.heading, model),
        Channel::RangeToLandmark | Channel::RangeToRobot => {
            let plans = [plans.of_sightings(channel), &Plan::new()];
            let [own, _] = sightings::residuals(evidence, [channel, channel], (track, plans), model);
            own
        }
        Channel::BearingToLandmark | Channel::BearingToRobot => {
            let plans = [&Plan::new(), plans.of_sightings(channel)];
            let [_, own] = sightings::residuals(evidence, [channel, channel], (track, plans), model);
            own
        }
    }
}

/// For every residual of the channel [`Channel::Actuator`] the sum of the squared changes of speed that single
/// commands make in its window, of the mean of both wheels and of right minus left, (rad/s)^2: commands that
/// come at random times add the variance of those times multiplied by this.
pub fn command_agitation(evidence: &Evidence<'_>, robot: RobotId, model: &RobotModel<f64>) -> Vec<[f64; 2]> {
    evidence.prepared(robot).map_or_else(Vec::new, |(track, plans)| agitation(track, &plans.actuator, model))
}

/// The true motion over 1 s against the whole chain driven by the commands, also of a robot whose encoders
/// were recorded: how well the model predicts from end to end.
pub fn end_to_end<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    match evidence.prepared(robot) {
        Some((track, plans)) => commanded::residuals(track, &plans.commanded, model),
        None => ChannelResiduals::without(Channel::CommandedBody, Omission::NotRecorded("robot")),
    }
}

/// One channel of a robot against the nominal model.
#[derive(Clone, Debug)]
pub struct ChannelComparison {
    /// The residuals.
    pub residuals: ChannelResiduals<f64>,
    /// A summary per component; `None` if there are too few residuals, which the omissions then say.
    pub summary: Option<Vec<Summary>>,
}

/// One robot against the nominal model.
#[derive(Clone, Debug)]
pub struct RobotComparison {
    /// Which robot.
    pub robot: RobotId,
    /// Every channel, in the order of [`Channel::ALL`].
    pub channels: Vec<ChannelComparison>,
}

impl RobotComparison {
    /// One of the channels.
    pub fn channel(&self, channel: Channel) -> Option<&ChannelComparison> {
        self.channels.iter().find(|own| own.residuals.channel == channel)
    }
}

/// Compares a recording with its nominal model, or with [`models`](crate::models) without one.
///
/// # Errors
/// The recording has no nominal model and its odometry is not of commands, or the model lacks a robot.
pub fn compare(recording: &Recording) -> Result<Vec<RobotComparison>, MismatchError> {
    let models = builtin::models(recording)?;
    let evidence = Evidence::new(recording, &models);
    let channel = |mut residuals: ChannelResiduals<f64>| {
        let summary = summarize(&residuals);
        let found = residuals.rows.len();
        if summary.is_none() && (found > 0 || residuals.omissions.is_empty()) {
            residuals.omissions.push(Omission::TooFew(found, MIN_RESIDUALS));
        }
        ChannelComparison { residuals, summary }
    };
    let robot = |(&robot, model): (&RobotId, &RobotModel<f64>)| RobotComparison {
        robot,
        channels: residuals(&evidence, robot, model).into_iter().map(channel).collect(),
    };
    Ok(models.iter().map(robot).collect())
}

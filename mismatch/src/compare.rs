//! A recording against its nominal model.

use pleiad_estimation::RobotId;
use pleiad_physics::{RobotModel, Scalar};
use pleiad_recording::Recording;

use crate::channel::Channel;
use crate::error::MismatchError;
use crate::evidence::Evidence;
use crate::model::nominal_models;
use crate::residual::{ChannelResiduals, Omission};
use crate::summary::{MIN_RESIDUALS, Summary, summarize};
use crate::{actuator, body, sensors};

/// The residuals of every channel of a robot under a model, in the order of [`Channel::ALL`].
///
/// A robot that the evidence does not have gives channels that were not recorded.
pub fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> Vec<ChannelResiduals<S>> {
    let obstacle = |channel| obstacle(evidence, robot, channel);
    let or = |channel, compare: &dyn Fn() -> ChannelResiduals<S>| match obstacle(channel) {
        Some(omission) => ChannelResiduals::without(channel, omission),
        None => compare(),
    };
    let mut channels = vec![
        or(Channel::Actuator, &|| actuator::residuals(evidence, robot, model)),
        or(Channel::Body, &|| body::residuals(evidence, robot, model)),
        or(Channel::Gyro, &|| body::gyro(evidence, robot, model)),
        or(Channel::Gps, &|| sensors::gps(evidence, robot, model)),
        or(Channel::Heading, &|| sensors::heading(evidence, robot, model)),
    ];
    match obstacle(Channel::RangeToLandmark) {
        Some(omission) => channels.extend(
            Channel::ALL[5..].iter().map(|&channel| ChannelResiduals::without(channel, omission.clone())),
        ),
        None => channels.extend(sensors::sightings(evidence, robot, model)),
    }
    channels
}

/// What keeps a whole channel from being compared: wheels or truth that are missing or stuck.
#[allow(clippy::float_cmp, reason = "a reading that is stuck repeats exactly")]
fn obstacle(evidence: &Evidence<'_>, robot: RobotId, channel: Channel) -> Option<Omission> {
    let Some((_, track)) = evidence.robot(robot) else { return Some(Omission::NotRecorded("robot")) };
    let wheels = &track.encoders;
    if wheels.is_empty() {
        return Some(Omission::NotRecorded("wheel angles"));
    }
    if wheels.windows(2).all(|pair| pair[0].angle_rad == pair[1].angle_rad) {
        return Some(Omission::Constant("wheel angles", wheels.len()));
    }
    if matches!(channel, Channel::Actuator | Channel::Gyro) {
        return None;
    }
    if track.truth.is_empty() {
        return Some(Omission::NotRecorded("truth"));
    }
    let stuck = track.truth.windows(2).all(|pair| pair[0].1 == pair[1].1);
    stuck.then_some(Omission::Constant("true poses", track.truth.len()))
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

/// Compares a recording with its nominal model.
///
/// # Errors
/// The recording has no nominal model, or the model lacks a robot.
pub fn compare(recording: &Recording) -> Result<Vec<RobotComparison>, MismatchError> {
    let models = nominal_models(recording)?;
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

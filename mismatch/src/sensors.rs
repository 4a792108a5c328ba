//! Positions and headings against their prediction from the true pose.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_physics::predict::{self, Anchor, Instant, Path};
use pleiad_physics::{Motion, Pose, RobotModel, Scalar, Surroundings};

use crate::channel::Channel;
use crate::evidence::{Evidence, is_constant};
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Regime, Residual};
use crate::track::{Track, motion};

/// A reading of position.
pub(crate) struct Fix {
    pub(crate) at: At,
    measured_m: [f64; 2],
}

/// A reading of heading.
pub(crate) struct Heading {
    pub(crate) at: At,
    measured_rad: f64,
}

/// The instant of a reading, and the truth then.
#[derive(Clone)]
pub(crate) struct At {
    pub(crate) time_s: f64,
    pub(crate) motion: Motion<f64>,
    surroundings: Surroundings,
    pub(crate) regime: Regime,
    pub(crate) pose: Pose<f64>,
    /// The reference pose that `pose` was carried from, and its stamp.
    reference: (f64, Pose<f64>),
    /// The motion on the robot's path at that stamp and at the reading's.
    on_path: Option<[Motion<f64>; 2]>,
}

impl At {
    /// If the truth then is known.
    pub(crate) fn new(evidence: &Evidence<'_>, robot: RobotId, track: &Track, time_s: f64) -> Option<Self> {
        let regime = track.regime_at(time_s)?;
        let pose = regime.pose?;
        let surroundings = evidence.surroundings(robot, time_s, Some(pose.position()));
        let reference = track.truth_near(time_s)?;
        let on_path = track.path().motion_at(reference.0).zip(track.path().motion_at(time_s));
        let on_path = on_path.map(|(first, last)| [first, last]);
        Some(Self { time_s, motion: motion(&regime, pose), surroundings, regime, pose, reference, on_path })
    }

    /// The stamp of the reference pose that the pose was carried from, seconds.
    pub(crate) fn stamp_s(&self) -> f64 {
        self.reference.0
    }

    /// The instant alone: velocities are taken for constant.
    pub(crate) fn plain(&self) -> Instant<'static> {
        let Self { time_s, motion, surroundings, .. } = *self;
        Instant { time_s, motion, surroundings, anchor: None, target: None }
    }

    /// The instant, with the robot's path to carry the reference pose along.
    pub(crate) fn instant<'a>(&self, track: &'a Track) -> Instant<'a> {
        let (time_s, pose) = self.reference;
        let anchor = self.on_path.map(|on_path| Anchor { time_s, pose, path: track.path(), on_path });
        Instant { anchor, ..self.plain() }
    }
}

/// Plans every sample of a channel that `item` knows to be of its kind.
fn plan<T>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    (what, samples): (&'static str, &[Sample]),
    item: impl Fn(&Reading, At) -> Option<T>,
) -> Plan<T> {
    let Some((_, track)) = evidence.robot(robot) else {
        return Plan::without(Omission::NotRecorded("robot"));
    };
    if let Some(omission) = track.placing_missing() {
        return Plan::without(omission);
    }
    if samples.is_empty() {
        return Plan::without(Omission::NotRecorded(what));
    }
    if is_constant(samples) {
        return Plan::without(Omission::Constant(what, samples.len()));
    }
    let mut plan = Plan::new();
    for sample in samples {
        match At::new(evidence, robot, track, evidence.seconds(sample.time)) {
            Some(at) => plan.items.extend(item(&sample.reading, at)),
            None => plan.count(|count| Omission::NoTruth(robot, count)),
        }
    }
    plan
}

pub(crate) fn gps_plan(evidence: &Evidence<'_>, robot: RobotId) -> Plan<Fix> {
    let samples = evidence.robot(robot).map_or(&[][..], |(recording, _)| &recording.gps);
    plan(evidence, robot, ("GPS positions", samples), |reading, at| match *reading {
        Reading::Gps { x_m, y_m } => Some(Fix { at, measured_m: [x_m, y_m] }),
        _ => None,
    })
}

pub(crate) fn heading_plan(evidence: &Evidence<'_>, robot: RobotId) -> Plan<Heading> {
    let samples = evidence.robot(robot).map_or(&[][..], |(recording, _)| &recording.heading);
    plan(evidence, robot, ("headings", samples), |reading, at| match *reading {
        Reading::Heading { heading_rad } => Some(Heading { at, measured_rad: heading_rad }),
        _ => None,
    })
}

/// Position, in the robot's true frame: forward and left.
pub(crate) fn gps<S: Scalar>(track: &Track, plan: &Plan<Fix>, model: &RobotModel<S>) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Gps, plan);
    let sigma = model.nominal.gps_sigma_m;
    for Fix { at, measured_m: [x_m, y_m] } in &plan.items {
        let [x, y] = predict::gps(model, &at.instant(track));
        let frame: Pose<S> = Pose::constant(at.pose.x_m, at.pose.y_m, at.pose.yaw_rad);
        let values = frame.rotate_back([-x + *x_m, -y + *y_m]);
        channel.push(Residual::new(at.time_s, at.regime, None, &values, &[sigma, sigma]));
    }
    channel
}

/// Heading, wrapped.
pub(crate) fn heading<S: Scalar>(
    track: &Track,
    plan: &Plan<Heading>,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(Channel::Heading, plan);
    for Heading { at, measured_rad } in &plan.items {
        let value = (-predict::heading(model, &at.instant(track)) + *measured_rad).wrapped();
        let sigma = model.nominal.heading_sigma_rad;
        channel.push(Residual::new(at.time_s, at.regime, None, &[value], &[sigma]));
    }
    channel
}

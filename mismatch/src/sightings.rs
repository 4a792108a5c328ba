//! Ranges and bearings against their prediction from the true poses.

use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::{LandmarkId, RobotId};
use pleiad_physics::chain::sensors::{self as chain, Seen};
use pleiad_physics::predict::{self, Instant, Path};
use pleiad_physics::{Context, Effect, RobotModel, Scalar, signal};

use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::residual::{ChannelResiduals, Omission, Residual};
use crate::sensors::At;
use crate::track::Track;

/// A range or a bearing.
pub(crate) struct Sighted {
    pub(crate) at: At,
    pub(crate) target: Target,
    pub(crate) seen: Seen,
    /// Metres or radians.
    pub(crate) measured: f64,
}

/// What a prediction lacks.
#[derive(Clone, Copy)]
pub(crate) enum Missing {
    Truth(RobotId),
    Landmark,
}

/// Range and bearing to landmarks, range and bearing to robots.
pub(crate) fn plans(evidence: &Evidence<'_>, robot: RobotId) -> [Plan<Sighted>; 4] {
    let Some((recording, track)) = evidence.robot(robot) else {
        return std::array::from_fn(|_| Plan::without(Omission::NotRecorded("robot")));
    };
    if let Some(omission) = track.placing_missing() {
        return std::array::from_fn(|_| Plan::without(omission.clone()));
    }
    let mut plans = std::array::from_fn(|_| Plan::new());
    let mut recorded = [false; 4];
    for sample in &recording.sightings {
        let Reading::Sighting { target, relative } = sample.reading else { continue };
        let (range, bearing) = range_and_bearing(&relative);
        let offset = match target {
            Target::Landmark(_) => 0,
            Target::Robot(_) => 2,
        };
        let measured = [(offset, range), (offset + 1, bearing)];
        let measured = measured.into_iter().filter_map(|(index, value)| Some((index, value?)));
        let time_s = evidence.seconds(sample.time);
        let at = At::new(evidence, robot, track, time_s).ok_or(Missing::Truth(robot));
        let seen = seen(evidence, target, time_s);
        for (index, measured) in measured {
            recorded[index] = true;
            let plan = &mut plans[index];
            match (&at, &seen) {
                (Ok(at), &Ok(seen)) => plan.items.push(Sighted { at: at.clone(), target, seen, measured }),
                (Err(Missing::Truth(whose)), _) | (_, Err(Missing::Truth(whose))) => {
                    plan.count(|count| Omission::NoTruth(*whose, count));
                }
                (_, Err(Missing::Landmark)) | (Err(Missing::Landmark), _) => plan.count(Omission::NotInMap),
            }
        }
    }
    let names = ["ranges to landmarks", "bearings of landmarks", "ranges to robots", "bearings of robots"];
    for ((plan, recorded), name) in plans.iter_mut().zip(recorded).zip(names) {
        if !recorded {
            plan.omissions.push(Omission::NotRecorded(name));
        }
    }
    plans
}

/// Where the target was, and how it moved.
pub(crate) fn seen(evidence: &Evidence<'_>, target: Target, time_s: f64) -> Result<Seen, Missing> {
    match target {
        Target::Landmark(landmark) => {
            let place = evidence.recording.landmarks.get(&landmark).ok_or(Missing::Landmark)?;
            Ok(Seen::landmark(landmark.0, *place))
        }
        Target::Robot(other) => {
            let regime = evidence.tracks.get(&other).and_then(|track| track.regime_at(time_s));
            let (pose, regime) =
                regime.and_then(|regime| Some((regime.pose?, regime))).ok_or(Missing::Truth(other))?;
            Ok(Seen {
                target: signal::Target::Robot(other.0),
                position_m: pose.position(),
                velocity_m_s: pose.rotate([regime.speed_m_s, 0.0]),
            })
        }
    }
}

/// What of a sighting a channel compares.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Range,
    Bearing,
}

pub(crate) fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    (channel, part): (Channel, Part),
    (track, plan): (&Track, &Plan<Sighted>),
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let mut channel = ChannelResiduals::planned(channel, plan);
    let renamed = renames(model);
    for own in &plan.items {
        let path_of = |target: Target| match target {
            Target::Robot(other) => evidence.tracks.get(&other)?.path_in_map(own.at.time_s),
            Target::Landmark(_) => None,
        };
        let plain = own.at.instant(track);
        let other = renamed.then(|| actual(model, &plain, own.target)).filter(|other| *other != own.target);
        let other = other.and_then(|other| Some((other, seen(evidence, other, plain.time_s).ok()?)));
        let (target, seen) = other.as_ref().map_or((own.target, &own.seen), |(target, seen)| (*target, seen));
        let path = path_of(target);
        let target = path.as_ref().map(|path| path as &dyn Path);
        let instant = &Instant { target, ..plain };
        let predicted = predict::sighting(model, instant, seen);
        let context = Context {
            surroundings: instant.surroundings,
            ..Context::new(&model.nominal, instant.time_s, instant.motion.lift())
        };
        let noise = chain::noise(model, &context, predicted.range_m, predicted.bearing_rad);
        let (value, sigma) = match part {
            Part::Range => (-predicted.range_m + own.measured, noise.range_sigma_m),
            Part::Bearing => ((-predicted.bearing_rad + own.measured).wrapped(), noise.bearing_sigma_rad),
        };
        channel.push(Residual::new(instant.time_s, own.at.regime, Some(own.target), &[value], &[sigma]));
    }
    channel
}

/// Whether a model gives wrong names to what is seen, always and not by chance.
pub(crate) fn renames<S: Scalar>(model: &RobotModel<S>) -> bool {
    model.effects.iter().any(|active| active.effect() == Effect::LandmarkIdentitySwap)
}

/// What a sighting of this name is of: the swap of two names undoes itself.
pub(crate) fn actual<S: Scalar>(model: &RobotModel<S>, instant: &Instant, named: Target) -> Target {
    let context = Context::new(&model.nominal, instant.time_s, instant.motion.lift());
    let target = match named {
        Target::Landmark(landmark) => signal::Target::Landmark(landmark.0),
        Target::Robot(robot) => signal::Target::Robot(robot.0),
    };
    match chain::identity(model, &context, target, &[]) {
        signal::Target::Landmark(landmark) => Target::Landmark(LandmarkId(landmark)),
        signal::Target::Robot(robot) => Target::Robot(RobotId(robot)),
    }
}

fn range_and_bearing(relative: &Relative) -> (Option<f64>, Option<f64>) {
    let of_point = |x: f64, y: f64| (Some(x.hypot(y)), Some(Scalar::atan2(y, x)));
    match *relative {
        Relative::Pose(pose) => of_point(pose.x_m(), pose.y_m()),
        Relative::Position { x_m, y_m } => of_point(x_m, y_m),
        Relative::Range { range_m } => (Some(range_m), None),
        Relative::Bearing { bearing_rad } => (None, Some(bearing_rad)),
        Relative::RangeBearing { range_m, bearing_rad } => (Some(range_m), Some(bearing_rad)),
    }
}

//! Ranges and bearings against their prediction from the true poses.

use pleiad_estimation::sample::{Reading, Target};
use pleiad_estimation::{LandmarkId, RobotId};
use pleiad_physics::chain::sensors::{self as chain, Seen};
use pleiad_physics::predict::{self, Instant, Path};
use pleiad_physics::{Context, Effect, Pose, RobotModel, Scalar, signal};

use crate::channel::Channel;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::reference::range_and_bearing;
use crate::residual::{ChannelResiduals, Omission, Residual};
use crate::sensors::At;
use crate::track::Track;

/// A range or a bearing.
pub(crate) struct Sighted {
    pub(crate) at: At,
    pub(crate) target: Target,
    pub(crate) seen: Seen,
    /// Of a robot that is seen, where its path begins in the map, by the truth near this instant.
    target_path: Option<Pose<f64>>,
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
        let target_path = match target {
            Target::Robot(robot) => evidence.tracks.get(&robot).and_then(|track| track.map_from_path(time_s)),
            Target::Landmark(_) => None,
        };
        for (index, measured) in measured {
            recorded[index] = true;
            let plan = &mut plans[index];
            match (&at, &seen) {
                (Ok(at), &Ok(seen)) => {
                    plan.items.push(Sighted { at: at.clone(), target, seen, target_path, measured });
                }
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

/// Ranges and bearings of one kind of target. A sighting that has both is predicted once.
pub(crate) fn residuals<S: Scalar>(
    evidence: &Evidence<'_>,
    [range, bearing]: [Channel; 2],
    (track, [ranges, bearings]): (&Track, [&Plan<Sighted>; 2]),
    model: &RobotModel<S>,
) -> [ChannelResiduals<S>; 2] {
    let mut all = [ChannelResiduals::planned(range, ranges), ChannelResiduals::planned(bearing, bearings)];
    let renamed = renames(model);
    for (own, measured) in joined(&ranges.items, &bearings.items) {
        let at = &own.at;
        let plain = at.plain();
        let other = renamed.then(|| actual(model, &plain, own.target)).filter(|other| *other != own.target);
        let other = other.and_then(|other| seen(evidence, other, at.time_s).ok());
        let predicted = match &other {
            Some(other) => predicted(evidence, (track, at), other, model),
            None => own.predicted(evidence, track, model),
        };
        let context = Context {
            surroundings: plain.surroundings,
            ..Context::new(&model.nominal, plain.time_s, plain.motion.lift())
        };
        let noise = chain::noise(model, &context, predicted.range_m, predicted.bearing_rad);
        let values = [
            measured[0].map(|range_m| (-predicted.range_m + range_m, noise.range_sigma_m)),
            measured[1].map(|bearing_rad| {
                ((-predicted.bearing_rad + bearing_rad).wrapped(), noise.bearing_sigma_rad)
            }),
        ];
        for (channel, value) in all.iter_mut().zip(values) {
            let Some((value, sigma)) = value else { continue };
            channel.push(Residual::new(at.time_s, at.regime, Some(own.target), &[value], &[sigma]));
        }
    }
    all
}

/// Sightings in the order of the record, with their range and bearing as far as they have them.
pub(crate) fn joined<'s>(
    ranges: &'s [Sighted],
    bearings: &'s [Sighted],
) -> Vec<(&'s Sighted, [Option<f64>; 2])> {
    let mut all = Vec::with_capacity(ranges.len().max(bearings.len()));
    // Both are in the order of the record; a sighting with both parts is in both.
    let mut rest = bearings.iter().peekable();
    for range in ranges {
        while let Some(bearing) = rest.next_if(|own| own.at.time_s < range.at.time_s) {
            all.push((bearing, [None, Some(bearing.measured)]));
        }
        let bearing = rest.next_if(|own| is_same(range, own)).map(|own| own.measured);
        all.push((range, [Some(range.measured), bearing]));
    }
    all.extend(rest.map(|bearing| (bearing, [None, Some(bearing.measured)])));
    all
}

#[allow(clippy::float_cmp, reason = "the same stamp")]
fn is_same(range: &Sighted, bearing: &Sighted) -> bool {
    range.target == bearing.target && range.at.time_s == bearing.at.time_s
}

impl Sighted {
    /// What the robot reads of what it says it sees.
    fn predicted<S: Scalar>(
        &self,
        evidence: &Evidence<'_>,
        track: &Track,
        model: &RobotModel<S>,
    ) -> signal::Sighting<S> {
        let path = match (self.target, self.target_path) {
            (Target::Robot(robot), Some(map_from_path)) => {
                evidence.tracks.get(&robot).map(|track| track.path_from(map_from_path))
            }
            _ => None,
        };
        let target = path.as_ref().map(|path| path as &dyn Path);
        predict::sighting(model, &Instant { target, ..self.at.instant(track) }, &self.seen)
    }
}

/// What a robot reads of a target: the reference pose is carried along its path, and a robot's along its own.
pub(crate) fn predicted<S: Scalar>(
    evidence: &Evidence<'_>,
    (track, at): (&Track, &At),
    seen: &Seen,
    model: &RobotModel<S>,
) -> signal::Sighting<S> {
    let path = match seen.target {
        signal::Target::Robot(robot) => {
            let track = evidence.tracks.get(&RobotId(robot));
            track.and_then(|track| track.path_in_map(at.time_s))
        }
        signal::Target::Landmark(_) => None,
    };
    let instant = Instant { target: path.as_ref().map(|path| path as &dyn Path), ..at.instant(track) };
    predict::sighting(model, &instant, seen)
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

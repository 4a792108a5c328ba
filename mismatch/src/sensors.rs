//! Readings against their prediction from the true pose.

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_physics::chain::sensors::Seen;
use pleiad_physics::predict::{self, Instant};
use pleiad_physics::signal;
use pleiad_physics::{Pose, RobotModel, Scalar};

use crate::channel::Channel;
use crate::evidence::{Evidence, is_constant};
use crate::residual::{ChannelResiduals, Omission, Regime};
use crate::track::{Track, motion};

/// The instant of a reading, if the truth then is known.
fn instant(
    evidence: &Evidence<'_>,
    robot: RobotId,
    track: &Track,
    time_s: f64,
) -> Option<(Instant, Regime, Pose<f64>)> {
    let regime = track.regime_at(time_s)?;
    let pose = regime.pose?;
    let surroundings = evidence.surroundings(robot, time_s, Some(pose.position()));
    Some((Instant { time_s, motion: motion(&regime, pose), surroundings }, regime, pose))
}

/// Compares every sample of a channel by `compare`, which gives `None` for a reading of another kind.
fn compared<S: Scalar>(
    (channel, what, samples): (Channel, &'static str, &[Sample]),
    evidence: &Evidence<'_>,
    robot: RobotId,
    compare: impl Fn(&Reading, &Instant, &Pose<f64>, &mut [S; 2]) -> Option<usize>,
) -> ChannelResiduals<S> {
    if samples.is_empty() {
        return ChannelResiduals::without(channel, Omission::NotRecorded(what));
    }
    if is_constant(samples) {
        return ChannelResiduals::without(channel, Omission::Constant(what, samples.len()));
    }
    let mut channel = ChannelResiduals::new(channel);
    let Some((_, track)) = evidence.robot(robot) else { return channel };
    for sample in samples {
        let time_s = sample.time.seconds();
        let Some((instant, regime, pose)) = instant(evidence, robot, track, time_s) else {
            channel.count(|count| Omission::NoTruth(robot, count));
            continue;
        };
        let mut values = [S::zero(); 2];
        if let Some(components) = compare(&sample.reading, &instant, &pose, &mut values) {
            channel.push(time_s, regime, None, &values[..components]);
        }
    }
    channel
}

/// Position, in the robot's true frame: forward and left.
pub(crate) fn gps<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let samples = evidence.robot(robot).map_or(&[][..], |(recording, _)| &recording.gps);
    compared((Channel::Gps, "GPS positions", samples), evidence, robot, |reading, instant, pose, values| {
        let Reading::Gps { x_m, y_m } = *reading else { return None };
        let [x, y] = predict::gps(model, instant);
        let frame: Pose<S> = Pose::constant(pose.x_m, pose.y_m, pose.yaw_rad);
        *values = frame.rotate_back([-x + x_m, -y + y_m]);
        Some(2)
    })
}

/// Heading, wrapped.
pub(crate) fn heading<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> ChannelResiduals<S> {
    let samples = evidence.robot(robot).map_or(&[][..], |(recording, _)| &recording.heading);
    compared((Channel::Heading, "headings", samples), evidence, robot, |reading, instant, _, values| {
        let Reading::Heading { heading_rad } = *reading else { return None };
        values[0] = (-predict::heading(model, instant) + heading_rad).wrapped();
        Some(1)
    })
}

/// Ranges and bearings: to landmarks, then to robots.
pub(crate) fn sightings<S: Scalar>(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<S>,
) -> [ChannelResiduals<S>; 4] {
    let mut channels = [
        Channel::RangeToLandmark,
        Channel::BearingToLandmark,
        Channel::RangeToRobot,
        Channel::BearingToRobot,
    ]
    .map(ChannelResiduals::new);
    let Some((recording, track)) = evidence.robot(robot) else { return channels };
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
        let time_s = sample.time.seconds();
        let place = instant(evidence, robot, track, time_s).ok_or(Missing::Truth(robot));
        let seen = seen(evidence, target, time_s);
        for (index, value) in measured {
            recorded[index] = true;
            let channel = &mut channels[index];
            match (&place, &seen) {
                (Ok((instant, regime, _)), Ok(seen)) => {
                    let predicted = predict::sighting(model, instant, seen);
                    let residual = if index == offset {
                        -predicted.range_m + value
                    } else {
                        (-predicted.bearing_rad + value).wrapped()
                    };
                    channel.push(time_s, *regime, Some(target), &[residual]);
                }
                (Err(Missing::Truth(whose)), _) | (_, Err(Missing::Truth(whose))) => {
                    channel.count(|count| Omission::NoTruth(*whose, count));
                }
                (_, Err(Missing::Landmark)) | (Err(Missing::Landmark), _) => {
                    channel.count(Omission::NotInMap);
                }
            }
        }
    }
    let names = ["ranges to landmarks", "bearings of landmarks", "ranges to robots", "bearings of robots"];
    for ((channel, recorded), name) in channels.iter_mut().zip(recorded).zip(names) {
        if !recorded {
            channel.omissions.push(Omission::NotRecorded(name));
        }
    }
    channels
}

/// What a prediction lacks.
#[derive(Clone, Copy)]
enum Missing {
    Truth(RobotId),
    Landmark,
}

/// Where the target was, and how it moved.
fn seen(evidence: &Evidence<'_>, target: Target, time_s: f64) -> Result<Seen, Missing> {
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

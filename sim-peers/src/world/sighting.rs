//! What a robot sees of the others and of landmarks.

use std::collections::BTreeMap;

use pleiad_estimation::geometry::{Vector2, Vector3, wrap_angle};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use rand_chacha::ChaCha12Rng;

use super::random::{Channel, normal, uniform};
use super::sensors::Channels;
use super::track::Track;
use super::{Landmarks, OBSERVATIONS_FROM_S};
use crate::scenario::{RelativeKind, RelativeSensor, See};

/// Items of landmarks among the streams of a channel lie above those of robots.
const LANDMARK_ITEMS: u64 = 1 << 32;

/// Something that may be seen, with the stream of its noise.
struct Candidate<'a> {
    target: Target,
    place: Place<'a>,
    stream: ChaCha12Rng,
}

enum Place<'a> {
    Moving(&'a Track),
    Fixed(Vector2),
}

/// All that a robot sees during a run. Each target has its own stream, from which every scan draws
/// whether or not the target is in view: one more target, or another path, shifts no other noise.
pub(super) fn sightings(
    channels: &Channels<'_>,
    tracks: &BTreeMap<RobotId, Track>,
    landmarks: &Landmarks,
) -> Vec<Sample> {
    let sensor = &channels.settings.relative;
    let stream = |item| channels.seed.item_stream(channels.robot, Channel::Relative, item);
    let mut candidates = Vec::new();
    if sensor.see != See::Landmarks {
        let others = tracks.iter().filter(|(robot, _)| **robot != channels.robot);
        candidates.extend(others.map(|(robot, track)| Candidate {
            target: Target::Robot(*robot),
            place: Place::Moving(track),
            stream: stream(u64::from(robot.0)),
        }));
    }
    if sensor.see != See::Robots {
        candidates.extend(landmarks.iter().map(|(landmark, [x_m, y_m])| Candidate {
            target: Target::Landmark(*landmark),
            place: Place::Fixed(Vector2::new(*x_m, *y_m)),
            stream: stream(LANDMARK_ITEMS + u64::from(landmark.0)),
        }));
    }
    let mut seen = Vec::new();
    for time in channels.stamps(Channel::Relative, sensor.rate_hz, OBSERVATIONS_FROM_S) {
        let observer = channels.track.pose_at(time);
        for candidate in &mut candidates {
            if let Some(relative) = candidate.sighted(sensor, &observer, time) {
                let target = candidate.target;
                seen.push(Sample { time, reading: Reading::Sighting { target, relative } });
            }
        }
    }
    seen
}

impl Candidate<'_> {
    fn sighted(&mut self, sensor: &RelativeSensor, observer: &Pose2, time: Timestamp) -> Option<Relative> {
        let missed = uniform(&mut self.stream) < sensor.drop_out;
        let noise = [(); 3].map(|()| normal(&mut self.stream));
        let (position, pose) = match self.place {
            Place::Moving(track) => {
                let pose = track.pose_at(time);
                (pose.position(), Some(pose))
            }
            Place::Fixed(position) => (position, None),
        };
        let offset = observer.rotate_back(position - observer.position());
        (!missed && in_view(sensor, offset)).then(|| measure(sensor, observer, offset, pose, noise))?
    }
}

/// Whether a target at `offset` in the observer's frame is within range and field of view.
fn in_view(sensor: &RelativeSensor, offset: Vector2) -> bool {
    let range_m = offset.norm();
    range_m >= sensor.min_range_m
        && range_m <= sensor.max_range_m
        && offset.y.atan2(offset.x).abs() <= sensor.half_fov_rad
}

/// The reading, or `None` where noise leaves no positive range: a device that measures distances reports
/// no such echo.
fn measure(
    sensor: &RelativeSensor,
    observer: &Pose2,
    offset: Vector2,
    pose: Option<Pose2>,
    noise: [f64; 3],
) -> Option<Relative> {
    let range_m = offset.norm() + sensor.sigma_range_m * noise[0];
    let bearing_rad = wrap_angle(offset.y.atan2(offset.x) + sensor.sigma_bearing_rad * noise[1]);
    let position_noise = Vector2::new(noise[0], noise[1]) * sensor.sigma_position_m;
    match (sensor.kind, pose) {
        (RelativeKind::RangeBearing, _) => {
            (range_m > 0.0).then_some(Relative::RangeBearing { range_m, bearing_rad })
        }
        (RelativeKind::Range, _) => (range_m > 0.0).then_some(Relative::Range { range_m }),
        (RelativeKind::Bearing, _) => Some(Relative::Bearing { bearing_rad }),
        (RelativeKind::Pose, Some(pose)) => {
            let error = Vector3::new(position_noise.x, position_noise.y, sensor.sigma_yaw_rad * noise[2]);
            Some(Relative::Pose(observer.between(&pose).compose(&Pose2::exp(error))))
        }
        (RelativeKind::Position, _) | (RelativeKind::Pose, None) => {
            let position = offset + position_noise;
            Some(Relative::Position { x_m: position.x, y_m: position.y })
        }
    }
}

//! What a robot sees of the others and of landmarks.

use std::collections::BTreeMap;

use pleiad_estimation::geometry::{Vector3, wrap_angle};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_physics::chain::sensors;
use pleiad_physics::signal::{self, Noise, Sighting};
use pleiad_physics::{Chance, Context};
use rand_chacha::ChaCha12Rng;

use super::random::{Channel, chance, normal, student_divisor, uniform};
use super::sensors::Channels;
use super::track::Track;
use super::{Landmarks, OBSERVATIONS_FROM_S};
use crate::scenario::{RelativeKind, RelativeSensor, See};

/// Items of landmarks among the streams of a channel lie above those of robots.
const LANDMARK_ITEMS: u64 = 1 << 32;

/// Something that may be seen, with the streams of its noise.
struct Candidate<'a> {
    target: signal::Target,
    place: Place<'a>,
    noise: ChaCha12Rng,
    tails: ChaCha12Rng,
    chances: ChaCha12Rng,
}

enum Place<'a> {
    Moving(&'a Track),
    Fixed([f64; 2]),
}

/// What chance does to one sighting.
struct Luck {
    missed: f64,
    noise: [f64; 3],
    chance: Chance,
}

/// A target in view.
struct InView {
    target: signal::Target,
    relative: Relative,
    chance: Chance,
}

/// All that a robot sees during a run. Each target has its own streams, from which every scan draws
/// whether or not the target is in view: one more target, or another path, shifts no other noise.
pub(super) fn sightings(
    channels: &Channels<'_>,
    tracks: &BTreeMap<RobotId, Track>,
    landmarks: &Landmarks,
) -> Vec<Sample> {
    let sensor = &channels.settings.relative;
    let candidate = |target, place, item| {
        let stream = |channel| channels.seed.item_stream(channels.robot, channel, item);
        let (noise, tails) = (stream(Channel::Relative), stream(Channel::Tails));
        Candidate { target, place, noise, tails, chances: stream(Channel::Chances) }
    };
    let mut candidates = Vec::new();
    if sensor.see != See::Landmarks {
        let others = tracks.iter().filter(|(robot, _)| **robot != channels.robot);
        candidates.extend(others.map(|(robot, track)| {
            candidate(signal::Target::Robot(robot.0), Place::Moving(track), u64::from(robot.0))
        }));
    }
    if sensor.see != See::Robots {
        candidates.extend(landmarks.iter().map(|(landmark, position)| {
            let item = LANDMARK_ITEMS + u64::from(landmark.0);
            candidate(signal::Target::Landmark(landmark.0), Place::Fixed(*position), item)
        }));
    }
    let mut seen = Vec::new();
    for time in channels.instants(Channel::Relative, sensor.rate_hz, OBSERVATIONS_FROM_S) {
        let context = channels.context(time);
        let in_view: Vec<InView> = candidates
            .iter_mut()
            .filter_map(|candidate| candidate.sighted(channels, &context, time))
            .collect();
        let targets: Vec<signal::Target> = in_view.iter().map(|seen| seen.target).collect();
        let time = channels.stamp(time);
        let mut named = Vec::with_capacity(targets.len());
        for InView { target, relative, chance } in in_view {
            let others: Vec<signal::Target> =
                targets.iter().copied().filter(|other| alike(*other, target)).collect();
            let context = Context { chance, ..context };
            let name = sensors::identity(&channels.model, &context, target, &others);
            // A sensor that gives a name twice in a scan keeps the first: no recording has both.
            if named.contains(&name) {
                continue;
            }
            named.push(name);
            let target = match name {
                signal::Target::Robot(robot) => Target::Robot(RobotId(robot)),
                signal::Target::Landmark(landmark) => Target::Landmark(LandmarkId(landmark)),
            };
            seen.push(Sample { time, reading: Reading::Sighting { target, relative } });
        }
    }
    seen
}

/// Whether one target could be taken for the other: another of the same kind.
fn alike(one: signal::Target, other: signal::Target) -> bool {
    use signal::Target::{Landmark, Robot};
    one != other && matches!((one, other), (Robot(_), Robot(_)) | (Landmark(_), Landmark(_)))
}

impl Candidate<'_> {
    fn luck(&mut self) -> Luck {
        let missed = uniform(&mut self.noise);
        let noise = [(); 3].map(|()| normal(&mut self.noise));
        Luck { missed, noise, chance: chance(&mut self.chances) }
    }

    fn sighted(
        &mut self,
        channels: &Channels<'_>,
        context: &Context<'_, f64>,
        time: Timestamp,
    ) -> Option<InView> {
        let luck = self.luck();
        let model = &channels.model;
        let position_m = match &self.place {
            Place::Moving(_) => [0.0; 2],
            Place::Fixed(position) => *position,
        };
        let how = sensors::sighting_geometry(model, context, self.target, position_m);
        let then = time.plus_seconds(-how.latency_s);
        let target_pose = match &self.place {
            Place::Moving(track) => Some(track.unwrapped_at(then)),
            Place::Fixed(_) => None,
        };
        // A landmark may stand elsewhere than the map says; a robot is where it is.
        let target_m = target_pose.map_or(how.target_m, |pose| pose.position());
        let map_from_sensor = channels.track().unwrapped_at(then).compose(&sensors::sensor(&how));
        let offset = map_from_sensor.point_seen(target_m);
        if !in_view(&channels.settings.relative, offset) {
            return None;
        }
        let read = sensors::sighting_of(model, context, offset);
        let mut spread = sensors::noise(model, context, read.range_m, read.bearing_rad);
        if spread.degrees_of_freedom.is_finite() {
            spread.range_sigma_m /= student_divisor(&mut self.tails, spread.degrees_of_freedom);
            spread.bearing_sigma_rad /= student_divisor(&mut self.tails, spread.degrees_of_freedom);
        }
        if luck.missed < 1.0 - read.detection_probability {
            return None;
        }
        let yaw_rad = target_pose.map(|pose| pose.yaw_rad - map_from_sensor.yaw_rad);
        let relative = measure(&channels.settings.relative, &read, &spread, yaw_rad, luck.noise)?;
        Some(InView { target: self.target, relative, chance: luck.chance })
    }
}

/// Whether a target at `offset` in the sensor's frame is within range and field of view.
fn in_view(sensor: &RelativeSensor, [x, y]: [f64; 2]) -> bool {
    let range_m = x.hypot(y);
    range_m >= sensor.min_range_m && range_m <= sensor.max_range_m && y.atan2(x).abs() <= sensor.half_fov_rad
}

/// The reading, or `None` where noise leaves no positive range: a device that measures distances reports
/// no such echo. `yaw_rad` is that of a robot in the frame of the sensor.
fn measure(
    sensor: &RelativeSensor,
    read: &Sighting<f64>,
    spread: &Noise<f64>,
    yaw_rad: Option<f64>,
    noise: [f64; 3],
) -> Option<Relative> {
    let range_m = read.range_m + spread.range_sigma_m.max(0.0) * noise[0];
    let bearing_rad = wrap_angle(read.bearing_rad + spread.bearing_sigma_rad.max(0.0) * noise[1]);
    let (sin, cos) = read.bearing_rad.sin_cos();
    let position = [read.range_m * cos, read.range_m * sin];
    let position_noise = [noise[0], noise[1]].map(|variate| sensor.sigma_position_m * variate);
    match (sensor.kind, yaw_rad) {
        (RelativeKind::RangeBearing, _) => {
            (range_m > 0.0).then_some(Relative::RangeBearing { range_m, bearing_rad })
        }
        (RelativeKind::Range, _) => (range_m > 0.0).then_some(Relative::Range { range_m }),
        (RelativeKind::Bearing, _) => Some(Relative::Bearing { bearing_rad }),
        (RelativeKind::Pose, Some(yaw_rad)) => {
            let error = Vector3::new(position_noise[0], position_noise[1], sensor.sigma_yaw_rad * noise[2]);
            Some(Relative::Pose(Pose2::new(position[0], position[1], yaw_rad).compose(&Pose2::exp(error))))
        }
        (RelativeKind::Position, _) | (RelativeKind::Pose, None) => Some(Relative::Position {
            x_m: position[0] + position_noise[0],
            y_m: position[1] + position_noise[1],
        }),
    }
}

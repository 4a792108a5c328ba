//! Where robots were without a reference system: an extended Kalman filter over everything the team measured.
//!
//! Its poses take the place of truth in a copy of the recording, at every instant at which something was measured. They
//! are wrong, by as much as the filter knows; what is made of residuals against them is [`mesh`]'s to say.
//!
//! [`mesh`]: crate::diagnosis

use std::collections::BTreeMap;

use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_physics::chain::sensors::Seen;
use pleiad_physics::predict::{self, Instant};
use pleiad_physics::{Motion, Pose, RobotModel, Scalar, Surroundings, signal};
use pleiad_recording::{Recording, RobotRecording, TruthSample};

use crate::diagnosis::{LOST, STATES, about, carried, gradient};
use crate::error::MismatchError;
use crate::evidence::origin;
use crate::track::Track;

/// Longest time between two references of a robot, seconds.
const LONGEST_S: f64 = 1.0;
/// Instants nearer to each other than this have one reference, where odometry is no series of wheel angles, seconds.
const SAME_S: f64 = 0.02;
/// How unsure a robot's beginning is, metres and radians.
const START: [f64; 2] = [0.1, 0.05];
/// What dead reckoning is off by, metres forward and left, radians, per root of a second: generous, because the model
/// may be wrong.
const BY_WHEELS: [f64; 3] = [0.02, 0.01, 0.03];
const BY_COMMANDS: [f64; 3] = [0.08, 0.03, 0.15];
/// A reading that is off by more sigmas is not used.
const GATE: f64 = 5.0;
/// Standard deviations of readings of which none is declared: metres, radians.
const SIGMAS: [f64; 2] = [0.1, 0.04];

/// A robot while it is filtered.
struct Robot {
    track: Track,
    /// The stamps of its references, seconds.
    stamps_s: Vec<f64>,
    poses: Vec<Pose<f64>>,
}

/// A reading, by the position of its robot.
struct Said<'r> {
    robot: usize,
    time_s: f64,
    reading: &'r Reading,
}

/// A copy of a recording in which truth is what a filter makes of the rest. One pose per robot is taken from truth:
/// where it began.
///
/// # Errors
/// A robot has no odometry, or nobody knows where it began.
pub(crate) fn references(
    recording: &Recording,
    models: &BTreeMap<RobotId, RobotModel<f64>>,
) -> Result<Recording, MismatchError> {
    let mut blind = recording.clone();
    let starts: Vec<Option<(Timestamp, Pose2)>> = recording.robots.values().map(begin).collect();
    for own in blind.robots.values_mut() {
        own.truth.clear();
    }
    let origin = origin(&blind);
    let ids: Vec<RobotId> = blind.robots.keys().copied().collect();
    let said = said(&blind, origin);
    let mut robots = Vec::with_capacity(ids.len());
    for ((id, own), start) in blind.robots.iter().zip(starts) {
        let model = models
            .get(id)
            .ok_or_else(|| MismatchError::NoNominalRobot { recording: recording.name.clone(), robot: *id })?;
        let unknown = || MismatchError::NoStart { recording: recording.name.clone(), robot: *id };
        robots.push(
            begun(own, model, origin, start.ok_or_else(unknown)?, &instants(&said, *id, &ids))
                .ok_or_else(unknown)?,
        );
    }
    let models: Vec<&RobotModel<f64>> = ids.iter().filter_map(|id| models.get(id)).collect();
    filter(&blind, &ids, &models, &mut robots, &said);
    for (own, robot) in blind.robots.values_mut().zip(&robots) {
        own.truth = samples(robot.stamps_s.iter().zip(&robot.poses), origin);
    }
    Ok(blind)
}

/// The first true pose that odometry is there for.
fn begin(own: &RobotRecording) -> Option<(Timestamp, Pose2)> {
    let driven = own.odometry.first().map(|sample| sample.time);
    let known = own.truth.iter().find(|sample| driven.is_none_or(|driven| sample.time >= driven));
    known.map(|sample| (sample.time, sample.pose))
}

/// Poses as a recording has them.
pub(crate) fn samples<'p>(
    poses: impl Iterator<Item = (&'p f64, &'p Pose<f64>)>,
    origin: Timestamp,
) -> Vec<TruthSample> {
    let sample = |(stamp_s, pose): (&f64, &Pose<f64>)| TruthSample {
        time: origin.plus_seconds(*stamp_s),
        pose: Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad),
    };
    poses.map(sample).collect()
}

fn said(recording: &Recording, origin: Timestamp) -> Vec<Said<'_>> {
    let mut all = Vec::new();
    for (robot, own) in recording.robots.values().enumerate() {
        for sample in own.gps.iter().chain(&own.heading).chain(&own.sightings) {
            all.push(Said { robot, time_s: sample.time.seconds_since(origin), reading: &sample.reading });
        }
    }
    all.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    all
}

/// When something was measured by a robot or of it.
fn instants(said: &[Said<'_>], id: RobotId, ids: &[RobotId]) -> Vec<f64> {
    let concerns = |own: &&Said<'_>| {
        let of_it =
            matches!(own.reading, Reading::Sighting { target: Target::Robot(seen), .. } if *seen == id);
        ids[own.robot] == id || of_it
    };
    said.iter().filter(concerns).map(|own| own.time_s).collect()
}

/// A robot with the stamps of its references, carried back or on from where it began to the first of them.
fn begun(
    own: &RobotRecording,
    model: &RobotModel<f64>,
    origin: Timestamp,
    (time, start): (Timestamp, Pose2),
    instants: &[f64],
) -> Option<Robot> {
    let track = Track::new(own, model, origin);
    let (first_s, last_s) = track.path().span_s()?;
    let snapped = |time_s: f64| match track.encoders.as_slice() {
        [] => (time_s / SAME_S).round() * SAME_S,
        samples => {
            let after = samples.partition_point(|sample| sample.time_s < time_s).min(samples.len() - 1);
            let before = after.saturating_sub(1);
            let nearer = time_s - samples[before].time_s < samples[after].time_s - time_s;
            samples[if nearer { before } else { after }].time_s
        }
    };
    let regular =
        (1..).map(|step| first_s + LONGEST_S * f64::from(step)).take_while(|time_s| *time_s < last_s);
    let mut stamps_s: Vec<f64> = instants.iter().copied().chain(regular).map(snapped).collect();
    stamps_s.retain(|stamp_s| *stamp_s >= first_s && *stamp_s <= last_s);
    stamps_s.sort_by(f64::total_cmp);
    stamps_s.dedup();
    let begun_s = time.seconds_since(origin).clamp(first_s, last_s);
    let path = track.path();
    let first = path.at(begun_s)?.pose.between(&path.at(*stamps_s.first()?)?.pose);
    let start = Pose::new(start.x_m(), start.y_m(), start.yaw_rad()).compose(&first);
    Some(Robot { poses: vec![start; stamps_s.len()], track, stamps_s })
}

/// What the filter knows.
struct Belief {
    covariance: Vec<f64>,
    size: usize,
    poses: Vec<Pose<f64>>,
}

fn filter(
    recording: &Recording,
    ids: &[RobotId],
    models: &[&RobotModel<f64>],
    robots: &mut [Robot],
    said: &[Said<'_>],
) {
    let size = STATES * robots.len();
    let poses: Vec<Pose<f64>> =
        robots.iter().map(|own| own.poses.first().copied().unwrap_or_else(Pose::identity)).collect();
    let mut belief = Belief { covariance: vec![0.0; size * size], size, poses };
    for (robot, pose) in belief.poses.clone().iter().enumerate() {
        belief.add(robot, &about(pose, START));
    }
    // Moves and readings in the order of time; a reading is taken at the references nearest to it.
    let mut next = vec![0_usize; robots.len()];
    let mut waiting = said.iter().peekable();
    loop {
        let due = (0..robots.len())
            .filter_map(|robot| Some((robot, *robots[robot].stamps_s.get(next[robot] + 1)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let until_s = due.map_or(f64::INFINITY, |(_, stamp_s)| stamp_s);
        while let Some(own) = waiting.next_if(|own| own.time_s < until_s - 0.5 * SAME_S) {
            let places: Vec<Option<Pose<f64>>> = (0..robots.len())
                .map(|robot| {
                    let path = robots[robot].track.path();
                    let stamp_s = robots[robot].stamps_s.get(next[robot])?;
                    Some(path.at(*stamp_s)?.pose.between(&path.at(own.time_s)?.pose))
                })
                .collect();
            belief.take(recording, ids, models, own, &places);
        }
        // Every robot's reference is what is known at its stamp.
        for (robot, own) in robots.iter_mut().enumerate() {
            if let Some(pose) = own.poses.get_mut(next[robot]) {
                *pose = belief.poses[robot];
            }
        }
        let Some((robot, stamp_s)) = due else { break };
        let from_s = robots[robot].stamps_s[next[robot]];
        belief.step(robot, &robots[robot].track, [from_s, stamp_s]);
        next[robot] += 1;
        robots[robot].poses[next[robot]] = belief.poses[robot];
    }
}

impl Belief {
    fn add(&mut self, robot: usize, block: &[[f64; STATES]; STATES]) {
        for (row, line) in block.iter().enumerate() {
            for (column, value) in line.iter().enumerate() {
                self.covariance[(STATES * robot + row) * self.size + STATES * robot + column] += value;
            }
        }
    }

    /// Dead reckoning from one stamp to the next.
    fn step(&mut self, robot: usize, track: &Track, [from_s, to_s]: [f64; 2]) {
        let moved = track.path().at(from_s).zip(track.path().at(to_s));
        let Some((from, to)) = moved else {
            // Nobody knows what happened in a pause.
            self.add(robot, &about(&self.poses[robot], LOST));
            return;
        };
        let moved = from.pose.between(&to.pose);
        let pose = &mut self.poses[robot];
        let end = pose.compose(&moved);
        let (sin, cos) = (libm::sin(end.yaw_rad), libm::cos(end.yaw_rad));
        let columns = [[cos, sin, 0.0], [-sin, cos, 0.0], [end.y_m, -end.x_m, 1.0]];
        *pose = end;
        let sigmas = if track.encoders.is_empty() { BY_COMMANDS } else { BY_WHEELS };
        for (column, sigma) in columns.iter().zip(sigmas) {
            let variance = sigma * sigma * (to_s - from_s);
            let block = std::array::from_fn(|row| {
                std::array::from_fn(|other| column[row] * column[other] * variance)
            });
            self.add(robot, &block);
        }
    }

    /// Takes a reading; `places` are where robots are by then, seen from their references.
    fn take(
        &mut self,
        recording: &Recording,
        ids: &[RobotId],
        models: &[&RobotModel<f64>],
        own: &Said<'_>,
        places: &[Option<Pose<f64>>],
    ) {
        let robot = own.robot;
        let Some(place) = places[robot] else { return };
        let model = models[robot];
        let instant = |pose: Pose<f64>| Instant {
            time_s: own.time_s,
            motion: Motion::at_rest(pose),
            surroundings: Surroundings::default(),
            anchor: None,
            target: None,
        };
        let or = |declared: f64, else_: f64| if declared > 0.0 { declared } else { else_ };
        match *own.reading {
            Reading::Gps { x_m, y_m } => {
                for axis in 0..2 {
                    let pose = self.poses[robot].compose(&place);
                    let error = [x_m, y_m][axis] - predict::gps(model, &instant(pose))[axis];
                    let direction = [[1.0, 0.0], [0.0, 1.0]][axis];
                    let weights = [(robot, carried(direction, 0.0, &pose))];
                    self.correct(error, &weights, or(model.nominal.gps_sigma_m, SIGMAS[0]));
                }
            }
            Reading::Heading { heading_rad } => {
                let pose = self.poses[robot].compose(&place);
                let error = (heading_rad - predict::heading(model, &instant(pose))).wrapped();
                let weights = [(robot, [0.0, 0.0, 1.0])];
                self.correct(error, &weights, or(model.nominal.heading_sigma_rad, SIGMAS[1]));
            }
            Reading::Sighting { target, ref relative } => {
                let (range_m, bearing_rad) = range_and_bearing(relative);
                for (is_bearing, measured) in [(false, range_m), (true, bearing_rad)] {
                    let Some(measured) = measured else { continue };
                    let pose = self.poses[robot].compose(&place);
                    let seen = match target {
                        Target::Landmark(landmark) => recording
                            .landmarks
                            .get(&landmark)
                            .map(|at| (Seen::landmark(landmark.0, *at), None)),
                        Target::Robot(other) => {
                            ids.iter().position(|id| *id == other).and_then(|other_robot| {
                                let there = self.poses[other_robot].compose(&places[other_robot]?);
                                let seen = Seen {
                                    target: signal::Target::Robot(other.0),
                                    position_m: there.position(),
                                    velocity_m_s: [0.0; 2],
                                };
                                Some((seen, Some((other_robot, there))))
                            })
                        }
                    };
                    let Some((seen, other)) = seen else { return };
                    let predicted = predict::sighting(model, &instant(pose), &seen);
                    let (error, sigma) = if is_bearing {
                        let error = (measured - predicted.bearing_rad).wrapped();
                        (error, or(model.nominal.bearing_sigma_rad, SIGMAS[1]))
                    } else {
                        (measured - predicted.range_m, or(model.nominal.range_sigma_m, SIGMAS[0]))
                    };
                    let (to_target, turning) = gradient(is_bearing, &pose, seen.position_m);
                    let mut weights = vec![(robot, carried(to_target.map(|value| -value), turning, &pose))];
                    weights.extend(other.map(|(robot, there)| (robot, carried(to_target, 0.0, &there))));
                    self.correct(error, &weights, sigma);
                }
            }
            _ => {}
        }
    }

    /// An update by one number.
    fn correct(&mut self, error: f64, weights: &[(usize, [f64; STATES])], sigma: f64) {
        let size = self.size;
        let times = |line: &[f64]| -> f64 {
            weights
                .iter()
                .flat_map(|(robot, own)| {
                    own.iter().enumerate().map(move |(offset, weight)| (STATES * robot + offset, weight))
                })
                .map(|(index, weight)| weight * line[index])
                .sum()
        };
        let gains: Vec<f64> = self.covariance.chunks(size).map(times).collect();
        let variance = times(&gains) + sigma * sigma;
        if error * error > GATE * GATE * variance {
            return;
        }
        for (row, gain) in gains.iter().enumerate() {
            for (value, other) in self.covariance[row * size..(row + 1) * size].iter_mut().zip(&gains) {
                *value -= gain * other / variance;
            }
        }
        for (pose, gains) in self.poses.iter_mut().zip(gains.chunks(STATES)) {
            let [x, y, yaw] = [0, 1, 2].map(|offset| gains[offset] * error / variance);
            *pose = moved(pose, [x, y, yaw]);
        }
    }
}

/// `exp(xi) pose`.
pub(crate) fn moved(pose: &Pose<f64>, [x, y, yaw]: [f64; STATES]) -> Pose<f64> {
    Pose::exp(x, y, yaw).compose(pose)
}

pub(crate) fn range_and_bearing(relative: &Relative) -> (Option<f64>, Option<f64>) {
    let of_point = |x: f64, y: f64| (Some(x.hypot(y)), Some(Scalar::atan2(y, x)));
    match *relative {
        Relative::Pose(pose) => of_point(pose.x_m(), pose.y_m()),
        Relative::Position { x_m, y_m } => of_point(x_m, y_m),
        Relative::Range { range_m } => (Some(range_m), None),
        Relative::Bearing { bearing_rad } => (None, Some(bearing_rad)),
        Relative::RangeBearing { range_m, bearing_rad } => (Some(range_m), Some(bearing_rad)),
    }
}

//! Where robots start and landmarks stand.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use pleiad_estimation::{LandmarkId, Pose2, RobotId};

use super::Landmarks;
use super::random::{Channel, Seed, between};
use crate::scenario::{Policy, RobotSettings};
use crate::{Error, Scenario};

/// Least distance between two starts that were not given, metres.
const SEPARATION_M: f64 = 1.0;
/// Random places tried before giving up.
const ATTEMPTS: u32 = 1000;

/// Where every robot starts: given, or at random with room around it. Robots are placed in the order of
/// their numbers, each from its own stream, so that a later one moves no earlier one.
pub(super) fn starts(scenario: &Scenario, seed: Seed) -> Result<BTreeMap<RobotId, Pose2>, Error> {
    let mut starts = BTreeMap::new();
    for (robot, settings) in &scenario.robots {
        if let Some(start) = settings.start {
            starts.insert(*robot, Pose2::new(start.x_m, start.y_m, start.heading_rad));
        }
    }
    for robot in scenario.robots.keys() {
        if !starts.contains_key(robot) {
            let start = free_place(scenario, *robot, seed, &starts)?;
            starts.insert(*robot, start);
        }
    }
    Ok(starts)
}

fn free_place(
    scenario: &Scenario,
    robot: RobotId,
    seed: Seed,
    taken: &BTreeMap<RobotId, Pose2>,
) -> Result<Pose2, Error> {
    let [x_min, x_max, y_min, y_max] = wander_area(scenario, robot);
    let mut stream = seed.stream(robot, Channel::Placement);
    for _ in 0..ATTEMPTS {
        let place = Pose2::new(
            between(&mut stream, x_min, x_max),
            between(&mut stream, y_min, y_max),
            between(&mut stream, -PI, PI),
        );
        if taken.values().all(|other| (other.position() - place.position()).norm() >= SEPARATION_M) {
            return Ok(place);
        }
    }
    Err(Error::Placement { robot, separation_m: SEPARATION_M, attempts: ATTEMPTS })
}

/// The map: the landmarks given, then the random ones, numbered on.
pub(super) fn landmarks(scenario: &Scenario, seed: Seed) -> Landmarks {
    let mut landmarks = scenario.landmarks.clone();
    let first = landmarks.keys().next_back().map_or(1, |last| last.0.saturating_add(1));
    let [x_min, x_max, y_min, y_max] = scenario.arena.bounds_m();
    // The world's own streams bear the number 0, which no robot has.
    let mut stream = seed.stream(RobotId(0), Channel::Landmarks);
    for index in 0..scenario.random_landmarks {
        let position = [between(&mut stream, x_min, x_max), between(&mut stream, y_min, y_max)];
        landmarks.insert(LandmarkId(first.saturating_add(index)), position);
    }
    landmarks
}

/// Where a robot's random waypoints lie: its area, or the arena, less a margin to turn in (at most a
/// tenth of the extent).
pub(super) fn wander_area(scenario: &Scenario, robot: RobotId) -> [f64; 4] {
    let [x_min, x_max, y_min, y_max] = own_area(scenario, robot);
    let margin = |extent: f64| (0.1 * extent).min(1.0);
    let (x_margin, y_margin) = (margin(x_max - x_min), margin(y_max - y_min));
    [x_min + x_margin, x_max - x_margin, y_min + y_margin, y_max - y_margin]
}

/// The area that a robot is given; without one the arena, which robots under `manoeuvres` share out in
/// squares or nearly so.
pub(super) fn own_area(scenario: &Scenario, robot: RobotId) -> [f64; 4] {
    let motion = &scenario.robots[&robot].motion;
    let arena = scenario.arena.bounds_m();
    match motion.area_m {
        Some(area_m) => area_m,
        None if motion.policy == Policy::Manoeuvres => share(scenario, robot, arena),
        None => arena,
    }
}

fn share(scenario: &Scenario, robot: RobotId, [x_min, x_max, y_min, y_max]: [f64; 4]) -> [f64; 4] {
    let shares = |settings: &RobotSettings| {
        settings.motion.policy == Policy::Manoeuvres && settings.motion.area_m.is_none()
    };
    let sharing: Vec<RobotId> =
        scenario.robots.iter().filter(|(_, settings)| shares(settings)).map(|(robot, _)| *robot).collect();
    let count = sharing.len().max(1) as f64;
    let (width_m, height_m) = (x_max - x_min, y_max - y_min);
    let columns = (count * width_m / height_m).sqrt().round().clamp(1.0, count);
    let rows = (count / columns).ceil();
    let rank = sharing.iter().position(|other| *other == robot).unwrap_or(0) as f64;
    let (column, row) = (rank % columns, (rank / columns).floor());
    let (width_m, height_m) = (width_m / columns, height_m / rows);
    let (left, bottom) = (x_min + column * width_m, y_min + row * height_m);
    [left, left + width_m, bottom, bottom + height_m]
}

//! Drives the whole team through a scenario. Robots take their ticks in order of time, because those that
//! wander look where the others are, and those that are near each other may push.

use std::collections::BTreeMap;

use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::Command;

use super::random::Seed;
use super::track::Track;
use super::vehicle::{Neighbour, Vehicle};
use crate::Scenario;

/// What one robot did.
pub(super) struct Drive {
    pub(super) track: Track,
    /// With stamps in common time.
    pub(super) commands: Vec<Command>,
    /// Angles of the left and right wheel at each tick, radians.
    pub(super) wheel_angles: Vec<[f64; 2]>,
    /// Steering angle at each tick, radians; 0 unless car-like.
    pub(super) steer_rad: Vec<f64>,
}

/// Drives every robot until its first tick at or after the end of the scenario.
pub(super) fn drive(
    scenario: &Scenario,
    starts: &BTreeMap<RobotId, Pose2>,
    seed: Seed,
) -> BTreeMap<RobotId, Drive> {
    let end = Timestamp::from_seconds(scenario.duration_s);
    let mut vehicles: Vec<Vehicle> =
        starts.iter().map(|(robot, start)| Vehicle::new(scenario, *robot, *start, seed)).collect();
    let mut team: Vec<Neighbour> = vehicles.iter().map(Vehicle::seen_by_others).collect();
    while let Some(index) = next(&vehicles, end) {
        vehicles[index].tick(&team);
        team[index] = vehicles[index].seen_by_others();
    }
    vehicles.into_iter().map(Vehicle::into_drive).collect()
}

/// The robot whose tick comes first, the smaller number at equal times; none once all are past the end.
fn next(vehicles: &[Vehicle], end: Timestamp) -> Option<usize> {
    let due = |(index, vehicle): (usize, &Vehicle)| (vehicle.now() < end).then(|| (vehicle.now(), index));
    vehicles.iter().enumerate().filter_map(due).min().map(|(_, index)| index)
}

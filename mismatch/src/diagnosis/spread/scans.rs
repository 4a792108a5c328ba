//! What a robot saw at one instant.

use pleiad_estimation::LandmarkId;
use pleiad_estimation::sample::Target;
use pleiad_physics::chain::sensors::Seen;
use pleiad_physics::{RobotModel, Scalar, predict};

use crate::channel::Channel;
use crate::diagnosis::unit::Unit;
use crate::sightings::{self, Sighted, seen};

/// Landmarks, robots: the channels of their ranges and bearings.
pub(super) const CHANNELS: [[Channel; 2]; 2] = [
    [Channel::RangeToLandmark, Channel::BearingToLandmark],
    [Channel::RangeToRobot, Channel::BearingToRobot],
];

/// A sighting.
pub(super) struct Reading<'s> {
    /// Its range, or its bearing if it has no range.
    pub(super) sighted: &'s Sighted,
    /// Range and bearing.
    pub(super) measured: [Option<f64>; 2],
}

impl Reading<'_> {
    /// Range and bearing minus those predicted for a target, and the range predicted.
    pub(super) fn errors(&self, model: &RobotModel<f64>, seen: &Seen) -> ([Option<f64>; 2], f64) {
        let predicted = predict::sighting(model, &self.sighted.at.bare(), seen);
        let range = self.measured[0].map(|range_m| range_m - predicted.range_m);
        let bearing = self.measured[1].map(|bearing_rad| (bearing_rad - predicted.bearing_rad).wrapped());
        ([range, bearing], predicted.range_m)
    }
}

/// Sightings of one kind of target at one instant.
pub(super) struct Scan<'s> {
    pub(super) time_s: f64,
    pub(super) readings: Vec<Reading<'s>>,
}

/// The sightings of landmarks (kind 0) or robots (kind 1) that could be placed, by instant.
pub(super) fn scans<'s>(unit: &'s Unit<'_>, kind: usize) -> Vec<Scan<'s>> {
    let Some((_, plans)) = unit.evidence.prepared(unit.robot) else { return Vec::new() };
    let [ranges, bearings] = [0, 1].map(|part| plans.sightings[2 * kind + part].items.as_slice());
    let mut found: Vec<Scan<'s>> = Vec::new();
    let mut push = |sighted: &'s Sighted, measured| {
        let time_s = sighted.at.time_s;
        let reading = Reading { sighted, measured };
        match found.last_mut() {
            Some(scan) if scan.time_s >= time_s => scan.readings.push(reading),
            _ => found.push(Scan { time_s, readings: vec![reading] }),
        }
    };
    // Both are in the order of the record; a sighting with both parts is in both.
    let mut rest = bearings;
    for range in ranges {
        let earlier = rest.partition_point(|own| own.at.time_s < range.at.time_s);
        for bearing in &rest[..earlier] {
            push(bearing, [None, Some(bearing.measured)]);
        }
        rest = &rest[earlier..];
        match rest.first() {
            Some(bearing) if is_same(range, bearing) => {
                push(range, [Some(range.measured), Some(bearing.measured)]);
                rest = &rest[1..];
            }
            _ => push(range, [Some(range.measured), None]),
        }
    }
    for bearing in rest {
        push(bearing, [None, Some(bearing.measured)]);
    }
    found
}

#[allow(clippy::float_cmp, reason = "the same stamp")]
fn is_same(range: &Sighted, bearing: &Sighted) -> bool {
    range.target == bearing.target && range.at.time_s == bearing.at.time_s
}

/// Everything of a kind whose place at an instant is known.
pub(super) fn targets(unit: &Unit<'_>, kind: usize, time_s: f64) -> Vec<(Target, Seen)> {
    let evidence = unit.evidence;
    if kind == 0 {
        let landmark =
            |(&id, place): (&LandmarkId, &[f64; 2])| (Target::Landmark(id), Seen::landmark(id.0, *place));
        return evidence.recording.landmarks.iter().map(landmark).collect();
    }
    let others = evidence.tracks.keys().filter(|robot| **robot != unit.robot);
    others
        .filter_map(|&robot| Some((Target::Robot(robot), seen(evidence, Target::Robot(robot), time_s).ok()?)))
        .collect()
}

/// What a sighting is of under a model that may swap names.
pub(super) fn actual(model: &RobotModel<f64>, reading: &Reading<'_>) -> Target {
    let named = reading.sighted.target;
    if sightings::renames(model) {
        sightings::actual(model, &reading.sighted.at.bare(), named)
    } else {
        named
    }
}

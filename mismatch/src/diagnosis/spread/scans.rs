//! What a robot saw at one instant.

use pleiad_estimation::LandmarkId;
use pleiad_estimation::sample::Target;
use pleiad_physics::chain::sensors::Seen;
use pleiad_physics::{RobotModel, Scalar, signal};

use crate::channel::Channel;
use crate::diagnosis::unit::Unit;
use crate::sensors::At;
use crate::sightings::{self, Sighted, joined, seen};

/// The median size of a normal error times this is its standard deviation.
const NORMAL_OVER_MEDIAN: f64 = 1.482_602_218_505_602;

/// A sighting.
pub(super) struct Reading<'s> {
    /// Its range, or its bearing if it has no range.
    pub(super) sighted: &'s Sighted,
    /// Range and bearing.
    pub(super) measured: [Option<f64>; 2],
}

impl Reading<'_> {
    /// Range and bearing minus those predicted for a target, and the range predicted.
    pub(super) fn errors(
        &self,
        unit: &Unit<'_>,
        model: &RobotModel<f64>,
        seen: &Seen,
    ) -> ([Option<f64>; 2], f64) {
        let predicted = predicted(unit, model, &self.sighted.at, seen);
        let range = self.measured[0].map(|range_m| range_m - predicted.range_m);
        let bearing = self.measured[1].map(|bearing_rad| (bearing_rad - predicted.bearing_rad).wrapped());
        ([range, bearing], predicted.range_m)
    }
}

/// Range and bearing of a target.
pub(super) fn predicted(
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    at: &At,
    seen: &Seen,
) -> signal::Sighting<f64> {
    let track = &unit.evidence.tracks[&unit.robot()];
    sightings::predicted(unit.evidence, (track, at), seen, model)
}

/// Sightings of one kind of target at one instant.
pub(super) struct Scan<'s> {
    pub(super) time_s: f64,
    pub(super) readings: Vec<Reading<'s>>,
}

/// The sightings of landmarks (kind 0) or robots (kind 1) that could be placed, by instant.
pub(super) fn scans<'s>(unit: &'s Unit<'_>, kind: usize) -> Vec<Scan<'s>> {
    let Some((_, plans)) = unit.evidence.prepared(unit.robot()) else { return Vec::new() };
    let [ranges, bearings] =
        Channel::SIGHTINGS[kind].map(|channel| plans.of_sightings(channel).items.as_slice());
    let mut found: Vec<Scan<'s>> = Vec::new();
    for (sighted, measured) in joined(ranges, bearings) {
        let time_s = sighted.at.time_s;
        let reading = Reading { sighted, measured };
        match found.last_mut() {
            Some(scan) if scan.time_s >= time_s => scan.readings.push(reading),
            _ => found.push(Scan { time_s, readings: vec![reading] }),
        }
    }
    found
}

/// Everything of a kind whose place at an instant is known.
pub(super) fn targets(unit: &Unit<'_>, kind: usize, time_s: f64) -> Vec<(Target, Seen)> {
    let evidence = unit.evidence;
    if kind == 0 {
        let landmark =
            |(&id, place): (&LandmarkId, &[f64; 2])| (Target::Landmark(id), Seen::landmark(id.0, *place));
        return evidence.recording.landmarks.iter().map(landmark).collect();
    }
    let others = evidence.tracks.keys().filter(|robot| **robot != unit.robot());
    others
        .filter_map(|&robot| Some((Target::Robot(robot), seen(evidence, Target::Robot(robot), time_s).ok()?)))
        .collect()
}

/// The spread of errors by the median of their sizes, which are reordered; `None` without errors, or where most
/// are zero.
pub(super) fn median_spread(sizes: &mut [f64]) -> Option<f64> {
    sizes.sort_by(f64::total_cmp);
    let middle = *sizes.get(sizes.len() / 2)?;
    (middle > 0.0).then_some(NORMAL_OVER_MEDIAN * middle)
}

/// Whether the declared sensor has a target in view at an instant, by this margin of range and bearing; yes if
/// none is declared.
pub(super) fn in_view(
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    at: &At,
    seen: &Seen,
    margins: [f64; 2],
) -> bool {
    let Some(nominal) = &unit.evidence.recording.nominal else { return true };
    let sensor = &nominal.range_sensor;
    let predicted = predicted(unit, model, at, seen);
    let half_fov_rad = sensor.half_fov_rad;
    predicted.range_m > sensor.min_range_m + margins[0]
        && predicted.range_m < sensor.max_range_m - margins[0]
        && (predicted.bearing_rad.abs() < half_fov_rad - margins[1] || half_fov_rad >= std::f64::consts::PI)
}

/// Whether a robot ever gave one name to two sightings of an instant. A sensor that does not has dropped one of
/// them.
pub(super) fn repeats(units: &[&Unit<'_>]) -> bool {
    let twice = |scan: &Scan<'_>| {
        let named = |index: usize| scan.readings[index].sighted.target;
        (1..scan.readings.len()).any(|index| (0..index).any(|other| named(other) == named(index)))
    };
    units.iter().any(|unit| (0..Channel::SIGHTINGS.len()).any(|kind| scans(unit, kind).iter().any(twice)))
}

/// What a sighting is of under a model that may swap names.
pub(super) fn actual(model: &RobotModel<f64>, reading: &Reading<'_>) -> Target {
    let named = reading.sighted.target;
    if sightings::renames(model) {
        sightings::actual(model, &reading.sighted.at.plain(), named)
    } else {
        named
    }
}

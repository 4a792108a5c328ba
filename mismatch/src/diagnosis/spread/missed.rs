//! What should have been seen and was not.
//!
//! An opportunity is a target that the declared sensor had in view at an instant at which it looked; whether it
//! was reported is a Bernoulli draw with
//!
//! ```text
//! logit(miss) = declared + constant + range r + bearing_squared b^2
//! ```
//!
//! The instants are the stamps of sightings, and those between them where the sensor's period says that it
//! looked and saw nothing.

use pleiad_physics::chain::sensors::Seen;
use pleiad_physics::{Effect, RobotModel};

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::spread::family::{Contrast, Family, Member, Place, Shown, blocks};
use crate::diagnosis::spread::maximum::{Bounds, Density};
use crate::diagnosis::spread::scans::{
    Reading, Scan, actual, in_view, median_spread, predicted, scans, targets,
};
use crate::diagnosis::unit::Unit;
use crate::sensors::At;
use crate::track::median_step;

/// Parameters: constant, by range, by squared bearing.
const CONSTANT: usize = 0;
/// A target closer than this many sigmas to the border of the view may be outside.
const MARGIN_SIGMAS: f64 = 3.0;
/// So many instants without any sighting in a row are a sensor that is off.
const MOST_SILENT: f64 = 25.0;
/// A reading this many sigmas from a target is of it, unless it is as near to the one whose name it bears.
const GATE: f64 = 6.0;
/// A declared detection probability of one counts as one miss in a thousand, as in the effect.
const LEAST_MISS_ODDS: f64 = 1e-3;

/// The logarithm of the smallest probability that is told from zero.
const LEAST_LOG: f64 = -700.0;

/// One opportunity.
struct Row {
    /// Range, metres, and squared bearing, rad^2.
    regressors: [f64; 2],
    missed: bool,
}

struct Opportunities {
    rows: Vec<Row>,
    blocks: Vec<usize>,
    declared_logit: f64,
    /// Probability that it was seen and lost its name to another, of which a scan keeps one.
    displaced: f64,
}

impl Density for Opportunities {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        for (row, value) in self.rows.iter().zip(into) {
            let [range, square] = row.regressors;
            let logit = self.declared_logit
                + parameters[CONSTANT]
                + parameters[CONSTANT + 1] * range
                + parameters[CONSTANT + 2] * square;
            let missed = 1.0 / (1.0 + libm::exp(-logit));
            let kept = 1.0 - self.displaced;
            *value = if row.missed {
                libm::log((missed * kept + self.displaced).max(f64::MIN_POSITIVE))
            } else {
                libm::log1p(-missed).max(LEAST_LOG) + libm::log(kept)
            };
        }
    }
}

/// Why a robot's misses say nothing.
pub(super) fn obstacle(units: &[&Unit<'_>]) -> Option<String> {
    let declared = units.iter().any(|unit| unit.evidence.recording.nominal.is_some());
    (!declared).then(|| "no range sensor was declared: nobody knows what it should have seen".to_owned())
}

/// What one robot could see, under a fit of the mean; so many sightings were displaced by wrong names.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit, displaced: f64) -> Option<Family<'u, 'a>> {
    let mut rows = Vec::new();
    let mut places = Vec::new();
    let mut probability: f64 = 1.0;
    for (position, unit) in units.iter().enumerate() {
        let Some(nominal) = &unit.evidence.recording.nominal else { continue };
        probability = nominal.range_sensor.detection_probability;
        let model = unit.model(&fit.terms);
        for kind in 0..Channel::SIGHTINGS.len() {
            collect(position, unit, &model, kind, &mut rows, &mut places);
        }
    }
    if rows.is_empty() || probability <= 0.0 {
        return None;
    }
    let declared_logit = libm::log(((1.0 - probability) / probability).max(LEAST_MISS_ODDS));
    let parameters = Effect::MissedDetections.info().parameters;
    let scales = [0.3, 0.1, 0.3];
    let bounds = parameters.iter().zip(scales).map(|(parameter, scale)| {
        let (low, high) = parameter.plausible;
        Bounds { low, high, scale }
    });
    let count = rows.len() as f64;
    let mean = |which: usize| rows.iter().map(|row: &Row| row.regressors[which]).sum::<f64>() / count;
    let typical = Contrast {
        weights: vec![(CONSTANT, 1.0), (CONSTANT + 1, mean(0)), (CONSTANT + 2, mean(1))],
        threshold: parameters[0].relevance.threshold(&pleiad_physics::Floors::default()),
    };
    let own: Vec<usize> = (CONSTANT..CONSTANT + 3).collect();
    Some(Family {
        bounds: bounds.collect(),
        density: Box::new(Opportunities { blocks: blocks(units, &places), rows, declared_logit, displaced }),
        units: units.to_vec(),
        places,
        start: vec![0.0; 3],
        nuisances: Vec::new(),
        members: vec![Member {
            effect: Effect::MissedDetections,
            off: vec![0.0; 3],
            start: vec![0.01; 3],
            shown: own.iter().map(|&index| Shown::Value(index)).collect(),
            parameters: own,
            contrasts: vec![typical],
            chances: None,
        }],
    })
}

fn collect(
    position: usize,
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    kind: usize,
    rows: &mut Vec<Row>,
    places: &mut Vec<Place>,
) {
    let own = scans(unit, kind);
    let Some((_, track)) = unit.evidence.robot(unit.robot()) else { return };
    if own.is_empty() {
        return;
    }
    let sigmas = spreads(unit, model, kind, &own);
    let margins = sigmas.map(|sigma| MARGIN_SIGMAS * sigma);
    for (time_s, scan) in instants(unit, &own) {
        let Some(at) = At::new(unit.evidence, unit.robot(), track, time_s) else { continue };
        let targets = targets(unit, kind, time_s);
        let near = |reading: &Reading<'_>, seen: &Seen| {
            let (errors, _) = reading.errors(unit, model, seen);
            errors
                .iter()
                .zip(sigmas)
                .all(|(error, sigma)| error.is_none_or(|error| error.abs() < GATE * sigma))
        };
        // Readings that are not where their names are: of another target.
        let misnamed: Vec<&Reading<'_>> = scan.map_or_else(Vec::new, |scan| {
            let fits = |reading: &&Reading<'_>| {
                let named = actual(model, reading);
                targets.iter().any(|(target, seen)| *target == named && near(reading, seen))
            };
            scan.readings.iter().filter(|reading| !fits(reading)).collect()
        });
        for (target, seen) in &targets {
            let (target, seen) = (*target, seen);
            if !in_view(unit, model, &at, seen, margins) {
                continue;
            }
            let predicted = predicted(unit, model, &at, seen);
            let named = |scan: &Scan<'_>| scan.readings.iter().any(|own| actual(model, own) == target);
            let reported = scan.is_some_and(named) || misnamed.iter().any(|own| near(own, seen));
            let regressors = [predicted.range_m, predicted.bearing_rad * predicted.bearing_rad];
            rows.push(Row { regressors, missed: !reported });
            places.push(Place { unit: position, time_s, channel: Channel::SIGHTINGS[kind][0] });
        }
    }
}

/// The spreads of ranges and bearings about what is predicted for the names they bear.
fn spreads(unit: &Unit<'_>, model: &RobotModel<f64>, kind: usize, own: &[Scan<'_>]) -> [f64; 2] {
    let mut sizes = [Vec::new(), Vec::new()];
    for scan in own {
        let targets = targets(unit, kind, scan.time_s);
        for reading in &scan.readings {
            let named = actual(model, reading);
            let Some((_, seen)) = targets.iter().find(|(target, _)| *target == named) else { continue };
            for (sizes, error) in sizes.iter_mut().zip(reading.errors(unit, model, seen).0) {
                sizes.extend(error.map(f64::abs));
            }
        }
    }
    sizes.map(|mut sizes| median_spread(&mut sizes).unwrap_or(0.0))
}

/// When the sensor looked, with what it saw of a kind.
fn instants<'s, 'a>(unit: &Unit<'_>, own: &'s [Scan<'a>]) -> Vec<(f64, Option<&'s Scan<'a>>)> {
    let mut stamps: Vec<f64> =
        (0..Channel::SIGHTINGS.len()).flat_map(|kind| scans(unit, kind)).map(|scan| scan.time_s).collect();
    stamps.sort_by(f64::total_cmp);
    stamps.dedup();
    let rates =
        unit.evidence.recording.nominal.as_ref().and_then(|nominal| nominal.robots.get(&unit.robot()));
    let rate_hz = rates.and_then(|robot| robot.rates_hz.get("relative_rate_hz")).copied();
    let period_s = rate_hz
        .filter(|rate_hz| *rate_hz > 0.0)
        .map_or_else(|| median_step(stamps.iter().copied()), |rate_hz| 1.0 / rate_hz);
    let mut found = Vec::new();
    let mut scans = own.iter().peekable();
    for (index, &stamp_s) in stamps.iter().enumerate() {
        if let Some(before_s) = index.checked_sub(1).map(|before| stamps[before]) {
            let steps = ((stamp_s - before_s) / period_s).round();
            let mut silent = 1.0;
            while steps <= MOST_SILENT && silent < steps {
                found.push((before_s + (stamp_s - before_s) * silent / steps, None));
                silent += 1.0;
            }
        }
        let scan = scans.next_if(|scan| scan.time_s <= stamp_s);
        found.push((stamp_s, scan));
    }
    found
}

//! Ranges and bearings: how wide, with what tails, and under which name.
//!
//! Of a sighting that names target A at range `r` and bearing `b`, with the others of its kind in view,
//!
//! ```text
//! density = (1 - k p) f(A) + k p/n sum over others B of f(B),   f = t((r - r_B)/sigma_r) t((b - b_B)/sigma_b)
//! sigma_r = a + s1 r + s2 r^2,   sigma_b = c + s |w|
//! ```
//!
//! with `a` and `c` estimated per kind of target, `t` Student's, and `n` the number of other sightings of that
//! kind at the same instant: a name is drawn among what was seen. A wrong name is therefore there twice. A
//! recording that holds no name twice has kept one of the two, and of wrong names half: `k = 1/2`, and one more
//! was seen than is recorded. Otherwise `k = 1`.

use pleiad_physics::{Effect, Floors, RobotModel};

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::noise;
use crate::diagnosis::spread::check::{Check, LEAST_OF_TARGET};
use crate::diagnosis::spread::density::{Student, log_sum};
use crate::diagnosis::spread::family::{Contrast, Family, Member, Place, Shown, blocks};
use crate::diagnosis::spread::maximum::{Bounds, Density};
use crate::diagnosis::spread::scans::{actual, in_view, median_spread, repeats, scans, targets};
use crate::diagnosis::unit::Unit;

/// Parameters: the logarithms of the least sigma, of range and bearing, to landmarks and to robots.
const BASE: usize = 0;
const LINEAR: usize = 4;
const SQUARE: usize = 5;
const BLUR: usize = 6;
const TAILS: usize = 7;
const MIXED: usize = 8;
/// The reciprocal of so many degrees of freedom is a tail that matters.
const LEAST_TAIL: f64 = 1.0 / 30.0;
/// A reading this many times the spread of its channel from a target cannot be of it.
const FAR: f64 = 12.0;
/// A sigma is at least this share of its value at no range and no turn.
const LEAST_SIGMA: f64 = 0.05;

/// One sighting.
struct Row {
    /// 0 landmark, 1 robot.
    kind: usize,
    /// Predicted range, metres: what sigma depends on.
    range_m: f64,
    yaw_rate_rad_s: f64,
    /// Measured minus predicted range and bearing of the target that it names.
    errors: [Option<f64>; 2],
    /// The same of others that it could be of.
    others: Vec<[Option<f64>; 2]>,
    /// How many others were seen at the same instant.
    choices: usize,
    time_s: f64,
    speed_m_s: f64,
    /// The number of its name among those of its kind.
    target: usize,
}

struct Sightings {
    rows: Vec<Row>,
    blocks: Vec<usize>,
    /// The share of wrong names that are recorded.
    kept: f64,
}

impl Sightings {
    /// Of range and bearing; `bases` are those at no range and no turn, by kind.
    fn sigmas(row: &Row, bases: &[[f64; 2]; 2], parameters: &[f64]) -> [f64; 2] {
        let base = bases[row.kind];
        let range = base[0] + row.range_m * (parameters[LINEAR] + row.range_m * parameters[SQUARE]);
        let bearing = base[1] + parameters[BLUR] * row.yaw_rate_rad_s.abs();
        [range.max(LEAST_SIGMA * base[0]), bearing.max(LEAST_SIGMA * base[1])]
    }
}

/// By how much the log-density of errors grows with the logarithms of the two sigmas.
fn slopes(errors: &[Option<f64>; 2], sigmas: [f64; 2], student: Student) -> [f64; 2] {
    [0, 1].map(|part| errors[part].map_or(0.0, |error| student.slope(error / sigmas[part])))
}

/// Of the errors of a range and a bearing, where they are there.
fn log_density(errors: &[Option<f64>; 2], sigmas: [f64; 2], student: Student) -> f64 {
    if let [Some(range), Some(bearing)] = *errors {
        return student.log_density_of_two([range / sigmas[0], bearing / sigmas[1]], sigmas[0] * sigmas[1]);
    }
    let part = |(error, sigma): (&Option<f64>, f64)| {
        error.map_or(0.0, |error| student.log_density(error / sigma, sigma))
    };
    errors.iter().zip(sigmas).map(part).sum()
}

impl Density for Sightings {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        let student = Student::new(parameters[TAILS]);
        let mixed = self.kept * libm::exp(parameters[MIXED]);
        let (own, other) = (libm::log1p(-mixed), libm::log(mixed));
        let bases = [0, 1].map(|kind| [0, 1].map(|part| libm::exp(parameters[BASE + 2 * kind + part])));
        for (row, value) in self.rows.iter().zip(into) {
            let sigmas = Self::sigmas(row, &bases, parameters);
            *value = log_density(&row.errors, sigmas, student);
            if row.choices > 0 && mixed > 0.0 {
                let others = row.others.iter().map(|errors| log_density(errors, sigmas, student));
                let others = others.fold(f64::NEG_INFINITY, log_sum);
                *value = log_sum(own + *value, other + others - libm::log(row.choices as f64));
            }
        }
    }

    fn checks(&self, parameters: &[f64]) -> Vec<Check> {
        [0, 1].into_iter().flat_map(|kind| self.left(kind, parameters)).collect()
    }

    /// All but the tails' in closed form.
    fn scores(&self, parameters: &[f64], free: &[usize]) -> Vec<Option<Vec<f64>>> {
        let closed = |index: &usize| (*index != TAILS).then(|| vec![0.0; self.rows.len()]);
        let mut all: Vec<Option<Vec<f64>>> = free.iter().map(closed).collect();
        let student = Student::new(parameters[TAILS]);
        let mixed = self.kept * libm::exp(parameters[MIXED]);
        let (own, other) = (libm::log1p(-mixed), libm::log(mixed));
        let bases = [0, 1].map(|kind| [0, 1].map(|part| libm::exp(parameters[BASE + 2 * kind + part])));
        for (index, row) in self.rows.iter().enumerate() {
            let sigmas = Self::sigmas(row, &bases, parameters);
            let mut slope = slopes(&row.errors, sigmas, student);
            let mut of_mixed = 0.0;
            if row.choices > 0 && mixed > 0.0 {
                let named = own + log_density(&row.errors, sigmas, student);
                let each: Vec<f64> =
                    row.others.iter().map(|errors| log_density(errors, sigmas, student)).collect();
                let share = other - libm::log(row.choices as f64);
                let others = each.iter().copied().fold(f64::NEG_INFINITY, log_sum) + share;
                let total = log_sum(named, others);
                let weight = libm::exp(named - total);
                slope = slope.map(|slope| weight * slope);
                for (errors, log_density) in row.others.iter().zip(each) {
                    let weight = libm::exp(log_density + share - total);
                    let own = slopes(errors, sigmas, student);
                    slope = [0, 1].map(|part| slope[part] + weight * own[part]);
                }
                of_mixed = libm::exp(others - total) - weight * mixed / (1.0 - mixed);
            }
            let base = bases[row.kind];
            // A sigma that is held at its least share grows with its base alone.
            let held = [0, 1].map(|part| sigmas[part] <= LEAST_SIGMA * base[part]);
            let relative =
                |part: usize, by: f64| if held[part] { 0.0 } else { slope[part] * by / sigmas[part] };
            for (&parameter, scores) in free.iter().zip(&mut all) {
                let Some(scores) = scores else { continue };
                scores[index] = match parameter {
                    LINEAR => relative(0, row.range_m),
                    SQUARE => relative(0, row.range_m * row.range_m),
                    BLUR => relative(1, row.yaw_rate_rad_s.abs()),
                    MIXED => of_mixed,
                    _ if parameter / 2 == row.kind => {
                        let part = parameter % 2;
                        if held[part] { slope[part] } else { relative(part, base[part]) }
                    }
                    _ => 0.0,
                };
            }
        }
        all
    }
}

impl Sightings {
    /// What is left of each part of a kind: how wide, and on which side.
    fn left(&self, kind: usize, parameters: &[f64]) -> Vec<Check> {
        let student = Student::new(parameters[TAILS]);
        let bases = [0, 1].map(|kind| [0, 1].map(|part| libm::exp(parameters[BASE + 2 * kind + part])));
        let own = || self.rows.iter().zip(&self.blocks).filter(|(row, _)| row.kind == kind);
        let z =
            |row: &Row, part: usize| Some(row.errors[part]? / Self::sigmas(row, &bases, parameters)[part]);
        let mut all = Vec::new();
        for part in 0..2 {
            let rows: Vec<(&Row, usize, f64)> =
                own().filter_map(|(row, block)| Some((row, *block, z(row, part)?))).collect();
            let over = |name: &'static str, of: &dyn Fn(&Row) -> f64| {
                (name, rows.iter().map(|(row, ..)| of(row)).collect::<Vec<f64>>())
            };
            let check = |of: &'static str, left: Vec<f64>, drivers: Vec<(&'static str, Vec<f64>)>| Check {
                of,
                left,
                blocks: rows.iter().map(|own| own.1).collect(),
                drivers,
                targets: rows.iter().map(|(row, ..)| row.target).collect(),
                least_of_target: if parameters[MIXED] < NEVER { LEAST_OF_TARGET } else { OFTEN_WRONG },
            };
            let mut drivers = vec![
                over("range", &|row| row.range_m),
                over("turning", &|row| row.yaw_rate_rad_s.abs()),
                over("speed", &|row| row.speed_m_s.abs()),
                over("time", &|row| row.time_s),
            ];
            // A wrong name makes range and bearing wrong at once; tails are each its own.
            if part == 0 && parameters[MIXED] < NEVER {
                let bearing = |row: &Row| z(row, 1).map_or(0.0, |z| student.relative(z));
                drivers.push(over("bearing", &bearing));
            }
            let left = rows.iter().map(|own| student.relative(own.2)).collect();
            all.push(check(SPREADS[kind][part], left, drivers));
            let mean = rows.iter().map(|own| own.2.clamp(-noise::CLIP, noise::CLIP)).collect();
            all.push(check(MEANS[kind][part], mean, Vec::new()));
        }
        all
    }
}

/// Names may be mixed up between two targets alone: then these are wrong more often than the others, but not most of the
/// time. A wrong name costs at most half of [`noise::CLIP`] squared in log-density; a quarter of the time, this.
const OFTEN_WRONG: f64 = 3.0;

/// What is left, in words, by kind and part.
const SPREADS: [[&str; 2]; 2] = [
    ["the spread of ranges to landmarks", "the spread of bearings of landmarks"],
    ["the spread of ranges to robots", "the spread of bearings of robots"],
];
const MEANS: [[&str; 2]; 2] = [
    ["the mean of ranges to landmarks", "the mean of bearings of landmarks"],
    ["the mean of ranges to robots", "the mean of bearings of robots"],
];

/// The sightings of one robot under a fit of the mean.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit) -> Option<Family<'u, 'a>> {
    let mut rows = Vec::new();
    let mut places = Vec::new();
    let repeats = repeats(units);
    for (position, unit) in units.iter().enumerate() {
        collect(position, unit, &unit.model(&fit.terms), repeats, &mut rows, &mut places);
    }
    if rows.is_empty() {
        return None;
    }
    let spread = |kind: usize, part: usize| -> Option<f64> {
        let own = rows.iter().filter(|row| row.kind == kind);
        let mut sizes: Vec<f64> = own.filter_map(|row: &Row| row.errors[part].map(f64::abs)).collect();
        median_spread(&mut sizes)
    };
    let spreads = [spread(0, 0), spread(0, 1), spread(1, 0), spread(1, 1)];
    for row in &mut rows {
        let near = |errors: &[Option<f64>; 2]| {
            (0..2).all(|part| {
                let spread = spreads[2 * row.kind + part].unwrap_or(f64::INFINITY);
                errors[part].is_none_or(|error| error.abs() < FAR * spread)
            })
        };
        row.others.retain(near);
    }
    // A likelihood with a parameter per kind and part that is there; a spread of zero has no logarithm.
    let known: Vec<usize> = (0..4).filter(|&index| spreads[index].is_some()).collect();
    let has = |part: usize| known.iter().any(|index| index % 2 == part);
    let base = |index: usize| spreads[index].unwrap_or(1.0);
    let around = |value: f64| Bounds { low: value.ln() - 8.0, high: value.ln() + 8.0, scale: 0.1 };
    let mut bounds: Vec<Bounds> = (0..4).map(|index| around(base(index))).collect();
    let reach = |effect: Effect, parameter: usize, scale: f64| {
        let (low, high) = effect.info().parameters[parameter].plausible;
        Bounds { low, high, scale }
    };
    bounds.push(reach(Effect::RangeDependentNoise, 1, 0.003));
    bounds.push(reach(Effect::RangeDependentNoise, 2, 0.001));
    bounds.push(reach(Effect::MotionBlur, 0, 0.003));
    bounds.push(Bounds { low: 0.0, high: 1.0, scale: 0.05 });
    bounds.push(Bounds { low: NEVER, high: -0.7, scale: 0.3 });
    // Where no effect explains wild errors, the spread is that of all.
    let whole = |index: usize| -> f64 {
        let own = rows.iter().filter(|row| row.kind == index / 2).filter_map(|row| row.errors[index % 2]);
        let (sum, count) = own.fold((0.0, 0.0), |(sum, count), error| (sum + error * error, count + 1.0));
        if sum > 0.0 { (sum / count).sqrt() } else { 1.0 }
    };
    let mut start: Vec<f64> = (0..4).map(|index| whole(index).ln()).collect();
    start.extend([0.0, 0.0, 0.0, 0.0, f64::NEG_INFINITY]);
    let mut members = Vec::new();
    if has(0) {
        members.extend(range_noise(units, &rows, &known));
    }
    if has(1) {
        members.push(Member {
            effect: Effect::MotionBlur,
            parameters: vec![BLUR],
            off: vec![0.0],
            start: vec![0.003],
            shown: vec![Shown::Value(BLUR)],
            contrasts: Vec::new(),
            chances: None,
        });
    }
    members.push(Member {
        effect: Effect::HeavyTails,
        parameters: vec![TAILS],
        off: vec![0.0],
        start: vec![0.1],
        shown: vec![Shown::Inverse(TAILS)],
        contrasts: vec![Contrast { weights: vec![(TAILS, 1.0)], threshold: LEAST_TAIL }],
        chances: None,
    });
    let choosable = rows.iter().filter(|row| row.choices > 0).count();
    if choosable > 0 {
        members.push(Member {
            effect: Effect::IdentityMixUp,
            parameters: vec![MIXED],
            off: vec![f64::NEG_INFINITY],
            start: vec![-4.0],
            shown: vec![Shown::Exp(MIXED)],
            contrasts: Vec::new(),
            chances: Some(choosable),
        });
    }
    let kept = kept(repeats);
    let density = Sightings { blocks: blocks(units, &places), rows, kept };
    let units = units.to_vec();
    Some(Family { units, places, density: Box::new(density), bounds, start, nuisances: known, members })
}

/// The logarithm of a probability that is as good as zero.
const NEVER: f64 = -14.0;

/// The spread of ranges that grows with range. Its constant part is told from the declared spread alone.
fn range_noise(units: &[&Unit<'_>], rows: &[Row], known: &[usize]) -> Option<Member> {
    let mut ranges: Vec<f64> =
        rows.iter().filter(|row| row.errors[0].is_some()).map(|row| row.range_m).collect();
    ranges.sort_by(f64::total_cmp);
    let share = |share: usize| ranges.get(ranges.len() * share / 100).copied();
    let (near, far) = (share(10)?, share(90)?);
    let often = |kind: usize| rows.iter().filter(|row| row.kind == kind).count();
    let kind = usize::from(!known.contains(&0) || (known.contains(&2) && often(1) > often(0)));
    let declared = units.first().map_or(0.0, |unit| unit.nominal().nominal.range_sigma_m);
    let constant = if declared > 0.0 { Shown::ExpLess(2 * kind, declared) } else { Shown::Fixed(0.0) };
    let threshold = Effect::RangeDependentNoise.info().parameters[1].relevance;
    let threshold = threshold.threshold(&Floors::default());
    // From a near to a far target sigma must grow, or fall, by as much as by the least slope that matters.
    let contrast = Contrast {
        weights: vec![(LINEAR, far - near), (SQUARE, far * far - near * near)],
        threshold: threshold * (far - near),
    };
    (far > near).then(|| Member {
        effect: Effect::RangeDependentNoise,
        parameters: vec![LINEAR, SQUARE],
        off: vec![0.0, 0.0],
        start: vec![1e-3, 1e-4],
        shown: vec![constant, Shown::Value(LINEAR), Shown::Value(SQUARE)],
        contrasts: vec![contrast],
        chances: None,
    })
}

/// The share of wrong names that are recorded.
fn kept(repeats: bool) -> f64 {
    if repeats { 1.0 } else { 0.5 }
}

/// The share of sightings that are not recorded because another bears their name.
pub(super) fn displaced(units: &[&Unit<'_>], probability: f64) -> f64 {
    (1.0 - kept(repeats(units))) * probability
}

/// The sightings of a unit.
fn collect(
    position: usize,
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    repeats: bool,
    rows: &mut Vec<Row>,
    places: &mut Vec<Place>,
) {
    for (kind, channels) in Channel::SIGHTINGS.into_iter().enumerate() {
        for scan in scans(unit, kind) {
            let targets = targets(unit, kind, scan.time_s);
            for own in &scan.readings {
                let named = actual(model, own);
                let Some((_, seen)) = targets.iter().find(|(target, _)| *target == named) else { continue };
                let (errors, range_m) = own.errors(unit, model, seen);
                if !errors.iter().flatten().all(|error| error.is_finite()) {
                    continue;
                }
                let others = targets.iter().filter(|(target, _)| *target != named);
                let number = targets.iter().position(|(target, _)| *target == named).unwrap_or_default();
                let at = &own.sighted.at;
                let choices = if repeats {
                    scan.readings.len() - 1
                } else if others.clone().any(|(_, seen)| in_view(unit, model, at, seen, [0.0; 2])) {
                    scan.readings.len()
                } else {
                    0
                };
                rows.push(Row {
                    kind,
                    range_m,
                    yaw_rate_rad_s: own.sighted.at.motion.yaw_rate_rad_s,
                    errors,
                    others: others.map(|(_, seen)| own.errors(unit, model, seen).0).collect(),
                    choices,
                    time_s: scan.time_s,
                    speed_m_s: own.sighted.at.motion.speed_m_s,
                    target: number,
                });
                let channel = channels[usize::from(own.measured[0].is_none())];
                places.push(Place { unit: position, time_s: scan.time_s, channel });
            }
        }
    }
}

#[cfg(test)]
mod tests;

//! Where the search for an effect begins: one start for what is linear near "off", several where an onset, a
//! place, a threshold or an angle has to be guessed first.
//!
//! The rules go by the kind, the name and the unit of a parameter, so that a new effect of the catalogue
//! needs no change here.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use pleiad_estimation::sample::Target;
use pleiad_physics::{Channel as Needed, Effect, EffectInfo, Fit, Parameter, Stage};

use crate::diagnosis::unit::Unit;

/// Onsets that are tried first.
const ONSETS: usize = 24;
/// Cells per side of the map in which a place is searched, coarse and fine.
const CELLS: [usize; 3] = [2, 4, 7];
/// Values of a threshold that are tried, and the ratio of the greatest and the least.
const THRESHOLDS: usize = 24;
const THRESHOLD_RANGE: f64 = 60.0;
/// The same of a limit.
const LIMIT_RANGE: f64 = 8.0;
/// A change of command takes at least this long to follow, seconds: what bounds an acceleration limit that
/// can act.
const SHORTEST_STEP_S: f64 = 0.02;
/// And so long at the most: what takes longer is no answer to a command.
const LONGEST_STEP_S: f64 = 2.0;
/// Beyond every place and before every time.
const EVERYWHERE: f64 = 1e9;
/// Values of a delay or lag that are tried, seconds.
const LAGS: [f64; 5] = [-0.02, 0.03, 0.08, 0.18, 0.4];

/// A start.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Start {
    pub(crate) values: Vec<f64>,
    /// Parameters along which the effect is linearized there; empty if the step from "off" to the values is
    /// the direction itself.
    pub(crate) along: Vec<usize>,
}

/// The parameters that say where and when an effect acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Placing {
    /// The onset.
    pub(crate) onset: Option<usize>,
    /// The first of the four bounds of a region.
    pub(crate) region: Option<usize>,
}

impl Placing {
    pub(crate) fn of(info: &EffectInfo) -> Self {
        let position = |name: &str| info.parameters.iter().position(|parameter| parameter.name == name);
        Self { onset: position("t_on_s"), region: position("region_m") }
    }

    /// Makes the values act always and everywhere.
    pub(crate) fn widen(self, values: &mut [f64]) {
        if let Some(onset) = self.onset {
            values[onset] = -EVERYWHERE;
        }
        if let Some(region) = self.region {
            values[region..region + 4].copy_from_slice(&[-EVERYWHERE, EVERYWHERE, -EVERYWHERE, EVERYWHERE]);
        }
    }

    /// How many parameters say it.
    pub(crate) fn count(self) -> usize {
        usize::from(self.onset.is_some()) + 4 * usize::from(self.region.is_some())
    }

    pub(crate) fn is_some(self) -> bool {
        self.onset.is_some() || self.region.is_some()
    }
}

/// What a shape parameter may be at the beginning.
enum Choices {
    /// It grows from its off value.
    Amplitude,
    /// One of these.
    Of(Vec<f64>),
    /// Onset or region: searched apart.
    Placing,
    /// A size from which "off" is a jump away.
    Threshold(Vec<f64>),
}

/// Starts of an effect for units that it would act on; onset and region are left at "off".
pub(crate) fn starts(effect: Effect, units: &[&Unit<'_>]) -> Vec<Start> {
    let info = effect.info();
    let choices: Vec<Choices> =
        info.parameters.iter().map(|parameter| choices(info, parameter, units)).collect();
    let off: Vec<f64> = info.parameters.iter().map(|parameter| parameter.off).collect();
    let amplitudes: Vec<usize> =
        (0..choices.len()).filter(|&index| matches!(choices[index], Choices::Amplitude)).collect();
    let mut shapes = vec![off.clone()];
    let mut starts: Vec<Start> = Vec::new();
    for (index, choice) in choices.iter().enumerate() {
        match choice {
            Choices::Of(values) => shapes = product(&shapes, values, |start, value| start[index] = value),
            Choices::Threshold(values) => {
                let at = |value: &f64| {
                    let mut start = off.clone();
                    start[index] = *value;
                    Start { values: start, along: Vec::new() }
                };
                starts.extend(values.iter().map(at));
            }
            Choices::Amplitude | Choices::Placing => {}
        }
    }
    if !amplitudes.is_empty() {
        starts.extend(shapes.into_iter().map(|values| Start { values, along: amplitudes.clone() }));
    }
    // Far from "off" a lag is no longer linear.
    if let [parameter] = info.parameters
        && info.stage == Stage::Actuator
        && parameter.unit == "s"
        && info.channels.contains(&Needed::Command)
    {
        let plausible = |lag: &&f64| (parameter.plausible.0..=parameter.plausible.1).contains(*lag);
        let at = |&lag: &f64| Start { values: vec![lag], along: Vec::new() };
        starts.extend(LAGS.iter().filter(plausible).map(at));
    }
    starts
}

fn product<V: Copy>(starts: &[Vec<f64>], values: &[V], set: impl Fn(&mut Vec<f64>, V)) -> Vec<Vec<f64>> {
    let mut all = Vec::with_capacity(starts.len() * values.len());
    for start in starts {
        for &value in values {
            let mut next = start.clone();
            set(&mut next, value);
            all.push(next);
        }
    }
    all
}

fn choices(info: &EffectInfo, parameter: &Parameter, units: &[&Unit<'_>]) -> Choices {
    let (least, greatest) = parameter.plausible;
    match (parameter.fit, parameter.name, parameter.component) {
        (_, "t_on_s" | "region_m", _) => Choices::Placing,
        (Fit::Choice, "id" | "ids", _) => Choices::Of(landmarks(units)),
        (Fit::Choice, _, _) => Choices::Of(integers(least, greatest)),
        // A delay is smooth: it has a derivative and, like a lag, starts far from zero.
        (Fit::Grid, "delay_s", _) => Choices::Amplitude,
        (Fit::Grid, _, _) => Choices::Threshold(thresholds(parameter, units)),
        (Fit::Smooth, _, _) if !is_shape(info, parameter) => Choices::Amplitude,
        (Fit::Smooth, _, _) if parameter.unit == "rad" => {
            // The amplitude may be negative, so half a period is enough.
            let period = greatest - least;
            Choices::Of((0..4).map(|step| least.max(-PI) + period * f64::from(step) / 8.0).collect())
        }
        (Fit::Smooth, _, _) => Choices::Of(vec![parameter.off / 3.0, parameter.off, parameter.off * 3.0]),
    }
}

/// Whether a smooth parameter shapes an effect whose size another parameter is.
fn is_shape(info: &EffectInfo, parameter: &Parameter) -> bool {
    info.parameters.len() > 1 && parameter.relevance == pleiad_physics::Relevance::Unbounded
}

/// Onsets, evenly spaced.
pub(crate) fn onsets(units: &[&Unit<'_>]) -> Vec<f64> {
    let first_s = units.iter().map(|unit| unit.span_s.0).fold(f64::INFINITY, f64::min);
    let last_s = units.iter().map(|unit| unit.span_s.1).fold(f64::NEG_INFINITY, f64::max);
    if first_s > last_s {
        return Vec::new();
    }
    let step_s = (last_s - first_s) / ONSETS as f64;
    (0..ONSETS).map(|index| first_s + step_s * index as f64).collect()
}

/// Squares of the map in which the robots were, in several sizes.
pub(crate) fn regions(units: &[&Unit<'_>]) -> Vec<[f64; 4]> {
    let places: Vec<[f64; 2]> = units
        .iter()
        .flat_map(|unit| unit.rows.iter().filter_map(|row| row.regime.pose.map(|pose| pose.position())))
        .collect();
    let bound = |axis: usize, worst: f64, pick: fn(f64, f64) -> f64| {
        places.iter().map(|place| place[axis]).fold(worst, pick)
    };
    let low = [0, 1].map(|axis| bound(axis, f64::INFINITY, f64::min));
    let high = [0, 1].map(|axis| bound(axis, f64::NEG_INFINITY, f64::max));
    if places.is_empty() {
        return Vec::new();
    }
    let side_m = (high[0] - low[0]).max(high[1] - low[1]).max(1e-3);
    let mut regions = Vec::new();
    for cells in CELLS {
        let cell_m = side_m / cells as f64;
        #[allow(clippy::cast_possible_truncation, reason = "a number of cells")]
        let visited: BTreeSet<[i64; 2]> = places
            .iter()
            .map(|place| [0, 1].map(|axis| ((place[axis] - low[axis]) / cell_m).floor() as i64))
            .collect();
        regions.extend(visited.into_iter().map(|[column, row]| {
            let (x, y) = (low[0] + column as f64 * cell_m, low[1] + row as f64 * cell_m);
            [x, x + cell_m, y, y + cell_m]
        }));
    }
    regions
}

fn landmarks(units: &[&Unit<'_>]) -> Vec<f64> {
    let seen: BTreeSet<u32> = units
        .iter()
        .flat_map(|unit| &unit.rows)
        .filter_map(|row| match row.target {
            Some(Target::Landmark(landmark)) => Some(landmark.0),
            _ => None,
        })
        .collect();
    seen.into_iter().map(f64::from).collect()
}

fn integers(least: f64, greatest: f64) -> Vec<f64> {
    let mut values = vec![least];
    while let Some(last) = values.last()
        && last + 1.0 <= greatest
        && values.len() < 64
    {
        values.push(last + 1.0);
    }
    values
}

/// Evenly spaced logarithms over what is plausible and could act: a limit cannot act above all that the
/// wheels are asked for, a threshold not above it either, and both may be far below.
pub(crate) fn thresholds(parameter: &Parameter, units: &[&Unit<'_>]) -> Vec<f64> {
    let demand = units
        .iter()
        .map(|unit| match parameter.unit {
            "rad/s" => unit.demand.wheel_rad_s,
            "m/s" => unit.demand.speed_m_s,
            "m/s^2" => unit.demand.change_m_s / SHORTEST_STEP_S,
            _ => f64::INFINITY,
        })
        .fold(0.0, f64::max);
    let greatest = parameter.plausible.1.min(demand);
    // A limit of speed far below what is asked for would stop the robot; a threshold may be small, and with a
    // small acceleration a robot gets there later.
    let range = match parameter.unit {
        "m/s^2" => LONGEST_STEP_S / SHORTEST_STEP_S,
        _ if parameter.off.is_finite() => THRESHOLD_RANGE,
        _ => LIMIT_RANGE,
    };
    let least = parameter.plausible.0.max(greatest / range);
    if greatest.partial_cmp(&least) != Some(std::cmp::Ordering::Greater) {
        return Vec::new();
    }
    let ratio = (greatest / least).powf(1.0 / THRESHOLDS as f64);
    (0..THRESHOLDS).map(|step| least * ratio.powi(i32::try_from(step).unwrap_or(0))).collect()
}

//! The search: from several starts, and with more levels as long as they pay.

use pleiad_estimation::fold::Fact;
use pleiad_estimation::likelihood::{
    Information, Level, Levels, Maximum, Problem, TunableFact, information, maximize,
};
use pleiad_recording::parallel;

use crate::levels;

/// A search is given up where a step promises less, in units of the log-likelihood: at first, and in the end.
const COARSE: f64 = 0.3;
const FINE: f64 = 0.01;
/// The share of outliers a search begins with.
pub const SHARE: f64 = 0.01;
/// Factors on the levels that further searches begin with: of the motion, of the sensors.
const OTHER_STARTS: [[f64; 2]; 4] = [[3.0, 3.0], [1.0 / 3.0, 1.0 / 3.0], [3.0, 1.0 / 3.0], [1.0 / 3.0, 3.0]];
/// Values at which a level that was zero is tried.
const TRIED: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];
/// Searches whose log-likelihoods end closer than this ended in one maximum.
const SAME: f64 = 2.0;

/// Where a search from one start ended.
pub struct Ended {
    pub motion_factor: f64,
    pub sensor_factor: f64,
    pub value: f64,
    /// At the best maximum of all.
    pub best: bool,
    pub converged: bool,
}

/// A level that was tried because it was zero.
pub struct Tried {
    pub level: Level,
    /// Of the log-likelihood.
    pub gain: f64,
    pub kept: bool,
}

/// What was found.
pub struct Found<'a> {
    pub problem: Problem<'a>,
    pub maximum: Maximum,
    pub information: Information,
    pub starts: Vec<Ended>,
    pub tried: Vec<Tried>,
    pub evaluations: usize,
}

/// Of points of a problem, on all processors.
pub fn evaluator<'a>(problem: &'a Problem<'a>) -> impl Fn(&[Vec<f64>]) -> Vec<Vec<f64>> + 'a {
    |points: &[Vec<f64>]| parallel::map(points, |point| problem.densities(point))
}

fn climb(problem: &Problem, start: &[f64], tolerance: f64) -> Maximum {
    let (lower, upper) = problem.bounds();
    maximize(&evaluator(problem), start, (&lower, &upper), tolerance)
}

/// The levels that are in the noise of some fact; those of the motion always.
pub fn in_facts(facts: &[TunableFact]) -> Vec<Level> {
    let mut there: Vec<Level> = Level::ALL.into_iter().filter(|level| level.is_motion()).collect();
    for fact in facts {
        if let Fact::Observation { quantity, .. } = fact.gathered() {
            for level in Level::of(quantity) {
                if !there.contains(level) {
                    there.push(*level);
                }
            }
        }
    }
    there.sort();
    there
}

/// Searches the `free` levels, and then each of `candidates` that pays; `asked` of them are taken in anyway.
pub fn search<'a>(
    facts: &'a [TunableFact],
    start: Levels,
    (free, candidates): (Vec<Level>, Vec<Level>),
    reach_m: f64,
    said: &dyn Fn(String),
) -> Found<'a> {
    let mut problem = Problem::new(facts, start, free, reach_m);
    let from = |[motion, sensors]: [f64; 2]| {
        let mut levels = start;
        for level in problem.free() {
            levels[*level] *= if level.is_motion() { motion } else { sensors };
        }
        problem.point(&levels, SHARE)
    };
    said("searching".to_owned());
    let mut maximum = climb(&problem, &from([1.0, 1.0]), COARSE);
    let mut ends = vec![([1.0, 1.0], maximum.clone())];
    for (index, factors) in OTHER_STARTS.into_iter().enumerate() {
        said(format!("searching from start {} of {}", index + 2, OTHER_STARTS.len() + 1));
        let end = climb(&problem, &from(factors), COARSE);
        if end.value > maximum.value {
            maximum = end.clone();
        }
        ends.push((factors, end));
    }
    let mut evaluations: usize = ends.iter().map(|(_, end)| end.evaluations).sum();
    let starts = ends.iter().map(|([motion_factor, sensor_factor], end)| Ended {
        motion_factor: *motion_factor,
        sensor_factor: *sensor_factor,
        value: end.value,
        best: maximum.value - end.value < SAME,
        converged: end.converged,
    });
    let starts = starts.collect();
    let mut tried = Vec::new();
    let measurements = count(&problem, &maximum.x);
    let mut left = candidates;
    while !left.is_empty() {
        let mut best: Option<(Level, Problem, Maximum)> = None;
        let mut gains = Vec::new();
        for level in &left {
            said(format!("trying {}", levels::key(*level)));
            let (wider, end) = widened(facts, &problem, &maximum, *level, reach_m);
            evaluations += end.evaluations;
            gains.push((*level, end.value - maximum.value));
            if best.as_ref().is_none_or(|(_, _, other)| end.value > other.value) {
                best = Some((*level, wider, end));
            }
        }
        let Some((level, wider, end)) = best else { break };
        let gain = end.value - maximum.value;
        if !pays(gain, measurements) {
            tried.extend(gains.into_iter().map(|(level, gain)| Tried { level, gain, kept: false }));
            break;
        }
        tried.push(Tried { level, gain, kept: true });
        left.retain(|other| *other != level);
        (problem, maximum) = (wider, end);
    }
    said("the maximum".to_owned());
    maximum = climb(&problem, &maximum.x, FINE);
    evaluations += maximum.evaluations;
    said("standard errors".to_owned());
    let information = information(&evaluator(&problem), &maximum.x, maximum.value);
    Found { problem, maximum, information, starts, tried, evaluations }
}

/// The problem with one level more, and where a search ends from the best of a few values of it.
fn widened<'a>(
    facts: &'a [TunableFact],
    problem: &Problem<'a>,
    maximum: &Maximum,
    level: Level,
    reach_m: f64,
) -> (Problem<'a>, Maximum) {
    let (levels, share) = problem.at(&maximum.x);
    let with = |value: f64| {
        let mut levels = levels;
        levels[level] = value;
        levels
    };
    let free: Vec<Level> = problem.free().iter().copied().chain([level]).collect();
    let wider = Problem::new(facts, with(TRIED[2]), free, reach_m);
    let points: Vec<Vec<f64>> = TRIED.iter().map(|value| wider.point(&with(*value), share)).collect();
    let values: Vec<f64> =
        evaluator(&wider)(&points).iter().map(|densities| densities.iter().sum()).collect();
    let (first, value) = points
        .into_iter()
        .zip(values)
        .max_by(|(_, a), (_, b)| a.total_cmp(b))
        .unwrap_or_else(|| (wider.point(&with(TRIED[2]), share), f64::NEG_INFINITY));
    // At a maximum without it the slope by the square of a level says whether it pays at all: a little of it does then.
    let end = if value > maximum.value {
        climb(&wider, &first, COARSE)
    } else {
        Maximum { x: first, value, converged: true, evaluations: 0 }
    };
    let evaluations = end.evaluations + TRIED.len();
    (wider, Maximum { evaluations, ..end })
}

/// Bayesian information criterion (Schwarz 1978): a parameter costs half the logarithm of the number of data.
pub fn pays(gain: f64, measurements: usize) -> bool {
    2.0 * gain > (measurements as f64).ln()
}

/// The number of measurements.
pub fn count(problem: &Problem, x: &[f64]) -> usize {
    problem.densities(x).iter().filter(|density| **density != 0.0).count()
}

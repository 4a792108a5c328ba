//! Two landmarks that bear each other's number.
//!
//! Found before anything is fitted: what is metres off would drag every other effect with it. The likelihood is
//! that of the sightings that name either landmark, with the names as they are and exchanged, the penalty of
//! each sighting bounded; both landmarks must gain, or the one that a robot sees if another robot sees both.
//! What is found becomes part of the unit's model.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{ActiveEffect, Effect};

use crate::channel::Channel;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::held_out::{Gain, summed};
use crate::diagnosis::naming::{Estimated, GAIN_ERRORS, Judged};
use crate::diagnosis::noise::CLIP;
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN};
use crate::diagnosis::spread::SpreadTerm;
use crate::diagnosis::spread::judge;
use crate::diagnosis::spread::scans::{scans, targets};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{BLOCK_S, Unit};
use crate::findings::Place;
use pleiad_recording::parallel;

/// The nominal model may be off by so many times the noise for reasons of its own.
const SLACK: f64 = 3.0;
/// Noise of ranges and bearings where none is declared, metres and radians.
const UNDECLARED: [f64; 2] = [0.1, 0.04];

/// Two names, the smaller first.
type Pair = (u32, u32);

/// By the name that sightings bear and another: what they gain by the other's place, per unit and block.
type Gains = BTreeMap<(u32, u32), Vec<Vec<f64>>>;

/// A swap that a robot shows.
pub(crate) struct Swap {
    robot: RobotId,
    pair: Pair,
    p: f64,
    gain: Gain,
}

/// What was looked for: swaps, and how many pairs of names there were.
#[derive(Default)]
pub(crate) struct Swaps {
    found: Vec<Swap>,
    pub(crate) tests: usize,
    /// Robots that see landmarks, with the names they see.
    robots: BTreeMap<RobotId, BTreeSet<u32>>,
}

/// Finds the swaps of every robot and gives them to its units' models.
pub(crate) fn swaps(units: &mut [Unit<'_>]) -> Swaps {
    let mut all = Swaps::default();
    let mut robots: Vec<RobotId> = units.iter().map(Unit::robot).collect();
    robots.sort_unstable();
    robots.dedup();
    let mut of_robots: BTreeMap<RobotId, Gains> = BTreeMap::new();
    let known: &[Unit<'_>] = units;
    let each = parallel::map(&robots, |&robot| {
        gains(&known.iter().filter(|unit| unit.robot() == robot).collect::<Vec<_>>())
    });
    for (robot, gains) in robots.into_iter().zip(each) {
        if gains.is_empty() {
            continue;
        }
        let gains: &Gains = of_robots.entry(robot).or_insert(gains);
        let seen: BTreeSet<u32> = gains.keys().map(|(named, _)| *named).collect();
        let names: Vec<u32> = seen.iter().copied().collect();
        all.robots.insert(robot, seen);
        all.tests += names.len() * names.len().saturating_sub(1) / 2;
        let mut found = Vec::new();
        for (index, &first) in names.iter().enumerate() {
            for &second in &names[index + 1..] {
                let (Some(one), Some(other)) = (gains.get(&(first, second)), gains.get(&(second, first)))
                else {
                    continue;
                };
                if 2.0 * sum(one).min(sum(other)) > LEAST_GAIN {
                    let p = upper_tail(2.0 * (sum(one) + sum(other)), 1);
                    let both: Vec<Vec<f64>> = one
                        .iter()
                        .zip(other)
                        .map(|(one, other)| one.iter().zip(other).map(|(a, b)| a + b).collect())
                        .collect();
                    found.push(Swap { robot, pair: (first, second), p, gain: summed(&both) });
                }
            }
        }
        found.sort_by(|a, b| b.gain.total.total_cmp(&a.gain.total));
        let mut taken: Vec<u32> = Vec::new();
        for swap in found {
            let (first, second) = swap.pair;
            if taken.contains(&first) || taken.contains(&second) {
                continue;
            }
            taken.extend([first, second]);
            all.found.push(swap);
        }
    }
    all.found.extend(halves(&all.found, &of_robots));
    for swap in &all.found {
        for unit in units.iter_mut().filter(|unit| unit.robot() == swap.robot) {
            unit.members[0].nominal.effects.push(effect(swap.pair));
        }
    }
    all
}

/// Swaps that a robot shows from one side, because it sees only one of the landmarks: what alone could be any
/// mistake is the same one where another robot shows both.
fn halves(found: &[Swap], of_robots: &BTreeMap<RobotId, Gains>) -> Vec<Swap> {
    let pairs: BTreeSet<Pair> = found.iter().map(|swap| swap.pair).collect();
    let mut halves: Vec<Swap> = Vec::new();
    for (&robot, gains) in of_robots {
        for &(first, second) in &pairs {
            let mut known = found.iter().chain(&halves).filter(|swap| swap.robot == robot);
            if known.any(|swap| [swap.pair.0, swap.pair.1].iter().any(|name| [first, second].contains(name)))
            {
                continue;
            }
            let side = match (gains.get(&(first, second)), gains.get(&(second, first))) {
                (Some(side), None) | (None, Some(side)) if 2.0 * sum(side) > LEAST_GAIN => side,
                _ => continue,
            };
            let p = upper_tail(2.0 * sum(side), 1);
            halves.push(Swap { robot, pair: (first, second), p, gain: summed(side) });
        }
    }
    halves
}

fn sum(blocks: &[Vec<f64>]) -> f64 {
    blocks.iter().flatten().sum()
}

impl Swaps {
    /// A finding per swap: of everyone if every robot that sees either landmark shows it.
    pub(super) fn terms(&self, tests: usize) -> Vec<SpreadTerm> {
        let mut by_pair: BTreeMap<Pair, Vec<&Swap>> = BTreeMap::new();
        for swap in &self.found {
            by_pair.entry(swap.pair).or_default().push(swap);
        }
        let mut terms = Vec::new();
        for (pair, own) in by_pair {
            let either = |names: &&BTreeSet<u32>| names.contains(&pair.0) || names.contains(&pair.1);
            if own.len() > 1 && own.len() == self.robots.values().filter(either).count() {
                let total = own.iter().map(|swap| swap.gain.total).sum();
                let variance: f64 = own.iter().map(|swap| swap.gain.standard_error.powi(2)).sum();
                let gain = Gain { total, standard_error: variance.sqrt(), consistent: false };
                let p = own.iter().map(|swap| swap.p).fold(1.0, f64::min);
                terms.push(term(
                    pair,
                    Whose::Everyone,
                    self.robots.keys().copied().collect(),
                    p,
                    gain,
                    tests,
                ));
            } else {
                let one = |swap: &&Swap| {
                    term(pair, Whose::Robot(swap.robot), vec![swap.robot], swap.p, swap.gain, tests)
                };
                terms.extend(own.iter().map(one));
            }
        }
        terms
    }
}

fn term(pair: Pair, whose: Whose, robots: Vec<RobotId>, p: f64, gain: Gain, tests: usize) -> SpreadTerm {
    let effect = Effect::LandmarkIdentitySwap;
    let values = vec![f64::from(pair.0), f64::from(pair.1)];
    // Names have no error.
    let estimated = Estimated {
        term: Term::new(effect, whose, values),
        errors: vec![Some(0.0); 2],
        profiled: Vec::new(),
        halves: Vec::new(),
    };
    let p_familywise = (p * tests as f64).min(1.0);
    let named = p_familywise < FAMILYWISE && gain.total > GAIN_ERRORS * gain.standard_error;
    let judged = Judged {
        estimated: vec![estimated],
        total: None,
        verdict: named.then(|| judge::verdict(effect, 1)),
        p_familywise,
        channel: Channel::RangeToLandmark,
        place: Place::default(),
        one_off: false,
    };
    SpreadTerm { judged, gain, robots, support: vec![effect], unnamed_rivals: Vec::new() }
}

fn effect((first, second): Pair) -> ActiveEffect<f64> {
    let values = [f64::from(first), f64::from(second)];
    // Two numbers for two parameters, none of them NaN.
    ActiveEffect::new(Effect::LandmarkIdentitySwap, &values)
        .unwrap_or_else(|_| ActiveEffect::off(Effect::LandmarkIdentitySwap))
}

/// What every name gains if its sightings are of another landmark: by named and other, per unit and block.
fn gains(units: &[&Unit<'_>]) -> Gains {
    let mut gains = Gains::new();
    let blank: Vec<Vec<f64>> = units.iter().map(|unit| vec![0.0; unit.blocks + 1]).collect();
    for (position, unit) in units.iter().enumerate() {
        let model = unit.nominal();
        let declared = [model.nominal.range_sigma_m, model.nominal.bearing_sigma_rad];
        let sigmas = [0, 1]
            .map(|part: usize| SLACK * if declared[part] > 0.0 { declared[part] } else { UNDECLARED[part] });
        let penalty = |errors: [Option<f64>; 2]| -> f64 {
            let part = |(error, sigma): (Option<f64>, f64)| {
                error.map_or(0.0, |error| 0.5 * (error / sigma).abs().min(CLIP).powi(2))
            };
            errors.into_iter().zip(sigmas).map(part).sum()
        };
        let landmarks = targets(unit, 0, 0.0);
        for scan in scans(unit, 0) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
            let block = (((scan.time_s - unit.span_s.0) / BLOCK_S).max(0.0) as usize).min(unit.blocks);
            for reading in &scan.readings {
                let Target::Landmark(named) = reading.sighted.target else { continue };
                let own = penalty(reading.errors(unit, model, &reading.sighted.seen).0);
                for (target, seen) in &landmarks {
                    let Target::Landmark(other) = target else { continue };
                    if *other != named {
                        let gain = own - penalty(reading.errors(unit, model, seen).0);
                        let known = gains.entry((named.0, other.0)).or_insert_with(|| blank.clone());
                        known[position][block] += gain;
                    }
                }
            }
        }
    }
    gains
}

//! How many ticks a turn of the wheel has: read off the angles themselves, which are whole ticks.
//!
//! No likelihood is needed. Changes of angle that are all multiples of one tick cannot be chance; the tick
//! follows from the angle turned and the ticks counted on the way.

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::held_out::{FOLDS, fold, summed};
use crate::diagnosis::naming::{Estimated, GAIN_ERRORS, Judged};
use crate::diagnosis::noise;
use crate::diagnosis::select::FAMILYWISE;
use crate::diagnosis::spread::SpreadTerm;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::{BLOCK_S, Unit};
use crate::findings::{Place, Verdict};

/// A change this close to a multiple of a tick, in ticks, lies on the grid.
const ON_GRID: f64 = 0.05;
/// This share of changes must lie on it.
const LEAST_SHARE: f64 = 0.99;
/// Fewer changes than this say nothing.
const LEAST_CHANGES: usize = 50;
/// The smallest change is taken for up to so many ticks.
const MOST_TICKS: u32 = 4;
/// An encoder is coarse with fewer than this share of the ticks declared,
const COARSE: f64 = 0.9;
/// or where none are declared, with fewer than this.
const UNDECLARED: f64 = 1000.0;
/// A count of ticks is known to this share at best: angles are recorded in decimals.
const LEAST_ERROR: f64 = 1e-6;

/// A change of a wheel's angle from one sample to the next.
#[derive(Clone, Copy)]
struct Change {
    unit: usize,
    time_s: f64,
    by_rad: f64,
}

/// The encoder of one robot, if it has fewer ticks than declared.
pub(super) fn coarse(units: &[&Unit<'_>], robot: RobotId, tests: usize) -> Option<SpreadTerm> {
    let changes = changes(units);
    let tick_rad = tick(&changes)?;
    let ticks = std::f64::consts::TAU / tick_rad;
    let declared = units.first()?.nominal().nominal.encoder_ticks_per_rev;
    let limit = if declared > 0.0 { COARSE * declared } else { UNDECLARED };
    let finer = if declared > 0.0 { declared } else { UNDECLARED };
    if ticks >= limit {
        return None;
    }
    // Each change would be on the coarse grid by chance with the share of the interval taken for it.
    let chance = libm::pow(2.0 * ON_GRID, changes.len().min(300) as f64);
    let p_familywise = (chance * tests as f64).min(1.0);
    let mut blocks: Vec<Vec<f64>> = units.iter().map(|unit| vec![0.0; unit.blocks + 1]).collect();
    let most = 0.5 * noise::CLIP * noise::CLIP;
    for number in 0..FOLDS {
        let held = |change: &Change| fold(units[change.unit], number).contains(&change.time_s);
        let rest: Vec<Change> = changes.iter().filter(|change| !held(change)).copied().collect();
        let known = tick(&rest);
        for change in changes.iter().filter(|change| held(change)) {
            let fits = known.is_some_and(|tick_rad| off_grid(change.by_rad, tick_rad) < ON_GRID);
            let gain = if fits { libm::log(finer / ticks).min(most) } else { -most };
            let since_s = (change.time_s - units[change.unit].span_s.0).max(0.0);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
            let block = ((since_s / BLOCK_S) as usize).min(units[change.unit].blocks);
            blocks[change.unit][block] += gain;
        }
    }
    let gain = summed(&blocks);
    let named = p_familywise < FAMILYWISE && gain.total > GAIN_ERRORS * gain.standard_error;
    let estimated = Estimated {
        term: Term::new(Effect::EncoderCoarse, Whose::Robot(robot), vec![ticks]),
        errors: vec![Some(error(&changes, tick_rad).max(LEAST_ERROR) * ticks)],
        profiled: Vec::new(),
        halves: Vec::new(),
    };
    let channel = if units.iter().any(|unit| unit.stretch(Channel::Actuator).is_some()) {
        Channel::Actuator
    } else {
        Channel::Body
    };
    let verdict = named.then_some(Verdict::Named);
    let judged = Judged {
        estimated: vec![estimated],
        total: None,
        verdict,
        p_familywise,
        channel,
        place: Place::default(),
        one_off: false,
    };
    let support = vec![Effect::EncoderCoarse];
    Some(SpreadTerm { judged, gain, robots: vec![robot], support, unnamed_rivals: Vec::new() })
}

/// Whether a robot recorded angles of its wheels.
pub(super) fn recorded(units: &[&Unit<'_>]) -> bool {
    units.iter().any(|unit| {
        unit.evidence.robot(unit.robot()).is_some_and(|(_, track)| track.wheels_missing().is_none())
    })
}

fn changes(units: &[&Unit<'_>]) -> Vec<Change> {
    let mut all = Vec::new();
    for (position, unit) in units.iter().enumerate() {
        let Some((_, track)) = unit.evidence.robot(unit.robot()) else { continue };
        for pair in track.encoders.windows(2) {
            for wheel in 0..2 {
                let by_rad = pair[1].angle_rad[wheel] - pair[0].angle_rad[wheel];
                if by_rad != 0.0 {
                    all.push(Change { unit: position, time_s: pair[1].time_s, by_rad });
                }
            }
        }
    }
    all
}

/// The tick of which all changes are multiples, if there is one, radians.
fn tick(changes: &[Change]) -> Option<f64> {
    if changes.len() < LEAST_CHANGES {
        return None;
    }
    let smallest = changes.iter().map(|change| change.by_rad.abs()).fold(f64::INFINITY, f64::min);
    let (_, most) = Effect::EncoderCoarse.info().parameters[0].plausible;
    (1..=MOST_TICKS).find_map(|ticks| {
        let refined = refined(changes, smallest / f64::from(ticks));
        let on = changes.iter().filter(|change| off_grid(change.by_rad, refined) < ON_GRID).count();
        let fits = on as f64 >= LEAST_SHARE * changes.len() as f64;
        (fits && refined > std::f64::consts::TAU / most).then_some(refined)
    })
}

/// The tick by least squares: small changes first, whose count of ticks a rough tick gets right.
fn refined(changes: &[Change], rough: f64) -> f64 {
    let mut sizes: Vec<f64> = changes.iter().map(|change| change.by_rad.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let (mut product, mut square) = (0.0, 0.0);
    let mut tick = rough;
    for size in sizes {
        let count = (size / tick).round();
        product += count * size;
        square += count * count;
        if square > 0.0 {
            tick = product / square;
        }
    }
    tick
}

/// How far a change is from a multiple of a tick, in ticks.
fn off_grid(by_rad: f64, tick_rad: f64) -> f64 {
    let ticks = by_rad / tick_rad;
    (ticks - ticks.round()).abs()
}

/// The relative error of the tick.
fn error(changes: &[Change], tick_rad: f64) -> f64 {
    let (mut residual, mut square) = (0.0, 0.0);
    for change in changes {
        let count = (change.by_rad / tick_rad).round();
        residual += (change.by_rad - count * tick_rad).powi(2);
        square += count * count;
    }
    (residual / changes.len() as f64 / square).sqrt() / tick_rad
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes of an angle that swings, read in whole ticks and written with five decimals.
    fn read(ticks_per_rev: f64) -> Vec<Change> {
        let tick_rad = std::f64::consts::TAU / ticks_per_rev;
        let angle = |index: u32| {
            let time_s = 0.02 * f64::from(index);
            let exact = 30.0 * (0.3 * time_s).sin() + 2.0 * time_s;
            let read = if ticks_per_rev > 0.0 { tick_rad * (exact / tick_rad).floor() } else { exact };
            (read * 1e5).round() / 1e5
        };
        let change = |index| Change { unit: 0, time_s: 0.0, by_rad: angle(index + 1) - angle(index) };
        (0..3000).map(change).filter(|change| change.by_rad != 0.0).collect()
    }

    #[test]
    fn ticks_are_counted_through_decimals() {
        for ticks_per_rev in [24.0, 64.0, 1024.0, 2048.0] {
            let changes = read(ticks_per_rev);
            let tick_rad = tick(&changes).unwrap();
            let found = std::f64::consts::TAU / tick_rad;
            let error = error(&changes, tick_rad).max(LEAST_ERROR) * found;
            assert!((found - ticks_per_rev).abs() < 3.0 * error, "{found} +- {error}");
        }
    }

    #[test]
    fn angles_that_are_not_counted_have_no_tick() {
        assert!(tick(&read(0.0)).is_none_or(|tick_rad| tick_rad < 2e-5), "but for the decimals");
        assert!(tick(&read(64.0)[..20]).is_none(), "too few");
    }
}

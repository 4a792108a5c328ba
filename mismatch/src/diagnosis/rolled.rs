//! Roll-outs: how far predictions are off after a while, under the nominal model, the nominal model refitted,
//! and the corrected one, on data that were not fitted.

use pleiad_physics::{Effect, RobotModel};

use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::held_out::{FOLDS, fold, left_out};
use crate::diagnosis::run::{Judgement, Prepared};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::findings::{RobotRollOuts, RollOut};
use crate::rollout::{HORIZONS_S, Rollout, rollouts};

/// The parameters that anyone would refit first: those of the nominal model that move a predicted pose.
const REFITTED: [Effect; 2] = [Effect::WheelRadiusError, Effect::TrackWidthError];

/// What roll-outs need.
pub(crate) struct Roller<'r, 'a> {
    pub(crate) prepared: &'r [Prepared<'a>],
    pub(crate) units: &'r [&'r Unit<'a>],
    pub(crate) tests: &'r [&'r Unit<'a>],
}

/// Squared errors per horizon: position, heading, count.
type Sums = Vec<[f64; 3]>;

/// The roll-outs of a finding's robots: nominal, refitted without it, corrected.
pub(crate) fn of_finding(roller: &Roller<'_, '_>, own: &Judgement, kept: &[Term]) -> Vec<RollOut> {
    let term = &own.judged.estimated.term;
    let units: Vec<&Unit<'_>> = own.support.units.iter().map(|&unit| roller.units[unit]).collect();
    rolled(roller, &units, kept, Some(term.effect))
}

/// The roll-outs of every robot under everything found.
pub(crate) fn per_robot(roller: &Roller<'_, '_>, fit: &Fit, kept: &[Term]) -> Vec<RobotRollOuts> {
    let _ = fit;
    let mut robots: Vec<_> = roller.units.iter().map(|unit| unit.robot).collect();
    robots.sort_unstable();
    robots.dedup();
    let one = |robot| {
        let units: Vec<&Unit<'_>> =
            roller.units.iter().copied().filter(|unit| unit.robot == robot).collect();
        let horizons = rolled(roller, &units, kept, None);
        let speeds: Vec<f64> = units
            .iter()
            .flat_map(|unit| unit.rows.iter().map(|row| row.regime.speed_m_s.abs()))
            .collect();
        let speed_m_s = speeds.iter().sum::<f64>() / speeds.len().max(1) as f64;
        let last = horizons.last()?;
        let factor = 100.0 / (speed_m_s * last.horizon_s).max(1e-9);
        let error_per_100_m = [last.nominal * factor, last.corrected * factor];
        Some(RobotRollOuts { robot: robot.0, horizons, error_per_100_m })
    };
    robots.into_iter().filter_map(one).collect()
}

fn rolled(roller: &Roller<'_, '_>, units: &[&Unit<'_>], kept: &[Term], without: Option<Effect>) -> Vec<RollOut> {
    let Some(robot) = units.first().map(|unit| unit.robot) else { return Vec::new() };
    let mut sums: [Sums; 3] = std::array::from_fn(|_| vec![[0.0; 3]; HORIZONS_S.len()]);
    let mut robots: Vec<_> = units.iter().map(|unit| unit.robot).collect();
    robots.sort_unstable();
    robots.dedup();
    let _ = robot;
    for robot in robots {
        let own: Vec<&Unit<'_>> = units.iter().copied().filter(|unit| unit.robot == robot).collect();
        let refitted: Vec<Term> = REFITTED
            .iter()
            .filter(|effect| Some(**effect) != without)
            .map(|&effect| {
                let off = effect.info().parameters.iter().map(|parameter| parameter.off).collect();
                Term::new(effect, Whose::Robot(robot), off)
            })
            .collect();
        let refit = fit(&own, refitted, &|_| true, Effort::RIVAL);
        let mine: Vec<Term> = kept.iter().filter(|term| term.acts_on(robot)).cloned().collect();
        let movable: Vec<bool> = mine.iter().map(|term| term.whose == Whose::Robot(robot)).collect();
        let corrected = fit(&own, mine, &|index| movable[index], Effort::RIVAL);
        let (Some(refit), Some(corrected)) = (refit, corrected) else { continue };
        let tests: Vec<&Unit<'_>> = roller.tests.iter().copied().filter(|unit| unit.robot == robot).collect();
        for unit in if tests.is_empty() { &own } else { &tests } {
            let folds: Vec<usize> = if tests.is_empty() { (0..FOLDS).collect() } else { vec![0] };
            let evidence = &roller.prepared[unit.recording].evidence;
            let nominal = rollouts(evidence, unit.robot, &unit.nominal, &HORIZONS_S);
            add(&mut sums[0], &nominal, &|_| true);
            for number in folds {
                let within = fold(unit, number);
                let kept = |rollout: &Rollout| !tests.is_empty() || within.contains(&rollout.time_s);
                let at = |fit: &Fit| -> RobotModel<f64> {
                    if tests.is_empty() && !fit.slots.is_empty() {
                        unit.model(&left_out(&own, fit, number).0)
                    } else {
                        unit.model(&fit.terms)
                    }
                };
                add(&mut sums[1], &rollouts(evidence, unit.robot, &at(&refit), &HORIZONS_S), &kept);
                add(&mut sums[2], &rollouts(evidence, unit.robot, &at(&corrected), &HORIZONS_S), &kept);
            }
        }
    }
    let rms = |sums: &[f64; 3], which: usize| (sums[which] / sums[2]).sqrt();
    (0..HORIZONS_S.len())
        .filter(|&index| sums.iter().all(|sums| sums[index][2] > 0.0))
        .map(|index| {
            let [nominal, refit, corrected] = [0, 1, 2].map(|model| rms(&sums[model][index], 0));
            let heading_rad = [0, 1, 2].map(|model| rms(&sums[model][index], 1));
            RollOut { horizon_s: HORIZONS_S[index], nominal, refit, corrected, heading_rad }
        })
        .collect()
}

fn add(sums: &mut Sums, rollouts: &[Vec<Rollout>], kept: &dyn Fn(&Rollout) -> bool) {
    for (sums, rollouts) in sums.iter_mut().zip(rollouts) {
        for rollout in rollouts.iter().filter(|rollout| kept(rollout)) {
            sums[0] += rollout.position_error_m.powi(2);
            sums[1] += rollout.heading_error_rad.powi(2);
            sums[2] += 1.0;
        }
    }
}

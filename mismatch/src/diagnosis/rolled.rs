//! Roll-outs: how far predictions are off after a while, under the nominal model, the nominal model refitted,
//! and the corrected one, on data that were not fitted.

use std::collections::BTreeMap;
use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_physics::{Effect, RobotModel};

use crate::diagnosis::fit::{Effort, Fit, fit};
use crate::diagnosis::held_out::{FOLDS, fold, left_out};
use crate::diagnosis::run::{Judgement, Prepared};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::findings::{RobotRollOuts, RollOut};
use crate::rollout::{ALWAYS, HORIZONS_S, Planned, Rollout};
use pleiad_recording::parallel;

/// The parameters that anyone would refit first: those of the nominal model that move a predicted pose.
const REFITTED: [Effect; 2] = [Effect::WheelRadiusError, Effect::TrackWidthError];

/// What roll-outs need.
pub(crate) struct Roller<'r, 'a> {
    pub(crate) prepared: &'r [Prepared<'a>],
    pub(crate) units: &'r [&'r Unit<'a>],
    pub(crate) tests: &'r [&'r Unit<'a>],
}

/// Sums per horizon: squared errors of position and of heading, and their number.
type Sums = Vec<[f64; 3]>;

/// The roll-outs of a robot.
pub(crate) struct Rolled {
    nominal: Sums,
    corrected: Sums,
    /// The nominal model refitted, without none or one of its parameters.
    refitted: BTreeMap<Option<Effect>, Sums>,
}

/// Rolls out every robot that something was found of, and the others under the nominal model alone.
pub(crate) fn robots(roller: &Roller<'_, '_>, kept: &[Term]) -> BTreeMap<RobotId, Rolled> {
    let mut robots: Vec<RobotId> = roller.units.iter().map(|unit| unit.robot()).collect();
    robots.sort_unstable();
    robots.dedup();
    let rolled = parallel::map(&robots, |&robot| {
        let mine: Vec<Term> = kept.iter().filter(|term| term.acts_on(robot)).cloned().collect();
        let own = Rolling::new(roller, robot);
        let nominal = own.sums(None);
        let mut refitted = BTreeMap::new();
        let without = mine.iter().map(|term| term.effect).filter(|effect| REFITTED.contains(effect));
        for without in [None].into_iter().chain(without.map(Some)) {
            refitted.insert(without, own.sums(refit(&own.fitted, robot, without).as_ref()));
        }
        let movable: Vec<bool> = mine.iter().map(|term| term.whose == Whose::Robot(robot)).collect();
        let corrected = if mine.is_empty() {
            nominal.clone()
        } else {
            own.sums(fit(&own.fitted, mine, &|index| movable[index], Effort::RIVAL).as_ref())
        };
        Rolled { nominal, corrected, refitted }
    });
    robots.into_iter().zip(rolled).collect()
}

/// The nominal model refitted without one of its parameters.
fn refit(units: &[&Unit<'_>], robot: RobotId, without: Option<Effect>) -> Option<Fit> {
    let term = |&effect: &Effect| {
        let off = effect.info().parameters.iter().map(|parameter| parameter.off).collect();
        Term::new(effect, Whose::Robot(robot), off)
    };
    let terms = REFITTED.iter().filter(|effect| Some(**effect) != without).map(term).collect();
    fit(units, terms, &|_| true, Effort::RIVAL)
}

/// A robot to be rolled out: the windows are the same under every model.
struct Rolling<'r, 'a> {
    prepared: &'r [Prepared<'a>],
    fitted: Vec<&'r Unit<'a>>,
    /// Of the recordings to test on, or else of those fitted on.
    rolled: Vec<(&'r Unit<'a>, Planned)>,
    tested: bool,
}

impl<'r, 'a> Rolling<'r, 'a> {
    fn new(roller: &Roller<'r, 'a>, robot: RobotId) -> Self {
        let own = |units: &'r [&'r Unit<'a>]| -> Vec<&'r Unit<'a>> {
            units.iter().copied().filter(|unit| unit.robot() == robot).collect()
        };
        let (fitted, tests) = (own(roller.units), own(roller.tests));
        let tested = !tests.is_empty();
        let planned = |unit: &'r Unit<'a>| {
            (unit, Planned::new(&roller.prepared[unit.recording].evidence, robot, &HORIZONS_S))
        };
        let rolled = if tested { tests } else { fitted.clone() }.into_iter().map(planned).collect();
        Self { prepared: roller.prepared, fitted, rolled, tested }
    }

    /// Sums of roll-outs under a fit, or under the nominal model: on the recordings to test on, or else fold by
    /// fold with the fit of the rest.
    fn sums(&self, fit: Option<&Fit>) -> Sums {
        let mut sums = vec![[0.0; 3]; HORIZONS_S.len()];
        let roll = |unit: &Unit<'_>, planned: &Planned, model: &RobotModel<f64>, within: &Range<f64>| {
            planned.rollouts(&self.prepared[unit.recording].evidence, unit.robot(), model, within)
        };
        if self.tested || fit.is_none_or(|fit| fit.slots.is_empty()) {
            for (unit, planned) in &self.rolled {
                let model = fit.map_or_else(|| unit.nominal().clone(), |fit| unit.model(&fit.terms));
                add(&mut sums, &roll(unit, planned, &model, &ALWAYS));
            }
        } else if let Some(fit) = fit {
            for number in 0..FOLDS {
                let (terms, _) = left_out(&self.fitted, fit, number);
                for (unit, planned) in &self.rolled {
                    add(&mut sums, &roll(unit, planned, &unit.model(&terms), &fold(unit, number)));
                }
            }
        }
        sums
    }
}

fn add(sums: &mut Sums, rollouts: &[Vec<Rollout>]) {
    for (sums, rollouts) in sums.iter_mut().zip(rollouts) {
        for rollout in rollouts {
            sums[0] += rollout.position_error_m.powi(2);
            sums[1] += rollout.heading_error_rad.powi(2);
            sums[2] += 1.0;
        }
    }
}

/// The roll-outs of a finding's robots.
pub(crate) fn of_finding(
    rolled: &BTreeMap<RobotId, Rolled>,
    units: &[&Unit<'_>],
    own: &Judgement,
) -> Vec<RollOut> {
    let effect = own.judged.estimated[0].term.effect;
    let without = REFITTED.contains(&effect).then_some(effect);
    let mut robots: Vec<RobotId> = own.support.units.iter().map(|&unit| units[unit].robot()).collect();
    robots.sort_unstable();
    robots.dedup();
    horizons(&robots.iter().filter_map(|robot| rolled.get(robot)).collect::<Vec<_>>(), without)
}

/// The roll-outs of every robot.
pub(crate) fn per_robot(rolled: &BTreeMap<RobotId, Rolled>, units: &[&Unit<'_>]) -> Vec<RobotRollOuts> {
    let one = |(&robot, rolled): (&RobotId, &Rolled)| {
        let horizons = horizons(&[rolled], None);
        let own = units.iter().filter(|unit| unit.robot() == robot);
        let speeds: Vec<f64> =
            own.flat_map(|unit| unit.rows.iter().map(|row| row.regime.speed_m_s.abs())).collect();
        let speed_m_s = speeds.iter().sum::<f64>() / speeds.len().max(1) as f64;
        let last = horizons.last()?;
        let factor = 100.0 / (speed_m_s * last.horizon_s).max(1e-9);
        let error_per_100_m = [last.nominal * factor, last.corrected * factor];
        Some(RobotRollOuts { robot: robot.0, horizons, error_per_100_m })
    };
    rolled.iter().filter_map(one).collect()
}

fn horizons(robots: &[&Rolled], without: Option<Effect>) -> Vec<RollOut> {
    let none = vec![[0.0; 3]; HORIZONS_S.len()];
    let at = |index: usize| {
        let rms = |of: &dyn Fn(&Rolled) -> [f64; 3]| {
            let sums = robots.iter().map(|robot| of(robot));
            let total = sums.fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
            (total[2] > 0.0).then(|| [(total[0] / total[2]).sqrt(), (total[1] / total[2]).sqrt()])
        };
        let nominal = rms(&|robot| robot.nominal[index])?;
        let refit = rms(&|robot| robot.refitted.get(&without).unwrap_or(&none)[index])?;
        let corrected = rms(&|robot| robot.corrected[index])?;
        Some(RollOut {
            horizon_s: HORIZONS_S[index],
            nominal: nominal[0],
            refit: refit[0],
            corrected: corrected[0],
            heading_rad: [nominal[1], refit[1], corrected[1]],
        })
    };
    (0..HORIZONS_S.len()).filter_map(at).collect()
}

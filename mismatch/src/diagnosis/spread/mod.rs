//! Effects of spread and chance: they do not move the mean of the residuals, which [`select`] looks at, but
//! how wide they scatter, with what tails, under which names, and what is missing.
//!
//! A second stage, on the residuals of the fitted mean. Each group of effects that show in the same rows has a
//! likelihood of its own ([`sighted`], [`walk`], [`executed`], [`missed`]), in which the noise levels are
//! estimated too; [`family`] selects among its effects, [`judge`] applies the rules of evidence of the first
//! stage, with the tests of both counted.
//!
//! [`select`]: crate::diagnosis::select

mod density;
mod executed;
mod family;
mod judge;
mod maximum;
mod missed;
mod report;
mod scans;
mod sighted;
mod walk;

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;

use crate::diagnosis::fit::Fit;
use crate::diagnosis::held_out::Gain;
use crate::diagnosis::naming::Judged;
use crate::diagnosis::parallel;
use crate::diagnosis::select::Entry;
use crate::diagnosis::spread::family::Family;
use crate::diagnosis::term::Whose;
use crate::diagnosis::unit::Unit;
use crate::findings::{Undetected, Untestable};

/// The effects that this stage estimates.
const EFFECTS: [Effect; 7] = [
    Effect::RangeDependentNoise,
    Effect::MotionBlur,
    Effect::HeavyTails,
    Effect::IdentityMixUp,
    Effect::MissedDetections,
    Effect::GyroRandomWalk,
    Effect::CommandJitter,
];

/// Whether an effect is one of spread or chance.
pub(crate) fn is_spread(effect: Effect) -> bool {
    EFFECTS.contains(&effect) || effect == Effect::CommandLoss
}

/// Takes the entries of this stage out of those of the first.
pub(crate) fn take(entries: &mut Vec<Entry>) -> Vec<Entry> {
    let (own, mean) = entries.drain(..).partition(|(effect, _)| is_spread(*effect));
    *entries = mean;
    own
}

/// An effect of spread that some robots show.
#[derive(Clone, Debug)]
pub(crate) struct SpreadTerm {
    pub(crate) judged: Judged,
    pub(crate) gain: Gain,
    pub(crate) robots: Vec<RobotId>,
    /// Effects that explain it about equally, its own first.
    pub(crate) support: Vec<Effect>,
}

/// What the stage says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    pub(crate) terms: Vec<SpreadTerm>,
    pub(crate) undetected: Vec<Undetected>,
    pub(crate) untestable: Vec<Untestable>,
    /// Terms of the mean that an effect of spread explains, by position, with the reason.
    pub(crate) explained: Vec<(usize, Effect)>,
}

/// The families of a robot that have effects among the entries.
type Build = for<'u, 'a> fn(&[&'u Unit<'a>], &Fit) -> Option<Family<'u, 'a>>;
const FAMILIES: [(&[Effect], Build); 4] = [
    (
        &[Effect::RangeDependentNoise, Effect::MotionBlur, Effect::HeavyTails, Effect::IdentityMixUp],
        sighted::family,
    ),
    (&[Effect::MissedDetections], missed::family),
    (&[Effect::GyroRandomWalk], walk::family),
    (&[Effect::CommandJitter, Effect::CommandLoss], executed::family),
];

/// Looks for effects of spread among the entries, beside a fit of the mean and among so many tests.
pub(crate) fn spread(units: &[&Unit<'_>], fit: &Fit, entries: &[Entry], tests: usize) -> Spread {
    let robots: BTreeSet<RobotId> = units.iter().map(|unit| unit.robot).collect();
    let mut jobs = Vec::new();
    for &robot in &robots {
        for (effects, build) in FAMILIES {
            if effects.iter().any(|&effect| entries.contains(&(effect, Whose::Robot(robot)))) {
                jobs.push((robot, build));
            }
        }
    }
    let parts = parallel::map(&jobs, |&(robot, build)| {
        let own: Vec<&Unit<'_>> = units.iter().copied().filter(|unit| unit.robot == robot).collect();
        build(&own, fit).map_or_else(Spread::default, |family| of_family(&family, fit, robot, tests))
    });
    let mut all = Spread::default();
    for part in parts {
        all.terms.extend(part.terms);
        all.undetected.extend(part.undetected);
        all.explained.extend(part.explained);
    }
    all.untestable = untestable(units, entries);
    all
}

fn of_family(family: &Family<'_, '_>, fit: &Fit, robot: RobotId, tests: usize) -> Spread {
    let base = family.base();
    let shows = family.select(&base, tests);
    let found: Vec<Effect> = shows.iter().map(|own| family.members[own.member].effect).collect();
    let mut own = Spread { undetected: judge::undetected(family, &base, &found, robot, tests), ..Spread::default() };
    for shows in &shows {
        let effect = family.members[shows.member].effect;
        // Effects of the mean that a family knows as rivals are the mean's to name.
        if is_spread(effect) {
            own.terms.push(judge::judged(family, shows, robot, tests));
        }
    }
    own.undetected.retain(|undetected| EFFECTS.iter().any(|effect| effect.name() == undetected.effect));
    let _ = fit;
    own
}

fn untestable(units: &[&Unit<'_>], entries: &[Entry]) -> Vec<Untestable> {
    let mut all = Vec::new();
    for &(effect, whose) in entries {
        let Whose::Robot(robot) = whose else { continue };
        let own: Vec<&Unit<'_>> = units.iter().copied().filter(|unit| unit.robot == robot).collect();
        let why = if effect == Effect::MissedDetections { missed::obstacle(&own) } else { None };
        if let Some(why) = why {
            all.push(Untestable { effect: effect.name().to_owned(), robot: Some(robot.0), why });
        }
    }
    all
}

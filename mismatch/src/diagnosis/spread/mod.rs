//! Effects of spread and chance: they do not move the mean of the residuals, which [`select`] looks at, but
//! how wide they scatter, with what tails, under which names, and what is missing.
//!
//! A second stage, on the residuals of the fitted mean. Each group of effects that show in the same rows has a
//! likelihood of its own ([`sighted`], [`walk`], [`executed`], [`missed`]), in which the noise levels are
//! estimated too; [`family`] selects among its effects, [`judge`] applies the rules of evidence of the first
//! stage, with the tests of both counted. [`ticks`] are counted and [`swap`] is looked for before the first.
//!
//! [`select`]: crate::diagnosis::select

mod check;
mod density;
mod executed;
mod family;
mod judge;
mod known;
mod maximum;
mod missed;
mod report;
mod scans;
mod sighted;
mod swap;
mod ticks;
mod timing;
mod walk;
mod yaw;

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::entries::Entries;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::held_out::Gain;
use crate::diagnosis::naming::Judged;
use crate::diagnosis::select::Entry;
use crate::diagnosis::spread::family::{Family, Shows};
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::unit::Unit;
use crate::findings::{Undetected, Untestable};
use pleiad_recording::parallel;

pub(crate) use known::{is_of_spread, known, known_swap};
pub(crate) use swap::{Swaps, swaps};

/// The effects that this stage estimates.
const EFFECTS: [Effect; 10] = [
    Effect::RangeDependentNoise,
    Effect::MotionBlur,
    Effect::HeavyTails,
    Effect::IdentityMixUp,
    Effect::MissedDetections,
    Effect::GyroRandomWalk,
    Effect::CommandJitter,
    Effect::CommandLoss,
    Effect::EncoderCoarse,
    Effect::LandmarkIdentitySwap,
];

/// Takes the entries of this stage out of those of the first, and adds what only this stage can test, if it is not to
/// be left out.
pub(crate) fn take(entries: &mut Entries, units: &[&Unit<'_>], leave_out: &[Effect]) -> Vec<Entry> {
    let is_own = |entry: &Entry| EFFECTS.contains(&entry.0);
    let (mut own, mean): (Vec<Entry>, Vec<Entry>) = entries.entries.drain(..).partition(is_own);
    entries.entries = mean;
    let counted = if leave_out.contains(&Effect::EncoderCoarse) { BTreeSet::new() } else { robots(units) };
    for robot in counted {
        let entry = (Effect::EncoderCoarse, Whose::Robot(robot));
        if ticks::recorded(&of_robot(units, robot)) && !own.contains(&entry) {
            own.push(entry);
            let tested = |known: &Untestable| known.effect == entry.0.name() && known.robot == Some(robot.0);
            entries.untestable.retain(|known| !tested(known));
        }
    }
    own
}

fn robots(units: &[&Unit<'_>]) -> BTreeSet<RobotId> {
    units.iter().map(|unit| unit.robot()).collect()
}

fn of_robot<'u, 'a>(units: &[&'u Unit<'a>], robot: RobotId) -> Vec<&'u Unit<'a>> {
    units.iter().copied().filter(|unit| unit.robot() == robot).collect()
}

/// An effect of spread that some robots show.
#[derive(Clone, Debug)]
pub(crate) struct SpreadTerm {
    pub(crate) judged: Judged,
    pub(crate) gain: Gain,
    pub(crate) robots: Vec<RobotId>,
    /// Effects that explain it about equally, its own first.
    pub(crate) support: Vec<Effect>,
    /// What has no name and may be in its place.
    pub(crate) unnamed_rivals: Vec<String>,
}

/// What the stage says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    pub(crate) terms: Vec<SpreadTerm>,
    pub(crate) undetected: Vec<Undetected>,
    pub(crate) untestable: Vec<Untestable>,
    pub(crate) explained: Vec<Explained>,
    /// Terms of the mean, by their positions in the fit, with an effect of spread that would do as well.
    pub(crate) rivals: Vec<(usize, Effect)>,
}

/// A term of the mean of which an effect of spread explains a part, or all.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Explained {
    /// The position of the term in the fit.
    pub(crate) position: usize,
    pub(crate) by: Effect,
    /// What it explains of the term's first parameter; `None` if nothing is left of the term.
    pub(crate) part: Option<f64>,
}

/// Makes a likelihood of units.
type Build<'f> = dyn for<'u, 'a> Fn(&[&'u Unit<'a>]) -> Option<Family<'u, 'a>> + 'f;

/// Effects that are looked for together.
#[derive(Clone, Copy)]
enum Group {
    Sightings,
    Gyro,
    Commands,
}

impl Group {
    const ALL: [Self; 3] = [Self::Sightings, Self::Gyro, Self::Commands];

    fn effects(self) -> &'static [Effect] {
        match self {
            Self::Sightings => &EFFECTS[..5],
            Self::Gyro => &EFFECTS[5..6],
            Self::Commands => &EFFECTS[6..8],
        }
    }

    /// What one robot shows, with gains on the held units if there are any.
    fn spread(
        self,
        units: &[&Unit<'_>],
        held: &[&Unit<'_>],
        fit: &Fit,
        robot: RobotId,
        (tests, leave_out): (usize, &[Effect]),
    ) -> Spread {
        let of_family = |build: &Build<'_>| {
            let (mut own, held) = (build(units), build(held));
            if let Some(own) = &mut own {
                own.members.retain(|member| !leave_out.contains(&member.effect));
            }
            let own = own.filter(|own| !own.members.is_empty());
            own.map_or_else(Spread::default, |own| of_family(&own, held.as_ref(), fit, robot, tests))
        };
        match self {
            Self::Sightings => {
                let mut all = of_family(&|units| sighted::family(units, fit));
                let mixed = all.terms.iter().map(|own| &own.judged.estimated[0].term);
                let mixed =
                    mixed.filter(|term| term.effect == Effect::IdentityMixUp).map(|term| term.values[0]);
                let displaced = sighted::displaced(units, mixed.sum());
                all.join(of_family(&|units| missed::family(units, fit, displaced)));
                all
            }
            Self::Gyro => of_family(&|units| walk::family(units, fit)),
            Self::Commands => of_family(&|units| executed::family(units, fit)),
        }
    }
}

/// Looks for effects of spread among the entries, beside a fit of the mean and among so many tests; `held` are
/// units of other recordings to test on.
pub(crate) fn spread(
    units: &[&Unit<'_>],
    held: &[&Unit<'_>],
    fit: &Fit,
    entries: &[Entry],
    swaps: &Swaps,
    (tests, leave_out): (usize, &[Effect]),
) -> Spread {
    let has = |effect: Effect, robot: RobotId| entries.contains(&(effect, Whose::Robot(robot)));
    let mut jobs = Vec::new();
    for robot in robots(units) {
        for group in Group::ALL {
            if group.effects().iter().any(|&effect| has(effect, robot)) {
                jobs.push((robot, group));
            }
        }
    }
    let parts = parallel::map(&jobs, |&(robot, group)| {
        group.spread(&of_robot(units, robot), &of_robot(held, robot), fit, robot, (tests, leave_out))
    });
    let mut all = Spread { terms: swaps.terms(tests), ..Spread::default() };
    for part in parts {
        all.join(part);
    }
    for robot in robots(units).into_iter().filter(|&robot| has(Effect::EncoderCoarse, robot)) {
        all.terms.extend(ticks::coarse(&of_robot(units, robot), robot, tests));
    }
    all.untestable = untestable(units, entries);
    all
}

impl Spread {
    /// Whether a finding says how residuals of a robot scatter in a channel; one of sightings says it of all of them.
    pub(crate) fn shows(&self, robot: RobotId, channel: Channel) -> bool {
        let seen = |channel: Channel| Channel::SIGHTINGS.as_flattened().contains(&channel);
        let found =
            self.terms.iter().filter(|own| own.judged.verdict.is_some() && own.robots.contains(&robot));
        found.map(|own| own.judged.channel).any(|known| known == channel || (seen(known) && seen(channel)))
    }

    fn join(&mut self, other: Self) {
        self.terms.extend(other.terms);
        self.undetected.extend(other.undetected);
        self.untestable.extend(other.untestable);
        self.explained.extend(other.explained);
        self.rivals.extend(other.rivals);
    }
}

fn of_family(
    family: &Family<'_, '_>,
    held: Option<&Family<'_, '_>>,
    fit: &Fit,
    robot: RobotId,
    tests: usize,
) -> Spread {
    let base = family.base();
    let mut shows = family.select(&base, tests);
    if let Some(held) = held {
        for shows in &mut shows {
            shows.gain = Family::gain_in(held, &shows.with, &shows.without);
        }
    }
    let found: Vec<Effect> = shows.iter().map(|own| family.members[own.member].effect).collect();
    let mut own =
        Spread { undetected: judge::undetected(family, &base, &found, robot, tests), ..Spread::default() };
    for shows in &shows {
        let effect = family.members[shows.member].effect;
        // Effects of the mean that a family knows as rivals are the mean's to name.
        if EFFECTS.contains(&effect) {
            own.terms.push(judge::judged(family, shows, robot, tests));
        }
    }
    own.explained = explained(family, &shows, &own.terms, fit);
    own.rivals = rivals(family, &shows, fit, robot);
    own.undetected.retain(|undetected| EFFECTS.iter().any(|effect| effect.name() == undetected.effect));
    own
}

/// What those that are findings explain of the mean.
fn explained(family: &Family<'_, '_>, shows: &[Shows], terms: &[SpreadTerm], fit: &Fit) -> Vec<Explained> {
    let mut all = Vec::new();
    for shows in shows {
        let effect = family.members[shows.member].effect;
        let is_finding =
            |own: &SpreadTerm| own.judged.estimated[0].term.effect == effect && own.judged.verdict.is_some();
        if !terms.iter().any(is_finding) {
            continue;
        }
        match effect {
            Effect::GyroRandomWalk => all.extend(walk::explained(family, shows, fit)),
            Effect::CommandJitter | Effect::CommandLoss => {
                all.extend(executed::explained(family, shows, effect, fit));
            }
            _ => {}
        }
    }
    all
}

/// Effects of spread that would do as well as what a family shows of the mean.
fn rivals(family: &Family<'_, '_>, shows: &[Shows], fit: &Fit, robot: RobotId) -> Vec<(usize, Effect)> {
    let mut all = Vec::new();
    for shows in shows {
        let effect = family.members[shows.member].effect;
        let own = |(_, term): &(usize, &Term)| term.effect == effect && term.acts_on(robot);
        for (position, _) in fit.terms.iter().enumerate().filter(own) {
            all.extend(shows.rivals.iter().map(|&rival| (position, rival)));
        }
    }
    all
}

fn untestable(units: &[&Unit<'_>], entries: &[Entry]) -> Vec<Untestable> {
    let mut all = Vec::new();
    for &(effect, whose) in entries {
        let Whose::Robot(robot) = whose else { continue };
        let own = of_robot(units, robot);
        let why = if effect == Effect::MissedDetections { missed::obstacle(&own) } else { None };
        if let Some(why) = why {
            all.push(Untestable { effect: effect.name().to_owned(), robot: Some(robot.0), why });
        }
    }
    all
}

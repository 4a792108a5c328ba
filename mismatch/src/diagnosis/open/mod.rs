//! What the catalogue does not explain: is structure left in a robot's residuals, does a product of what it did
//! describe it, and if none does, what does it look like?
//!
//! [`monomial`] is the dictionary, [`target`] and [`motion`] make columns of it, [`bench`] scores them beside what
//! is fitted ([`picture`]), [`search`] adds forms and curves ([`spline`]), [`rival`] asks whether they do better
//! than effects that were taken for them, [`tell`] says what was found, [`draw`] what shows it.

mod bench;
mod draw;
mod monomial;
mod motion;
mod picture;
mod rival;
mod search;
mod spline;
mod target;
mod tell;

use std::collections::BTreeSet;

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::open::picture::Picture;
use crate::diagnosis::open::search::{Curve, Form, Ground};
use crate::diagnosis::open::target::Target;
use crate::diagnosis::run::Judgement;
use crate::diagnosis::spread::Spread;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;
use crate::findings::Finding;
use crate::view::{PartialResidual, Plots, ShapePlot};
use pleiad_recording::parallel;

/// A rest that gains less than this share of what the forms of a target gain leaves them their names.
const REST: f64 = 0.05;
/// The most curves of a robot.
const MOST_CURVES: usize = 4;

/// A finding without a name, with what shows it; the number of the finding is the caller's.
pub(crate) struct Unnamed {
    pub(crate) target: Target,
    pub(crate) finding: Finding,
    pub(crate) partial: Vec<PartialResidual>,
    pub(crate) shapes: Vec<ShapePlot>,
}

/// What the search says.
#[derive(Default)]
pub(crate) struct Opened {
    pub(crate) found: Vec<Unnamed>,
    /// What is off on which robot, named or not.
    unexplained: Vec<(RobotId, Target)>,
    /// Terms of the fit that a form makes needless.
    pub(crate) displaced: BTreeSet<usize>,
    pub(crate) notes: Vec<String>,
}

/// What was found of one robot.
pub(crate) struct Hypothesis<'u, 'a> {
    /// What is fitted: terms, then curves, then forms.
    pub(crate) picture: Picture<'u, 'a>,
    /// The terms alone.
    pub(crate) base: Picture<'u, 'a>,
    pub(crate) forms: Vec<Form>,
    pub(crate) curves: Vec<Curve>,
    /// Targets whose forms are not the whole: more would be needed than one may have.
    pub(crate) short: BTreeSet<Target>,
    pub(crate) notes: Vec<String>,
}

/// Effects of spread that also move the mean of what they show in, from one instant to the next.
const WANDERING: [Effect; 4] =
    [Effect::GyroRandomWalk, Effect::IdentityMixUp, Effect::LandmarkIdentitySwap, Effect::EncoderCoarse];

/// Searches what a fit leaves in every robot's residuals, among so many other tests; `held` are units of other
/// recordings to test on.
pub(crate) fn open(
    units: &[&Unit<'_>],
    held: &[&Unit<'_>],
    names: &[String],
    fit: &Fit,
    spread: &Spread,
    tests: usize,
) -> Opened {
    let robots: BTreeSet<RobotId> = units.iter().map(|unit| unit.robot()).collect();
    let robots: Vec<RobotId> = robots.into_iter().collect();
    let grounds = parallel::map(&robots, |&robot| {
        let own: Vec<&Unit<'_>> = units.iter().copied().filter(|unit| unit.robot() == robot).collect();
        Ground::new(own, &fit.terms, &wandering(spread, robot))
    });
    let tests = tests + grounds.iter().map(Ground::tests).sum::<usize>();
    let each = parallel::map(&robots.iter().zip(&grounds).collect::<Vec<_>>(), |(robot, ground)| {
        let base = Picture::new(units, fit, **robot);
        let first = hypothesis(ground, base, tests);
        let mut places = rival::places(units, fit, **robot);
        if first.forms.is_empty() && first.curves.is_empty() {
            places.extend(rival::joint(&fit.terms, **robot));
            if places.is_empty() {
                return Opened { notes: first.notes, ..Opened::default() };
            }
        }
        let (kept, displaced) = rival::compared(ground, fit, **robot, first, &places, tests);
        let mut told = tell::told(ground, held, names, **robot, &kept, tests);
        told.displaced = displaced;
        let targets = kept.forms.iter().map(|own| own.target).chain(kept.curves.iter().map(|own| own.target));
        told.unexplained = targets.map(|target| (**robot, target)).collect();
        told
    });
    let mut all = Opened::default();
    for own in each {
        all.found.extend(own.found);
        all.displaced.extend(own.displaced);
        all.unexplained.extend(own.unexplained);
        all.notes.extend(own.notes);
    }
    all.found.sort_by(|a, b| b.finding.held_out.log_score_gain.total_cmp(&a.finding.held_out.log_score_gain));
    all
}

impl Opened {
    /// Whether something without a name was found of a robot in a channel.
    pub(crate) fn shows(&self, robot: RobotId, channel: Channel) -> bool {
        let own = self.unexplained.iter().filter(|(known, _)| *known == robot);
        own.flat_map(|(_, target)| target.channels()).any(|(known, _)| *known == channel)
    }

    /// Makes of names what cannot be told, where something without a name shows in a channel that they touch: a name
    /// claims to be the whole of it, and the effect may be a makeshift for a part. Doubt spreads: what touches a channel
    /// of a name that is doubted may be a makeshift for the same.
    pub(crate) fn doubt(&self, units: &[&Unit<'_>], judgements: &mut [Judgement]) {
        let robots: BTreeSet<RobotId> = units.iter().map(|unit| unit.robot()).collect();
        for robot in robots {
            let own = |own: &&Unnamed| own.finding.robots.contains(&robot.0);
            let found: Vec<&Unnamed> = self.found.iter().filter(own).collect();
            let rivals: Vec<String> = found.iter().filter_map(|own| own.finding.expression.clone()).collect();
            let mut names: Vec<&mut Judgement> = judgements
                .iter_mut()
                .filter(|own| own.claims())
                .filter(|own| own.support.units.iter().all(|&unit| units[unit].robot() == robot))
                .collect();
            let effects: Vec<Effect> = names.iter().map(|own| own.judged.estimated[0].term.effect).collect();
            let channels = found.iter().flat_map(|own| own.target.channels()).map(|(channel, _)| *channel);
            for position in makeshifts(&effects, channels.collect()) {
                names[position].doubt(rivals.iter().cloned());
            }
        }
    }

    /// Takes from terms of the fit what forms explain better; says so.
    pub(crate) fn displace(
        &self,
        judgements: &mut [Judgement],
        spread: &mut Spread,
        notes: &mut Vec<String>,
    ) {
        for own in judgements {
            if own.judged.verdict.is_some() && own.group.iter().any(|term| self.displaced.contains(term)) {
                own.judged.verdict = None;
                notes.push(format!("{} is no finding: what has no name explains it better", own.name()));
            }
        }
        // How wide residuals scatter cannot be judged where their mean is not explained.
        for own in &mut spread.terms {
            let shows = |(robot, target): &(RobotId, Target)| {
                own.robots.contains(robot)
                    && target
                        .channels()
                        .iter()
                        .any(|(channel, _)| are_judged_together(*channel, own.judged.channel))
            };
            if own.judged.verdict.is_some() && self.unexplained.iter().any(shows) {
                own.judged.verdict = None;
                let name = own.judged.estimated[0].term.effect.name();
                notes.push(format!(
                    "{name} is no finding: something without a name shows in the same channel"
                ));
            }
        }
    }

    /// Adds what shows the findings, which begin at a number.
    pub(crate) fn plot(&self, first: usize, plots: &mut Plots) {
        for (index, own) in self.found.iter().enumerate() {
            let finding = first + index;
            plots.partial.extend(own.partial.iter().map(|one| PartialResidual { finding, ..one.clone() }));
            plots.shapes.extend(own.shapes.iter().map(|one| ShapePlot { finding, ..one.clone() }));
        }
    }
}

/// The positions of effects that touch one of these channels, or a channel of another that does. Where two do, all: one
/// thing moves the whole robot, as a marker of the truth beside its middle, and each name takes up a part of it.
fn makeshifts(effects: &[Effect], mut channels: BTreeSet<Channel>) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    loop {
        let shows = |position: &usize| channels.iter().any(|&channel| touches(effects[*position], channel));
        let more: Vec<usize> = (0..effects.len()).filter(|own| !found.contains(own)).filter(shows).collect();
        if more.is_empty() {
            return if found.len() > 1 { (0..effects.len()).collect() } else { found };
        }
        for position in more {
            channels.extend(Channel::ALL.into_iter().filter(|&channel| touches(effects[position], channel)));
            found.insert(position);
        }
    }
}

/// Whether a likelihood of spread has both channels: of sightings it has all.
fn are_judged_together(a: Channel, b: Channel) -> bool {
    let seen = |channel: Channel| Channel::SIGHTINGS.as_flattened().contains(&channel);
    a == b || (seen(a) && seen(b))
}

/// Targets in channels that a finding of spread moves about.
fn wandering(spread: &Spread, robot: RobotId) -> Vec<Target> {
    let found = spread.found();
    let own = found.iter().filter(|own| own.robots.contains(&robot));
    let channels: Vec<Channel> = own
        .filter(|own| WANDERING.contains(&own.judged.estimated[0].term.effect))
        .flat_map(|own| match own.judged.estimated[0].term.effect {
            Effect::GyroRandomWalk => vec![Channel::Gyro],
            Effect::EncoderCoarse => vec![Channel::Actuator, Channel::Body, Channel::Gyro],
            _ => Channel::SIGHTINGS.as_flattened().to_vec(),
        })
        .collect();
    let shows = |target: &Target| target.channels().iter().any(|(channel, _)| channels.contains(channel));
    Target::ALL.into_iter().filter(shows).collect()
}

/// Forms beside a base, and curves where they do not suffice.
pub(crate) fn hypothesis<'u, 'a>(
    ground: &Ground<'u, 'a>,
    base: Picture<'u, 'a>,
    tests: usize,
) -> Hypothesis<'u, 'a> {
    let (forms, short) = ground.forms(&base, tests);
    let picture = built(&base, &[], &forms);
    let mut own = Hypothesis { picture, base, forms, curves: Vec::new(), short, notes: Vec::new() };
    for target in own.short.clone() {
        own.bend(ground, target, tests);
    }
    let mut closed: BTreeSet<Target> = own.curves.iter().map(|curve| curve.target).collect();
    let mut paired: BTreeSet<Target> = BTreeSet::new();
    while own.curves.len() < MOST_CURVES {
        let open = ground.targets.iter().copied().filter(|target| !closed.contains(target));
        let left = open.filter_map(|target| ground.curve(&own.picture, target, tests));
        let Some(rest) = left.reduce(|a, b| if b.gain > a.gain { b } else { a }) else { break };
        let target = rest.target;
        let (others, bare) = own.without_forms_of(target);
        if others.len() < own.forms.len() {
            // What came first may be a makeshift for two forms of the same.
            if paired.insert(target)
                && let Some(pair) = ground.pair(&bare, &own.picture, &rest)
            {
                own.forms = others.into_iter().chain(pair).collect();
                own.picture = built(&own.base, &own.curves, &own.forms);
                continue;
            }
            let by_forms =
                2.0 * (own.picture.log_likelihood() - bare.log_likelihood()) / rest.inflation.max(1.0);
            if !own.short.contains(&target) && rest.gain < REST * by_forms {
                closed.insert(target);
                own.notes.push(format!(
                    "robot {}: the form of the {} leaves a rest over {}: it is a description, not the whole",
                    ground.units[0].robot(),
                    target.words().0,
                    rest.regressor.symbol().0
                ));
                continue;
            }
        }
        closed.insert(target);
        own.bend(ground, target, tests);
    }
    own
}

impl<'u, 'a> Hypothesis<'u, 'a> {
    /// The forms of other targets, and what is fitted without those of this one.
    fn without_forms_of(&self, target: Target) -> (Vec<Form>, Picture<'u, 'a>) {
        let others: Vec<Form> = self.forms.iter().filter(|own| own.target != target).cloned().collect();
        let bare = built(&self.base, &self.curves, &others);
        (others, bare)
    }

    /// Puts a curve in the place of the forms of a target, if there is one that matters.
    fn bend(&mut self, ground: &Ground<'u, 'a>, target: Target, tests: usize) {
        let (others, bare) = self.without_forms_of(target);
        let Some(curve) = ground.curve(&bare, target, tests) else { return };
        let with = bare.with(&curve.all_columns());
        let positions: Vec<usize> = (bare.size()..with.size()).collect();
        if !tell::curve_matters(ground, &curve, (&with, &positions), &bare) {
            return;
        }
        self.curves.push(curve);
        self.short.remove(&target);
        self.forms = others;
        self.picture = built(&self.base, &self.curves, &self.forms);
    }
}

/// A base with curves and forms.
pub(crate) fn built<'u, 'a>(base: &Picture<'u, 'a>, curves: &[Curve], forms: &[Form]) -> Picture<'u, 'a> {
    let mut columns: Vec<_> = curves.iter().flat_map(Curve::all_columns).collect();
    columns.extend(forms.iter().map(|form| form.columns.clone()));
    if columns.is_empty() { base.clone() } else { base.with(&columns) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(effects: &[Effect], channels: &[Channel]) -> Vec<usize> {
        makeshifts(effects, channels.iter().copied().collect()).into_iter().collect()
    }

    #[test]
    fn a_name_in_a_channel_with_something_unnamed_is_doubted_and_one_elsewhere_is_not() {
        let names = [Effect::IcrOffset, Effect::SensorYawMisalignment];
        assert_eq!(found(&names, &[Channel::Body]), [0]);
        assert_eq!(found(&names, &[Channel::BearingToLandmark]), [1]);
        assert_eq!(found(&names, &[Channel::Gps]), Vec::<usize>::new());
        assert_eq!(found(&names, &[]), Vec::<usize>::new());
    }

    #[test]
    fn where_two_names_are_doubted_all_of_the_robot_are() {
        // What a marker of the truth beside the middle of a robot is taken for.
        let names = [Effect::SensorLeverArm, Effect::IcrOffset, Effect::Crab, Effect::GpsLeverArm];
        assert_eq!(found(&names, &[Channel::Body]), [0, 1, 2, 3]);
    }
}

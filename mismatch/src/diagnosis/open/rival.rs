//! Whether effects of the catalogue were taken for what a form describes better.
//!
//! The catalogue has its turn first, and takes of what it does not have as much as its entries can imitate. So
//! forms are also searched where those entries are left out, and the shorter description is kept.

use std::collections::BTreeSet;

use nalgebra::DMatrix;
use pleiad_estimation::RobotId;

use crate::channel::Channel;
use crate::diagnosis::fit::{Effort, Fit, Normal, fit};
use crate::diagnosis::open::picture::Picture;
use crate::diagnosis::open::search::{Curve, Form, Ground};
use crate::diagnosis::open::target::Target;
use crate::diagnosis::open::{Hypothesis, built, hypothesis};
use crate::diagnosis::starts::Placing;
use crate::diagnosis::term::{Term, Whose};
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;

/// A name is given up for what is better by this, twice in log-likelihood: of much the same, the name.
const NAME: f64 = 12.0;
/// What other robots may say of a region, as a share of what one says, for it to be that robot's.
const OTHERS: f64 = 0.02;

/// The best of: forms beside everything, forms instead of the effects that show in the same channels, and those
/// forms with the effects that are still needed. With the terms that are not.
pub(crate) fn compared<'u, 'a>(
    ground: &Ground<'u, 'a>,
    full: &Fit,
    robot: RobotId,
    first: Hypothesis<'u, 'a>,
    places: &[usize],
    tests: usize,
) -> (Hypothesis<'u, 'a>, BTreeSet<usize>) {
    let mut targets: BTreeSet<Target> = first.forms.iter().map(|own| own.target).collect();
    targets.extend(first.curves.iter().map(|own| own.target));
    let shows = |term: &Term| {
        let mut channels = targets.iter().flat_map(|target| target.channels());
        channels.any(|(channel, _)| touches(term.effect, *channel))
    };
    let suspects: Vec<usize> = (0..full.terms.len())
        .filter(|term| {
            let own = &full.terms[*term];
            places.contains(term) || (own.whose == Whose::Robot(robot) && shows(own))
        })
        .collect();
    if suspects.is_empty() {
        return (first, BTreeSet::new());
    }
    let shown = suspects.clone();
    let Some(base) = refitted(&ground.units, full, robot, &suspects) else {
        return (first, BTreeSet::new());
    };
    let second = hypothesis(ground, base, tests);
    if first.forms.is_empty() && first.curves.is_empty() && second.forms.is_empty() {
        return (first, BTreeSet::new());
    }
    // The forms that are all there is: those of the second may hold what the terms of the first explain.
    let sure = if first.forms.is_empty() && first.curves.is_empty() { &second } else { &first };
    let inflations = sure.forms.iter().map(|own| own.inflation);
    let inflation = inflations.chain(sure.curves.iter().map(|own| own.inflation)).fold(1.0, f64::max);
    let rows: usize = ground.units.iter().map(|unit| unit.rows.len()).sum();
    let price = (rows as f64 / inflation).max(2.0).ln();
    let worth = |own: &Hypothesis<'u, 'a>| {
        let forms: f64 = own.forms.iter().map(|form| price + ground.price(form.target, &form.monomial)).sum();
        let curves: f64 = own.curves.iter().map(|curve| curve.columns.len() as f64 * price).sum();
        let mut slots = own.base.slots.len();
        for term in &own.base.terms {
            if term.acts_on(robot) {
                slots += Placing::of(term.effect.info()).count();
            }
        }
        let terms = slots as f64 * price;
        2.0 * own.picture.log_likelihood() / inflation - forms - curves - terms
    };
    let short = second.short.clone();
    // Beside forms that were found beside everything, effects that lost what they explained go too.
    let still = needed(&first.base, &first, &suspects, full, price * inflation);
    let needed = needed(&first.base, &second, &suspects, full, price * inflation);
    let third = if needed.terms.is_empty() {
        None
    } else {
        let dropped: Vec<usize> =
            suspects.iter().copied().filter(|term| !needed.terms.contains(term)).collect();
        refitted(&ground.units, full, robot, &dropped).map(|base| {
            let picture = built(&base, &needed.curves, &needed.forms);
            let (forms, curves, notes) = (needed.forms, needed.curves, Vec::new());
            (Hypothesis { picture, base, forms, curves, short: short.clone(), notes }, dropped)
        })
    };
    let dropped: Vec<usize> = suspects.iter().copied().filter(|term| !still.terms.contains(term)).collect();
    let fourth = (!dropped.is_empty()).then(|| refitted(&ground.units, full, robot, &dropped)).flatten();
    let fourth = fourth.map(|base| {
        let picture = built(&base, &still.curves, &still.forms);
        let (forms, curves, notes) = (still.forms, still.curves, Vec::new());
        (Hypothesis { picture, base, forms, curves, short: first.short.clone(), notes }, dropped)
    });
    // Names that need a form beside them are no better than a form alone that says it in fewer.
    let names_alone = first.forms.is_empty() && first.curves.is_empty();
    let count = |own: &Hypothesis<'u, 'a>| {
        let terms = own.base.terms.iter().filter(|term| term.acts_on(robot)).count();
        terms + own.forms.len() + own.curves.len()
    };
    let described = count(&first);
    let mut best = (worth(&first), first, Vec::new());
    let mut handicap = NAME;
    for (own, dropped) in [Some((second, suspects)), third, fourth].into_iter().flatten() {
        let own_worth = worth(&own);
        let least = if !names_alone && count(&own) < described { 0.0 } else { handicap };
        if own_worth > best.0 + least && !(own.forms.is_empty() && own.curves.is_empty()) {
            best = (own_worth, own, dropped);
            handicap = 0.0;
        }
    }
    let mut displaced: BTreeSet<usize> = best.2.into_iter().collect();
    displaced.extend(suspects_left(&best.1, full).into_iter().filter(|term| shown.contains(term)));
    (best.1, displaced)
}

/// Terms of a fit of which nothing that matters is left beside what was found.
fn suspects_left(found: &Hypothesis<'_, '_>, full: &Fit) -> BTreeSet<usize> {
    let Some(unit) = found.picture.units.first() else { return BTreeSet::new() };
    let mut matters = vec![None; full.terms.len()];
    for (slot, &(term, parameter)) in found.base.slots.iter().enumerate() {
        let own = &found.base.terms[term];
        let Some(known) = full.terms.iter().position(|other| other.is_of(own)) else { continue };
        let described = &own.parameters()[parameter];
        let size = (own.values[parameter] - described.off + found.picture.moved[slot]).abs();
        let threshold = described.relevance.threshold(&unit.members[0].floors);
        let large = size.partial_cmp(&threshold) != Some(std::cmp::Ordering::Less);
        matters[known] = Some(matters[known].unwrap_or(false) || large);
    }
    (0..matters.len()).filter(|&term| matters[term] == Some(false)).collect()
}

/// The terms of the world that are in a region in which only this robot drives: they may be its own.
pub(crate) fn places(units: &[&Unit<'_>], full: &Fit, robot: RobotId) -> Vec<usize> {
    let said = |term: usize, own: bool| -> f64 {
        let of_unit = |(index, unit): (usize, &&Unit<'_>)| -> f64 {
            let slots = (0..full.slots.len()).filter(|&slot| full.slots[slot].0 == term);
            let columns = slots.map(|slot| &full.columns[index][slot]);
            let parts = columns.flat_map(|column| column.parts.iter().zip(&unit.stretches));
            parts
                .filter_map(|(part, stretch)| Some((part.as_ref()?, stretch)))
                .map(|(part, stretch)| {
                    let sigmas = &full.states[index].noise.sigma[stretch.range()];
                    part.iter().zip(sigmas).map(|(value, sigma)| (value / sigma).powi(2)).sum::<f64>()
                })
                .sum()
        };
        units.iter().enumerate().filter(|(_, unit)| (unit.robot() == robot) == own).map(of_unit).sum()
    };
    let is_place = |term: &usize| {
        let own = &full.terms[*term];
        own.whose == Whose::Everyone
            && Placing::of(own.effect.info()).region.is_some()
            && said(*term, false) < OTHERS * said(*term, true)
    };
    (0..full.terms.len()).filter(is_place).collect()
}

/// The terms of a robot that share a channel with another of its own: several may together imitate what one form
/// describes, and leave nothing in which a form would show.
pub(crate) fn joint(terms: &[Term], robot: RobotId) -> Vec<usize> {
    let own: Vec<usize> = (0..terms.len()).filter(|&term| terms[term].whose == Whose::Robot(robot)).collect();
    let share = |a: usize, b: usize| {
        let both =
            |channel: &Channel| touches(terms[a].effect, *channel) && touches(terms[b].effect, *channel);
        Channel::ALL.iter().any(both)
    };
    own.iter().copied().filter(|&a| own.iter().any(|&b| a != b && share(a, b))).collect()
}

/// The terms of a robot without some, fitted again.
fn refitted<'u, 'a>(
    units: &[&'u Unit<'a>],
    full: &Fit,
    robot: RobotId,
    dropped: &[usize],
) -> Option<Picture<'u, 'a>> {
    let kept = (0..full.terms.len()).filter(|term| !dropped.contains(term));
    let terms: Vec<Term> =
        kept.map(|term| full.terms[term].clone()).filter(|term| term.acts_on(robot)).collect();
    let movable: Vec<bool> = terms.iter().map(|term| term.whose == Whose::Robot(robot)).collect();
    let own = fit(units, terms, &|term| movable[term], Effort::RIVAL)?;
    Some(Picture::new(units, &own, robot))
}

struct Needed {
    terms: BTreeSet<usize>,
    forms: Vec<Form>,
    curves: Vec<Curve>,
}

/// Of suspected terms and of forms that were found without them, those that are needed beside each other, by
/// linearization.
fn needed(
    base: &Picture<'_, '_>,
    found: &Hypothesis<'_, '_>,
    suspects: &[usize],
    full: &Fit,
    price: f64,
) -> Needed {
    let all = built(base, &found.curves, &found.forms);
    let mut terms: BTreeSet<usize> = suspects.iter().copied().collect();
    let mut forms: Vec<usize> = (0..found.forms.len()).collect();
    let first_form = all.size() - found.forms.len();
    let normal = Normal::new(&all.units, &all.states, &all.columns, all.size());
    // Distances from "off".
    let mut away = vec![f64::NAN; all.size()];
    for (slot, &(term, parameter)) in base.slots.iter().enumerate() {
        let own = &full.terms[term];
        away[slot] = own.values[parameter] - own.parameters()[parameter].off + all.moved[slot];
    }
    away[first_form..].copy_from_slice(&all.moved[first_form..]);
    let mut open: BTreeSet<usize> = (0..all.size()).collect();
    loop {
        let kept: Vec<usize> = open.iter().copied().collect();
        let size = kept.len();
        let mut information = DMatrix::from_fn(size, size, |i, j| normal.information[(kept[i], kept[j])]);
        for slot in 0..size {
            information[(slot, slot)] *= 1.0 + 1e-9;
        }
        let Some(covariance) = information.cholesky().map(|own| own.inverse()) else { break };
        let lost = |slots: &[usize]| {
            let places: Vec<usize> =
                slots.iter().filter_map(|slot| kept.iter().position(|own| own == slot)).collect();
            let part =
                DMatrix::from_fn(places.len(), places.len(), |i, j| covariance[(places[i], places[j])]);
            let values = nalgebra::DVector::from_fn(places.len(), |i, _| away[kept[places[i]]]);
            if places.is_empty() || values.iter().any(|value| !value.is_finite()) {
                return f64::INFINITY;
            }
            part.cholesky().map_or(f64::INFINITY, |own| values.dot(&own.solve(&values)))
        };
        // What costs more than it gives, the least useful first; of forms the more, because there are many.
        let of_term = |&term: &usize| {
            let slots: Vec<usize> =
                (0..base.slots.len()).filter(|&slot| base.slots[slot].0 == term).collect();
            (lost(&slots) - slots.len() as f64 * price, Ok(term), slots)
        };
        let of_form = |&form: &usize| {
            let slots = vec![first_form + form];
            (lost(&slots) - 2.0 * price, Err(form), slots)
        };
        let least = terms.iter().map(of_term).chain(forms.iter().map(of_form));
        let least = least.filter(|own| own.0 < 0.0).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, which, slots)) = least else { break };
        match which {
            Ok(term) => {
                terms.remove(&term);
            }
            Err(form) => forms.retain(|own| *own != form),
        }
        // The others take over what it explained: what is away follows by the covariance.
        let places: Vec<usize> =
            slots.iter().filter_map(|slot| kept.iter().position(|own| own == slot)).collect();
        let part = DMatrix::from_fn(places.len(), places.len(), |i, j| covariance[(places[i], places[j])]);
        let values = nalgebra::DVector::from_fn(places.len(), |i, _| away[kept[places[i]]]);
        if let Some(solved) = part.cholesky().map(|own| own.solve(&values)) {
            for (place, &slot) in kept.iter().enumerate() {
                let change: f64 = (0..places.len()).map(|i| covariance[(place, places[i])] * solved[i]).sum();
                away[slot] -= change;
            }
        }
        for slot in slots {
            open.remove(&slot);
        }
    }
    let forms = forms.into_iter().map(|form| found.forms[form].clone()).collect();
    Needed { terms, forms, curves: found.curves.clone() }
}

#[cfg(test)]
mod tests {
    use pleiad_physics::Effect;

    use super::*;

    #[test]
    fn names_of_one_robot_that_share_a_channel_are_held_against_a_form() {
        let of = |effect: Effect, robot: u32| {
            let off = effect.info().parameters.iter().map(|parameter| parameter.off).collect();
            Term::new(effect, Whose::Robot(RobotId(robot)), off)
        };
        let terms = [
            of(Effect::WheelRadiusError, 1),
            of(Effect::SensorYawMisalignment, 1),
            of(Effect::TrackWidthError, 1),
            of(Effect::WheelRadiusError, 2),
        ];
        assert_eq!(joint(&terms, RobotId(1)), [0, 2]);
        assert_eq!(joint(&terms, RobotId(2)), Vec::<usize>::new());
    }
}

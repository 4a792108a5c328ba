//! What may be said of forms and curves: the rules of evidence of catalogue effects, and findings.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;

use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::fit::states;
use crate::diagnosis::held_out::{Gain, compared};
use crate::diagnosis::naming::{GAIN_ERRORS, NEAR_END, Z_95};
use crate::diagnosis::open::draw::{shown_curve, shown_form};
use crate::diagnosis::open::monomial::{Base, unit};
use crate::diagnosis::open::picture::{Folds, Picture, shift};
use crate::diagnosis::open::search::{Curve, Ground};
use crate::diagnosis::open::target::Target;
use crate::diagnosis::open::{Hypothesis, Opened};
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN};
use crate::diagnosis::unit::{Column, Unit};
use crate::findings::{Estimate, Finding, HeldOut, Place, Shape, Verdict};

/// A curve acts where it is larger than this share of its largest.
const ACTS: f64 = 0.5;

/// Every form and curve of a robot that obeys the rules; of the others, a note.
pub(crate) fn told(
    ground: &Ground<'_, '_>,
    held: &[&Unit<'_>],
    names: &[String],
    robot: RobotId,
    kept: &Hypothesis<'_, '_>,
    tests: usize,
) -> Opened {
    let mut all = Opened { notes: kept.notes.clone(), ..Opened::default() };
    let curves: usize = kept.curves.iter().map(|curve| curve.columns.len()).sum();
    let first = kept.picture.size() - curves - kept.forms.len();
    let mut at = first;
    for curve in &kept.curves {
        let positions: Vec<usize> = (at..at + curve.columns.len()).collect();
        at += positions.len();
        match of_curve(ground, robot, kept, curve, &positions, tests) {
            Ok(finding) => {
                all.found.push(shown_curve(ground, names, robot, kept, curve, &positions, finding));
            }
            Err(why) => all.notes.push(why),
        }
    }
    for (index, form) in kept.forms.iter().enumerate() {
        match of_form(ground, held, robot, kept, index, tests) {
            Ok(finding) => {
                let position = first + curves + index;
                all.found.push(shown_form(ground, names, robot, kept, form, position, finding));
            }
            Err(why) => all.notes.push(why),
        }
    }
    all
}

/// `left velocity += c v w`.
fn expression(target: Target, monomial: &crate::diagnosis::open::monomial::Monomial) -> String {
    let text = monomial.text();
    let times = if text == "1" { String::new() } else { format!(" {text}") };
    format!("{} += c{times}", target.words().0)
}

fn of_form(
    ground: &Ground<'_, '_>,
    held: &[&Unit<'_>],
    robot: RobotId,
    kept: &Hypothesis<'_, '_>,
    index: usize,
    tests: usize,
) -> Result<Finding, String> {
    let form = &kept.forms[index];
    let picture = &kept.picture;
    let position = picture.size() - kept.forms.len() + index;
    let text = expression(form.target, &form.monomial);
    let units = form.monomial.coefficient_unit(form.target.words().1);
    let value = picture.moved[position];
    let no = |why: &str| {
        Err(format!("robot {robot}: {text} (c = {value:.3e} {units}) is there, but {why}; it is no finding"))
    };
    let Some(score) = Ground::beside(picture, &kept.forms, index) else {
        return no("cannot be told from the rest");
    };
    let without = picture.without(&[position]);
    let ratio = 2.0 * (picture.log_likelihood() - without.log_likelihood()) / score.inflation.max(1.0);
    let p_familywise = (score.p.max(upper_tail(ratio, 1)) * tests as f64).min(1.0);
    let size = (value.abs() - NEAR_END * score.error) * ground.size(form.target, &form.columns);
    if p_familywise >= FAMILYWISE || ratio <= LEAST_GAIN {
        return no("not clear enough");
    }
    if size <= ground.bound(form.target, &ground.harmless(form.target), &form.columns) {
        return no("too small to matter");
    }
    let own: Vec<&Unit<'_>> = held.iter().copied().filter(|unit| unit.robot() == robot).collect();
    let gain = if own.is_empty() {
        picture.gain_over(&without, Folds::Spans)
    } else {
        on_held(ground, &own, kept, index).unwrap_or_default()
    };
    if gain.total <= GAIN_ERRORS * gain.standard_error {
        return no("of no use on data left out");
    }
    let mut support_set = vec![text.clone()];
    support_set.extend(form.equivalent.iter().map(|own| expression(form.target, own)));
    let ci95 = [value - Z_95 * score.error, value + Z_95 * score.error];
    let estimate = Estimate { value, unit: units.clone(), ci95 };
    Ok(Finding {
        verdict: if kept.short.contains(&form.target) { Verdict::Unnameable } else { Verdict::Form },
        expression_units: Some(units),
        support_set,
        parameters: BTreeMap::from([("c".to_owned(), estimate)]),
        expression: Some(text),
        p_familywise: p_familywise.max(f64::MIN_POSITIVE),
        held_out: held_out(gain),
        ..bare(robot, form.target, ground)
    })
}

fn held_out(gain: Gain) -> HeldOut {
    HeldOut { log_score_gain: gain.total, log_score_gain_se: gain.standard_error, rollout_rmse: Vec::new() }
}

fn bare(robot: RobotId, target: Target, ground: &Ground<'_, '_>) -> Finding {
    let main = ground.units.iter().find_map(|unit| Some(unit.stretches[target.main(unit)?.0].channel));
    Finding {
        verdict: Verdict::Unnameable,
        robots: vec![robot.0],
        stage: target.stage().to_owned(),
        channel: main.map_or("", |channel| channel.name()).to_owned(),
        effect: None,
        expression: None,
        expression_units: None,
        support_set: Vec::new(),
        parameters: BTreeMap::new(),
        place: Place::default(),
        p_familywise: 1.0,
        held_out: HeldOut::default(),
        shape: None,
        manoeuvre: None,
        summary: String::new(),
        equation: None,
        configuration: String::new(),
    }
}

/// The gain of a form on recordings that were not fitted on, beside the other forms.
fn on_held(
    ground: &Ground<'_, '_>,
    held: &[&Unit<'_>],
    kept: &Hypothesis<'_, '_>,
    index: usize,
) -> Option<Gain> {
    let picture = &kept.picture;
    let first = picture.size() - kept.forms.len();
    let own = Ground::new(held.to_vec(), &picture.terms, &[]);
    let mut with = states(held, &picture.terms)?;
    let mut last: Vec<Vec<f64>> = Vec::new();
    for (position, form) in kept.forms.iter().enumerate() {
        let columns = own.columns(form.target, &|at| form.monomial.value(at));
        for ((unit, state), column) in held.iter().zip(&mut with).zip(&columns) {
            let before = state.residuals.clone();
            shift(unit, column, picture.moved[first + position], &mut state.residuals);
            if position == index {
                last.push(before.iter().zip(&state.residuals).map(|(a, b)| a - b).collect());
            }
        }
    }
    let mut without = with.clone();
    for (state, change) in without.iter_mut().zip(&last) {
        for (residual, change) in state.residuals.iter_mut().zip(change) {
            *residual += change;
        }
    }
    for (unit, state) in held.iter().zip(with.iter_mut().chain(&mut without)) {
        state.noise = crate::diagnosis::noise::estimate(unit, &picture.terms, &state.residuals, None);
    }
    let _ = ground;
    Some(compared(held, &with, &without))
}

fn mains(ground: &Ground<'_, '_>, target: Target) -> Vec<Option<(usize, usize)>> {
    ground.units.iter().map(|unit| target.main(unit)).collect()
}

/// Adds a multiple of a column to another.
fn add(sum: &mut Column, own: &Column, times: f64) {
    for (sum, own) in sum.parts.iter_mut().zip(&own.parts) {
        let Some(own) = own else { continue };
        let sum = sum.get_or_insert_with(|| vec![0.0; own.len()]);
        for (sum, own) in sum.iter_mut().zip(own) {
            *sum += times * own;
        }
    }
}

/// The root mean square of the residuals of a target.
fn spread(ground: &Ground<'_, '_>, target: Target, picture: &Picture<'_, '_>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (unit, state) in ground.units.iter().zip(&picture.states) {
        let Some((which, component)) = target.main(unit) else { continue };
        let stretch = &unit.stretches[which];
        for row in stretch.range().skip(component).step_by(stretch.components) {
            let most = 10.0 * state.noise.sigma[row];
            if most.is_finite() {
                sum += state.residuals[row].abs().min(most).powi(2);
                count += 1;
            }
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

/// Whether what a curve explains is certainly more than what is harmless.
pub(crate) fn curve_matters(
    ground: &Ground<'_, '_>,
    curve: &Curve,
    (with, positions): (&Picture<'_, '_>, &[usize]),
    without: &Picture<'_, '_>,
) -> bool {
    let target = curve.target;
    let (share, error) = with.share_over(without, &mains(ground, target), curve.folds());
    let least = (share - NEAR_END * error).max(0.0).sqrt();
    let mut whole: Vec<Column> = ground.units.iter().map(|unit| Column::empty(unit)).collect();
    for (index, own) in whole.iter_mut().enumerate() {
        for &position in positions {
            add(own, &with.columns[index][position], with.moved[position]);
        }
    }
    least * spread(ground, target, without) > ground.bound(target, &ground.harmless(target), &whole)
}

fn of_curve(
    ground: &Ground<'_, '_>,
    robot: RobotId,
    kept: &Hypothesis<'_, '_>,
    curve: &Curve,
    positions: &[usize],
    tests: usize,
) -> Result<Finding, String> {
    let picture = &kept.picture;
    let (what, powers) = curve.target.words();
    let (regressor, regressor_powers) = curve.regressor.symbol();
    let no = |why: &str| {
        Err(format!(
            "robot {robot}: the {what} is off by a curve over {regressor}, but {why}; it is no finding"
        ))
    };
    let without = picture.without(positions);
    let gain = picture.gain_over(&without, curve.folds());
    if !curve_matters(ground, curve, (picture, positions), &without) {
        return no("too small to matter");
    }
    if gain.total <= GAIN_ERRORS * gain.standard_error {
        return no("of no use on data left out");
    }
    let (share, error) = picture.share_over(&without, &mains(ground, curve.target), curve.folds());
    let mut values = vec![0.0; curve.basis.knots.len()];
    let mut errors = vec![0.0; curve.basis.knots.len()];
    let bench = crate::diagnosis::open::bench::Bench::new(&without, curve.target);
    let together = bench.and_then(|bench| bench.score_together(&curve.all_columns(), 0.0));
    for (index, ((knot, _), &position)) in curve.columns.iter().zip(positions).enumerate() {
        values[*knot] = picture.moved[position];
        errors[*knot] = together.as_ref().map_or(f64::NAN, |own| own.covariance[(index, index)].sqrt());
    }
    let ci95 = [share - Z_95 * error, (share + Z_95 * error).min(1.0)];
    let share = Estimate { value: share, unit: "1".to_owned(), ci95 };
    let place = acts(ground, curve, &values);
    Ok(Finding {
        place,
        expression: Some(format!("{what} += f({regressor})")),
        expression_units: Some(unit(powers)),
        p_familywise: (curve.p * tests as f64).clamp(f64::MIN_POSITIVE, 1.0),
        held_out: held_out(gain),
        shape: Some(Shape {
            of: what.to_owned(),
            unit: unit(powers),
            regressor: regressor.to_owned(),
            regressor_unit: unit(regressor_powers),
            knots: curve.basis.knots.clone(),
            values,
            errors,
            residual_share: share,
        }),
        ..bare(robot, curve.target, ground)
    })
}

/// Where a curve is large: a span of time, a place, or a regime of its regressor.
fn acts(ground: &Ground<'_, '_>, curve: &Curve, values: &[f64]) -> Place {
    let knots = &curve.basis.knots;
    let most = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let large = || knots.iter().zip(values).filter(|(_, value)| value.abs() >= ACTS * most);
    let from = large().next().map_or(knots[0], |(knot, _)| *knot);
    let to = large().next_back().map_or(knots[knots.len() - 1], |(knot, _)| *knot);
    let extent = |base: Base| {
        let each = ground.units.iter().zip(&ground.motions);
        let all = each.flat_map(|(unit, motions)| curve.target.instants(unit, motions));
        let known = all.map(|at| at.get(base)).filter(|value| value.is_finite());
        known.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
            [least.min(value), most.max(value)]
        })
    };
    let mut place = Place::default();
    match curve.regressor {
        Base::Time => place.time = vec![[from, to]],
        Base::X => {
            let [least, most] = extent(Base::Y);
            place.region_m = Some([from, to, least, most]);
        }
        Base::Y => {
            let [least, most] = extent(Base::X);
            place.region_m = Some([least, most, from, to]);
        }
        _ => {
            let (name, powers) = curve.regressor.symbol();
            place.regime = format!("{name} from {from:.3} to {to:.3} {}", unit(powers));
        }
    }
    place
}

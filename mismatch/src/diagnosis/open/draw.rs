//! What shows a form or a curve: partial residuals, and residuals over what it depends on.

use pleiad_estimation::RobotId;

use crate::diagnosis::open::monomial::{Base, Instant, unit};
use crate::diagnosis::open::picture::{Picture, shift};
use crate::diagnosis::open::search::{Curve, Form, Ground};
use crate::diagnosis::open::target::Target;
use crate::diagnosis::open::{Hypothesis, Unnamed};
use crate::diagnosis::series::gain_over_time;
use crate::diagnosis::unit::Column;
use crate::findings::Finding;
use crate::view::{PartialResidual, ShapePlot};

/// Points of a curve that is drawn.
const POINTS: usize = 120;

/// What is left without a finding, and what it predicts, in the component that shows it most.
fn partial(
    ground: &Ground<'_, '_>,
    names: &[String],
    robot: RobotId,
    target: Target,
    with: &Picture<'_, '_>,
    columns: &[(f64, &Vec<Column>)],
) -> Vec<PartialResidual> {
    let mut all = Vec::new();
    for (index, unit) in ground.units.iter().enumerate() {
        let Some((which, component)) = target.main(unit) else { continue };
        let stretch = &unit.stretches[which];
        let rows = || stretch.range().skip(component).step_by(stretch.components);
        let mut bare = with.states[index].clone();
        for (coefficient, own) in columns {
            shift(unit, &own[index], -coefficient, &mut bare.residuals);
        }
        all.push(PartialResidual {
            finding: 0,
            recording: names.get(unit.recording).cloned().unwrap_or_default(),
            robot: robot.0,
            channel: stretch.channel,
            component,
            time_s: rows().map(|row| unit.rows[row].time_s).collect(),
            predicted: rows().map(|row| bare.residuals[row] - with.states[index].residuals[row]).collect(),
            residual: rows().map(|row| bare.residuals[row]).collect(),
            gain: gain_over_time(unit, &with.states[index], &bare),
        });
    }
    all
}

pub(crate) fn shown_form(
    ground: &Ground<'_, '_>,
    names: &[String],
    robot: RobotId,
    kept: &Hypothesis<'_, '_>,
    form: &Form,
    position: usize,
    finding: Finding,
) -> Unnamed {
    let value = kept.picture.moved[position];
    let partial = partial(ground, names, robot, form.target, &kept.picture, &[(value, &form.columns)]);
    // Over its regressor if it has only one.
    let mut bases: Vec<Base> = form.monomial.0.iter().map(|factor| factor.0).collect();
    bases.dedup();
    let shapes = match bases[..] {
        [base] => drawn(ground, form.target, base, &partial, &|x| {
            value * form.monomial.value(&Instant::of(&[(base, x)]))
        }),
        _ => Vec::new(),
    };
    Unnamed { target: form.target, finding, partial, shapes }
}

pub(crate) fn shown_curve(
    ground: &Ground<'_, '_>,
    names: &[String],
    robot: RobotId,
    kept: &Hypothesis<'_, '_>,
    curve: &Curve,
    positions: &[usize],
    finding: Finding,
) -> Unnamed {
    let values: Vec<f64> = positions.iter().map(|&position| kept.picture.moved[position]).collect();
    let columns: Vec<(f64, &Vec<Column>)> =
        values.iter().copied().zip(curve.columns.iter().map(|(_, columns)| columns)).collect();
    let partial = partial(ground, names, robot, curve.target, &kept.picture, &columns);
    let shapes = drawn(ground, curve.target, curve.regressor, &partial, &|x| {
        curve.columns.iter().zip(&values).map(|((knot, _), value)| value * curve.basis.value(*knot, x)).sum()
    });
    Unnamed { target: curve.target, finding, partial, shapes }
}

/// Residuals over a regressor, with what a function of it predicts of them.
fn drawn(
    ground: &Ground<'_, '_>,
    target: Target,
    base: Base,
    partial: &[PartialResidual],
    function: &dyn Fn(f64) -> f64,
) -> Vec<ShapePlot> {
    let mut all = Vec::new();
    let recorded = ground.units.iter().zip(&ground.motions).filter(|(unit, _)| target.is_recorded(unit));
    for ((unit_of, motions), own) in recorded.zip(partial) {
        let x: Vec<f64> = target.instants(unit_of, motions).iter().map(|at| at.get(base)).collect();
        let known = || x.iter().copied().filter(|x| x.is_finite());
        let (least, greatest) =
            (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
        if x.len() != own.residual.len() || least >= greatest {
            continue;
        }
        // From a rate to what it adds up to over a row.
        let (mut product, mut square) = (0.0, 0.0);
        for (x, predicted) in x.iter().zip(&own.predicted).filter(|(x, _)| x.is_finite()) {
            product += function(*x) * predicted;
            square += function(*x).powi(2);
        }
        let scale = if square > 0.0 { product / square } else { 0.0 };
        let curve = (0..=POINTS).map(|index| {
            let x = least + (greatest - least) * index as f64 / POINTS as f64;
            [x, scale * function(x)]
        });
        let (name, powers) = base.symbol();
        all.push(ShapePlot {
            finding: 0,
            recording: own.recording.clone(),
            robot: own.robot,
            channel: own.channel,
            component: own.component,
            regressor: name.to_owned(),
            regressor_unit: unit(powers),
            curve: curve.collect(),
            x,
            residual: own.residual.clone(),
        });
    }
    all
}

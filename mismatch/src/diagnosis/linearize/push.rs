//! Derivatives by pushes. A push shows in the windows around its instant and in no other, and what the body remembers
//! from window to window knows nothing of it: the wheels did not notice.

use pleiad_physics::{Dual, Effect, Scalar, Variable};

use crate::channel::Channel;
use crate::diagnosis::linearize::Request;
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Unit, Values};
use crate::{body, gyro};

/// The most parameters of a push that are differentiated by.
const MOST: usize = 3;

/// Whether pushes beside these terms may be looked at in a stretch window by window. A reading of another channel may
/// be carried past any instant, and where a robot was pushed already, that push is split with this.
pub(super) fn is_local(unit: &Unit<'_>, terms: &[Term], which: usize) -> bool {
    let stretch = &unit.stretches[which];
    let robot = unit.members[stretch.member].robot;
    let windows = unit.evidence.prepared(robot).map(|(_, plans)| match stretch.channel {
        Channel::Body => plans.body.items.len(),
        Channel::Gyro => plans.gyro.items.len(),
        _ => 0,
    });
    windows == Some(stretch.rows)
        && !terms.iter().any(|term| term.effect == Effect::Push && term.acts_on(robot))
}

/// The derivatives of a stretch by the parameters of each push, which are in its request.
pub(super) fn slopes(unit: &Unit<'_>, terms: &[Term], requests: &[&Request], which: usize) -> Vec<Values> {
    let stretch = &unit.stretches[which];
    let member = &unit.members[stretch.member];
    let Some((track, plans)) = unit.evidence.prepared(member.robot) else { return Vec::new() };
    let model = member.model(terms);
    let begun = match stretch.channel {
        Channel::Body => body::begun(track, &plans.body, &model),
        _ => gyro::begun(&plans.gyro, &model),
    };
    let index = model.effects.len();
    let one = |request: &&Request| {
        let Some(&push_s) = request.term.values.first() else { return Vec::new() };
        let mut variables = [Variable::Effect { index: usize::MAX, parameter: 0 }; MOST];
        for (variable, &parameter) in variables.iter_mut().zip(&request.along) {
            *variable = Variable::Effect { index, parameter };
        }
        let pushed = model.clone().with(request.term.active()).differentiated::<MOST>(&variables);
        let mut parts = vec![vec![0.0; stretch.rows * stretch.components]; request.along.len()];
        let mut put = |row: usize, values: &[Dual<MOST>]| {
            for (component, value) in values.iter().enumerate() {
                for (part, slope) in parts.iter_mut().zip(value.derivatives()) {
                    let shows = value.value().is_finite();
                    part[row * stretch.components + component] = if shows { *slope } else { f64::NAN };
                }
            }
        };
        if stretch.channel == Channel::Body {
            for (row, values) in body::around(track, &plans.body, &begun, &pushed, push_s) {
                put(row, &values);
            }
        } else {
            for (row, values) in gyro::around(&plans.gyro, &begun, &pushed, push_s) {
                put(row, &values);
            }
        }
        let shows = |part: &Vec<f64>| {
            part.iter().all(|value| value.is_finite()) && part.iter().any(|value| *value != 0.0)
        };
        parts.into_iter().map(|part| shows(&part).then_some(part)).collect()
    };
    requests.iter().map(one).collect()
}

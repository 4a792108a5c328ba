//! Commands that are executed at random times, or not at all.
//!
//! A command that changes the set-point by `du` and acts `d` later than expected turns the wheel in a window
//! by `F(d)` more than predicted: for a first-order servo a closed form. Over the commands `k` of a window
//!
//! ```text
//! residual = m F'(0) + sum of F_k(d_k) + white noise of Student's t
//! jitter: d_k ~ U(0, D), so F' has the variance (J^2 + D^2)/12 F'_k(0)^2, J the declared jitter
//! loss: with probability p, d_k is the time to the next command; at most two of a window
//! ```
//!
//! `m` is a delay left over by the fit of the mean, and the tails of the noise are estimated: a window that the
//! model of the servo does not fit is not an execution gone wrong. `du` is what the set-point hooks of the
//! fitted effects make of a command. Windows that share a command are taken as independent
//! given it; variances are summed over blocks.

use pleiad_physics::chain::actuator::Command;
use pleiad_physics::signal::{SetPoint, WheelSetPoint};
use pleiad_physics::{Context, Effect, Motion, Pose, RobotModel};

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::NEAR_END;
use crate::diagnosis::spread::Explained;
use crate::diagnosis::spread::family::{Family, Member, Place, Shown, Shows, blocks};
use crate::diagnosis::spread::maximum::Bounds;
use crate::diagnosis::spread::timing::{DELAY, JITTER, LOSS, NEVER, NOISE, Row, TAILS, Windows};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;
use crate::track::{Track, motion};

/// Of this many commands of a window it is asked whether they were lost.
const ASKED: usize = 8;
/// After this many time constants a command's delay no longer shows.
const MEMORY: f64 = 6.0;
/// A step between commands beyond this is a gap and no loss, seconds.
const GAP_S: f64 = 0.5;
/// A change of the set-point that an effect alters by more than this share is bent.
const BENT: f64 = 0.3;
/// A lost command must change a window by this share of its noise.
const LEAST_CHANGE: f64 = 0.3;
/// The wheels of one robot against its commands, under a fit of the mean.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit) -> Option<Family<'u, 'a>> {
    let mut rows = Vec::new();
    let mut places = Vec::new();
    for (position, unit) in units.iter().enumerate() {
        let model = unit.model(&fit.terms);
        let values = unit.values(&fit.terms, &|channel| channel == Channel::Actuator);
        let Some(values) = values.into_iter().flatten().next() else { continue };
        collect(position, unit, &model, &values, &mut rows, &mut places);
    }
    let mut spreads = [0, 1].map(|part: usize| {
        let mut sizes: Vec<f64> = rows.iter().map(|row: &Row| row.residual[part].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
    });
    // Without noise there is nothing to weigh a residual against.
    for spread in &mut spreads {
        *spread = spread.max(1e-6);
    }
    if rows.is_empty() {
        return None;
    }
    for row in &mut rows {
        let size = |changes: &[f64; 2]| (changes[0] / spreads[0]).hypot(changes[1] / spreads[1]);
        row.lost.retain(|changes| size(changes) > LEAST_CHANGE);
        row.lost.sort_by(|a, b| size(b).total_cmp(&size(a)));
        row.lost.truncate(ASKED);
    }
    let (_, most_s) = Effect::CommandJitter.info().parameters[0].plausible;
    let around = |value: f64| Bounds { low: value.ln() - 8.0, high: value.ln() + 8.0, scale: 0.1 };
    let bounds = vec![
        around(spreads[0]),
        around(spreads[1]),
        Bounds { low: -0.2, high: 0.2, scale: 1e-3 },
        Bounds { low: 0.0, high: most_s * most_s, scale: 1e-4 },
        Bounds { low: NEVER, high: -0.7, scale: 0.3 },
        Bounds { low: 0.0, high: 0.5, scale: 0.05 },
    ];
    let mut members = vec![Member {
        effect: Effect::CommandJitter,
        parameters: vec![JITTER],
        off: vec![0.0],
        start: vec![1e-4],
        shown: vec![Shown::Root(JITTER)],
        contrasts: Vec::new(),
        chances: None,
    }];
    // A command shows in about two windows.
    let asked = rows.iter().map(|row| row.lost.len()).sum::<usize>().div_ceil(2);
    if asked > 0 {
        members.push(Member {
            effect: Effect::CommandLoss,
            parameters: vec![LOSS],
            off: vec![f64::NEG_INFINITY],
            start: vec![-3.5],
            shown: vec![Shown::Exp(LOSS)],
            contrasts: Vec::new(),
            chances: Some(asked),
        });
    }
    Some(Family {
        density: Box::new(Windows { blocks: blocks(units, &places), rows }),
        units: units.to_vec(),
        places,
        bounds,
        start: vec![spreads[0].ln(), spreads[1].ln(), 0.0, 0.0, f64::NEG_INFINITY, 0.05],
        nuisances: vec![NOISE, NOISE + 1, DELAY, TAILS],
        members,
    })
}

/// A change of the set-point: when it acts, by how much, and how late it would be if it were lost.
struct Change {
    acts_s: f64,
    /// Of the wheels' mean, and of right minus left, rad/s.
    by: [f64; 2],
    late_s: Option<f64>,
    /// A limit or a dead band changes it: when exactly a set-point leaves that, no fit knows well enough.
    bent: bool,
}

fn collect(
    position: usize,
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    values: &[f64],
    rows: &mut Vec<Row>,
    places: &mut Vec<Place>,
) {
    let Some((track, plans)) = unit.evidence.prepared(unit.robot()) else { return };
    let measured: Vec<_> = plans.actuator.items.iter().filter(|item| item.measured.is_some()).collect();
    if measured.len() * 2 != values.len() {
        return;
    }
    let (constants_s, latency_s) = servo(model);
    let changes = changes(unit, track, model, latency_s);
    let memory_s = MEMORY * constants_s[0].max(constants_s[1]) + GAP_S;
    let declared = unit.evidence.recording.nominal.as_ref();
    let declared_jitter_s = declared.map_or(0.0, |nominal| nominal.noise.command_jitter_s);
    for (item, residual) in measured.into_iter().zip(values.chunks_exact(2)) {
        let (from_s, to_s) = (item.window.from_s, item.window.to_s);
        let first = changes.partition_point(|change| change.acts_s < from_s - memory_s);
        let past = changes.partition_point(|change| change.acts_s < to_s);
        let mut row = Row {
            residual: [residual[0], residual[1]],
            delayed: [0.0; 2],
            agitation: [0.0; 2],
            lost: Vec::new(),
            declared_jitter_s,
            time_s: f64::midpoint(from_s, to_s),
        };
        if changes[first..past].iter().any(|change| change.bent) {
            continue;
        }
        for change in &changes[first..past] {
            let (begun_s, ended_s) = (from_s - change.acts_s, to_s - change.acts_s);
            let delayed = [0, 1].map(|part: usize| {
                let reached = |since_s| reached(since_s, constants_s[part]);
                -change.by[part] * (reached(ended_s) - reached(begun_s))
            });
            for (part, change) in delayed.into_iter().enumerate() {
                row.delayed[part] += change;
                row.agitation[part] += change * change;
            }
            if let Some(late_s) = change.late_s {
                row.lost.push([0, 1].map(|part: usize| {
                    let turned = |since_s| turned(since_s, constants_s[part]);
                    let late = turned(ended_s - late_s) - turned(begun_s - late_s);
                    change.by[part] * (late - turned(ended_s) + turned(begun_s))
                }));
            }
        }
        rows.push(row);
        places.push(Place {
            unit: position,
            time_s: f64::midpoint(from_s, to_s),
            channel: Channel::Actuator,
        });
    }
}

/// Time constants of mean and difference, and the delay of commands, that a model gives its servo.
fn servo(model: &RobotModel<f64>) -> ([f64; 2], f64) {
    let nominal = &model.nominal;
    let sum = |effect: Effect| -> f64 {
        model.effects.iter().filter(|own| own.effect() == effect).map(|own| own.values()[0]).sum()
    };
    let lag_s = sum(Effect::ActuatorLag);
    let constants_s = [nominal.servo_time_constant_s, nominal.servo_time_constant_turn_s];
    let delay_s = nominal.command_latency_s + sum(Effect::CommandDelay) + 0.5 * sum(Effect::CommandJitter);
    (constants_s.map(|constant_s| (constant_s + lag_s).max(1e-4)), delay_s)
}

fn changes(unit: &Unit<'_>, track: &Track, model: &RobotModel<f64>, latency_s: f64) -> Vec<Change> {
    let recorded = unit.evidence.robot(unit.robot()).map_or(&[][..], |(recording, _)| &recording.commands);
    let stamps: Vec<f64> = recorded.iter().map(|command| unit.evidence.seconds(command.time)).collect();
    let targets = |model: &RobotModel<f64>| -> Vec<[f64; 2]> {
        track.commands.iter().map(|command| target(track, model, command, latency_s)).collect()
    };
    let (targets, plain) = (targets(model), targets(unit.nominal()));
    let change = |index: usize| {
        let time_s = track.commands[index].time_s;
        let next = stamps.partition_point(|stamp_s| *stamp_s <= time_s);
        let by =
            |targets: &[[f64; 2]]| [0, 1].map(|part: usize| targets[index][part] - targets[index - 1][part]);
        let (by, plain) = (by(&targets), by(&plain));
        let size = |by: [f64; 2]| by[0].hypot(0.5 * by[1]);
        Change {
            acts_s: time_s + latency_s,
            bent: size([by[0] - plain[0], by[1] - plain[1]]) > BENT * size(plain),
            by,
            late_s: stamps.get(next).map(|next_s| next_s - time_s).filter(|late_s| *late_s < GAP_S),
        }
    };
    (1..track.commands.len()).map(change).collect()
}

/// What a command asks of the wheels under a model: their mean, and right minus left, rad/s.
fn target(track: &Track, model: &RobotModel<f64>, command: &Command, latency_s: f64) -> [f64; 2] {
    let time_s = command.time_s + latency_s;
    let mut context = Context::new(&model.nominal, time_s, Motion::at_rest(Pose::identity()));
    if let Some(regime) = track.regime_at(time_s) {
        context.motion = motion(&regime, regime.pose.unwrap_or(Pose::identity()));
    }
    let mut asked = SetPoint { speed_m_s: command.speed_m_s, yaw_rate_rad_s: command.yaw_rate_rad_s };
    model.apply(&context, |effect, values| effect.set_point(values, &context, &mut asked));
    let [radius_m, axle_m] = track.geometry_m;
    let turn_m_s = 0.5 * axle_m * asked.yaw_rate_rad_s;
    let speed_rad_s = [asked.speed_m_s - turn_m_s, asked.speed_m_s + turn_m_s].map(|rim| rim / radius_m);
    let mut wheels = WheelSetPoint { speed_rad_s };
    model.apply(&context, |effect, values| effect.wheel_set_point(values, &context, &mut wheels));
    let [left, right] = wheels.speed_rad_s;
    [f64::midpoint(left, right), right - left]
}

/// What share of a step a servo has reached after a time.
fn reached(since_s: f64, constant_s: f64) -> f64 {
    if since_s > 0.0 { -libm::expm1(-since_s / constant_s) } else { 0.0 }
}

/// The time integral of the same, seconds.
fn turned(since_s: f64, constant_s: f64) -> f64 {
    if since_s > 0.0 { since_s - constant_s * reached(since_s, constant_s) } else { 0.0 }
}

/// What a random timing explains of a delay in the mean: a jitter its half, a loss what it delays on average,
/// which the likelihood has told apart.
pub(super) fn explained(family: &Family<'_, '_>, shows: &Shows, by: Effect, fit: &Fit) -> Vec<Explained> {
    let parameters = &shows.with.parameters;
    let jitter_s = parameters[JITTER].sqrt();
    let half_s = if by == Effect::CommandJitter { 0.5 * jitter_s } else { 0.0 };
    let variance = |index: usize| shows.known.between(index, index).unwrap_or(0.0);
    let half_error_s = if half_s > 0.0 { 0.25 * variance(JITTER).sqrt() / jitter_s } else { 0.0 };
    let error_s = variance(DELAY).sqrt().hypot(half_error_s);
    let own =
        |term: &Term| term.effect == Effect::CommandDelay && family.units.iter().all(|unit| unit.has(term));
    let floors = family.units.first().map(|unit| unit.members[0].floors).unwrap_or_default();
    let judged = |(position, term): (usize, &Term)| {
        let left_s = term.values[0] + parameters[DELAY] - half_s;
        let threshold_s = term.parameters()[0].relevance.threshold(&floors);
        let remains = left_s.abs() - NEAR_END * error_s > threshold_s;
        Explained { position, by, part: remains.then_some(term.values[0] - left_s) }
    };
    fit.terms.iter().enumerate().filter(|(_, term)| own(term)).map(judged).collect()
}

#[cfg(test)]
mod tests {
    use pleiad_physics::chain::actuator::{ActuatorState, schedule};
    use pleiad_physics::predict::{CommandWindow, wheel_turns};
    use pleiad_physics::{Chance, Drive, Nominal, Surroundings};

    use super::*;

    /// The turn of both wheels' mean from `from_s` to `to_s` when a set-point comes at this time.
    fn driven(comes_s: f64, from_s: f64, to_s: f64) -> f64 {
        let mut nominal = Nominal::ideal(0.05, 0.3);
        nominal.servo_time_constant_s = 0.08;
        let model = RobotModel::nominal(Drive::Differential, nominal);
        let command = |time_s, speed_m_s| Command { time_s, speed_m_s, yaw_rate_rad_s: 0.0 };
        let commands = [command(0.0, 0.2), command(comes_s, 0.5)];
        let scheduled = schedule(&model, &commands, |_| Chance::EXPECTED);
        let mut state = ActuatorState::default();
        let mut turn = |from_s, to_s| {
            let motion = Motion::at_rest(Pose::identity());
            let window = CommandWindow { from_s, to_s, motion, surroundings: Surroundings::default() };
            let [left, right] = wheel_turns(&model, &scheduled, &window, &mut state);
            f64::midpoint(left, right)
        };
        turn(0.0, from_s);
        turn(from_s, to_s)
    }

    #[test]
    fn a_late_command_turns_the_wheel_by_the_closed_form_less() {
        let by_rad_s = (0.5 - 0.2) / 0.05;
        let window = (1.0, 1.2);
        for (comes_s, late_s) in [(0.9, 0.04), (1.05, 0.04), (1.18, 0.04), (0.97, 0.1)] {
            let simulated =
                driven(comes_s + late_s, window.0, window.1) - driven(comes_s, window.0, window.1);
            let change = |late_s: f64| {
                let at = |end_s: f64| turned(end_s - comes_s - late_s, 0.08);
                by_rad_s * (at(window.1) - at(window.0))
            };
            let closed = change(late_s) - change(0.0);
            assert!((simulated - closed).abs() < 1e-12, "{comes_s} {late_s}: {simulated} {closed}");
            assert!(closed < -1e-3, "it shows");
            // The slope with the delay is minus what the servo reaches in the window.
            let slope = -by_rad_s * (reached(1.2 - comes_s, 0.08) - reached(1.0 - comes_s, 0.08));
            let step = 1e-6;
            assert!((slope - (change(step) - change(-step)) / (2.0 * step)).abs() < 1e-4);
        }
    }
}

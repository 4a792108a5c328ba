//! Commands that are executed at random times, or not at all.
//!
//! A command that changes the set-point by `du` and acts `d` later than expected turns the wheel in a window
//! by `F(d)` more than predicted: for a first-order servo a closed form. Over the commands `k` of a window
//!
//! ```text
//! residual = m F'(0) + sum of F_k(d_k) + white noise
//! jitter: d_k ~ U(0, D), so F' has the variance (J^2 + D^2)/12 F'_k(0)^2, J the declared jitter
//! loss: with probability p, d_k is the time to the next command; at most two of a window
//! ```
//!
//! `m` is a delay left over by the fit of the mean. Windows that share a command are taken as independent
//! given it; variances are summed over blocks.

use pleiad_physics::chain::actuator::Command;
use pleiad_physics::{Effect, RobotModel};

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::NEAR_END;
use crate::diagnosis::spread::Explained;
use crate::diagnosis::spread::density::{bounded, log_sum};
use crate::diagnosis::spread::family::{Family, Member, Place, Shown, Shows, blocks};
use crate::diagnosis::spread::maximum::{Bounds, Density};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;

/// Logarithms of the white noise of both components.
const NOISE: usize = 0;
/// A delay of all commands, seconds.
const DELAY: usize = 2;
/// The square of the jitter's greatest delay.
const JITTER: usize = 3;
/// The logarithm of the probability of a loss.
const LOSS: usize = 4;
/// Of this many commands of a window it is asked whether they were lost.
const ASKED: usize = 8;
/// After this many time constants a command's delay no longer shows.
const MEMORY: f64 = 6.0;
/// A step between commands beyond this is a gap and no loss, seconds.
const GAP_S: f64 = 0.5;
/// A lost command must change a window by this share of its noise.
const LEAST_CHANGE: f64 = 0.3;
/// The logarithm of a probability that is as good as zero.
const NEVER: f64 = -14.0;

/// One window of the wheels: their mean, and right minus left.
struct Row {
    residual: [f64; 2],
    /// Change with a delay of every command, rad/s.
    delayed: [f64; 2],
    /// The sum of the squares of the same, command by command.
    agitation: [f64; 2],
    /// What each of the commands asked for changes if it is lost.
    lost: Vec<[f64; 2]>,
    declared_jitter_s: f64,
}

struct Windows {
    rows: Vec<Row>,
    blocks: Vec<usize>,
}

impl Density for Windows {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        let white = [0, 1].map(|component| libm::exp(2.0 * parameters[NOISE + component]));
        let lost = parameters[LOSS];
        let kept = libm::log1p(-libm::exp(lost));
        for (row, value) in self.rows.iter().zip(into) {
            let jitter = (parameters[JITTER] + row.declared_jitter_s.powi(2)) / 12.0;
            let sigma = [0, 1].map(|part: usize| (white[part] + jitter * row.agitation[part]).sqrt());
            let of = |changes: [f64; 2]| -> f64 {
                let part = |part: usize| {
                    let expected = parameters[DELAY] * row.delayed[part] + changes[part];
                    bounded((row.residual[part] - expected) / sigma[part], sigma[part])
                };
                part(0) + part(1)
            };
            *value = of([0.0; 2]);
            if lost == f64::NEG_INFINITY || row.lost.is_empty() {
                continue;
            }
            let count = row.lost.len() as f64;
            let mut sum = *value + count * kept;
            for (index, one) in row.lost.iter().enumerate() {
                sum = log_sum(sum, of(*one) + lost + (count - 1.0) * kept);
                for other in &row.lost[..index] {
                    let both = [one[0] + other[0], one[1] + other[1]];
                    sum = log_sum(sum, of(both) + 2.0 * lost + (count - 2.0) * kept);
                }
            }
            *value = sum;
        }
    }
}

/// The wheels of one robot against its commands, under a fit of the mean.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit) -> Option<Family<'u, 'a>> {
    let mut rows = Vec::new();
    let mut places = Vec::new();
    for (position, unit) in units.iter().enumerate() {
        let model = unit.model(&fit.terms);
        let values = unit.values(&model, &|channel| channel == Channel::Actuator);
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
    let asked = rows.iter().filter(|row| !row.lost.is_empty()).count();
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
        start: vec![spreads[0].ln(), spreads[1].ln(), 0.0, 0.0, f64::NEG_INFINITY],
        nuisances: vec![NOISE, NOISE + 1, DELAY],
        members,
    })
}

/// A change of the set-point: when it acts, by how much, and how late it would be if it were lost.
struct Change {
    acts_s: f64,
    /// Of the wheels' mean, and of right minus left, rad/s.
    by: [f64; 2],
    late_s: Option<f64>,
}

fn collect(
    position: usize,
    unit: &Unit<'_>,
    model: &RobotModel<f64>,
    values: &[f64],
    rows: &mut Vec<Row>,
    places: &mut Vec<Place>,
) {
    let Some((track, plans)) = unit.evidence.prepared(unit.robot) else { return };
    let measured: Vec<_> = plans.actuator.items.iter().filter(|item| item.measured.is_some()).collect();
    if measured.len() * 2 != values.len() {
        return;
    }
    let (constants_s, latency_s) = servo(model);
    let changes = changes(unit, &track.commands, track.geometry_m, latency_s);
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
        };
        for change in &changes[first..past] {
            let (begun_s, ended_s) = (from_s - change.acts_s, to_s - change.acts_s);
            let delayed = [0, 1].map(|part: usize| {
                let reached = |since_s| reached(since_s, constants_s[part]);
                -change.by[part] * (reached(ended_s) - reached(begun_s))
            });
            for ((sum, agitation), delayed) in row.delayed.iter_mut().zip(&mut row.agitation).zip(delayed) {
                *sum += delayed;
                *agitation += delayed * delayed;
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

fn changes(
    unit: &Unit<'_>,
    commands: &[Command],
    [radius_m, axle_m]: [f64; 2],
    latency_s: f64,
) -> Vec<Change> {
    let recorded = unit.evidence.robot(unit.robot).map_or(&[][..], |(recording, _)| &recording.commands);
    let stamps: Vec<f64> = recorded.iter().map(|command| unit.evidence.seconds(command.time)).collect();
    let change = |pair: &[Command]| {
        let time_s = pair[1].time_s;
        let next = stamps.partition_point(|stamp_s| *stamp_s <= time_s);
        Change {
            acts_s: time_s + latency_s,
            by: [
                (pair[1].speed_m_s - pair[0].speed_m_s) / radius_m,
                (pair[1].yaw_rate_rad_s - pair[0].yaw_rate_rad_s) * axle_m / radius_m,
            ],
            late_s: stamps.get(next).map(|next_s| next_s - time_s).filter(|late_s| *late_s < GAP_S),
        }
    };
    commands.windows(2).map(change).collect()
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
    let own = |term: &Term| {
        term.effect == Effect::CommandDelay && family.units.iter().all(|unit| term.acts_on(unit.robot))
    };
    let floors = family.units.first().map(|unit| unit.floors).unwrap_or_default();
    let judged = |(position, term): (usize, &Term)| {
        let left_s = term.values[0] + parameters[DELAY] - half_s;
        let threshold_s = term.parameters()[0].relevance.threshold(&floors);
        let remains = left_s.abs() - NEAR_END * error_s > threshold_s;
        Explained { position, by, part: remains.then_some(term.values[0] - left_s) }
    };
    fit.terms.iter().enumerate().filter(|(_, term)| own(term)).map(judged).collect()
}

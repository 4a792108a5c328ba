//! Facts folded together: a stretch of the ledger, linearized where all of it says that the robots were.
//!
//! The extended Kalman filter linearizes each measurement where the ones before it put the robots, and never comes back
//! to it. Facts are raw, so that it can: a forward pass as ever, a backward pass that takes what came later to the points
//! of linearization (the adjoint form of the smoother, `bierman1973`), and forward again, linearized there. Repeated, that
//! is Gauss-Newton on all of the stretch (`bell1994`). The last forward pass is the estimate.
//!
//! Errors stay what they are in the fold: of the true correction from the one that is linearized at, `G = exp(xi) G_bar`.
//! So a motion common to the team stays in the null space of every relative measurement, wherever each of them is
//! linearized.

use crate::fold::{
    DEFAULT_GATE, Fact, FactKey, FoldConfig, Outcome, Residual, SkipReason, Taken, across, fold, linearize,
    taken,
};
use crate::geometry::{Matrix3, Vector3};
use crate::joint::{Block, ErrorForm, Joint, Member, Participant, Prepared};
use crate::measurement::{self, Linearization};
use crate::{Pose2, Timestamp, fact::Quantity};

/// How facts are linearized together.
///
/// Time is cut into blocks. Each is folded once, linearized where its facts and those of the time ahead say that the robots
/// were, and then the joint at its end is the prior of the next. A team that closes its past looks no further ahead than the
/// next time at which it may be closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Relinearization {
    /// Length of a block, ns.
    pub block_ns: i64,
    /// How far beyond a block its facts are smoothed, ns.
    pub ahead_ns: i64,
    /// Passes over the facts of a block, the last of them included; 1 is the extended Kalman filter.
    pub passes: u32,
    /// Distance of the times beyond which no block looks, ns, a multiple of the length of a block; 0 if there are none.
    pub cell_ns: i64,
}

impl Relinearization {
    /// The block that a time is in, as the times it begins after and ends at, and how far it looks.
    fn block_of(&self, time: Timestamp) -> (Timestamp, Timestamp, Timestamp) {
        let before = |length: i64| {
            let last = time.0.saturating_sub(1);
            last.saturating_sub(last.rem_euclid(length.max(1)))
        };
        let start = before(self.block_ns);
        let edge =
            if self.cell_ns > 0 { before(self.cell_ns).saturating_add(self.cell_ns) } else { i64::MAX };
        let end = start.saturating_add(self.block_ns).min(edge);
        (Timestamp(start), Timestamp(end), Timestamp(end.saturating_add(self.ahead_ns).min(edge)))
    }
}

/// A measurement that fits nothing keeps so much of its weight, so that its noise is a number.
const LEAST_WEIGHT: f64 = 1e-9;

/// What is told of every fact that is folded: which, what became of it, and the joint after it.
pub(crate) type Told<'a> = dyn FnMut(usize, Residual, &dyn Fn() -> Joint) + 'a;

/// Folds `facts`, which must be in the order of their keys and all of later blocks than those in `joint`, block by block.
/// `ended` is told the joint at the end of each; facts that come later may yet move where its facts are linearized, up to as
/// far ahead as it looks.
pub(crate) fn fold_blocks(
    joint: &mut Joint,
    config: &FoldConfig,
    how: &Relinearization,
    facts: &[(FactKey, Fact)],
    ended: &mut dyn FnMut(Timestamp, &Joint),
    told: &mut Told<'_>,
) {
    let mut from = 0;
    while let Some((first, _)) = facts.get(from) {
        let (_, end, ahead) = how.block_of(first.time);
        let until = |time: Timestamp| from + facts[from..].partition_point(|(key, _)| key.time <= time);
        let (block, seen) = (until(end), until(ahead));
        let mut shifted = |index: usize, residual, now: &dyn Fn() -> Joint| told(from + index, residual, now);
        fold_window(joint, (config, how), &facts[from..seen], block - from, &mut shifted);
        ended(end, joint);
        from = block;
    }
}

/// Folds the first `count` of `facts`, each linearized where `passes` passes over all of them say that the robots were; with
/// one pass each is linearized where those before it say so.
///
/// A boot, and a robot's being placed, end a stretch: what is before is not linearized again by what is after. In the
/// additive form, whose error is not the same at another time, every fact is folded alone.
fn fold_window(
    joint: &mut Joint,
    (config, how): (&FoldConfig, &Relinearization),
    facts: &[(FactKey, Fact)],
    count: usize,
    told: &mut Told<'_>,
) {
    let mut from = 0;
    while from < count {
        let (key, fact) = &facts[from];
        if joint.form() == ErrorForm::Invariant && is_measurement(joint, key, fact) {
            let length =
                facts[from..].iter().take_while(|(key, fact)| is_measurement(joint, key, fact)).count();
            let mut shifted =
                |index: usize, residual, now: &dyn Fn() -> Joint| told(from + index, residual, now);
            let taken = length.min(count - from);
            fold_stretch(joint, (config, how), &facts[from..from + length], taken, &mut shifted);
            from += taken;
        } else {
            let residual = fold(joint, config, key, fact);
            told(from, residual, &|| joint.clone());
            from += 1;
        }
    }
}

/// Whether a fact changes no robot's place in the map.
fn is_measurement(joint: &Joint, key: &FactKey, fact: &Fact) -> bool {
    if let Fact::Observation { quantity, observer, other, .. } = fact
        && taken(joint, key, quantity, observer, other.as_ref())
            .is_ok_and(|taken| across::is_across(joint, quantity, &taken))
    {
        return false;
    }
    match fact {
        Fact::Boot(_) => false,
        Fact::Observation { quantity: Quantity::Absolute(crate::fact::Absolute::Pose(_)), .. } => {
            joint.index(key.id.robot).is_some()
        }
        Fact::Observation { quantity: Quantity::Feature { landmark, .. }, .. } => {
            joint.landmark_index(*landmark).is_some()
        }
        Fact::Observation { .. } => true,
    }
}

/// A measurement of a stretch.
struct Event<'a> {
    time: Timestamp,
    quantity: &'a Quantity,
    noise: Matrix3,
    participants: Vec<Taken>,
}

/// Where it is linearized.
struct Points {
    /// The corrections of those who take part in each measurement.
    events: Vec<Vec<Pose2>>,
    /// Blocks of parameters, which stay what they are.
    parameters: Vec<(usize, Vector3)>,
}

/// What the forward pass leaves of a measurement for the backward pass.
struct Trace {
    /// Of each participant the correction at which it was linearized, and the mean of its error from there before the update.
    at: Vec<(Pose2, Vector3)>,
    /// Which errors were moved by those of which parameters, and how, before everything else.
    couplings: Vec<(usize, usize, Matrix3)>,
    /// Rows of the covariance before the update, of each participant.
    rows: Vec<[Vec<f64>; 3]>,
    /// The update, if there was one, with its participants.
    update: Option<(Prepared, Vec<Participant>)>,
    /// In the last pass dimension, normalized innovation squared and probability of being of something.
    surprise: Option<(usize, f64, f64)>,
}

fn fold_stretch(
    joint: &mut Joint,
    (config, how): (&FoldConfig, &Relinearization),
    facts: &[(FactKey, Fact)],
    count: usize,
    told: &mut Told<'_>,
) {
    let events: Vec<Result<Event<'_>, SkipReason>> =
        facts.iter().map(|(key, fact)| event(joint, key, fact)).collect();
    let points =
        (1..how.passes).fold(None, |points, _| Some(smoothed(joint, config, &events, points.as_ref())));
    let mut pass = Pass::new(joint.clone(), points.as_ref());
    for (index, event) in events.iter().enumerate().take(count) {
        let at = points.as_ref().map(|points| points.events[index].as_slice());
        let residual = match event {
            Ok(event) => pass.take(config, event, at, true).0,
            Err(reason) => Residual::without_measurement(Outcome::Skipped(*reason)),
        };
        told(index, residual, &|| pass.clone().ended());
    }
    *joint = pass.ended();
    if let Some(quarantine) = &config.quarantine {
        // Within a stretch nobody changes frames: who was found to contradict the others in it does at its end.
        let began = facts.first().map_or(Timestamp::MIN, |(key, _)| key.time);
        let found = |member: &Member| {
            member
                .reputation
                .distrust
                .filter(|of| of.whole && of.since >= began)
                .map(|of| (member.robot, of.since))
        };
        let found: Vec<_> = joint.members().filter_map(found).collect();
        for (robot, since) in found {
            joint.detach(robot, since, quarantine.last_chance(since));
        }
    }
}

fn event<'a>(joint: &Joint, key: &FactKey, fact: &'a Fact) -> Result<Event<'a>, SkipReason> {
    let Fact::Observation { quantity, noise, observer, other } = fact else { return Err(SkipReason::Noise) };
    let noise = super::usable(quantity, noise.as_ref())?;
    let participants = taken(joint, key, quantity, observer, other.as_ref())?;
    Ok(Event { time: key.time, quantity, noise: measurement::noise_matrix(&noise), participants })
}

/// Where the participants of each measurement were, by all of the stretch: a forward and a backward pass.
fn smoothed(
    joint: &Joint,
    config: &FoldConfig,
    events: &[Result<Event<'_>, SkipReason>],
    points: Option<&Points>,
) -> Points {
    let mut pass = Pass::new(joint.clone(), points);
    let begun = pass.clone();
    let traces = events.iter().enumerate().map(|(index, event)| {
        let at = points.map(|points| points.events[index].as_slice());
        event.as_ref().ok().map(|event| pass.take(config, event, at, false).1)
    });
    let traces: Vec<Option<Trace>> = traces.collect();
    let mut adjoint = vec![0.0; joint.covariance().size()];
    let along = |row: &[f64], adjoint: &[f64]| {
        let mut sum = 0.0;
        for (a, b) in row.iter().zip(adjoint) {
            sum += a * b;
        }
        sum
    };
    let mut points = vec![Vec::new(); events.len()];
    for (trace, points) in traces.iter().zip(&mut points).rev() {
        let Some(trace) = trace else { continue };
        if let Some((prepared, participants)) = &trace.update {
            prepared.take_back(participants, &mut adjoint);
        }
        let moved = |((correction, mean), rows): (&(Pose2, Vector3), &[Vec<f64>; 3])| {
            let moved = [0, 1, 2].map(|axis| along(&rows[axis], &adjoint));
            Pose2::exp(mean - Vector3::from(moved)).compose(correction)
        };
        *points = trace.at.iter().zip(&trace.rows).map(moved).collect();
        for (index, row, by) in trace.couplings.iter().rev() {
            for column in 0..3 {
                let mut sum = 0.0;
                for axis in 0..3 {
                    sum += by[(axis, column)] * adjoint[3 * index + axis];
                }
                adjoint[3 * row + column] += sum;
            }
        }
    }
    let parameters =
        joint.blocks().iter().enumerate().filter(|(_, block)| matches!(block, Block::Parameters(_)));
    let parameters = parameters.filter_map(|(index, _)| {
        let moved = [0, 1, 2].map(|axis| along(&joint.covariance().row(3 * index + axis), &adjoint));
        let value = begun.joint.parameters_at(index)?.value + begun.means[index] - Vector3::from(moved);
        Some((index, value))
    });
    Points { events: points, parameters: parameters.collect() }
}

/// A forward pass over a stretch. Errors are measured from the corrections of the joint, which are where the last
/// measurement of each robot was linearized; they have a mean.
#[derive(Clone)]
struct Pass {
    joint: Joint,
    means: Vec<Vector3>,
}

impl Pass {
    fn new(joint: Joint, points: Option<&Points>) -> Self {
        let mut means = vec![Vector3::zeros(); joint.covariance().size() / 3];
        let mut joint = joint;
        for (index, value) in points.iter().flat_map(|points| &points.parameters) {
            if let Some(former) = joint.parameters_at(*index).map(|of| of.value) {
                means[*index] = former - value;
                joint.correct(*index, value - former);
            }
        }
        Self { joint, means }
    }

    /// Takes a measurement, linearized with its participants' corrections at `at`, or where they are thought to be.
    fn take(
        &mut self,
        config: &FoldConfig,
        event: &Event<'_>,
        at: Option<&[Pose2]>,
        last: bool,
    ) -> (Residual, Trace) {
        let (residual, trace) = self.absorb(config, event, at, last);
        if let Some((dimension, nis, weight)) = trace.surprise {
            super::reflect(
                &mut self.joint,
                config,
                event.time,
                event.quantity,
                &event.participants,
                (dimension, nis, weight),
                false,
            );
        }
        (residual, trace)
    }

    fn absorb(
        &mut self,
        config: &FoldConfig,
        event: &Event<'_>,
        at: Option<&[Pose2]>,
        last: bool,
    ) -> (Residual, Trace) {
        let mut trace = Trace {
            at: Vec::with_capacity(2),
            couplings: Vec::new(),
            rows: Vec::with_capacity(2),
            update: None,
            surprise: None,
        };
        let of_map = !matches!(event.quantity, Quantity::Robot { .. });
        if let Some(robot) = self.joint.distrusted(super::robots(&event.participants), of_map) {
            let outcome = Outcome::Skipped(SkipReason::Distrusted(robot));
            return (Residual::without_measurement(outcome), trace);
        }
        for (which, (index, state)) in event.participants.iter().enumerate() {
            if let Some((row, by)) =
                state.as_ref().and_then(|state| self.joint.move_by_parameters(*index, state))
            {
                let moved = by * self.means[row];
                self.means[*index] += moved;
                trace.couplings.push((*index, row, by));
            }
            let former = *self.joint.frame(*index);
            if let Some(at) = at {
                // What a correction moves by from one measurement to the next, it was pushed by noise.
                self.joint.set_frame(*index, at[which]);
                self.means[*index] -= at[which].compose(&former.inverse()).log();
            } else {
                self.joint.set_frame(*index, Pose2::exp(self.means[*index]).compose(&former));
                self.means[*index] = Vector3::zeros();
            }
            if let Some(state) = state {
                self.joint.propagate(*index, state);
            }
            trace.at.push((*self.joint.frame(*index), self.means[*index]));
        }
        for (index, _) in &event.participants {
            trace.rows.push([0, 1, 2].map(|axis| self.joint.covariance().row(3 * index + axis)));
        }
        let (poses, influences) =
            super::seen_poses(&self.joint, event.time, event.quantity, &event.participants);
        let linearized = match linearize(event.quantity, &poses) {
            Ok(linearized) => linearized,
            Err(reason) => return (Residual::without_measurement(Outcome::Skipped(reason)), trace),
        };
        let participants = super::participants(event.quantity, &event.participants, &influences, &linearized);
        let mut innovation = linearized.innovation;
        for Participant { index, jacobian } in &participants {
            innovation -= jacobian * self.means[*index];
        }
        let dimension = linearized.dimension;
        let threshold = config.gate[dimension - 1];
        let residual = |outcome, nis| Residual { outcome, dimension, innovation, nis };
        let prepare =
            |noise: &Matrix3| self.joint.covariance().prepare(dimension, &innovation, noise, &participants);
        let stated = event.noise * self.joint.part(event.participants[0].0).reputation.noise_level;
        let weight = match (&config.clutter, at) {
            (Some(_), Some(_)) => weight(&linearized, &stated, threshold),
            _ => 1.0,
        };
        let noise = stated / weight;
        let Some(mut prepared) = prepare(&noise) else {
            return (Residual::without_measurement(Outcome::Skipped(SkipReason::Noise)), trace);
        };
        let nis = prepared.nis();
        if last {
            // Softer noise is for the update; what is surprising is so by what was stated.
            let stated = if weight < 1.0 { prepare(&stated) } else { None };
            let of = stated.as_ref().unwrap_or(&prepared);
            let odds = config.clutter.map(|clutter| clutter.log_odds(event.quantity));
            let weight = odds.map_or(1.0, |odds| of.weight_in_clutter(odds));
            trace.surprise = Some((dimension, of.nis(), weight));
        }
        if nis > threshold {
            let softer = prepare(&(noise * (nis / threshold))).filter(|_| !last && config.clutter.is_none());
            let Some(softer) = softer else {
                return (residual(Outcome::Rejected { threshold }, nis), trace);
            };
            prepared = softer;
        }
        if let Some(clutter) = &config.clutter {
            let weight = prepared.weight_in_clutter(clutter.log_odds(event.quantity));
            if last {
                self.joint.reduce_in_clutter(&prepared, weight);
                for (index, mean) in self.means.iter_mut().enumerate() {
                    *mean += prepared.correction(index) * weight;
                }
                return (residual(Outcome::Used, nis), trace);
            }
            if at.is_none() {
                match prepare(&(noise / weight.max(LEAST_WEIGHT))) {
                    Some(softer) => prepared = softer,
                    None => {
                        return (Residual::without_measurement(Outcome::Skipped(SkipReason::Noise)), trace);
                    }
                }
            }
        }
        self.joint.reduce(&prepared);
        for (index, mean) in self.means.iter_mut().enumerate() {
            *mean += prepared.correction(index);
        }
        trace.update = Some((prepared, participants));
        (residual(Outcome::Used, nis), trace)
    }

    /// The joint at the end.
    fn ended(mut self) -> Joint {
        for (index, mean) in self.means.iter().enumerate() {
            self.joint.correct(index, *mean);
        }
        self.joint
    }
}

/// Weight of a measurement that may be of nothing, by its distance from a smoothed trajectory: that of the loss of Geman and
/// McClure (`geman1987`), which hardly grows beyond the gate.
fn weight(linearized: &Linearization, noise: &Matrix3, threshold: f64) -> f64 {
    let square = crate::joint::squared(linearized.dimension, &linearized.innovation, noise);
    // An open gate says nothing of what does not fit.
    let threshold = if threshold.is_finite() { threshold } else { DEFAULT_GATE[linearized.dimension - 1] };
    let share = threshold / (threshold + square);
    (share * share).max(LEAST_WEIGHT)
}

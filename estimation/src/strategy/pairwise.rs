//! Luft, Schubert, Roumeliotis & Burgard 2018 [luft2018]: every robot keeps its block and a factor `s_ij` of
//! each of its correlations, `P_ij = s_ij s_ji^T`. When two robots meet they update their pair exactly, and
//! each of them scales its other factors by `P_a+ P_a^-1`: the approximation that spares everyone else.
//!
//! The observer asks, the robot that was seen answers with its belief and factor, the observer computes the
//! pair's update with its own belief as it then is, takes its side and sends the other its verdict. A
//! verdict is taken only if the block it rests on has not changed since the answer. If it is lost or
//! refused, the two hold factors of different versions. Such factors are never multiplied: the pair's
//! cross-covariance then counts as unknown, `diag(P_a/w, P_b/(1-w))` bounds the pair for every `w`, and an
//! update from there leaves both with a cross term they agree on again, unless it would leave them worse
//! off than before.

use std::collections::BTreeMap;

use nalgebra::{SMatrix, SVector};

use super::block::{Block, Instant, apply};
use super::fusion::{least, symmetric};
use super::peer::{Core, Out, too_late};
use super::{Answer, Command, Counts, Factor, MeetingId, Message, Question, Verdict, View};
use crate::fact::{Noise, Quantity};
use crate::geometry::{Matrix3, Vector3};
use crate::measurement::{self, Linearization};
use crate::nominal::NominalTrajectory;
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

type Matrix6 = SMatrix<f64, 6, 6>;

/// Questions and answers that may be open at once; older ones are given up.
const MOST_OPEN: usize = 64;

#[derive(Debug)]
pub(super) struct Pairwise {
    robot: RobotId,
    gate: [f64; 3],
    block: Option<Block>,
    /// Counts the changes of the block, so that a verdict on an old one is known.
    revision: u64,
    /// `s_ij` of every robot met.
    row: BTreeMap<RobotId, Factor>,
    number: u64,
    /// Own observations that wait for an answer.
    open: BTreeMap<u64, Open>,
    /// What was answered, until the verdict.
    promised: BTreeMap<MeetingId, Promise>,
    counts: Counts,
}

#[derive(Clone, Copy, Debug)]
struct Open {
    time: Timestamp,
    other: RobotId,
    relative: Relative,
    noise: Noise,
}

#[derive(Clone, Copy, Debug)]
struct Promise {
    revision: u64,
    /// The block as it was answered.
    block: Block,
}

/// The update of a pair: both corrections, both blocks, and the cross-covariance.
pub(super) struct PairUpdate {
    pub corrections: [Vector3; 2],
    pub joint: Matrix6,
    pub nis: f64,
}

/// The Kalman update of a pair with `innovation = -H xi_a + H xi_b + n`; `None` if the innovation has no
/// positive definite covariance.
pub(super) fn update_pair(joint: &Matrix6, at: &Linearization, noise: &Matrix3) -> Option<PairUpdate> {
    let mut h = SMatrix::<f64, 3, 6>::zeros();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&-at.jacobian);
    h.fixed_view_mut::<3, 3>(0, 3).copy_from(&at.jacobian);
    let mut noise = *noise;
    for row in at.dimension..3 {
        noise[(row, row)] = 1.0;
    }
    let cholesky = (h * joint * h.transpose() + noise).cholesky()?;
    let gain = cholesky.solve(&(h * joint)).transpose();
    let correction: SVector<f64, 6> = gain * at.innovation;
    let keep = Matrix6::identity() - gain * h;
    let updated = keep * joint * keep.transpose() + gain * noise * gain.transpose();
    Some(PairUpdate {
        corrections: [correction.fixed_rows::<3>(0).into(), correction.fixed_rows::<3>(3).into()],
        joint: 0.5 * (updated + updated.transpose()),
        nis: at.innovation.dot(&cholesky.solve(&at.innovation)),
    })
}

/// The covariance of a pair from its blocks and cross term.
pub(super) fn pair(own: &Matrix3, other: &Matrix3, cross: &Matrix3) -> Matrix6 {
    let mut joint = Matrix6::zeros();
    joint.fixed_view_mut::<3, 3>(0, 0).copy_from(own);
    joint.fixed_view_mut::<3, 3>(3, 3).copy_from(other);
    joint.fixed_view_mut::<3, 3>(0, 3).copy_from(cross);
    joint.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross.transpose());
    joint
}

fn block_of(joint: &Matrix6, row: usize, column: usize) -> Matrix3 {
    joint.fixed_view::<3, 3>(3 * row, 3 * column).into()
}

/// The update of a pair whose cross-covariance is unknown, with the weight that makes the product of the
/// determinants of both blocks least; `None` if that is no less than before.
fn update_unknown(
    own: &Matrix3,
    other: &Matrix3,
    at: &Linearization,
    noise: &Matrix3,
) -> Option<PairUpdate> {
    let update =
        |weight: f64| update_pair(&pair(&(own / weight), &(other / (1.0 - weight)), &Matrix3::zeros()), at, noise);
    let size = |update: &PairUpdate| {
        block_of(&update.joint, 0, 0).determinant() * block_of(&update.joint, 1, 1).determinant()
    };
    let weight = least(|weight| update(weight).map_or(f64::INFINITY, |update| size(&update)));
    update(weight).filter(|update| size(update) < own.determinant() * other.determinant())
}

impl Pairwise {
    pub fn new(robot: RobotId, gate: [f64; 3]) -> Self {
        Self {
            robot,
            gate,
            block: None,
            revision: 0,
            row: BTreeMap::new(),
            number: 0,
            open: BTreeMap::new(),
            promised: BTreeMap::new(),
            counts: Counts::default(),
        }
    }

    /// Takes one side of a pair's update. `before` is the block it was computed from. Factors with third
    /// robots are scaled by `P+ P^-1`.
    fn take(
        &mut self,
        before: &Block,
        correction: Vector3,
        covariance: Matrix3,
        (other, factor): (RobotId, Factor),
    ) -> Option<()> {
        let inverse = before.covariance.cholesky()?;
        // P+ P^-1 = (P^-1 P+)^T, both symmetric.
        let scale = inverse.solve(&covariance).transpose();
        for (robot, factor) in &mut self.row {
            if *robot != other {
                factor.matrix = scale * factor.matrix;
            }
        }
        self.row.insert(other, factor);
        self.block =
            Some(Block { correction: apply(&before.correction, correction), covariance, ..*before });
        self.revision += 1;
        self.counts.used += 1;
        Some(())
    }

    fn answer(&mut self, from: RobotId, question: Question, trajectory: &NominalTrajectory, out: &mut Out) {
        let (Some(block), Ok(state)) = (&self.block, trajectory.at(question.time)) else {
            self.counts.refused += 1;
            return;
        };
        if question.id.observer != from || too_late(block.last, question.time) {
            self.counts.refused += 1;
            return;
        }
        let block = block.at(&Instant { time: question.time, state });
        self.promised.insert(question.id, Promise { revision: self.revision, block });
        while self.promised.len() > MOST_OPEN {
            self.promised.pop_first();
        }
        let factor = self.row.get(&from).and_then(|factor| Some((factor.version?, factor.matrix)));
        let answer = Answer {
            id: question.id,
            pose: block.pose(&state),
            covariance: Symmetric3::from_lower(&block.covariance),
            factor,
        };
        out.push(Command::Send { to: from, message: Message::Answer(answer) });
    }

    fn decide(&mut self, from: RobotId, answer: &Answer, trajectory: &NominalTrajectory, out: &mut Out) {
        if answer.id.observer != self.robot {
            self.counts.refused += 1;
            return;
        }
        let Some(open) = self.open.get(&answer.id.number).copied().filter(|open| open.other == from) else {
            self.counts.repeated += 1;
            return;
        };
        self.open.remove(&answer.id.number);
        let (Some(block), Ok(state)) = (&self.block, trajectory.at(open.time)) else {
            self.counts.refused += 1;
            return;
        };
        if too_late(block.last, open.time) {
            self.counts.refused += 1;
            return;
        }
        let before = block.at(&Instant { time: open.time, state });
        let Ok(at) = measurement::of_robot(&open.relative, &before.pose(&state), &answer.pose) else {
            self.counts.refused += 1;
            return;
        };
        let noise = measurement::noise_matrix(&open.noise);
        let theirs = answer.covariance.to_matrix();
        let update = match (self.row.get(&from), &answer.factor) {
            (None, None) => update_pair(&pair(&before.covariance, &theirs, &Matrix3::zeros()), &at, &noise),
            (Some(own), Some((version, other))) if own.version == Some(*version) => {
                let cross = own.matrix * other.transpose();
                update_pair(&pair(&before.covariance, &theirs, &cross), &at, &noise)
            }
            _ => {
                self.counts.disagreed += 1;
                update_unknown(&before.covariance, &theirs, &at, &noise)
            }
        };
        let Some(update) = update else {
            self.counts.refused += 1;
            return;
        };
        if update.nis > self.gate[at.dimension - 1] {
            self.counts.rejected += 1;
            return;
        }
        let verdict = Verdict {
            id: answer.id,
            correction: update.corrections[1],
            covariance: Symmetric3::from_lower(&block_of(&update.joint, 1, 1)),
        };
        let factor = Factor { version: Some(answer.id), matrix: block_of(&update.joint, 0, 1) };
        let own = symmetric(&block_of(&update.joint, 0, 0));
        if self.take(&before, update.corrections[0], own, (from, factor)).is_some() {
            out.push(Command::Send { to: from, message: Message::Verdict(verdict) });
        }
    }

    fn obey(&mut self, from: RobotId, verdict: &Verdict) {
        let Some(promise) = self.promised.remove(&verdict.id) else {
            self.counts.repeated += 1;
            return;
        };
        if verdict.id.observer != from || promise.revision != self.revision {
            self.counts.refused += 1;
            return;
        }
        let factor = Factor { version: Some(verdict.id), matrix: Matrix3::identity() };
        let covariance = verdict.covariance.to_matrix();
        match self.take(&promise.block, verdict.correction, covariance, (from, factor)) {
            Some(()) => self.counts.completed += 1,
            None => self.counts.refused += 1,
        }
    }
}

impl Core for Pairwise {
    fn place(&mut self, at: &Instant, pose: &Pose2, noise: &Noise) {
        self.block = Some(Block::placed(at, pose, noise));
    }

    fn absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise, _out: &mut Out) {
        let Some(block) = &mut self.block else { return };
        let mut moved = block.at(at);
        match moved.against_map(at, quantity, noise, &self.gate) {
            Some(Ok((fused, keep))) => {
                moved.take(&fused);
                *block = moved;
                self.revision += 1;
                for factor in self.row.values_mut() {
                    factor.matrix = keep * factor.matrix;
                }
                self.counts.absolute += 1;
            }
            Some(Err(_)) => self.counts.rejected += 1,
            None => self.counts.refused += 1,
        }
    }

    fn sight(&mut self, at: &Instant, robot: RobotId, relative: &Relative, noise: &Noise, out: &mut Out) {
        self.counts.relative += 1;
        if self.block.is_none() {
            return;
        }
        let id = MeetingId { observer: self.robot, number: self.number };
        self.number += 1;
        self.open.insert(id.number, Open { time: at.time, other: robot, relative: *relative, noise: *noise });
        while self.open.len() > MOST_OPEN {
            self.open.pop_first();
        }
        let question = Message::Question(Question { id, time: at.time });
        out.push(Command::Send { to: robot, message: question });
    }

    fn receive(&mut self, from: RobotId, message: Message, trajectory: &NominalTrajectory, out: &mut Out) {
        match message {
            Message::Question(question) => self.answer(from, question, trajectory, out),
            Message::Answer(answer) => self.decide(from, &answer, trajectory, out),
            Message::Verdict(verdict) => self.obey(from, &verdict),
            Message::Sighting(_) | Message::RowAnswer(_) | Message::TeamUpdate(_) => self.counts.refused += 1,
        }
    }

    fn view(&self, at: &Instant) -> Option<View> {
        let view = self.block.as_ref()?.view(at);
        // In the invariant error a factor does not change while its robot moves.
        Some(View { row: self.row.clone(), ..view })
    }

    fn counts(&self) -> Counts {
        Counts { pending: self.open.len() as u64, ..self.counts }
    }
}

//! Luft, Schubert, Roumeliotis & Burgard 2018 (`luft2018`): every robot keeps its block and a factor `s_ij` of
//! each of its correlations, `P_ij = s_ij s_ji^T`. When two robots meet they update their pair exactly, and
//! each of them scales its other factors by `P_a+ P_a^-1`: the approximation that spares everyone else.
//!
//! The observer asks, the robot that was seen answers with its belief and factor, the observer computes the
//! pair's update with its own belief as it then is, takes its side and sends the other its verdict. A
//! verdict is taken only if the block it rests on has not changed since the answer. If it is lost or
//! refused, the two hold factors of different versions. Such factors are never multiplied: the pair's
//! cross-covariance then counts as unknown, `diag(P_a/w, P_b/(1-w))` bounds the pair for every `w`, and an
//! update from there leaves both with a cross term they agree on again. Where that would leave the two worse
//! off than before, each side is updated by covariance intersection for itself, and they go on disagreeing.
//!
//! Meetings that overlap would refuse one another's verdicts, so that robots take turns: one question of its
//! own at a time, and between an answer and its verdict nothing else, for at most [`PATIENCE_S`]. Meetings
//! are ordered by time, observer and number; a robot with an open question answers only earlier meetings, so
//! that whoever waits waits for an earlier meeting, and no ring of waiting can close.

mod update;

use std::collections::{BTreeMap, VecDeque};

use super::block::{Block, Instant, apply};
use super::fusion::{Measured, Split, fuse_best};
use super::peer::{Core, Out, Seen, too_late};
use super::{Answer, Change, Command, Counts, Factor, MeetingId, Message, Question, Verdict, View};
use crate::fact::{Noise, Quantity};
use crate::geometry::{Matrix3, Vector3};
use crate::measurement::{self, Linearization};
use crate::nominal::NominalTrajectory;
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

use update::{block_of, update_unknown};
pub(super) use update::{pair, update_pair};

/// Own observations and others' questions that may wait for their turn, and answers that a verdict may still
/// come for; older ones are given up.
const MOST_OPEN: usize = 64;
/// How long an answer or a verdict is waited for, s of odometry.
const PATIENCE_S: f64 = 0.3;

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
    /// The last odometry.
    now: Timestamp,
    /// Own observations that wait for their turn.
    own: VecDeque<Open>,
    /// The one that waits for an answer, and since when.
    open: Option<(Open, Timestamp)>,
    /// Its answer, while a verdict is waited for.
    answered: Option<Answer>,
    /// Questions that wait for their turn.
    questions: BTreeMap<Turn, RobotId>,
    /// The meeting whose verdict is waited for, and since when.
    holding: Option<(MeetingId, Timestamp)>,
    /// Measurements against the map that wait for it too.
    absolute: VecDeque<(Instant, Quantity, Noise)>,
    /// What was answered, until the verdict.
    promised: BTreeMap<MeetingId, Promise>,
    /// Questions heard.
    heard: Seen,
    counts: Counts,
}

/// The order of meetings.
type Turn = (Timestamp, MeetingId);

#[derive(Clone, Copy, Debug)]
struct Open {
    id: MeetingId,
    time: Timestamp,
    other: RobotId,
    relative: Relative,
    noise: Noise,
}

impl Open {
    fn turn(&self) -> Turn {
        (self.time, self.id)
    }
}

#[derive(Clone, Copy, Debug)]
struct Promise {
    revision: u64,
    /// The block as it was answered.
    block: Block,
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
            now: Timestamp::MIN,
            own: VecDeque::new(),
            open: None,
            answered: None,
            questions: BTreeMap::new(),
            holding: None,
            absolute: VecDeque::new(),
            promised: BTreeMap::new(),
            heard: Seen::default(),
            counts: Counts::default(),
        }
    }

    /// Takes one side of a pair's update. `before` is the block it was computed from. Factors are scaled by
    /// `P+ P^-1`, but for that with the partner if the two agreed on it.
    fn take(
        &mut self,
        before: &Block,
        correction: Vector3,
        covariance: Matrix3,
        agreed: Option<(RobotId, Factor)>,
    ) -> Option<()> {
        let inverse = before.covariance.cholesky()?;
        // P+ P^-1 = (P^-1 P+)^T, both symmetric.
        let scale = inverse.solve(&covariance).transpose();
        for factor in self.row.values_mut() {
            factor.matrix = scale * factor.matrix;
        }
        self.row.extend(agreed);
        self.block = Some(Block { correction: apply(&before.correction, correction), covariance, ..*before });
        self.revision += 1;
        self.counts.used += 1;
        Some(())
    }

    /// Goes on with what is next in turn, as far as nothing has to be waited for.
    fn advance(&mut self, trajectory: &NominalTrajectory, out: &mut Out) {
        let patient = |since: Timestamp, now: Timestamp| now.seconds_since(since) <= PATIENCE_S;
        loop {
            if self.holding.is_some_and(|(_, since)| patient(since, self.now)) {
                return;
            }
            self.holding = None;
            while let Some((at, quantity, noise)) = self.absolute.pop_front() {
                self.update_absolute(&at, &quantity, &noise);
            }
            if let Some(answer) = self.answered.take() {
                self.decide(&answer, trajectory, out);
                continue;
            }
            if self.open.is_some_and(|(_, since)| !patient(since, self.now)) {
                self.open = None;
                self.counts.refused += 1;
            }
            // What is too old would be refused by whoever hears of it.
            while self.own.front().is_some_and(|own| too_late(self.now, own.time)) {
                self.own.pop_front();
                self.counts.refused += 1;
            }
            while let Some((turn, _)) =
                self.questions.first_key_value().filter(|(turn, _)| too_late(self.now, turn.0))
            {
                let turn = *turn;
                self.questions.remove(&turn);
                self.counts.refused += 1;
            }
            let own = self.open.map(|(open, _)| open).or(self.own.front().copied());
            let question = self.questions.first_key_value().map(|(turn, from)| (*turn, *from));
            match (question, own) {
                (Some((turn, from)), own) if own.is_none_or(|own| turn < own.turn()) => {
                    self.questions.remove(&turn);
                    self.answer(from, turn, trajectory, out);
                }
                (_, Some(own)) if self.open.is_none() => {
                    self.own.pop_front();
                    self.open = Some((own, self.now));
                    let question = Message::Question(Question { id: own.id, time: own.time });
                    out.push(Command::Send { to: own.other, message: question });
                }
                _ => return,
            }
        }
    }

    fn answer(&mut self, from: RobotId, (time, id): Turn, trajectory: &NominalTrajectory, out: &mut Out) {
        let question = Question { id, time };
        let (Some(block), Ok(state)) = (&self.block, trajectory.at(question.time)) else {
            self.counts.refused += 1;
            return;
        };
        if too_late(block.last, question.time) {
            self.counts.refused += 1;
            return;
        }
        self.holding = Some((id, self.now));
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

    fn decide(&mut self, answer: &Answer, trajectory: &NominalTrajectory, out: &mut Out) {
        let Some((open, _)) = self.open.take() else { return };
        // The other waits for a verdict whatever becomes of the observation.
        let change = self.update(&open, answer, trajectory);
        let verdict = Message::Verdict(Verdict { id: answer.id, change });
        out.push(Command::Send { to: open.other, message: verdict });
    }

    /// The update of the pair; takes the own side, and gives what changes on the other.
    fn update(&mut self, open: &Open, answer: &Answer, trajectory: &NominalTrajectory) -> Option<Change> {
        let (Some(block), Ok(state)) = (&self.block, trajectory.at(open.time)) else {
            self.counts.refused += 1;
            return None;
        };
        if too_late(block.last, open.time) {
            self.counts.refused += 1;
            return None;
        }
        let before = block.at(&Instant { time: open.time, state });
        let Ok(at) = measurement::of_robot(&open.relative, &before.pose(&state), &answer.pose) else {
            self.counts.refused += 1;
            return None;
        };
        let noise = measurement::noise_matrix(&open.noise);
        let theirs = answer.covariance.to_matrix();
        let cross = match (self.row.get(&open.other), &answer.factor) {
            (None, None) => Some(Matrix3::zeros()),
            (Some(own), Some((version, other))) if own.version == Some(*version) => {
                Some(own.matrix * other.transpose())
            }
            _ => None,
        };
        // The approximation of correlations with third robots can make a pair indefinite; what it says is then
        // no covariance, and counts as unknown too.
        let joint = cross.map(|cross| pair(&before.covariance, &theirs, &cross));
        let update = if let Some(joint) = joint.filter(|joint| joint.cholesky().is_some()) {
            update_pair(&joint, &at, &noise)
        } else {
            self.counts.disagreed += 1;
            match update_unknown(&before.covariance, &theirs, &at, &noise) {
                None => return self.intersect(&before, &theirs, &at, &noise),
                better => better,
            }
        };
        let Some(update) = update else {
            self.counts.refused += 1;
            return None;
        };
        if update.nis > self.gate[at.dimension - 1] {
            self.counts.rejected += 1;
            return None;
        }
        let factor = Factor { version: Some(answer.id), matrix: block_of(&update.joint, 0, 1) };
        let own = block_of(&update.joint, 0, 0);
        self.take(&before, update.corrections[0], own, Some((open.other, factor)))?;
        let covariance = Symmetric3::from_lower(&block_of(&update.joint, 1, 1));
        Some(Change { correction: update.corrections[1], covariance, agreed: true })
    }

    /// Both sides of a pair that disagrees, each by covariance intersection for itself.
    fn intersect(
        &mut self,
        before: &Block,
        theirs: &Matrix3,
        at: &Linearization,
        noise: &Matrix3,
    ) -> Option<Change> {
        let side = |own: &Matrix3, other: &Matrix3, jacobian: Matrix3| {
            let zero = Matrix3::zeros();
            let prior = Split { correlated: *own, independent: zero };
            let measured = Measured {
                dimension: at.dimension,
                innovation: at.innovation,
                jacobian,
                correlated: at.jacobian * other * at.jacobian.transpose(),
                independent: zero,
                noise: *noise,
            };
            fuse_best(&prior, &measured).filter(|fused| fused.nis <= self.gate[at.dimension - 1])
        };
        let own = side(&before.covariance, theirs, -at.jacobian);
        let other = side(theirs, &before.covariance, at.jacobian);
        if let Some(fused) = own {
            self.take(before, fused.correction, fused.covariance, None);
        }
        other.map(|fused| Change {
            correction: fused.correction,
            covariance: Symmetric3::from_lower(&fused.covariance),
            agreed: false,
        })
    }

    fn obey(&mut self, from: RobotId, verdict: &Verdict) {
        if verdict.id.observer != from {
            self.counts.refused += 1;
            return;
        }
        if self.holding.is_some_and(|(id, _)| id == verdict.id) {
            self.holding = None;
        }
        let Some(promise) = self.promised.remove(&verdict.id) else {
            self.counts.repeated += 1;
            return;
        };
        let Some(change) = &verdict.change else { return };
        if promise.revision != self.revision {
            self.counts.refused += 1;
            return;
        }
        let factor = Factor { version: Some(verdict.id), matrix: Matrix3::identity() };
        let covariance = change.covariance.to_matrix();
        let agreed = change.agreed.then_some((from, factor));
        match self.take(&promise.block, change.correction, covariance, agreed) {
            Some(()) => self.counts.completed += 1,
            None => self.counts.refused += 1,
        }
    }
}

impl Pairwise {
    fn update_absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise) {
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
}

impl Core for Pairwise {
    fn place(&mut self, at: &Instant, pose: &Pose2, noise: &Noise) {
        self.block = Some(Block::placed(at, pose, noise));
    }

    fn absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise, _out: &mut Out) {
        if self.holding.is_some() {
            self.absolute.push_back((*at, *quantity, *noise));
        } else {
            self.update_absolute(at, quantity, noise);
        }
    }

    fn sight(&mut self, at: &Instant, robot: RobotId, relative: &Relative, noise: &Noise, _out: &mut Out) {
        self.counts.relative += 1;
        if self.block.is_none() {
            return;
        }
        let id = MeetingId { observer: self.robot, number: self.number };
        self.number += 1;
        self.own.push_back(Open { id, time: at.time, other: robot, relative: *relative, noise: *noise });
        if self.own.len() > MOST_OPEN {
            self.own.pop_front();
            self.counts.refused += 1;
        }
    }

    fn tick(&mut self, trajectory: &NominalTrajectory, out: &mut Out) {
        self.now = trajectory.end().0;
        self.advance(trajectory, out);
    }

    fn receive(&mut self, from: RobotId, message: Message, trajectory: &NominalTrajectory, out: &mut Out) {
        match message {
            // A second answer would promise anew what a repeated verdict then counts twice.
            Message::Question(question) if self.heard.repeated(question.id) => self.counts.repeated += 1,
            Message::Question(question) if question.id.observer == from => {
                self.questions.insert((question.time, question.id), from);
                if self.questions.len() > MOST_OPEN {
                    self.questions.pop_first();
                    self.counts.refused += 1;
                }
            }
            Message::Answer(answer) => {
                let expected = self.open.is_some_and(|(open, _)| open.id == answer.id && open.other == from);
                if expected {
                    self.answered = Some(answer);
                } else {
                    self.counts.repeated += 1;
                }
            }
            Message::Verdict(verdict) => self.obey(from, &verdict),
            Message::Question(_) | Message::Sighting(_) | Message::RowAnswer(_) | Message::TeamUpdate(_) => {
                self.counts.refused += 1;
            }
        }
        self.advance(trajectory, out);
    }

    fn view(&self, at: &Instant) -> Option<View> {
        let view = self.block.as_ref()?.view(at);
        // In the invariant error a factor does not change while its robot moves.
        Some(View { row: self.row.clone(), ..view })
    }

    fn counts(&self) -> Counts {
        let waiting = self.own.len() + self.questions.len() + self.absolute.len();
        Counts { pending: waiting as u64 + u64::from(self.open.is_some()), ..self.counts }
    }
}

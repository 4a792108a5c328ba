//! Roumeliotis & Bekey 2002 (`roumeliotis2002`) as published: the centralized filter in the additive error,
//! distributed by factors. Every robot keeps its block and its own row; at a meeting the observer computes
//! the gain of every robot from the two rows and broadcasts them, and everyone applies what it hears.
//!
//! It is the centralized filter as long as every broadcast reaches everyone once and in one order, and no
//! two exchanges overlap; that order is the transport's to give. A lost, repeated or overtaken broadcast
//! leaves rows that belong to different histories; nothing notices, and nothing repairs it.

use std::collections::BTreeMap;

use super::block::Instant;
use super::fusion::symmetric;
use super::peer::{Core, Out, Seen};
use super::{Command, Counts, Factor, Gain, MeetingId, Message, Question, RowAnswer, TeamUpdate, View};
use crate::fact::{Noise, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector2};
use crate::joint::ErrorForm;
use crate::measurement::{self, Linearization};
use crate::nominal::NominalTrajectory;
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

/// Observations that may wait for an answer; older ones are given up.
const MOST_OPEN: usize = 64;

#[derive(Debug)]
pub(super) struct Factored {
    robot: RobotId,
    gate: [f64; 3],
    member: Option<Member>,
    number: u64,
    open: BTreeMap<u64, Open>,
    /// Only to count what is used twice: the published form does not look.
    seen: Seen,
    counts: Counts,
}

#[derive(Clone, Copy, Debug)]
struct Open {
    time: Timestamp,
    other: RobotId,
    relative: Relative,
    noise: Noise,
}

/// A robot's block and row, in the additive error, as of its last event.
#[derive(Clone, Debug)]
struct Member {
    pose: Pose2,
    covariance: Matrix3,
    /// Nominal state at the last event.
    last: NominalState,
    last_time: Timestamp,
    /// The product of all transitions.
    motion: Matrix3,
    /// `Pi_ij = Phi_i^-1 P_ij Phi_j^-T`.
    row: BTreeMap<RobotId, Matrix3>,
}

/// A participant of an update, as the observer sees it.
struct Participant<'a> {
    robot: RobotId,
    covariance: Matrix3,
    motion: Matrix3,
    row: &'a BTreeMap<RobotId, Matrix3>,
    jacobian: Matrix3,
}

impl Member {
    /// At a later instant: pose along the odometry, `P <- Phi P Phi^T + Q`.
    fn at(&self, at: &Instant) -> Self {
        if at.time <= self.last_time {
            return self.clone();
        }
        let correction = self.pose.compose(&self.last.nominal.inverse());
        let pose = correction.compose(&at.state.nominal);
        let moved = pose.position() - self.pose.position();
        let transition = Matrix3::new(1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0);
        let to_error = pose.additive_from_invariant() * correction.adjoint();
        let noise = at.state.noise_sum.minus(self.last.noise_sum).congruence(&to_error).to_matrix();
        Self {
            pose,
            covariance: symmetric(&(transition * self.covariance * transition.transpose() + noise)),
            last: at.state,
            last_time: at.time,
            motion: transition * self.motion,
            row: self.row.clone(),
        }
    }

    /// `x += K r`, `P -= K S K^T`, and the same for its own row.
    fn apply(&mut self, robot: RobotId, update: &TeamUpdate) {
        let Some(own) = update.gains.iter().find(|gain| gain.robot == robot) else { return };
        let s = update.innovation_covariance.to_matrix();
        let gain = self.motion * own.without_motion;
        let by = gain * update.innovation;
        self.pose = Pose2::new(self.pose.x_m() + by.x, self.pose.y_m() + by.y, self.pose.yaw_rad() + by.z);
        self.covariance = symmetric(&(self.covariance - gain * s * gain.transpose()));
        for other in update.gains.iter().filter(|other| other.robot != robot) {
            let base = self.row.entry(other.robot).or_insert_with(Matrix3::zeros);
            *base -= own.without_motion * s * other.without_motion.transpose();
        }
    }
}

/// The gains of the whole team; `Err(nis)` if the gate refuses, `None` if something cannot be inverted.
fn team_update(
    id: MeetingId,
    at: &Linearization,
    noise: &Matrix3,
    participants: &[Participant],
    gate: &[f64; 3],
) -> Option<Result<TeamUpdate, f64>> {
    let mut s = *noise;
    for row in at.dimension..3 {
        s[(row, row)] = 1.0;
    }
    for p in participants {
        for q in participants {
            let block = if p.robot == q.robot {
                p.covariance
            } else {
                let base = p.row.get(&q.robot).copied().unwrap_or_else(Matrix3::zeros);
                p.motion * base * q.motion.transpose()
            };
            s += p.jacobian * block * q.jacobian.transpose();
        }
    }
    let cholesky = symmetric(&s).cholesky()?;
    let nis = at.innovation.dot(&cholesky.solve(&at.innovation));
    if nis > gate[at.dimension - 1] {
        return Some(Err(nis));
    }
    let mut sums: BTreeMap<RobotId, Matrix3> = BTreeMap::new();
    for p in participants {
        // Phi_p^-1 P_pp H_p^T; Pi_ip = Pi_pi^T is in p's row.
        let own = p.motion.lu().solve(&p.covariance)? * p.jacobian.transpose();
        *sums.entry(p.robot).or_insert_with(Matrix3::zeros) += own;
        for (robot, base) in p.row {
            let part = base.transpose() * p.motion.transpose() * p.jacobian.transpose();
            *sums.entry(*robot).or_insert_with(Matrix3::zeros) += part;
        }
    }
    let gains = sums
        .into_iter()
        .map(|(robot, sum)| Gain { robot, without_motion: cholesky.solve(&sum.transpose()).transpose() })
        .collect();
    #[allow(clippy::cast_possible_truncation, reason = "1 to 3")]
    let dimension = at.dimension as u8;
    let innovation_covariance = Symmetric3::from_lower(&symmetric(&s));
    Some(Ok(TeamUpdate { id, dimension, innovation: at.innovation, innovation_covariance, gains }))
}

impl Factored {
    pub fn new(robot: RobotId, gate: [f64; 3]) -> Self {
        Self {
            robot,
            gate,
            member: None,
            number: 0,
            open: BTreeMap::new(),
            seen: Seen::default(),
            counts: Counts::default(),
        }
    }

    fn next_id(&mut self) -> MeetingId {
        let id = MeetingId { observer: self.robot, number: self.number };
        self.number += 1;
        id
    }

    fn conclude(&mut self, update: Option<Result<TeamUpdate, f64>>, out: &mut Out) -> bool {
        match (update, &mut self.member) {
            (Some(Ok(update)), Some(member)) => {
                member.apply(self.robot, &update);
                self.counts.broadcast += 1;
                out.push(Command::Broadcast(Message::TeamUpdate(update)));
                return true;
            }
            (Some(Err(_)), _) => self.counts.rejected += 1,
            _ => self.counts.refused += 1,
        }
        false
    }

    fn answer(&mut self, from: RobotId, question: Question, trajectory: &NominalTrajectory, out: &mut Out) {
        let (Some(member), Ok(state)) = (&mut self.member, trajectory.at(question.time)) else {
            self.counts.refused += 1;
            return;
        };
        *member = member.at(&Instant { time: question.time, state });
        let answer = RowAnswer {
            id: question.id,
            pose: member.pose,
            covariance: Symmetric3::from_lower(&member.covariance),
            motion: member.motion,
            row: member.row.iter().map(|(robot, base)| (*robot, *base)).collect(),
        };
        out.push(Command::Send { to: from, message: Message::RowAnswer(answer) });
    }

    fn meet(&mut self, from: RobotId, answer: &RowAnswer, trajectory: &NominalTrajectory, out: &mut Out) {
        let Some(open) = self.open.get(&answer.id.number).copied().filter(|open| open.other == from) else {
            self.counts.repeated += 1;
            return;
        };
        self.open.remove(&answer.id.number);
        let (Some(member), Ok(state)) = (&mut self.member, trajectory.at(open.time)) else {
            self.counts.refused += 1;
            return;
        };
        *member = member.at(&Instant { time: open.time, state });
        let Ok(at) = measurement::of_robot(&open.relative, &member.pose, &answer.pose) else {
            self.counts.refused += 1;
            return;
        };
        let theirs: BTreeMap<RobotId, Matrix3> = answer.row.iter().copied().collect();
        let participants = [
            Participant {
                robot: self.robot,
                covariance: member.covariance,
                motion: member.motion,
                row: &member.row,
                jacobian: -at.jacobian * member.pose.invariant_from_additive(),
            },
            Participant {
                robot: from,
                covariance: answer.covariance.to_matrix(),
                motion: answer.motion,
                row: &theirs,
                jacobian: at.jacobian * answer.pose.invariant_from_additive(),
            },
        ];
        let noise = measurement::noise_matrix(&open.noise);
        let update = team_update(answer.id, &at, &noise, &participants, &self.gate);
        if self.conclude(update, out) {
            self.counts.used += 1;
            self.counts.completed += 1;
        }
    }
}

impl Core for Factored {
    fn place(&mut self, at: &Instant, pose: &Pose2, noise: &Noise) {
        let turned = pose.additive_from_invariant() * pose.adjoint();
        self.member = Some(Member {
            pose: *pose,
            covariance: symmetric(&(turned * measurement::noise_matrix(noise) * turned.transpose())),
            last: at.state,
            last_time: at.time,
            motion: Matrix3::identity(),
            row: BTreeMap::new(),
        });
    }

    fn absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise, out: &mut Out) {
        let id = self.next_id();
        let Some(member) = &mut self.member else { return };
        *member = member.at(at);
        let (linearization, sign) = match quantity {
            Quantity::Absolute(absolute) => (Ok(measurement::of_map(absolute, &member.pose)), 1.0),
            Quantity::Landmark { position_m: [x, y], relative, .. } => {
                (measurement::of_point(relative, &member.pose, Vector2::new(*x, *y)), -1.0)
            }
            Quantity::Robot { .. } | Quantity::Feature { .. } => return,
        };
        let Ok(linearization) = linearization else {
            self.counts.refused += 1;
            return;
        };
        let participant = Participant {
            robot: self.robot,
            covariance: member.covariance,
            motion: member.motion,
            row: &member.row,
            jacobian: linearization.jacobian * sign * member.pose.invariant_from_additive(),
        };
        let noise = measurement::noise_matrix(noise);
        let update = team_update(id, &linearization, &noise, &[participant], &self.gate);
        if self.conclude(update, out) {
            self.counts.absolute += 1;
        }
    }

    fn sight(&mut self, at: &Instant, robot: RobotId, relative: &Relative, noise: &Noise, out: &mut Out) {
        self.counts.relative += 1;
        let id = self.next_id();
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
            Message::RowAnswer(answer) => self.meet(from, &answer, trajectory, out),
            Message::TeamUpdate(update) => {
                self.counts.counted_twice += u64::from(self.seen.repeated(update.id));
                if let Some(member) = &mut self.member {
                    member.apply(self.robot, &update);
                    self.counts.applied += 1;
                }
            }
            Message::Sighting(_) | Message::Answer(_) | Message::Verdict(_) => self.counts.refused += 1,
        }
    }

    fn view(&self, at: &Instant) -> Option<View> {
        let member = self.member.as_ref()?.at(at);
        // The robot of the smaller number keeps Phi_i Pi_ij, the other Phi_j.
        let factor = |(other, base): (&RobotId, &Matrix3)| {
            let matrix = if self.robot < *other { member.motion * base } else { member.motion };
            (*other, Factor { version: None, matrix })
        };
        Some(View {
            time: at.time,
            pose: member.pose,
            form: ErrorForm::Additive,
            covariance: member.covariance,
            row: member.row.iter().map(factor).collect(),
        })
    }

    fn counts(&self) -> Counts {
        Counts { pending: self.open.len() as u64, ..self.counts }
    }
}

//! The joint state of the team: a correction per robot and one covariance over all of them.

mod covariance;

pub use covariance::JointCovariance;
pub(crate) use covariance::Prepared;

use crate::fact::{Boot, Continuation, NominalState};
use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId};

/// In which coordinates the error of a pose is Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ErrorForm {
    /// `X = exp(xi) X_hat`: the error stays put while the robot moves, and an error common to the team
    /// is never seen by a relative measurement.
    #[default]
    Invariant,
    /// The textbook filter: errors of position and yaw add to the estimate.
    Additive,
}

/// One robot's part of the joint state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Who.
    pub robot: RobotId,
    /// On the trajectory of which boot.
    pub boot: BootIndex,
    /// `G`: the estimate at any time is `G N(t)`.
    pub correction: Pose2,
    /// The robot's nominal pose at its last event: there the additive form is linearized.
    pub nominal: Pose2,
    /// The noise sum already folded into the covariance.
    pub folded_noise: Symmetric3,
    placed: bool,
}

impl Member {
    /// A robot's part from its numbers, for [`Joint::from_parts`].
    pub fn new(
        robot: RobotId,
        boot: BootIndex,
        correction: Pose2,
        nominal: Pose2,
        folded_noise: Symmetric3,
    ) -> Self {
        Self { robot, boot, correction, nominal, folded_noise, placed: true }
    }
}

/// A joint taken apart, to be kept or sent.
#[derive(Clone, Debug, PartialEq)]
pub struct JointParts {
    /// The robots in the order of their rows, and whether they have a place in the map.
    pub members: Vec<(Member, bool)>,
    /// Packed lower triangle of the covariance, row after row.
    pub lower: Vec<f64>,
    /// How many measurements went into it.
    pub updates: u64,
}

/// A robot taking part in an update: its index and the derivative of the prediction with respect to its
/// invariant error.
pub(crate) struct Participant {
    pub index: usize,
    pub jacobian: Matrix3,
}

/// What an update did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// The whole joint was updated.
    Used {
        /// Normalized innovation squared.
        nis: f64,
    },
    /// The innovation failed the gate; nothing but process noise entered.
    Rejected {
        /// Normalized innovation squared.
        nis: f64,
        /// The gate.
        threshold: f64,
    },
    /// The innovation covariance is not positive definite: the noise given was not.
    Indefinite,
}

/// The team as a joint filter sees it after some prefix of the facts.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    form: ErrorForm,
    members: Vec<Member>,
    covariance: JointCovariance,
    updates: u64,
}

impl Joint {
    /// No robot yet.
    pub fn new(form: ErrorForm) -> Self {
        Self { form, members: Vec::new(), covariance: JointCovariance::default(), updates: 0 }
    }

    /// In which coordinates the error is Gaussian.
    pub fn form(&self) -> ErrorForm {
        self.form
    }

    /// How many measurements went into it.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// The robots that have a place in the map, in the order of their rows in the covariance.
    pub fn members(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|member| member.placed)
    }

    /// A robot that has a place in the map.
    pub fn member(&self, robot: RobotId) -> Option<&Member> {
        self.index(robot).map(|index| &self.members[index])
    }

    /// The covariance over all robots, in the coordinates of the error form; rows in the order in which
    /// the robots were first placed. Rows of a robot without a place are zero.
    pub fn covariance(&self) -> &JointCovariance {
        &self.covariance
    }

    /// Row block of a robot in [`Joint::covariance`].
    pub fn index(&self, robot: RobotId) -> Option<usize> {
        self.members.iter().position(|member| member.robot == robot && member.placed)
    }

    /// All there is to it, robots without a place included: from the parts a joint can be made again.
    pub fn parts(&self) -> JointParts {
        let members = self.members.iter().map(|member| (*member, member.placed));
        JointParts {
            members: members.collect(),
            lower: self.covariance.lower().to_vec(),
            updates: self.updates,
        }
    }

    /// The joint of these parts; `None` if the covariance does not have a row for every member.
    pub fn from_parts(form: ErrorForm, parts: JointParts) -> Option<Self> {
        let covariance = JointCovariance::from_lower(3 * parts.members.len(), parts.lower)?;
        let members = parts.members.into_iter().map(|(member, placed)| Member { placed, ..member });
        Some(Self { form, members: members.collect(), covariance, updates: parts.updates })
    }

    /// Estimate and covariance of one robot at `state` of its nominal trajectory. The covariance is of
    /// the additive error (position in the map, yaw): what is published.
    pub fn estimate(&self, robot: RobotId, state: &NominalState) -> Option<(Pose2, Symmetric3)> {
        let index = self.index(robot)?;
        let member = &self.members[index];
        let block = self.covariance.block(index, index);
        Some(extrapolate(self.form, &member.correction, &member.nominal, member.folded_noise, &block, state))
    }

    /// Places a robot: `G = z N^-1`, its block from the noise of `z` in the body frame, no cross terms.
    pub(crate) fn place(
        &mut self,
        robot: RobotId,
        boot: BootIndex,
        z: &Pose2,
        noise: &Matrix3,
        at: &NominalState,
    ) {
        let member = Member {
            robot,
            boot,
            correction: z.compose(&at.nominal.inverse()),
            nominal: at.nominal,
            folded_noise: at.noise_sum,
            placed: true,
        };
        let index = if let Some(index) = self.members.iter().position(|known| known.robot == robot) {
            self.members[index] = member;
            self.covariance.clear(index);
            index
        } else {
            self.members.push(member);
            self.covariance.grow();
            self.members.len() - 1
        };
        let adjoint = z.adjoint();
        let mut block = adjoint * noise * adjoint.transpose();
        if self.form == ErrorForm::Additive {
            let m = z.additive_from_invariant();
            block = m * block * m.transpose();
        }
        self.covariance.set_diagonal(index, Symmetric3::from_lower(&block));
    }

    /// A boot begins: a continued one carries the robot's block on, a lost one ends it.
    pub(crate) fn boot(&mut self, robot: RobotId, index: BootIndex, boot: &Boot) {
        let Some(row) = self.index(robot) else { return };
        match &boot.continuation {
            Some(continuation) if continuation.previous == self.members[row].boot => {
                self.carry_on(row, index, boot, continuation);
            }
            _ => {
                self.members[row].placed = false;
                self.covariance.clear(row);
            }
        }
    }

    /// `S = N_new(t0) N_old(t1)^-1`, `G <- G S^-1`, and the noise not yet folded is carried into the new
    /// frame; then the unseen motion of the gap. Cross terms stay (`docs/theory.md`, boots).
    fn carry_on(&mut self, row: usize, index: BootIndex, boot: &Boot, continuation: &Continuation) {
        let s = boot.nominal.compose(&continuation.last.nominal.inverse());
        let member = &mut self.members[row];
        let unfolded = unfolded_noise(continuation.last.noise_sum, member.folded_noise);
        // The additive form is linearized at the last event; that pose is the same in the new frame.
        member.nominal = s.compose(&member.nominal);
        member.correction = member.correction.compose(&s.inverse());
        member.folded_noise = unfolded.congruence(&s.adjoint()).scaled(-1.0);
        member.boot = index;
        if self.form == ErrorForm::Additive {
            // Its coordinates do not stay put, so that what is carried is folded here, with the gap.
            let gap = continuation.gap.congruence(&boot.nominal.adjoint());
            self.propagate(row, &NominalState { nominal: boot.nominal, noise_sum: gap });
            self.members[row].folded_noise = Symmetric3::zero();
        } else {
            // The gap is motion in the body frame at the pose after it. What is carried is folded with the
            // next event, as it would have been without the boot.
            let pose = member.correction.compose(&boot.nominal);
            member.nominal = boot.nominal;
            self.covariance.add_diagonal(row, continuation.gap.congruence(&pose.adjoint()));
        }
    }

    /// Folds the process noise a robot has accumulated since its last event.
    pub(crate) fn propagate(&mut self, index: usize, state: &NominalState) {
        let member = &mut self.members[index];
        let mut added = state.noise_sum.minus(member.folded_noise).congruence(&member.correction.adjoint());
        if self.form == ErrorForm::Additive {
            let pose = member.correction.compose(&state.nominal);
            let last = member.correction.compose(&member.nominal);
            self.covariance.transform(index, &additive_transition(&last, &pose));
            added = added.congruence(&pose.additive_from_invariant());
        }
        member.folded_noise = state.noise_sum;
        member.nominal = state.nominal;
        self.covariance.add_diagonal(index, added);
    }

    /// The part of the robot in a row.
    pub(crate) fn part(&self, index: usize) -> &Member {
        &self.members[index]
    }

    /// Measures a robot's error from another correction. For windows of the fold.
    pub(crate) fn set_correction(&mut self, index: usize, correction: Pose2) {
        self.members[index].correction = correction;
    }

    /// Takes an update from the covariance, and leaves the corrections. For windows of the fold.
    pub(crate) fn reduce(&mut self, prepared: &Prepared) {
        self.updates += 1;
        self.covariance.downdate(prepared);
    }

    /// Carries a robot's part on to `state` of its nominal trajectory, as an event there would that measures nothing.
    pub fn carry_to(&mut self, robot: RobotId, state: &NominalState) {
        if let Some(index) = self.index(robot) {
            self.propagate(index, state);
        }
    }

    /// One update of the whole joint with an innovation of `dimension` and the given noise, if it passes
    /// the gate.
    pub(crate) fn update(
        &mut self,
        dimension: usize,
        innovation: &Vector3,
        noise: &Matrix3,
        participants: &mut [Participant],
        threshold: f64,
    ) -> Update {
        if self.form == ErrorForm::Additive {
            for participant in participants.iter_mut() {
                let member = &self.members[participant.index];
                let pose = member.correction.compose(&member.nominal);
                participant.jacobian *= pose.invariant_from_additive();
            }
        }
        let Some(prepared) = self.covariance.prepare(dimension, innovation, noise, participants) else {
            return Update::Indefinite;
        };
        let nis = prepared.nis();
        if nis > threshold {
            return Update::Rejected { nis, threshold };
        }
        self.updates += 1;
        self.covariance.downdate(&prepared);
        for (index, member) in self.members.iter_mut().enumerate().filter(|(_, member)| member.placed) {
            let delta = prepared.correction(index);
            match self.form {
                ErrorForm::Invariant => {
                    member.correction = Pose2::exp(delta).compose(&member.correction);
                }
                ErrorForm::Additive => {
                    let pose = member.correction.compose(&member.nominal);
                    let moved =
                        Pose2::new(pose.x_m() + delta.x, pose.y_m() + delta.y, pose.yaw_rad() + delta.z);
                    member.correction = moved.compose(&member.nominal.inverse());
                }
            }
        }
        Update::Used { nis }
    }

    /// The bits of the estimate, for comparing two of them: robots, corrections, covariance.
    pub(crate) fn words(&self) -> impl Iterator<Item = u64> + '_ {
        let members = self.members.iter().flat_map(|member| {
            let g = &member.correction;
            [
                u64::from(member.robot.0),
                u64::from(member.boot.0),
                u64::from(member.placed),
                g.x_m().to_bits(),
                g.y_m().to_bits(),
                g.yaw_rad().to_bits(),
            ]
            .into_iter()
            .chain(member.folded_noise.0.into_iter().map(f64::to_bits))
        });
        members.chain(self.covariance.lower().iter().map(|entry| entry.to_bits()))
    }
}

/// The noise a boot leaves behind that is not folded yet. A robot that lost the end of its journal carries
/// on from before facts that others hold already; their noise cannot be taken back, and none is added.
fn unfolded_noise(last: Symmetric3, folded: Symmetric3) -> Symmetric3 {
    let unfolded = last.minus(folded);
    let before = [0, 2, 5].into_iter().any(|entry| unfolded.0[entry] < -1e-9 * last.0[entry]);
    if before { Symmetric3::zero() } else { unfolded }
}

/// A robot's estimate at `state` of its nominal trajectory, and the covariance of position and yaw, from
/// what the joint holds of it as of its last event.
pub(crate) fn extrapolate(
    form: ErrorForm,
    correction: &Pose2,
    last_nominal: &Pose2,
    folded_noise: Symmetric3,
    block: &Matrix3,
    state: &NominalState,
) -> (Pose2, Symmetric3) {
    let pose = correction.compose(&state.nominal);
    let grown = state.noise_sum.minus(folded_noise).congruence(&correction.adjoint());
    let published = pose.additive_from_invariant();
    let block = Symmetric3::from_lower(block);
    let covariance = match form {
        ErrorForm::Invariant => block.plus(grown).congruence(&published),
        ErrorForm::Additive => {
            let phi = additive_transition(&correction.compose(last_nominal), &pose);
            block.congruence(&phi).plus(grown.congruence(&published))
        }
    };
    (pose, covariance)
}

/// `[I, J (p_new - p_last)]`: the textbook transition from a robot's last event to `pose`.
pub(crate) fn additive_transition(last: &Pose2, pose: &Pose2) -> Matrix3 {
    let moved = pose.position() - last.position();
    Matrix3::new(1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0)
}

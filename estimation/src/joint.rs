//! The joint state of the team: a correction per robot and one covariance over all of them.

mod block;
mod boots;
mod component;
mod covariance;
mod standing;
mod updates;
mod view;

pub use block::{Block, MappedLandmark, Member, ParameterKind, Parameters};
pub(crate) use component::Placement;
pub use component::{Anchor, Component, End, Measured, Tie};
pub use covariance::JointCovariance;
pub(crate) use covariance::{Prepared, squared};
pub(crate) use standing::Surprise;
pub use standing::{Contradiction, Distrust, Party, Reputation};
pub(crate) use view::{RobotView, clock_influence};

use crate::fact::NominalState;
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, LandmarkId, Pose2, RobotId, Timestamp};

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

/// A joint taken apart, to be kept or sent.
#[derive(Clone, Debug, PartialEq)]
pub struct JointParts {
    /// What the rows stand for, three by three, and, of robots, whether they have a place in the map.
    pub blocks: Vec<(Block, bool)>,
    /// Packed lower triangle of the covariance, row after row.
    pub lower: Vec<f64>,
    /// What was measured across components.
    pub ties: Vec<Tie>,
    /// Who contradicts whom.
    pub contradictions: Vec<Contradiction>,
    /// Where landmarks are said to be, where names may be wrong.
    pub stated: Vec<(LandmarkId, [f64; 2])>,
    /// How many measurements went into it.
    pub updates: u64,
}

/// A block taking part in an update: its index and the derivative of the prediction with respect to its error.
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
        /// Probability that it is not of nothing; 1 where nothing is.
        weight: f64,
    },
    /// The innovation failed the gate; nothing but process noise entered.
    Rejected {
        /// Normalized innovation squared.
        nis: f64,
        /// The gate.
        threshold: f64,
        /// Probability that it is not of nothing; 1 where nothing is.
        weight: f64,
    },
    /// The innovation covariance is not positive definite: the noise given was not.
    Indefinite,
}

/// The team as a joint filter sees it after some prefix of the facts.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    form: ErrorForm,
    blocks: Vec<Block>,
    covariance: JointCovariance,
    ties: Vec<Tie>,
    /// In the order of author and whom it measured.
    contradictions: Vec<Contradiction>,
    /// Where landmarks are said to be, in the order of their numbers; kept where names may be wrong.
    stated: Vec<(LandmarkId, [f64; 2])>,
    updates: u64,
}

impl Joint {
    /// No robot yet.
    pub fn new(form: ErrorForm) -> Self {
        Self {
            form,
            blocks: Vec::new(),
            covariance: JointCovariance::default(),
            ties: Vec::new(),
            contradictions: Vec::new(),
            stated: Vec::new(),
            updates: 0,
        }
    }

    /// In which coordinates the error is Gaussian.
    pub fn form(&self) -> ErrorForm {
        self.form
    }

    /// How many measurements went into it.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// What the rows of the covariance stand for, three by three.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The robots that have a place in the map, in the order of their rows in the covariance.
    pub fn members(&self) -> impl Iterator<Item = &Member> {
        self.blocks.iter().filter_map(Block::placed)
    }

    /// A robot that has a place in the map.
    pub fn member(&self, robot: RobotId) -> Option<&Member> {
        self.members().find(|member| member.robot == robot)
    }

    /// The covariance over all blocks, in the coordinates of the error form; rows in the order in which
    /// the robots were first placed. Rows of a robot without a place are zero.
    pub fn covariance(&self) -> &JointCovariance {
        &self.covariance
    }

    /// Block of a robot in [`Joint::covariance`].
    pub fn index(&self, robot: RobotId) -> Option<usize> {
        self.blocks.iter().position(|block| block.placed().is_some_and(|member| member.robot == robot))
    }

    /// Block of a robot's parameters, if they are estimated.
    pub fn parameter_index(&self, robot: RobotId, kind: ParameterKind) -> Option<usize> {
        let is = |of: &Parameters| of.robot == robot && of.kind == kind;
        self.blocks.iter().position(|block| matches!(block, Block::Parameters(of) if is(of)))
    }

    /// The parameters in a block.
    pub(crate) fn parameters_at(&self, index: usize) -> Option<&Parameters> {
        match &self.blocks[index] {
            Block::Parameters(of) => Some(of),
            _ => None,
        }
    }

    /// Parameters of a robot, if they are estimated, and their covariance.
    pub fn parameters(&self, robot: RobotId, kind: ParameterKind) -> Option<(&Parameters, Matrix3)> {
        let index = self.parameter_index(robot, kind)?;
        Some((self.parameters_at(index)?, self.covariance.block(index, index)))
    }

    /// Block of a landmark of the team's map.
    pub fn landmark_index(&self, landmark: LandmarkId) -> Option<usize> {
        let is = |mapped: &MappedLandmark| mapped.landmark == landmark;
        self.blocks.iter().position(|block| matches!(block, Block::Landmark(mapped) if is(mapped)))
    }

    /// All there is to it, robots without a place included: from the parts a joint can be made again.
    pub fn parts(&self) -> JointParts {
        let blocks = self.blocks.iter().map(|block| (*block, block.placed().is_some()));
        JointParts {
            blocks: blocks.collect(),
            lower: self.covariance.lower().to_vec(),
            ties: self.ties.clone(),
            contradictions: self.contradictions.clone(),
            stated: self.stated.clone(),
            updates: self.updates,
        }
    }

    /// The joint of these parts; `None` if the covariance does not have rows for every block, a tie has no anchor, or
    /// contradictions or stated landmarks are not in order.
    pub fn from_parts(form: ErrorForm, parts: JointParts) -> Option<Self> {
        let covariance = JointCovariance::from_lower(3 * parts.blocks.len(), parts.lower)?;
        let blocks = parts.blocks.into_iter().map(|(block, placed)| match block {
            Block::Robot(member) => Block::Robot(Member { placed, ..member }),
            other => other,
        });
        let blocks: Vec<Block> = blocks.collect();
        let anchored = |end: &End| match end {
            End::Anchor(index) => matches!(blocks.get(*index), Some(Block::Anchor(_))),
            End::Map | End::Point(_) => true,
        };
        let pairs = parts.contradictions.iter().map(|of| (of.author, of.of));
        let sound = parts.stated.is_sorted_by(|a, b| a.0 < b.0)
            && pairs.is_sorted_by(|a, b| a < b)
            && parts.ties.iter().all(|tie| tie.ends.iter().all(anchored));
        let JointParts { ties, contradictions, stated, updates, .. } = parts;
        sound.then_some(Self { form, blocks, covariance, ties, contradictions, stated, updates })
    }

    /// Estimate and covariance of one robot at `state` of its nominal trajectory, when its clock shows `time`. The covariance is of
    /// the additive error (position in the map, yaw): what is published.
    pub fn estimate(
        &self,
        robot: RobotId,
        time: Timestamp,
        state: &NominalState,
    ) -> Option<(Pose2, Symmetric3)> {
        Some(self.view(robot)?.estimate(time, state))
    }

    /// The correction of one robot that holds at `state` of its nominal trajectory, when its clock shows `time`. It is that of its
    /// last event, unless its odometry or clock is calibrated.
    pub fn correction_at(&self, robot: RobotId, time: Timestamp, state: &NominalState) -> Option<Pose2> {
        Some(self.view(robot)?.correction_at(time, state))
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
        let correction = z.compose(&at.nominal.inverse());
        let mut member = Member::new(robot, boot, correction, at.nominal, at.noise_sum);
        member.folded_motion = at.sensitivity.map_or_else(Matrix3::zeros, |sensitivity| sensitivity.motion);
        let known = |block: &Block| matches!(block, Block::Robot(known) if known.robot == robot);
        let index = if let Some(index) = self.blocks.iter().position(known) {
            if let Block::Robot(Member { boot: of, placed: true, reputation, .. }) = self.blocks[index]
                && of == boot
            {
                member.reputation = reputation;
            }
            self.blocks[index] = Block::Robot(member);
            self.covariance.clear(index);
            index
        } else {
            self.add(&Block::Robot(member))
        };
        let adjoint = z.adjoint();
        let mut block = adjoint * noise * adjoint.transpose();
        if self.form == ErrorForm::Additive {
            let m = z.additive_from_invariant();
            block = m * block * m.transpose();
        }
        self.covariance.set_diagonal(index, Symmetric3::from_lower(&block));
    }

    /// Whether a robot is in a frame of its own from which nothing was seen.
    pub(crate) fn is_alone(&self, robot: RobotId) -> bool {
        let Some(own) = self.member(robot).map(|member| member.component) else { return false };
        let in_it = (0..self.blocks.len()).filter(|index| self.component(*index) == Some(own)).count();
        own != Component::MAP && in_it == 1
    }

    /// The error of a block moves with that of another: `x_i <- x_i + A x_m`.
    pub(crate) fn couple(&mut self, i: usize, m: usize, a: &Matrix3) {
        self.covariance.couple(i, m, a);
    }

    fn add(&mut self, block: &Block) -> usize {
        let free = self.blocks.iter().position(|block| *block == Block::Free);
        if let Some(index) = free {
            self.blocks[index] = *block;
            return index;
        }
        self.blocks.push(*block);
        self.covariance.grow();
        self.blocks.len() - 1
    }

    /// Folds the process noise a robot has accumulated since its last event, and what the parameters of its odometry move
    /// it by.
    pub(crate) fn propagate(&mut self, index: usize, state: &NominalState) {
        self.move_by_parameters(index, state);
        let member = self.part(index);
        let mut added = state
            .noise_sum
            .minus(member.folded_noise)
            .congruence(&member.correction.adjoint())
            .scaled(member.reputation.noise_level);
        if self.form == ErrorForm::Additive {
            let pose = member.correction.compose(&state.nominal);
            let last = member.correction.compose(&member.nominal);
            self.covariance.transform(index, &additive_transition(&last, &pose));
            added = added.congruence(&pose.additive_from_invariant());
        }
        let member = self.part_mut(index);
        member.folded_noise = state.noise_sum;
        member.nominal = state.nominal;
        self.covariance.add_diagonal(index, added);
    }

    /// `xi <- xi + A p` with `A = Ad_G (W(t) - W(last))`: what the odometry's parameters did since the last event.
    /// Gives the block of the parameters and `A`. Once done, there is nothing more to move for the same state.
    pub(crate) fn move_by_parameters(
        &mut self,
        index: usize,
        state: &NominalState,
    ) -> Option<(usize, Matrix3)> {
        let sensitivity = state.sensitivity.as_ref()?;
        let member = *self.part(index);
        self.part_mut(index).folded_motion = sensitivity.motion;
        let row = self.parameter_index(member.robot, ParameterKind::Motion)?;
        let value = self.parameters_at(row)?.value;
        let by = member.correction.adjoint() * (sensitivity.motion - member.folded_motion);
        self.part_mut(index).correction = Pose2::exp(by * value).compose(&member.correction);
        self.covariance.couple(index, row, &by);
        Some((row, by))
    }

    /// The robot in a block that is known to hold one.
    ///
    /// Indices come from [`Joint::index`] and from blocks added as robots, so that there always is one.
    #[allow(clippy::panic, reason = "an index of a robot's block is only ever taken from a robot's block")]
    pub(crate) fn part(&self, index: usize) -> &Member {
        match &self.blocks[index] {
            Block::Robot(member) => member,
            other => panic!("block {index} is no robot: {other:?}"),
        }
    }

    #[allow(clippy::panic, reason = "an index of a robot's block is only ever taken from a robot's block")]
    fn part_mut(&mut self, index: usize) -> &mut Member {
        match &mut self.blocks[index] {
            Block::Robot(member) => member,
            other => panic!("block {index} is no robot: {other:?}"),
        }
    }

    /// What the error of a block is the error of: a robot's correction, a landmark's pose.
    pub(crate) fn frame(&self, index: usize) -> &Pose2 {
        match &self.blocks[index] {
            Block::Landmark(mapped) => &mapped.pose,
            Block::Anchor(anchor) => &anchor.pose,
            _ => &self.part(index).correction,
        }
    }

    /// Measures a block's error from another correction or pose. For windows of the fold.
    pub(crate) fn set_frame(&mut self, index: usize, frame: Pose2) {
        match &mut self.blocks[index] {
            Block::Landmark(mapped) => mapped.pose = frame,
            Block::Anchor(anchor) => anchor.pose = frame,
            _ => self.part_mut(index).correction = frame,
        }
    }

    /// Gives a landmark a place, seen from the frame `from` of the robot in a block at `position`, with covariance `spread` there.
    ///
    /// It is a frame turned as the one it was seen from, and its error is that robot's with the noise of the measurement:
    /// `xi_l = xi_a + Ad_{X_l} n`. `mount` is what else moves the frame it is seen from, and how.
    pub(crate) fn map_landmark(
        &mut self,
        landmark: LandmarkId,
        observer: usize,
        mount: Option<(usize, Matrix3)>,
        from: &Pose2,
        position: Vector2,
        spread: &Matrix3,
    ) {
        let pose = from.compose(&Pose2::new(position.x, position.y, 0.0));
        let component = self.component(observer).unwrap_or(Component::MAP);
        let index = self.add(&Block::Landmark(MappedLandmark { landmark, pose, component }));
        self.covariance.couple(index, observer, &Matrix3::identity());
        if let Some((mount, by)) = mount {
            self.covariance.couple(index, mount, &by);
        }
        let noise = Symmetric3::from_lower(spread).congruence(&pose.adjoint());
        self.covariance.add_diagonal(index, noise);
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

    /// Takes an error found into what it is the error of.
    pub(crate) fn correct(&mut self, index: usize, delta: Vector3) {
        match (&mut self.blocks[index], self.form) {
            (Block::Robot(member), ErrorForm::Invariant) if member.placed => {
                member.correction = Pose2::exp(delta).compose(&member.correction);
            }
            (Block::Robot(member), ErrorForm::Additive) if member.placed => {
                let pose = member.correction.compose(&member.nominal);
                let moved = Pose2::new(pose.x_m() + delta.x, pose.y_m() + delta.y, pose.yaw_rad() + delta.z);
                member.correction = moved.compose(&member.nominal.inverse());
            }
            (Block::Parameters(of), _) => of.value += delta,
            (Block::Landmark(mapped), _) => mapped.pose = Pose2::exp(delta).compose(&mapped.pose),
            (Block::Anchor(anchor), _) => anchor.pose = Pose2::exp(delta).compose(&anchor.pose),
            (Block::Robot(_) | Block::Free, _) => {}
        }
    }

    /// The bits of the estimate, for comparing two of them: robots, corrections, covariance.
    pub(crate) fn words(&self) -> impl Iterator<Item = u64> + '_ {
        let blocks = self.blocks.iter().flat_map(Block::words);
        let blocks = blocks.chain(self.ties.iter().flat_map(Tie::words));
        let blocks = blocks.chain(self.contradictions.iter().flat_map(Contradiction::words));
        let stated = self.stated.iter().flat_map(|(id, [x, y])| [u64::from(id.0), x.to_bits(), y.to_bits()]);
        let blocks = blocks.chain(stated);
        blocks.chain(self.covariance.lower().iter().map(|entry| entry.to_bits()))
    }
}

/// `[I, J (p_new - p_last)]`: the textbook transition from a robot's last event to `pose`.
pub(crate) fn additive_transition(last: &Pose2, pose: &Pose2) -> Matrix3 {
    let moved = pose.position() - last.position();
    Matrix3::new(1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0)
}

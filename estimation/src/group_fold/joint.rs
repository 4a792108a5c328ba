//! The joint state of a team in any group, and the fold of one fact into it.

use super::covariance::Participant;
use super::{
    Continuation, Fact, Linearization, Noise, NominalState, Quantity, Space, Symmetric, TeamCovariance,
    Unusable,
};
use crate::fact::Fingerprint;
use crate::fold::FactKey;
use crate::geometry::Tangent;
use crate::{BootIndex, RobotId};

/// Chi-square at 99.9 % for 1 to 6 degrees of freedom (`abramowitz1964`, table 26.8).
const GATES: [f64; 6] = [10.828, 13.816, 16.266, 18.467, 20.515, 22.458];

/// All that decides the bits of an estimate besides the facts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoldConfig<const D: usize> {
    /// Gate on the normalized innovation squared by dimension of the measurement, 1 to `D`; infinite to accept everything.
    pub gate: [f64; D],
}

impl<const D: usize> Default for FoldConfig<D> {
    /// Chi-square at 99.9 %; beyond six degrees of freedom, none.
    fn default() -> Self {
        Self { gate: std::array::from_fn(|index| GATES.get(index).copied().unwrap_or(f64::INFINITY)) }
    }
}

/// A robot's part in the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member<G, const D: usize> {
    /// Which robot.
    pub robot: RobotId,
    /// The boot whose nominal trajectory is corrected.
    pub boot: BootIndex,
    /// `G`, with `Xhat(t) = G N(t)`.
    pub correction: G,
    /// `N` at the robot's last event.
    pub nominal: G,
    /// `C` up to which process noise is folded.
    pub folded_noise: Symmetric<D>,
    placed: bool,
}

/// Why a fact was not folded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SkipReason {
    /// A participant has no place in the map yet.
    NotPlaced(RobotId),
    /// A participant's state belongs to a boot that has ended or has not begun.
    OtherBoot(RobotId),
    /// The measurement has no linearization at the estimate.
    Unusable(Unusable),
    /// The innovation covariance is not positive definite, or the noise has the wrong dimension.
    Noise,
    /// A robot observed itself.
    Itself,
}

/// What the fold did with a fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// A boot took effect.
    Booted,
    /// A robot was placed in the map by its prior.
    Placed,
    /// The joint was updated.
    Used,
    /// The gate refused it; nothing but process noise entered.
    Rejected {
        /// The gate.
        threshold: f64,
    },
    /// It could not be folded.
    Skipped(SkipReason),
}

/// The record every fact leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual<const D: usize> {
    /// What became of it.
    pub outcome: Outcome,
    /// Dimension of the measurement; 0 where there was none.
    pub dimension: usize,
    /// Measured minus predicted before the update; zero beyond the dimension.
    pub innovation: Tangent<D>,
    /// Normalized innovation squared.
    pub nis: f64,
}

impl<const D: usize> Residual<D> {
    fn without_measurement(outcome: Outcome) -> Self {
        Self { outcome, dimension: 0, innovation: Tangent::zeros(), nis: 0.0 }
    }
}

/// The team as a joint filter sees it after some prefix of the facts.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint<G, const D: usize> {
    members: Vec<Member<G, D>>,
    covariance: TeamCovariance<D>,
}

impl<G, const D: usize> Default for Joint<G, D> {
    /// No robot yet.
    fn default() -> Self {
        Self { members: Vec::new(), covariance: TeamCovariance::default() }
    }
}

impl<G: Space<D>, const D: usize> Joint<G, D> {
    /// The robots that have a place in the map, with their blocks in the covariance.
    pub fn members(&self) -> impl Iterator<Item = (usize, &Member<G, D>)> {
        self.members.iter().enumerate().filter(|(_, member)| member.placed)
    }

    /// Block of a robot that has a place in the map.
    pub fn index(&self, robot: RobotId) -> Option<usize> {
        self.members().find(|(_, member)| member.robot == robot).map(|(index, _)| index)
    }

    /// The covariance of all right-invariant errors `xi`; rows of a robot without a place are zero.
    pub fn covariance(&self) -> &TeamCovariance<D> {
        &self.covariance
    }

    /// `Xhat = G N` of a robot at `state` of its nominal trajectory, and the covariance of its `xi`: what is published is
    /// `A P A^T` with the group's `additive_from_invariant`.
    pub fn estimate(&self, robot: RobotId, state: &NominalState<G, D>) -> Option<(G, Symmetric<D>)> {
        let index = self.index(robot)?;
        let member = &self.members[index];
        let added = unfolded(member, state);
        Some((member.correction.compose(&state.nominal), self.covariance.diagonal(index).plus(&added)))
    }

    /// Carries a robot's part on to `state` of its nominal trajectory, as an event there would that measures nothing.
    pub fn carry_to(&mut self, robot: RobotId, state: &NominalState<G, D>) {
        if let Some(index) = self.index(robot) {
            self.propagate(index, state);
        }
    }

    /// A hash of all bits: of two joints of the same facts it is the same.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut words = Vec::new();
        for member in &self.members {
            words.extend([u64::from(member.robot.0), u64::from(member.boot.0), u64::from(member.placed)]);
            words.extend(member.correction.words().chain(member.nominal.words()));
            words.extend(member.folded_noise.packed().map(f64::to_bits));
        }
        words.extend(self.covariance.lower().iter().map(|entry| entry.to_bits()));
        Fingerprint::of_words(words)
    }

    /// Folds one fact. To be called in the order of the keys; [`FactSet`](super::FactSet) does.
    pub fn fold(&mut self, config: &FoldConfig<D>, key: &FactKey, fact: &Fact<G, D>) -> Residual<D> {
        let folded = match fact {
            Fact::Boot { nominal, continuation } => {
                self.boot(key.id.robot, key.id.boot, nominal, continuation.as_ref());
                Ok(Residual::without_measurement(Outcome::Booted))
            }
            Fact::Observation { quantity, noise, observer, other } => {
                self.observe(config, key, quantity, noise, observer, other.as_ref())
            }
        };
        folded.unwrap_or_else(|reason| Residual::without_measurement(Outcome::Skipped(reason)))
    }

    fn observe(
        &mut self,
        config: &FoldConfig<D>,
        key: &FactKey,
        quantity: &Quantity<G, D>,
        noise: &Noise<D>,
        observer: &NominalState<G, D>,
        other: Option<&(BootIndex, NominalState<G, D>)>,
    ) -> Result<Residual<D>, SkipReason> {
        if noise.dimension != quantity.dimension() {
            return Err(SkipReason::Noise);
        }
        if let Quantity::Absolute(absolute) = quantity
            && let Some(z) = G::prior(absolute)
            && self.index(key.id.robot).is_none()
        {
            self.place(key, &z, &noise.covariance, observer);
            return Ok(Residual::without_measurement(Outcome::Placed));
        }
        let a = self.participant(key.id.robot, key.id.boot)?;
        let b = match (quantity, other) {
            (Quantity::Robot { robot, .. }, _) if *robot == key.id.robot => return Err(SkipReason::Itself),
            (Quantity::Robot { robot, .. }, None) => return Err(SkipReason::NotPlaced(*robot)),
            (Quantity::Robot { robot, .. }, Some((boot, state))) => {
                Some((self.participant(*robot, *boot)?, state))
            }
            (Quantity::Landmark { .. } | Quantity::Absolute(_), _) => None,
        };
        self.propagate(a, observer);
        if let Some((b, state)) = b {
            self.propagate(b, state);
        }
        let at = self.linearize(quantity, a, b.map(|(b, _)| b)).map_err(SkipReason::Unusable)?;
        let mut participants = Vec::with_capacity(2);
        let sign = if matches!(quantity, Quantity::Absolute(_)) { 1.0 } else { -1.0 };
        participants.push(Participant { index: a, jacobian: at.jacobian * sign });
        participants.extend(b.map(|(index, _)| Participant { index, jacobian: at.jacobian }));
        self.update(config, &at, &noise.covariance, &participants)
    }

    fn participant(&self, robot: RobotId, boot: BootIndex) -> Result<usize, SkipReason> {
        let index = self.index(robot).ok_or(SkipReason::NotPlaced(robot))?;
        if self.members[index].boot == boot { Ok(index) } else { Err(SkipReason::OtherBoot(robot)) }
    }

    /// Linearizes at `G N` of the participants' last event, which is now.
    fn linearize(
        &self,
        quantity: &Quantity<G, D>,
        a: usize,
        b: Option<usize>,
    ) -> Result<Linearization<D>, Unusable> {
        let pose = |index: usize| self.members[index].correction.compose(&self.members[index].nominal);
        match (quantity, b) {
            (Quantity::Robot { relative, .. }, Some(b)) => G::of_robot(relative, &pose(a), &pose(b)),
            (Quantity::Robot { relative, .. }, None) => G::of_robot(relative, &pose(a), &pose(a)),
            (Quantity::Landmark { relative, position_m, .. }, _) => {
                G::of_point(relative, &pose(a), position_m)
            }
            (Quantity::Absolute(absolute), _) => Ok(G::of_map(absolute, &pose(a))),
        }
    }

    /// Places a robot: `G = z N^-1`, its block from the noise of `z` in the body frame, no cross terms.
    fn place(&mut self, key: &FactKey, z: &G, noise: &Symmetric<D>, at: &NominalState<G, D>) {
        let member = Member {
            robot: key.id.robot,
            boot: key.id.boot,
            correction: z.compose(&at.nominal.inverse()),
            nominal: at.nominal,
            folded_noise: at.noise_sum,
            placed: true,
        };
        let known = self.members.iter().position(|known| known.robot == key.id.robot);
        let index = known.unwrap_or(self.members.len());
        if known.is_some() {
            self.members[index] = member;
        } else {
            self.members.push(member);
            self.covariance.grow();
        }
        self.covariance.clear(index);
        self.covariance.add_diagonal(index, &noise.congruence(&z.adjoint()));
    }

    /// A boot begins: a continued one carries the robot's block on, a lost one ends it (`docs/theory.md`, section 6).
    fn boot(
        &mut self,
        robot: RobotId,
        boot: BootIndex,
        nominal: &G,
        continuation: Option<&Continuation<G, D>>,
    ) {
        let Some(index) = self.index(robot) else { return };
        let member = &mut self.members[index];
        match continuation {
            Some(Continuation { previous, last, gap }) if *previous == member.boot => {
                let s = nominal.compose(&last.nominal.inverse());
                let carried = last.noise_sum.minus(&member.folded_noise);
                member.correction = member.correction.compose(&s.inverse());
                member.folded_noise = carried.congruence(&s.adjoint()).scaled(-1.0);
                member.nominal = *nominal;
                member.boot = boot;
                let pose = member.correction.compose(nominal);
                self.covariance.add_diagonal(index, &gap.congruence(&pose.adjoint()));
            }
            _ => {
                member.placed = false;
                self.covariance.clear(index);
            }
        }
    }

    /// `P_ii += Ad_G (C - C_last) Ad_G^T`.
    fn propagate(&mut self, index: usize, state: &NominalState<G, D>) {
        let member = &mut self.members[index];
        let added = unfolded(member, state);
        member.folded_noise = state.noise_sum;
        member.nominal = state.nominal;
        self.covariance.add_diagonal(index, &added);
    }

    /// One update of the whole joint, if it passes the gate.
    fn update(
        &mut self,
        config: &FoldConfig<D>,
        at: &Linearization<D>,
        noise: &Symmetric<D>,
        participants: &[Participant<D>],
    ) -> Result<Residual<D>, SkipReason> {
        let prepared = self.covariance.prepare(at.dimension, &at.innovation, noise, participants);
        let prepared = prepared.ok_or(SkipReason::Noise)?;
        let nis = prepared.nis();
        let threshold = at.dimension.checked_sub(1).and_then(|index| config.gate.get(index));
        let threshold = *threshold.ok_or(SkipReason::Noise)?;
        let outcome = if nis > threshold { Outcome::Rejected { threshold } } else { Outcome::Used };
        if outcome == Outcome::Used {
            self.covariance.downdate(&prepared);
            for (index, member) in self.members.iter_mut().enumerate().filter(|(_, member)| member.placed) {
                member.correction = G::exp(&prepared.correction(index)).compose(&member.correction);
            }
        }
        Ok(Residual { outcome, dimension: at.dimension, innovation: at.innovation, nis })
    }
}

/// Process noise since the robot's last event, in the frame of the map.
fn unfolded<G: Space<D>, const D: usize>(member: &Member<G, D>, state: &NominalState<G, D>) -> Symmetric<D> {
    state.noise_sum.minus(&member.folded_noise).congruence(&member.correction.adjoint())
}

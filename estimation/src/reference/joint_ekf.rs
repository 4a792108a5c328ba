//! The centralized joint filter over facts: the oracle of the fold.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::facts::{FactContent, Measurement, ReferenceFact, State, noise_matrix};
use super::joint::JointCovariance;
use super::models::{
    ErrorForm, Outcome, SkipReason, additive_from_invariant, adjoint, blocks, dynamic, error_from_body,
    linearize, quarter_turn,
};
use crate::fact::{Absolute, Boot, EntryId, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId, Timestamp};

pub use crate::fold::DEFAULT_GATE;

/// The joint extended Kalman filter over facts, as a function from a list of facts to an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointEkf {
    /// Which error the covariance speaks of.
    pub form: ErrorForm,
    /// Largest normalized innovation squared that is used, for measurements of dimension 1, 2 and 3.
    pub gate: [f64; 3],
}

/// What [`JointEkf::fold`] returns.
#[derive(Clone, Debug, PartialEq)]
pub struct JointEstimate {
    /// Which error the covariance speaks of.
    pub form: ErrorForm,
    /// The placed robots, ascending.
    pub robots: Vec<RobotEstimate>,
    /// Their joint covariance, each robot at its last event, in the same order.
    pub covariance: JointCovariance,
    /// What became of every fact, in fold order.
    pub records: Vec<FactRecord>,
}

/// The estimate of one placed robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotEstimate {
    /// Which robot.
    pub robot: RobotId,
    /// The boot whose nominal trajectory is corrected.
    pub boot: BootIndex,
    /// `G`, with `X(t) = G N(t)`.
    pub correction: Pose2,
    /// Nominal pose at the last event, and the noise sum up to which the covariance counts.
    pub last: NominalState,
}

impl RobotEstimate {
    /// `X = G N` at the last event.
    pub fn pose(&self) -> Pose2 {
        self.correction.compose(&self.last.nominal)
    }
}

/// What became of one fact.
#[derive(Clone, Debug, PartialEq)]
pub struct FactRecord {
    /// Which fact.
    pub id: EntryId,
    /// Its time.
    pub time: Timestamp,
    /// What became of it.
    pub outcome: Outcome,
}

impl JointEstimate {
    /// The estimate of one robot, if it is placed.
    pub fn robot(&self, robot: RobotId) -> Option<&RobotEstimate> {
        self.robots.iter().find(|estimate| estimate.robot == robot)
    }

    /// What became of one fact.
    pub fn outcome(&self, id: EntryId) -> Option<Outcome> {
        self.records.iter().find(|record| record.id == id).map(|record| record.outcome)
    }

    /// NIS and dimension of every fact that came before the gate, used and rejected.
    pub fn nis(&self) -> impl Iterator<Item = (f64, usize)> + '_ {
        self.records.iter().filter_map(|record| record.outcome.nis())
    }

    /// The facts whose NIS is within a share `tolerance` of the gate they were folded with: correct
    /// implementations may decide them differently.
    pub fn near_gate(&self, gate: &[f64; 3], tolerance: f64) -> Vec<EntryId> {
        let near = |record: &&FactRecord| {
            record.outcome.nis().is_some_and(|(nis, dimension)| {
                let threshold = dimension.checked_sub(1).and_then(|index| gate.get(index));
                threshold.is_some_and(|threshold| (nis - threshold).abs() <= tolerance * threshold)
            })
        };
        self.records.iter().filter(near).map(|record| record.id).collect()
    }

    /// Pose and covariance (in the form's coordinates) of a robot carried forward to a nominal state
    /// of its current boot.
    pub fn predict(&self, robot: RobotId, to: &NominalState) -> Option<(Pose2, Matrix3)> {
        let estimate = self.robot(robot)?;
        let (transition, noise) = carry(self.form, estimate, to);
        let block = self.covariance.block(robot, robot)?;
        let covariance = transition * block * transition.transpose() + noise;
        Some((estimate.correction.compose(&to.nominal), covariance))
    }

    /// The joint covariance of the additive errors `(x, y, yaw)`, whatever the form.
    pub fn additive_covariance(&self) -> DMatrix<f64> {
        let matrix = self.covariance.matrix();
        match self.form {
            ErrorForm::Additive => matrix.clone(),
            ErrorForm::Invariant => {
                let mut map = DMatrix::zeros(matrix.nrows(), matrix.ncols());
                for (index, estimate) in self.robots.iter().enumerate() {
                    let block = dynamic(&additive_from_invariant(&estimate.pose()));
                    map.view_mut((3 * index, 3 * index), (3, 3)).copy_from(&block);
                }
                &map * matrix * map.transpose()
            }
        }
    }
}

impl JointEkf {
    /// The filter with the default gate.
    pub fn new(form: ErrorForm) -> Self {
        Self { form, gate: DEFAULT_GATE }
    }

    /// Folds facts, in any order and with repetitions, into an estimate.
    ///
    /// A continued boot is carried over only from the robot's current boot; any other boot entry
    /// forgets the robot's block.
    pub fn fold(&self, facts: &[ReferenceFact]) -> JointEstimate {
        let mut sorted: Vec<&ReferenceFact> = facts.iter().collect();
        sorted.sort_by_key(|fact| fact.order());
        sorted.dedup_by_key(|fact| fact.id);
        let mut run = Run {
            form: self.form,
            gate: self.gate,
            team: BTreeMap::new(),
            covariance: JointCovariance::default(),
        };
        let record = |fact: &ReferenceFact| FactRecord {
            id: fact.id,
            time: fact.time,
            outcome: match &fact.content {
                FactContent::Boot(boot) => run.boot(fact.id.robot, fact.id.boot, boot),
                FactContent::Measurement(measurement) => run.measurement(measurement),
            },
        };
        let records = sorted.into_iter().map(record).collect();
        let robots = run.team.into_values().filter_map(|member| match member {
            Member::Placed(estimate) => Some(estimate),
            Member::Unplaced(_) => None,
        });
        JointEstimate { form: self.form, robots: robots.collect(), covariance: run.covariance, records }
    }
}

/// A robot that has booted.
#[derive(Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "nearly all are placed")]
enum Member {
    Unplaced(BootIndex),
    Placed(RobotEstimate),
}

impl Member {
    fn boot(&self) -> BootIndex {
        match self {
            Self::Unplaced(boot) => *boot,
            Self::Placed(estimate) => estimate.boot,
        }
    }
}

/// A fold under way.
struct Run {
    form: ErrorForm,
    gate: [f64; 3],
    team: BTreeMap<RobotId, Member>,
    covariance: JointCovariance,
}

/// Transition and noise that take a robot's error from its last event to a later nominal state.
///
/// Invariant: `I` and `Ad_G (C - C_last) Ad_G^T`. Additive: `Phi = [I, J (p - p_last); 0, 1]` and that
/// noise between `M` and `M^T` at the predicted pose.
fn carry(form: ErrorForm, estimate: &RobotEstimate, to: &NominalState) -> (Matrix3, Matrix3) {
    let ad = adjoint(&estimate.correction);
    let gained = to.noise_sum.to_matrix() - estimate.last.noise_sum.to_matrix();
    let noise = ad * gained * ad.transpose();
    match form {
        ErrorForm::Invariant => (Matrix3::identity(), noise),
        ErrorForm::Additive => {
            let predicted = estimate.correction.compose(&to.nominal);
            let displacement: Vector2 = predicted.position() - estimate.pose().position();
            let m = additive_from_invariant(&predicted);
            let transition = blocks(&nalgebra::Matrix2::identity(), &(quarter_turn() * displacement));
            (transition, m * noise * m.transpose())
        }
    }
}

impl Run {
    fn boot(&mut self, robot: RobotId, index: BootIndex, boot: &Boot) -> Outcome {
        let carried = match (self.team.get(&robot), &boot.continuation) {
            (Some(Member::Placed(estimate)), Some(continuation))
                if estimate.boot == continuation.previous =>
            {
                Some((*estimate, continuation))
            }
            _ => None,
        };
        let Some((mut estimate, continuation)) = carried else {
            self.covariance.remove(robot);
            self.team.insert(robot, Member::Unplaced(index));
            return Outcome::Boot;
        };
        if self.form == ErrorForm::Additive {
            // The additive error has no coordinates that stay put, so the remaining noise is folded now.
            self.advance(&mut estimate, &continuation.last);
        }
        let shift = boot.nominal.compose(&continuation.last.nominal.inverse());
        let ad = adjoint(&shift);
        let mut owed = continuation.last.noise_sum.to_matrix() - estimate.last.noise_sum.to_matrix();
        // Carried on from before its own last event: its journal had lost the end. Nothing is owed then.
        if (0..3)
            .any(|axis| owed[(axis, axis)] < -1e-9 * continuation.last.noise_sum.to_matrix()[(axis, axis)])
        {
            owed = Matrix3::zeros();
        }
        estimate.boot = index;
        estimate.correction = estimate.correction.compose(&shift.inverse());
        estimate.last =
            NominalState::new(boot.nominal, Symmetric3::from_lower(&-(ad * owed * ad.transpose())));
        let body = error_from_body(self.form, &estimate.pose());
        self.covariance.add(robot, &(body * continuation.gap.to_matrix() * body.transpose()));
        self.team.insert(robot, Member::Placed(estimate));
        Outcome::Boot
    }

    /// Carries one robot's error forward to a nominal state of its current boot.
    fn advance(&mut self, estimate: &mut RobotEstimate, to: &NominalState) {
        let (transition, noise) = carry(self.form, estimate, to);
        self.covariance.transform(estimate.robot, &transition);
        self.covariance.add(estimate.robot, &noise);
        estimate.last = *to;
    }

    fn measurement(&mut self, measurement: &Measurement) -> Outcome {
        let observer = measurement.observer;
        if measurement.observed.is_some_and(|observed| observed.robot == observer.robot) {
            return Outcome::Skipped(SkipReason::Malformed);
        }
        let Some(noise) = noise_matrix(&measurement.noise) else {
            return Outcome::Skipped(SkipReason::NoiseDimension);
        };
        if let Quantity::Absolute(Absolute::Pose(pose)) = &measurement.quantity
            && let Some(Member::Unplaced(boot)) = self.team.get(&observer.robot)
            && *boot == observer.boot
        {
            return self.place(&observer, pose, &noise);
        }
        let participants: Vec<State> = std::iter::once(observer).chain(measurement.observed).collect();
        let mut poses = Vec::new();
        let mut estimates = Vec::new();
        for state in &participants {
            match self.team.get(&state.robot) {
                Some(member) if member.boot() != state.boot => {
                    return Outcome::Skipped(SkipReason::OtherBoot);
                }
                None | Some(Member::Unplaced(_)) => return Outcome::Skipped(SkipReason::Unplaced),
                Some(Member::Placed(estimate)) => {
                    poses.push(estimate.correction.compose(&state.nominal.nominal));
                    estimates.push(*estimate);
                }
            }
        }
        for (state, mut estimate) in participants.iter().zip(estimates) {
            self.advance(&mut estimate, &state.nominal);
            self.team.insert(state.robot, Member::Placed(estimate));
        }
        let linearized = match linearize(self.form, &measurement.quantity, &poses[0], poses.get(1)) {
            Ok(linearized) => linearized,
            Err(reason) => return Outcome::Skipped(reason),
        };
        let observed = measurement.observed.map(|state| state.robot);
        let (outcome, corrections) =
            self.covariance.update(&linearized, observer.robot, observed, &noise, &self.gate);
        for (robot, d) in corrections {
            if let Some(Member::Placed(estimate)) = self.team.get_mut(&robot) {
                correct(self.form, estimate, &d);
            }
        }
        outcome
    }

    /// The prior of an unplaced robot: `G = z N^-1`, `P_ii = Ad_z R Ad_z^T` (or `diag(R_z, 1)` for it).
    fn place(&mut self, observer: &State, pose: &Pose2, noise: &DMatrix<f64>) -> Outcome {
        if noise.nrows() != 3 {
            return Outcome::Skipped(SkipReason::NoiseDimension);
        }
        let body = error_from_body(self.form, pose);
        let block = body * noise.fixed_view::<3, 3>(0, 0) * body.transpose();
        self.covariance.insert(observer.robot, &block);
        let estimate = RobotEstimate {
            robot: observer.robot,
            boot: observer.boot,
            correction: pose.compose(&observer.nominal.nominal.inverse()),
            last: observer.nominal,
        };
        self.team.insert(observer.robot, Member::Placed(estimate));
        Outcome::Placed
    }
}

/// Applies a correction of a robot's error: `G <- exp(d) G`, or `x += d` at the last event.
fn correct(form: ErrorForm, estimate: &mut RobotEstimate, d: &Vector3) {
    estimate.correction = match form {
        ErrorForm::Invariant => Pose2::exp(*d).compose(&estimate.correction),
        ErrorForm::Additive => {
            let pose = estimate.pose();
            Pose2::new(pose.x_m() + d.x, pose.y_m() + d.y, pose.yaw_rad() + d.z)
                .compose(&estimate.last.nominal.inverse())
        }
    };
}

#[cfg(test)]
mod tests;

//! What a boot does to the joint: a continued one carries a robot's block on, a lost one ends it.

use super::{Block, Component, ErrorForm, Joint, Parameters, Reputation, block};
use crate::fact::{Boot, Calibration, Continuation, NominalState};
use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, Pose2, RobotId, Timestamp};

impl Joint {
    /// A robot that has no place anywhere begins a frame of its own with a boot.
    pub(crate) fn begin_frame(&mut self, robot: RobotId, index: BootIndex, boot: &Boot) {
        if self.form != ErrorForm::Invariant || self.index(robot).is_some() {
            return;
        }
        self.untie_the_lost();
        let at = NominalState::new(boot.nominal, Symmetric3::zero());
        self.place(robot, index, &Pose2::identity(), &Matrix3::zeros(), &at);
        if let Some(row) = self.index(robot) {
            self.part_mut(row).component = Component::new(boot.time, robot);
        }
    }

    /// A boot begins: a continued one carries the robot's block on, a lost one ends it.
    pub(crate) fn boot(&mut self, robot: RobotId, index: BootIndex, boot: &Boot) {
        self.absolve(robot);
        let row = self.index(robot);
        let carried_on = match (&boot.continuation, row) {
            (Some(continuation), Some(row)) if continuation.previous == self.part(row).boot => {
                self.carry_on(row, index, boot, continuation);
                true
            }
            _ => {
                if let Some(row) = row {
                    self.part_mut(row).placed = false;
                    self.covariance.clear(row);
                }
                false
            }
        };
        if self.form == ErrorForm::Invariant {
            self.calibrate(robot, boot.time, boot.calibration.as_ref(), carried_on);
        }
    }

    /// What is uncertain of a robot from a boot on. What was estimated before stays if the boot is carried on.
    fn calibrate(
        &mut self,
        robot: RobotId,
        since: Timestamp,
        calibration: Option<&Calibration>,
        carried_on: bool,
    ) {
        let wanted: Vec<_> = calibration.into_iter().flat_map(block::uncertain).collect();
        for index in 0..self.blocks.len() {
            let Block::Parameters(of) = &self.blocks[index] else { continue };
            if of.robot == robot && !(carried_on && wanted.iter().any(|(kind, _)| *kind == of.kind)) {
                self.blocks[index] = Block::Free;
                self.covariance.clear(index);
            }
        }
        for (kind, [a, b, c]) in wanted {
            if self.parameter_index(robot, kind).is_none() {
                let value = Vector3::zeros();
                let index = self.add(&Block::Parameters(Parameters { robot, kind, value, since }));
                self.covariance.set_diagonal(index, Symmetric3::diagonal(a * a, b * b, c * c));
            }
        }
    }

    /// `S = N_new(t0) N_old(t1)^-1`, `G <- G S^-1`, and the noise not yet folded is carried into the new
    /// frame; then the unseen motion of the gap. Cross terms stay (`docs/theory.md`, boots).
    fn carry_on(&mut self, row: usize, index: BootIndex, boot: &Boot, continuation: &Continuation) {
        let s = boot.nominal.compose(&continuation.last.nominal.inverse());
        let form = self.form;
        let member = self.part_mut(row);
        let unfolded = unfolded_noise(continuation.last.noise_sum, member.folded_noise);
        // The additive form is linearized at the last event; that pose is the same in the new frame.
        member.nominal = s.compose(&member.nominal);
        member.correction = member.correction.compose(&s.inverse());
        member.folded_noise = unfolded.congruence(&s.adjoint()).scaled(-1.0);
        member.folded_motion = continuation
            .last
            .sensitivity
            .map_or_else(Matrix3::zeros, |last| s.adjoint() * (member.folded_motion - last.motion));
        member.boot = index;
        // Whoever begins anew is believed anew.
        member.reputation =
            Reputation { noise_level: member.reputation.noise_level, ..Reputation::default() };
        if form == ErrorForm::Additive {
            // Its coordinates do not stay put, so that what is carried is folded here, with the gap.
            let gap = continuation.gap.congruence(&boot.nominal.adjoint());
            self.propagate(row, &NominalState::new(boot.nominal, gap));
            self.part_mut(row).folded_noise = Symmetric3::zero();
        } else {
            // The gap is motion in the body frame at the pose after it. What is carried is folded with the
            // next event, as it would have been without the boot.
            let pose = member.correction.compose(&boot.nominal);
            member.nominal = boot.nominal;
            self.covariance.add_diagonal(row, continuation.gap.congruence(&pose.adjoint()));
        }
    }
}

/// The noise a boot leaves behind that is not folded yet. A robot that lost the end of its journal carries
/// on from before facts that others hold already; their noise cannot be taken back, and none is added.
fn unfolded_noise(last: Symmetric3, folded: Symmetric3) -> Symmetric3 {
    let unfolded = last.minus(folded);
    let before = [0, 2, 5].into_iter().any(|entry| unfolded.0[entry] < -1e-9 * last.0[entry]);
    if before { Symmetric3::zero() } else { unfolded }
}

//! The nominal trajectories of a robot's boots, one after the other.

use pleiad_estimation::fact::{NominalState, VoidReason};
use pleiad_estimation::motion::Step;
use pleiad_estimation::nominal::{NominalTrajectory, Outside};
use pleiad_estimation::{BootIndex, Pose2, Timestamp};

#[derive(Debug, Default)]
pub(super) struct Segments {
    all: Vec<(BootIndex, NominalTrajectory)>,
}

impl Segments {
    pub(super) fn begin(&mut self, boot: BootIndex, time: Timestamp, nominal: Pose2, horizon: usize) {
        self.all.push((boot, NominalTrajectory::new(time, nominal, horizon)));
    }

    pub(super) fn extend(&mut self, step: &Step) {
        if let Some((_, trajectory)) = self.all.last_mut() {
            trajectory.extend(step);
        }
    }

    pub(super) fn last(&self) -> Option<(BootIndex, &NominalTrajectory)> {
        self.all.last().map(|(boot, trajectory)| (*boot, trajectory))
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (BootIndex, &NominalTrajectory)> {
        self.all.iter().map(|(boot, trajectory)| (*boot, trajectory))
    }

    /// The state of the last boot.
    pub(super) fn current(&self, time: Timestamp) -> Result<NominalState, Outside> {
        self.all.last().map_or(Err(Outside::Before), |(_, trajectory)| trajectory.at(time))
    }

    /// The state in whichever boot covers `time`; [`VoidReason::Clock`] if it is after the last odometry.
    pub(super) fn find(&self, time: Timestamp) -> Result<(BootIndex, NominalState), VoidReason> {
        let mut reason = VoidReason::Clock;
        for (boot, trajectory) in self.all.iter().rev() {
            match trajectory.at(time) {
                Ok(state) => return Ok((*boot, state)),
                Err(Outside::After) => return Err(reason),
                Err(Outside::Forgotten) => return Err(VoidReason::TrajectoryLost),
                // Before this boot; if an earlier one ended before `time`, it fell into the gap between.
                Err(Outside::Before) => reason = VoidReason::OdometryGap,
            }
        }
        Err(VoidReason::BeforeBoot)
    }
}

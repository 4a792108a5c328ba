//! The nominal trajectories of a robot's boots, one after the other.

use pleiad_estimation::fact::{NominalState, VoidReason};
use pleiad_estimation::motion::Step;
use pleiad_estimation::nominal::{NominalTrajectory, Outside};
use pleiad_estimation::{BootIndex, Pose2, Timestamp};

#[derive(Debug, Default)]
pub(super) struct Segments {
    all: Vec<Segment>,
    /// Trajectories keep how they depend on what is calibrated.
    calibrated: bool,
    /// Path length of the boots forgotten, m.
    forgotten_m: f64,
}

#[derive(Debug)]
pub(super) struct Segment {
    pub boot: BootIndex,
    pub trajectory: NominalTrajectory,
    /// `odom_from_nominal`: the published frame goes on where a boot begins its trajectory elsewhere.
    pub odom: Pose2,
}

impl Segments {
    pub(super) fn new(calibrated: bool) -> Self {
        Self { calibrated, ..Self::default() }
    }

    pub(super) fn begin(
        &mut self,
        boot: BootIndex,
        time: Timestamp,
        nominal: Pose2,
        odom: Pose2,
        horizon: usize,
    ) {
        let trajectory = NominalTrajectory::new(time, nominal, horizon);
        let trajectory = if self.calibrated { trajectory.calibrated() } else { trajectory };
        self.all.push(Segment { boot, trajectory, odom });
    }

    /// Goes on, or begins, with a state from the journal.
    pub(super) fn restore(
        &mut self,
        boot: BootIndex,
        time: Timestamp,
        state: NominalState,
        odom: Pose2,
        horizon: usize,
    ) {
        match self.all.last_mut() {
            Some(last) if last.boot == boot => last.trajectory.restore(time, state),
            _ => self.all.push(Segment {
                boot,
                trajectory: NominalTrajectory::resume(time, state, horizon),
                odom,
            }),
        }
    }

    pub(super) fn extend(&mut self, step: &Step) {
        if let Some(last) = self.all.last_mut() {
            last.trajectory.extend(step);
        }
    }

    pub(super) fn last(&self) -> Option<(BootIndex, &NominalTrajectory)> {
        self.all.last().map(|segment| (segment.boot, &segment.trajectory))
    }

    pub(super) fn odom(&self) -> Pose2 {
        self.all.last().map_or_else(Pose2::identity, |segment| segment.odom)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Segment> {
        self.all.iter()
    }

    pub(super) fn of(&self, boot: BootIndex) -> Option<&NominalTrajectory> {
        self.all.iter().find(|segment| segment.boot == boot).map(|segment| &segment.trajectory)
    }

    pub(super) fn distance_m(&self) -> f64 {
        self.forgotten_m + self.all.iter().map(|segment| segment.trajectory.distance_m()).sum::<f64>()
    }

    /// The state of the last boot.
    pub(super) fn current(&self, time: Timestamp) -> Result<NominalState, Outside> {
        self.all.last().map_or(Err(Outside::Before), |segment| segment.trajectory.at(time))
    }

    /// The state in whichever boot covers `time`; [`VoidReason::Clock`] if it is after the last odometry.
    pub(super) fn find(&self, time: Timestamp) -> Result<(BootIndex, NominalState), VoidReason> {
        let mut reason = VoidReason::Clock;
        for Segment { boot, trajectory, .. } in self.all.iter().rev() {
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

    /// Forgets what nobody can ask for any more.
    pub(super) fn forget_until(&mut self, time: Timestamp) {
        while self.all.len() > 1 && self.all[1].trajectory.start() <= time {
            self.forgotten_m += self.all.remove(0).trajectory.distance_m();
        }
        self.all.iter_mut().for_each(|segment| segment.trajectory.forget_until(time));
    }
}

//! A robot's odometry integrated once more, from its samples: what the node made of them, for judging.

use pleiad_agent::NodeConfig;
use pleiad_estimation::Pose2;
use pleiad_estimation::motion::{DeadReckoning, OdometryRefusal, Step};
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::{Reading, Sample};

/// One robot's odometry, integrated.
#[derive(Clone, Debug)]
pub struct Reckoned {
    /// `N(t)` and `C(t)`, from the prior on.
    pub trajectory: NominalTrajectory,
    /// The motion between each two odometry samples.
    pub steps: Vec<Step>,
}

impl Reckoned {
    /// Of samples in the order of time. Without odometry the trajectory begins at time 0 and stays there.
    ///
    /// # Errors
    /// An odometry sample that the node would have refused too.
    pub fn of(config: &NodeConfig, samples: &[Sample]) -> Result<Self, OdometryRefusal> {
        let odometry = |sample: &&Sample| {
            matches!(
                sample.reading,
                Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_)
            )
        };
        let start = samples.iter().find(odometry).map(|sample| sample.time).unwrap_or_default();
        let nominal = config.prior.map_or_else(Pose2::identity, |prior| prior.pose);
        let mut reckoned =
            Self { trajectory: NominalTrajectory::new(start, nominal, usize::MAX), steps: Vec::new() };
        let mut dead_reckoning = DeadReckoning::new(config.motion);
        for sample in samples {
            if let Reading::Gyro { yaw_rate_rad_s } = sample.reading {
                dead_reckoning.gyro(sample.time, yaw_rate_rad_s);
            } else if odometry(&sample)
                && let Some(step) = dead_reckoning.odometry(*sample)?
            {
                reckoned.trajectory.extend(&step);
                reckoned.steps.push(step);
            }
        }
        Ok(reckoned)
    }
}

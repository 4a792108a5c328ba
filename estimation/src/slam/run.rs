//! Samples of one robot, in the order of their stamps, into the filter.

use super::filter::{JointSlam, Outcome, Slam};
use crate::motion::{DeadReckoning, MotionModel, OdometryRefusal, Step};
use crate::sample::{Reading, Relative, Sample, SampleRefusal, Target};
use crate::{LandmarkId, Timestamp};

/// What became of one scan.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanOutcome {
    /// When it was taken.
    pub time: Timestamp,
    /// The names its sightings carry, which the filter sees only if it associates by name, and what became of them.
    pub sightings: Vec<(LandmarkId, Outcome)>,
}

/// One map, or several side by side.
#[derive(Clone, Debug)]
enum Filter {
    One(Box<Slam>),
    Several(Box<JointSlam>),
}

impl Filter {
    fn best(&self) -> &Slam {
        match self {
            Self::One(slam) => slam,
            Self::Several(joint) => joint.best(),
        }
    }
}

/// The filter behind dead reckoning: scans wait until the odometry after them says how far the robot had come.
#[derive(Clone, Debug)]
pub struct SlamRun {
    filter: Filter,
    reckoning: DeadReckoning,
    waiting: Vec<(Timestamp, Vec<(LandmarkId, Relative)>)>,
    before_odometry: usize,
}

impl SlamRun {
    /// Before the first sample.
    pub fn new(slam: Slam, motion: MotionModel) -> Self {
        let reckoning = DeadReckoning::new(motion);
        Self { filter: Filter::One(Box::new(slam)), reckoning, waiting: Vec::new(), before_odometry: 0 }
    }

    /// The same with several maps side by side.
    pub fn joint(slam: JointSlam, motion: MotionModel) -> Self {
        let reckoning = DeadReckoning::new(motion);
        Self { filter: Filter::Several(Box::new(slam)), reckoning, waiting: Vec::new(), before_odometry: 0 }
    }

    /// What all sightings are taken for now, in their order, where later ones can change that; `None` otherwise.
    pub fn settled_outcomes(&self) -> Option<Vec<Outcome>> {
        match &self.filter {
            Filter::One(_) => None,
            Filter::Several(joint) => Some(joint.outcomes()),
        }
    }

    /// The filter, as of the last odometry; the best map of several.
    pub fn slam(&self) -> &Slam {
        self.filter.best()
    }

    /// Sightings from before the first odometry, which were left out.
    pub fn before_odometry(&self) -> usize {
        self.before_odometry
    }

    /// Takes a sample. Sightings of robots and absolute measurements are not used.
    ///
    /// `scanned` is called after every scan, with the filter as it is then.
    ///
    /// # Errors
    /// [`OdometryRefusal`] wrapped in [`Refused`], or a sighting without a noise; the sample leaves no trace.
    pub fn sample(
        &mut self,
        sample: &Sample,
        mut scanned: impl FnMut(&Slam, &ScanOutcome),
    ) -> Result<(), Refused> {
        match sample.reading {
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                if let Some(step) = self.reckoning.odometry(*sample)? {
                    self.advance(&step, &mut scanned)?;
                }
            }
            Reading::Gyro { yaw_rate_rad_s } => self.reckoning.gyro(sample.time, yaw_rate_rad_s),
            Reading::Sighting { target: Target::Landmark(landmark), relative } => {
                sample.check()?;
                if self.reckoning.last_time().is_none_or(|last| last > sample.time) {
                    self.before_odometry += 1;
                    return Ok(());
                }
                match self.waiting.last_mut() {
                    Some((time, scan)) if *time == sample.time => scan.push((landmark, relative)),
                    _ => self.waiting.push((sample.time, vec![(landmark, relative)])),
                }
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {}
        }
        Ok(())
    }

    fn advance(&mut self, step: &Step, scanned: &mut impl FnMut(&Slam, &ScanOutcome)) -> Result<(), Refused> {
        let whole = step.to.seconds_since(step.from);
        let mut at = step.from;
        let mut go = |filter: &mut Filter, to: Timestamp| {
            let share = to.seconds_since(at) / whole;
            if share > 0.0 {
                let (motion, noise) = (step.motion * share, step.covariance.scaled(share));
                match filter {
                    Filter::One(slam) => slam.propagate(&motion, noise),
                    Filter::Several(joint) => joint.propagate(&motion, noise),
                }
                at = to;
            }
        };
        let due = self.waiting.partition_point(|(time, _)| *time <= step.to);
        for (time, scan) in self.waiting.drain(..due) {
            go(&mut self.filter, time);
            let outcomes = match &mut self.filter {
                Filter::One(slam) => slam.scan(time, &scan)?,
                Filter::Several(joint) => joint.scan(time, &scan)?,
            };
            let names = scan.iter().map(|(name, _)| *name);
            let outcome = ScanOutcome { time, sightings: names.zip(outcomes).collect() };
            scanned(self.filter.best(), &outcome);
        }
        go(&mut self.filter, step.to);
        Ok(())
    }
}

/// Why a sample was not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refused {
    /// Odometry.
    #[error(transparent)]
    Odometry(#[from] OdometryRefusal),
    /// A sighting.
    #[error(transparent)]
    Sighting(#[from] SampleRefusal),
}

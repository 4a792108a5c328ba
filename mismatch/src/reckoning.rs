//! Dead reckoning by one robot's odometry, asked for any instant.

use pleiad_physics::predict::Path;
use pleiad_physics::{Motion, Pose};

use crate::search::first_not;

/// One sample of odometry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Its stamp, seconds.
    pub(crate) time_s: f64,
    /// Driven from this sample to the next, metres.
    pub(crate) forward_m: f64,
    /// Turned from this sample to the next, radians.
    pub(crate) yaw_rad: f64,
}

/// Where the robot is, in the frame of its beginning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reckoned {
    pub(crate) pose: Pose<f64>,
    pub(crate) path_m: f64,
}

/// Steps joined into a path.
#[derive(Clone, Debug)]
pub(crate) struct Reckoning {
    /// The stamps alone, because they are searched.
    times_s: Vec<f64>,
    steps: Vec<(Step, Reckoned)>,
    /// A longer step is a pause: what happened in it is unknown, seconds.
    pause_s: f64,
}

impl Reckoning {
    /// The steps are at increasing times; what the last one drives is not used.
    pub(crate) fn new(steps: impl Iterator<Item = Step>, pause_s: f64) -> Self {
        let mut here = Reckoned { pose: Pose::identity(), path_m: 0.0 };
        let steps = steps.map(|step| {
            let at = here;
            here = advanced(&at, &step, 1.0);
            (step, at)
        });
        let steps: Vec<_> = steps.collect();
        Self { times_s: steps.iter().map(|(step, _)| step.time_s).collect(), steps, pause_s }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// The stamps of the first and the last sample, seconds.
    pub(crate) fn span_s(&self) -> Option<(f64, f64)> {
        Some((*self.times_s.first()?, *self.times_s.last()?))
    }

    /// Odometry is nearly free of noise, so it may be interpolated. `None` outside the samples and in a
    /// pause.
    pub(crate) fn at(&self, time_s: f64) -> Option<Reckoned> {
        let (step, reckoned, share) = self.within(time_s)?;
        Some(if share > 0.0 { advanced(reckoned, step, share) } else { *reckoned })
    }

    /// How far it has driven (metres) and turned (radians): the same without the pose.
    pub(crate) fn travelled(&self, time_s: f64) -> Option<(f64, f64)> {
        let (step, reckoned, share) = self.within(time_s)?;
        Some((reckoned.path_m + share * step.forward_m, reckoned.pose.yaw_rad + share * step.yaw_rad))
    }

    /// The step that an instant lies in, and which share of it has passed.
    fn within(&self, time_s: f64) -> Option<(&Step, &Reckoned, f64)> {
        let after = self.after(time_s);
        let (step, reckoned) = self.steps.get(after.checked_sub(1)?)?;
        let since_s = time_s - step.time_s;
        if since_s <= 0.0 {
            return Some((step, reckoned, 0.0));
        }
        let step_s = self.times_s.get(after)? - step.time_s;
        (step_s <= self.pause_s).then_some((step, reckoned, since_s / step_s))
    }

    /// The position of the first sample after an instant.
    fn after(&self, time_s: f64) -> usize {
        first_not(&self.times_s, |stamp_s| *stamp_s, time_s, |stamp_s| stamp_s <= time_s)
    }
}

impl Path for Reckoning {
    /// Between samples the velocity is constant.
    fn motion_at(&self, time_s: f64) -> Option<Motion<f64>> {
        let after = self.after(time_s);
        let (step, reckoned) = self.steps.get(after.checked_sub(1)?)?;
        let step_s = self.times_s.get(after)? - step.time_s;
        if step_s > self.pause_s {
            return None;
        }
        let mut motion = Motion::at_rest(advanced(reckoned, step, (time_s - step.time_s) / step_s).pose);
        motion.speed_m_s = step.forward_m / step_s;
        motion.yaw_rate_rad_s = step.yaw_rad / step_s;
        Some(motion)
    }
}

fn advanced(from: &Reckoned, step: &Step, share: f64) -> Reckoned {
    let forward_m = share * step.forward_m;
    let moved = Pose::exp(forward_m, 0.0, share * step.yaw_rad);
    Reckoned { pose: from.pose.compose(&moved), path_m: from.path_m + forward_m }
}

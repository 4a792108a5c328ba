//! Where a robot truly was at any instant of a run.

use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::{Pose2, Timestamp};

/// True motion over one tick: constant wheel speeds, and the slip growing from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    pub(super) time: Timestamp,
    pub(super) pose: Pose2,
    pub(super) forward_m_s: f64,
    pub(super) yaw_rate_rad_s: f64,
}

impl Step {
    /// What the wheels say of the first `dt_s` seconds: an arc.
    pub(super) fn wheels(&self, dt_s: f64) -> Pose2 {
        Pose2::exp(Vector3::new(self.forward_m_s * dt_s, 0.0, self.yaw_rate_rad_s * dt_s))
    }
}

/// The true path of one robot: exact at the ticks of its odometry, on arcs in between.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    start: Pose2,
    steps: Vec<Step>,
    /// Slip at the end of each of `knots` equal parts of each step, from the start of the step.
    slip: Vec<Vector3>,
    knots: usize,
    end: Timestamp,
    end_pose: Pose2,
}

impl Track {
    pub(super) fn new(start: Pose2, begin: Timestamp, knots: usize) -> Self {
        Self { start, steps: Vec::new(), slip: Vec::new(), knots, end: begin, end_pose: start }
    }

    /// Appends a step from the present end to `until`; `slip` holds one entry per knot.
    pub(super) fn push(&mut self, forward_m_s: f64, yaw_rate_rad_s: f64, slip: &[Vector3], until: Timestamp) {
        debug_assert_eq!(slip.len(), self.knots);
        let step = Step { time: self.end, pose: self.end_pose, forward_m_s, yaw_rate_rad_s };
        let whole = slip.last().copied().unwrap_or_else(Vector3::zeros);
        let wheels = step.wheels(until.seconds_since(self.end));
        self.end_pose = step.pose.compose(&wheels).compose(&Pose2::exp(whole));
        self.end = until;
        self.steps.push(step);
        self.slip.extend_from_slice(slip);
    }

    pub(super) fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Where the robot stood before its first tick.
    pub fn start(&self) -> Pose2 {
        self.start
    }

    /// The last tick.
    pub fn end(&self) -> Timestamp {
        self.end
    }

    /// Where the robot was at the last tick.
    pub fn end_pose(&self) -> Pose2 {
        self.end_pose
    }

    /// The true pose, `map_from_robot`, at `time`: at rest before the first tick and after the last.
    pub fn pose_at(&self, time: Timestamp) -> Pose2 {
        if time >= self.end {
            return self.end_pose;
        }
        let Some(index) = self.steps.partition_point(|step| step.time <= time).checked_sub(1) else {
            return self.start;
        };
        let step = &self.steps[index];
        let until = self.steps.get(index + 1).map_or(self.end, |next| next.time);
        let elapsed_s = time.seconds_since(step.time);
        let share = elapsed_s / until.seconds_since(step.time);
        step.pose.compose(&step.wheels(elapsed_s)).compose(&Pose2::exp(self.slip_at(index, share)))
    }

    /// Slip after a share of a step: straight between knots.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of [0, 1] of the knots"
    )]
    fn slip_at(&self, index: usize, share: f64) -> Vector3 {
        let knots = &self.slip[index * self.knots..(index + 1) * self.knots];
        let position = share * self.knots as f64;
        let before = (position as usize).min(self.knots - 1);
        let from = if before == 0 { Vector3::zeros() } else { knots[before - 1] };
        from + (knots[before] - from) * (position - before as f64)
    }
}

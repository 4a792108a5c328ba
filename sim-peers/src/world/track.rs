//! Where a robot truly was at any instant of a run.

use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_physics::{Motion, Pose};

/// Velocities are differences over this long to either side, seconds: the spacing of knots.
const HALF_SPAN_S: f64 = 0.005;

/// The true path of one robot: exact at its knots, on arcs in between.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    start: Pose2,
    /// When each step of the robot's odometry began.
    ticks: Vec<Timestamp>,
    /// The pose at the end of each of `knots` equal parts of each step. The yaw is not wrapped.
    poses: Vec<Pose<f64>>,
    knots: usize,
    end: Timestamp,
}

impl Track {
    pub(super) fn new(start: Pose2, begin: Timestamp, knots: usize) -> Self {
        Self { start, ticks: Vec::new(), poses: Vec::new(), knots, end: begin }
    }

    /// Appends a step from the present end to `until`; `poses` holds one pose per knot.
    pub(super) fn push(&mut self, poses: &[Pose<f64>], until: Timestamp) {
        debug_assert_eq!(poses.len(), self.knots);
        self.ticks.push(self.end);
        self.poses.extend_from_slice(poses);
        self.end = until;
    }

    /// Every tick of the odometry: the beginnings of all steps, and the end of the last.
    pub(super) fn ticks(&self) -> impl Iterator<Item = Timestamp> + '_ {
        self.ticks.iter().copied().chain([self.end])
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
        wrapped(self.last())
    }

    /// The true pose, `map_from_robot`, at `time`: at rest before the first tick and after the last.
    pub fn pose_at(&self, time: Timestamp) -> Pose2 {
        wrapped(self.unwrapped_at(time))
    }

    /// The same with a yaw that is not wrapped.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of [0, 1] of the knots"
    )]
    pub(super) fn unwrapped_at(&self, time: Timestamp) -> Pose<f64> {
        if time >= self.end {
            return self.last();
        }
        let Some(tick) = self.ticks.partition_point(|begun| *begun <= time).checked_sub(1) else {
            return self.first();
        };
        let until = self.ticks.get(tick + 1).copied().unwrap_or(self.end);
        let share = time.seconds_since(self.ticks[tick]) / until.seconds_since(self.ticks[tick]);
        let position = share * self.knots as f64;
        let before = (position as usize).min(self.knots - 1);
        let next = tick * self.knots + before;
        let from = next.checked_sub(1).map_or_else(|| self.first(), |previous| self.poses[previous]);
        between(&from, &self.poses[next], position - before as f64)
    }

    /// Pose and velocity at `time`; the velocity is the mean over ten milliseconds.
    pub(super) fn motion_at(&self, time: Timestamp) -> Motion<f64> {
        let mut motion = Motion::at_rest(self.unwrapped_at(time));
        let [forward_m_s, _, yaw_rate_rad_s] = self.mean_velocity(time, HALF_SPAN_S);
        motion.speed_m_s = forward_m_s;
        motion.yaw_rate_rad_s = yaw_rate_rad_s;
        motion
    }

    /// Mean velocity of the body over `half_s` to either side of `time`: forward, left (m/s), yaw (rad/s).
    pub(super) fn mean_velocity(&self, time: Timestamp, half_s: f64) -> [f64; 3] {
        let (before, after) = (time.plus_seconds(-half_s), time.plus_seconds(half_s));
        let (from, to) = (self.unwrapped_at(before), self.unwrapped_at(after));
        let duration_s = after.seconds_since(before);
        let [forward_m, left_m] = from.rotate_back([to.x_m - from.x_m, to.y_m - from.y_m]);
        [forward_m, left_m, to.yaw_rad - from.yaw_rad].map(|moved| moved / duration_s)
    }

    /// Velocity at the end in the map, m/s.
    pub(super) fn end_velocity(&self) -> Vector2 {
        let [.., before, last] = self.poses.as_slice() else { return Vector2::zeros() };
        let Some(begun) = self.ticks.last() else { return Vector2::zeros() };
        let knot_s = self.end.seconds_since(*begun) / self.knots as f64;
        Vector2::new(last.x_m - before.x_m, last.y_m - before.y_m) / knot_s
    }

    /// The pose at the end, with a yaw that is not wrapped.
    pub(super) fn last(&self) -> Pose<f64> {
        self.poses.last().copied().unwrap_or_else(|| self.first())
    }

    fn first(&self) -> Pose<f64> {
        Pose::new(self.start.x_m(), self.start.y_m(), self.start.yaw_rad())
    }
}

/// A pose as others have it.
pub(super) fn wrapped(pose: Pose<f64>) -> Pose2 {
    Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad)
}

/// The pose after a share of the way from one pose to the next, at constant velocity of the body.
fn between(from: &Pose<f64>, to: &Pose<f64>, share: f64) -> Pose<f64> {
    let motion = from.between(to);
    let twist = Pose2::new(motion.x_m, motion.y_m, motion.yaw_rad).log();
    from.compose(&Pose::exp(twist.x * share, twist.y * share, motion.yaw_rad * share))
}

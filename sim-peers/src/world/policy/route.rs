//! A closed route of straight legs with turns on the spot.

use std::f64::consts::FRAC_PI_2;

use pleiad_estimation::Pose2;
use pleiad_estimation::geometry::{Vector2, wrap_angle};

use super::{Twist, View, steer};
use crate::scenario::Motion;

/// A turn on the spot is done when the heading is this close to the leg's, radians.
const ALIGNED_RAD: f64 = 0.02;
/// Slowest approach to a corner, m/s; below it a robot would never quite arrive.
const CREEP_M_S: f64 = 0.05;
/// Speed per metre still to go near a corner, 1/s.
const APPROACH_HZ: f64 = 1.5;
/// Nearer to the corner than this the direction to it is mostly noise, and the leg's is kept, metres.
const NEAR_M: f64 = 0.3;

/// The corners in order, and the leg being driven.
pub(super) struct Route {
    corners: Vec<Vector2>,
    /// The corner driven to.
    next: usize,
    turning: bool,
}

impl Route {
    /// A square whose first side lies ahead of `start`; `sense` +1 turns left at corners, -1 right.
    pub(super) fn square(start: &Pose2, side_m: f64, sense: f64) -> Self {
        let across = sense * side_m;
        let corners = [(0.0, 0.0), (side_m, 0.0), (side_m, across), (0.0, across)];
        Self::new(corners.iter().map(|(x, y)| start.act(Vector2::new(*x, *y))).collect())
    }

    /// There and back along a line ahead of `start`.
    pub(super) fn line(start: &Pose2, length_m: f64) -> Self {
        Self::new(vec![start.position(), start.act(Vector2::new(length_m, 0.0))])
    }

    fn new(corners: Vec<Vector2>) -> Self {
        Self { corners, next: 1, turning: false }
    }

    pub(super) fn command(&mut self, motion: &Motion, view: &View<'_>) -> Twist {
        let (mut leg, mut ahead) = self.leg(view);
        if !self.turning && ahead.dot(&leg) <= 0.0 {
            self.next = (self.next + 1) % self.corners.len();
            self.turning = true;
            (leg, ahead) = self.leg(view);
        }
        let remaining_m = ahead.dot(&leg);
        // On a leg the robot heads for its corner, so that it comes back to the line.
        let toward = if remaining_m > NEAR_M { ahead } else { leg };
        let error_rad = wrap_angle(toward.y.atan2(toward.x) - view.pose.yaw_rad());
        self.turning &= error_rad.abs() > ALIGNED_RAD;
        let forward_m_s = if self.turning || error_rad.abs() > FRAC_PI_2 {
            0.0
        } else {
            motion.speed_m_s.min((APPROACH_HZ * remaining_m).max(CREEP_M_S))
        };
        Twist { forward_m_s, yaw_rate_rad_s: steer(motion, error_rad) }
    }

    /// Unit vector of the present leg, and the way from the robot to its end.
    fn leg(&self, view: &View<'_>) -> (Vector2, Vector2) {
        let from = self.corners[(self.next + self.corners.len() - 1) % self.corners.len()];
        let to = self.corners[self.next];
        ((to - from).normalize(), to - view.pose.position())
    }
}

//! From one random point to the next, around other robots.

use pleiad_estimation::geometry::{Vector2, skew_times, wrap_angle};
use pleiad_estimation::{Pose2, RobotId};
use rand_chacha::ChaCha12Rng;

use super::{Twist, View, steer};
use crate::Scenario;
use crate::scenario::Motion;
use crate::world::placement::wander_area;
use crate::world::random::between;

/// A waypoint counts as reached from this near, metres.
const REACHED_M: f64 = 0.5;
/// Share of the cruising speed kept while facing away from the waypoint.
const LEAST_SPEED_SHARE: f64 = 0.2;
/// A leg is given up after this many times the time it should take, and ten seconds.
const PATIENCE: f64 = 3.0;
/// Robots nearer than the distance to keep plus this are steered around, metres.
const CAUTION_M: f64 = 1.0;
/// Weight of steering around a robot at the distance to keep, against that of the waypoint.
const AVOIDANCE: f64 = 2.0;
/// A robot stops for others within the distance to keep plus half of [`CAUTION_M`] and this cosine of
/// its forward axis.
const AHEAD_COSINE: f64 = 0.7;

/// A wandering robot.
pub(super) struct Wander {
    motion: Motion,
    area_m: [f64; 4],
    stream: ChaCha12Rng,
    leg: Leg,
}

struct Leg {
    to: Vector2,
    speed_m_s: f64,
    give_up_s: f64,
}

impl Wander {
    pub(super) fn new(scenario: &Scenario, robot: RobotId, start: Pose2, mut stream: ChaCha12Rng) -> Self {
        let settings = &scenario.robots[&robot];
        let area_m = wander_area(scenario, robot);
        let leg = leg(&settings.motion, area_m, start.position(), 0.0, &mut stream);
        Self { motion: settings.motion.clone(), area_m, stream, leg }
    }

    pub(super) fn command(&mut self, view: &View<'_>) -> Twist {
        let here = view.pose.position();
        if (self.leg.to - here).norm() < REACHED_M || view.time_s > self.leg.give_up_s {
            self.leg = leg(&self.motion, self.area_m, here, view.time_s, &mut self.stream);
        }
        let mut toward =
            (self.leg.to - here).try_normalize(0.0).unwrap_or_else(|| view.pose.rotate(Vector2::x()));
        let mut clearance = 1.0_f64;
        let keep_m = self.motion.keep_away_m;
        if keep_m > 0.0 {
            for other in view.team.iter().filter(|other| other.robot != view.robot) {
                let away = here - other.pose.position();
                let distance_m = away.norm();
                let closeness = (keep_m + CAUTION_M - distance_m) / CAUTION_M;
                if closeness <= 0.0 || distance_m <= 0.0 {
                    continue;
                }
                let away = away / distance_m;
                // Turned by a quarter both robots pass on the same side instead of facing each other.
                toward += (away + skew_times(away)) * (AVOIDANCE * closeness);
                if view.pose.rotate_back(-away).x > AHEAD_COSINE {
                    clearance = clearance.min((2.0 * (distance_m - keep_m) / CAUTION_M).clamp(0.0, 1.0));
                }
            }
        }
        let error_rad = wrap_angle(toward.y.atan2(toward.x) - view.pose.yaw_rad());
        let share = error_rad.cos().max(LEAST_SPEED_SHARE);
        Twist {
            forward_m_s: self.leg.speed_m_s * share * clearance,
            yaw_rate_rad_s: steer(&self.motion, error_rad),
        }
    }
}

/// A random leg from `here`.
fn leg(motion: &Motion, area_m: [f64; 4], here: Vector2, now_s: f64, stream: &mut ChaCha12Rng) -> Leg {
    let [x_min, x_max, y_min, y_max] = area_m;
    let to = Vector2::new(between(stream, x_min, x_max), between(stream, y_min, y_max));
    let speed_m_s = between(stream, motion.min_speed_m_s, motion.speed_m_s);
    Leg { to, speed_m_s, give_up_s: now_s + PATIENCE * (to - here).norm() / speed_m_s + 10.0 }
}

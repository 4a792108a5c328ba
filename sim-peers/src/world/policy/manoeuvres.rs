//! A programme rich in manoeuvres, as an operator drives it: one after the other in random order, and in
//! between back to where the next one has room.

use std::f64::consts::PI;

use pleiad_estimation::RobotId;
use pleiad_estimation::geometry::{Vector2, wrap_angle};
use pleiad_physics::Pose;
use rand_chacha::ChaCha12Rng;

use super::programme::{Limits, Manoeuvre, extent, programme};
use super::script::Script;
use super::{Twist, View, steer};
use crate::Scenario;
use crate::scenario::{DriveKind, ManoeuvreKind, Motion};
use crate::world::placement::own_area;
use crate::world::random::{between, uniform};

/// Kept free along the border of the area, a share of its smaller extent, and at most so many metres.
const MARGIN_SHARE: f64 = 0.1;
const MARGIN_M: f64 = 0.4;
/// A start counts as reached from this near, metres; a car is not that exact.
const REACHED_M: f64 = 0.08;
const CAR_REACHED_M: f64 = 0.5;
/// A heading counts as reached from this near, radians.
const ALIGNED_RAD: f64 = 0.03;
/// Off the way by more than this a robot turns on the spot, radians.
const TURN_FIRST_RAD: f64 = 0.4;
/// Slowest approach, m/s, and speed per metre still to go, 1/s.
const CREEP_M_S: f64 = 0.05;
const APPROACH_HZ: f64 = 1.2;
/// An approach takes no longer, seconds.
const PATIENCE_S: f64 = 25.0;

/// So many changes of phase at one instant are enough to find something to drive.
const CHOICES_AT_ONCE: u32 = 8;

/// A robot that goes through the programme.
pub(super) struct Manoeuvres {
    area_m: [f64; 4],
    limits: Limits,
    /// Which are driven; all if empty.
    kinds: Vec<ManoeuvreKind>,
    /// Manoeuvres still to come before all are shuffled again.
    deck: Vec<Manoeuvre>,
    stream: ChaCha12Rng,
    phase: Phase,
}

enum Phase {
    /// Nothing chosen yet.
    Choosing,
    /// To where a manoeuvre has room.
    Approaching {
        next: Manoeuvre,
        to: Vector2,
        heading_rad: f64,
        give_up_s: f64,
        arrived: bool,
    },
    Playing(Script),
}

impl Manoeuvres {
    pub(super) fn new(scenario: &Scenario, robot: RobotId, stream: ChaCha12Rng) -> Self {
        let settings = &scenario.robots[&robot];
        let motion = &settings.motion;
        let [x_min, x_max, y_min, y_max] = own_area(scenario, robot);
        let smaller_m = (x_max - x_min).min(y_max - y_min);
        let drive = &settings.drive;
        let tightest_m =
            (drive.kind == DriveKind::CarLike).then(|| drive.wheelbase_m / drive.max_steer_rad.tan());
        // A car that is called back turns round first.
        let turning_m = tightest_m.map_or(0.0, |radius_m| (2.0 * radius_m).min(0.25 * smaller_m));
        let margin_m = (MARGIN_SHARE * smaller_m).min(MARGIN_M) + turning_m;
        let limits = Limits {
            speed_m_s: motion.speed_m_s,
            yaw_rate_rad_s: motion.max_yaw_rate_rad_s,
            tightest_m,
            reach_m: 0.5 * smaller_m - margin_m,
        };
        let area_m = [x_min + margin_m, x_max - margin_m, y_min + margin_m, y_max - margin_m];
        let kinds = motion.manoeuvres.clone();
        Self { area_m, limits, kinds, deck: Vec::new(), stream, phase: Phase::Choosing }
    }

    pub(super) fn command(&mut self, motion: &Motion, view: &View<'_>) -> Twist {
        for _ in 0..CHOICES_AT_ONCE {
            match &mut self.phase {
                Phase::Choosing => self.choose(view),
                Phase::Playing(script) => match script.next(view.time_s) {
                    // Whoever strays, by effects or slip, is called back.
                    Some(twist) if self.inside(view) => return twist,
                    _ => self.phase = Phase::Choosing,
                },
                Phase::Approaching { .. } => match self.approach(motion, view) {
                    Some(twist) => return twist,
                    None => self.play(),
                },
            }
        }
        // Where nothing can be driven at all.
        Twist::default()
    }

    fn choose(&mut self, view: &View<'_>) {
        if self.deck.is_empty() {
            let [first, rest] = programme(&self.limits, &self.kinds);
            // Taken from the end.
            self.deck = self.shuffled(rest);
            let first = self.shuffled(first);
            self.deck.extend(first);
        }
        let Some(next) = self.deck.pop() else { return };
        let heading_rad = between(&mut self.stream, -PI, PI);
        let [x_min, x_max, y_min, y_max] = self.area_m;
        let middle = Vector2::new(f64::midpoint(x_min, x_max), f64::midpoint(y_min, y_max));
        let to = if self.limits.tightest_m.is_some() {
            middle
        } else {
            // From here the manoeuvre lies in the middle of the area.
            let [left, right, bottom, top] = extent(&next, Pose::new(0.0, 0.0, heading_rad));
            middle - Vector2::new(f64::midpoint(left, right), f64::midpoint(bottom, top))
        };
        let give_up_s = view.time_s + PATIENCE_S;
        self.phase = Phase::Approaching { next, to, heading_rad, give_up_s, arrived: false };
    }

    /// By Fisher and Yates.
    fn shuffled(&mut self, mut manoeuvres: Vec<Manoeuvre>) -> Vec<Manoeuvre> {
        for last in (1..manoeuvres.len()).rev() {
            let other = ((last + 1) as f64 * uniform(&mut self.stream)).floor();
            // The draw is below `last + 1`.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            manoeuvres.swap(last, other as usize);
        }
        manoeuvres
    }

    /// The command on the way to the start; none when it is reached.
    fn approach(&mut self, motion: &Motion, view: &View<'_>) -> Option<Twist> {
        let Phase::Approaching { next, to, heading_rad, give_up_s, arrived } = &mut self.phase else {
            return None;
        };
        let ahead = *to - view.pose.position();
        let (distance_m, here) = (ahead.norm(), view.pose);
        let error_rad = wrap_angle(ahead.y.atan2(ahead.x) - here.yaw_rad());
        let speed_m_s = (0.8 * motion.speed_m_s).min((APPROACH_HZ * distance_m).max(CREEP_M_S));
        if self.limits.tightest_m.is_some() {
            let room = extent(next, Pose::new(here.x_m(), here.y_m(), here.yaw_rad()));
            let done = within(room, self.area_m) || distance_m < CAR_REACHED_M || view.time_s > *give_up_s;
            let speed_m_s = speed_m_s.max(0.4 * motion.speed_m_s);
            return (!done)
                .then(|| Twist { forward_m_s: speed_m_s, yaw_rate_rad_s: steer(motion, error_rad) });
        }
        *arrived |= distance_m < REACHED_M;
        if *arrived {
            let error_rad = wrap_angle(*heading_rad - here.yaw_rad());
            let done = error_rad.abs() < ALIGNED_RAD || view.time_s > *give_up_s;
            return (!done).then(|| Twist { forward_m_s: 0.0, yaw_rate_rad_s: steer(motion, error_rad) });
        }
        let forward_m_s = if error_rad.abs() > TURN_FIRST_RAD { 0.0 } else { speed_m_s };
        let late = view.time_s > *give_up_s;
        (!late).then(|| Twist { forward_m_s, yaw_rate_rad_s: steer(motion, error_rad) })
    }

    fn play(&mut self) {
        if let Phase::Approaching { next, .. } = &self.phase {
            self.phase = Phase::Playing(Script::new(next));
        }
    }

    /// Whether the robot is where it should be: in its area, the margin included.
    fn inside(&self, view: &View<'_>) -> bool {
        let [x_min, x_max, y_min, y_max] = self.area_m;
        let spare_m = 0.5 * (MARGIN_M.min(MARGIN_SHARE * (x_max - x_min).min(y_max - y_min)));
        let place = view.pose.position();
        within(
            [place.x, place.x, place.y, place.y],
            [x_min - spare_m, x_max + spare_m, y_min - spare_m, y_max + spare_m],
        )
    }
}

/// Whether one rectangle lies within another.
fn within(inner: [f64; 4], outer: [f64; 4]) -> bool {
    inner[0] >= outer[0] && inner[1] <= outer[1] && inner[2] >= outer[2] && inner[3] <= outer[3]
}

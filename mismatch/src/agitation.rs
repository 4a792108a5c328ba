//! By how much a window of the wheels would change with the instants at which commands come.
//!
//! A command that comes `t` later takes from a window the change of speed that it makes there, times `t`. If
//! commands come at random times, the window has the variance of those times multiplied by the sum of the
//! squares of these changes: it is where commands act by the model, late ones later.

use pleiad_physics::chain::actuator::{Scheduled, servo};
use pleiad_physics::chain::servo::follow;
use pleiad_physics::signal::Servo;
use pleiad_physics::{Context, RobotModel, Scalar};

use crate::actuator::Turning;
use crate::plan::Plan;
use crate::schedule::Schedule;
use crate::track::Track;

/// After so many time constants a change of the set-point has been followed.
const FOLLOWED: f64 = 8.0;
/// A limit of acceleration takes no longer, seconds.
const LONGEST_RAMP_S: f64 = 2.0;

/// For every window that is compared the sum of the squared changes of speed that single commands make in it, of
/// both wheels' mean and of right minus left, (rad/s)^2.
pub(crate) fn agitation<S: Scalar>(
    track: &Track,
    plan: &Plan<Turning>,
    model: &RobotModel<S>,
) -> Vec<[f64; 2]> {
    let [radius_m, axle_m] = track.geometry_m;
    let schedule = Schedule::new(model, &track.commands);
    let scheduled = schedule.all();
    let windows = plan.items.iter().filter(|own| own.measured.is_some()).map(|own| &own.window);
    let one = |window: &pleiad_physics::predict::CommandWindow| {
        let middle_s = f64::midpoint(window.from_s, window.to_s);
        let context = Context {
            surroundings: window.surroundings,
            ..Context::new(&model.nominal, middle_s, window.motion.lift())
        };
        let follows = Follows::of(&servo(model, &context));
        let first = scheduled.partition_point(|own| own.from_s.value() < window.from_s - follows.reach_s());
        let past = scheduled.partition_point(|own| own.from_s.value() < window.to_s);
        let mut sums = [0.0; 2];
        for index in first.max(1)..past.max(first.max(1)) {
            let (before, after) = (&scheduled[index - 1], &scheduled[index]);
            let changes = follows.within(before, after, (window.from_s, window.to_s));
            sums[0] += (changes[0] / radius_m).powi(2);
            sums[1] += (changes[1] * axle_m / radius_m).powi(2);
        }
        sums
    };
    windows.map(one).collect()
}

/// How the servo follows, in numbers.
struct Follows {
    time_constants_s: [f64; 2],
    limits: [f64; 2],
}

impl Follows {
    fn of<S: Scalar>(servo: &Servo<S>) -> Self {
        Self {
            time_constants_s: [servo.time_constant_s.value(), servo.time_constant_turn_s.value()],
            limits: [servo.acceleration_limit_m_s2.value(), f64::INFINITY],
        }
    }

    fn reach_s(&self) -> f64 {
        let ramp_s = if self.limits[0].is_finite() { LONGEST_RAMP_S } else { 0.0 };
        FOLLOWED * self.time_constants_s[0].max(self.time_constants_s[1]) + ramp_s
    }

    /// By how much speed and yaw rate change in a window on their way from one command to the next.
    fn within<S: Scalar>(
        &self,
        before: &Scheduled<S>,
        after: &Scheduled<S>,
        (from_s, to_s): (f64, f64),
    ) -> [f64; 2] {
        let acts_s = after.from_s.value();
        let steps = [
            after.command.speed_m_s - before.command.speed_m_s,
            after.command.yaw_rate_rad_s - before.command.yaw_rate_rad_s,
        ];
        [0, 1].map(|axis| {
            let reached = |time_s: f64| {
                let since_s = time_s - acts_s;
                if since_s <= 0.0 {
                    return 0.0;
                }
                follow(0.0, steps[axis], self.time_constants_s[axis], self.limits[axis], since_s).speed
            };
            if steps[axis] == 0.0 { 0.0 } else { reached(to_s) - reached(from_s) }
        })
    }
}

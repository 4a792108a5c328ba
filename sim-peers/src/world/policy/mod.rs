//! Rules of motion: from where a robot is to a velocity command. Robots are steered by the true pose, as
//! by somebody who watches them, so that they stay in their area however far their own estimate drifts.

mod manoeuvres;
mod programme;
mod route;
mod script;
mod wander;

use std::f64::consts::PI;

use pleiad_estimation::{Pose2, RobotId};
use rand_chacha::ChaCha12Rng;

use crate::Scenario;
use crate::scenario::{Direction, Motion, Policy};
use manoeuvres::Manoeuvres;
use route::Route;
use script::Script;
use wander::Wander;

use super::vehicle::Neighbour;

/// Yaw rate commanded per radian of heading error, 1/s.
const STEERING_GAIN_HZ: f64 = 2.0;

/// A velocity command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Twist {
    pub(super) forward_m_s: f64,
    pub(super) yaw_rate_rad_s: f64,
}

/// What a rule may look at.
pub(super) struct View<'a> {
    pub(super) robot: RobotId,
    pub(super) time_s: f64,
    pub(super) pose: Pose2,
    /// Every robot, this one included, at its last tick.
    pub(super) team: &'a [Neighbour],
}

/// One robot's rule at work.
pub(super) struct Driver {
    motion: Motion,
    rule: Rule,
}

enum Rule {
    Parked,
    Circle,
    FigureEight,
    Route(Route),
    Wander(Wander),
    Manoeuvres(Manoeuvres),
    Script(Script),
    /// Wanders while it is its turn.
    InTurn {
        wander: Wander,
        turn: u32,
        turns: u32,
    },
}

impl Driver {
    pub(super) fn new(scenario: &Scenario, robot: RobotId, start: Pose2, stream: ChaCha12Rng) -> Self {
        let motion = scenario.robots[&robot].motion.clone();
        let wander = |stream| Wander::new(scenario, robot, start, stream);
        let rule = match motion.policy {
            Policy::Parked => Rule::Parked,
            Policy::Circle => Rule::Circle,
            Policy::FigureEight => Rule::FigureEight,
            Policy::Square => Rule::Route(Route::square(&start, motion.side_m, sense(&motion))),
            Policy::LineBackAndForth => Rule::Route(Route::line(&start, motion.side_m)),
            Policy::WaypointsRandom => Rule::Wander(wander(stream)),
            Policy::Manoeuvres => Rule::Manoeuvres(Manoeuvres::new(scenario, robot, stream)),
            Policy::Script => Rule::Script(Script::new(&motion.script)),
            Policy::PortableLandmarks => {
                let (rank, _) = rank(scenario, robot);
                Rule::InTurn { wander: wander(stream), turn: rank % 2, turns: 2 }
            }
            Policy::OneMover => {
                let (turn, turns) = rank(scenario, robot);
                Rule::InTurn { wander: wander(stream), turn, turns }
            }
        };
        Self { motion, rule }
    }

    pub(super) fn command(&mut self, view: &View<'_>) -> Twist {
        let motion = &self.motion;
        match &mut self.rule {
            Rule::Parked => Twist::default(),
            Rule::Circle => circle(motion, sense(motion)),
            Rule::FigureEight => {
                let loop_s = 2.0 * PI * motion.radius_m / motion.speed_m_s;
                let first_sense = (view.time_s / loop_s).floor() % 2.0 == 0.0;
                circle(motion, if first_sense { sense(motion) } else { -sense(motion) })
            }
            Rule::Route(route) => route.command(motion, view),
            Rule::Wander(wander) => wander.command(view),
            Rule::Manoeuvres(manoeuvres) => manoeuvres.command(motion, view),
            Rule::Script(script) => script.next(view.time_s).unwrap_or_default(),
            Rule::InTurn { wander, turn, turns } => {
                let now = (view.time_s / motion.move_s).floor() % f64::from(*turns);
                if (now - f64::from(*turn)).abs() < 0.5 { wander.command(view) } else { Twist::default() }
            }
        }
    }
}

/// +1 to the left, -1 to the right.
fn sense(motion: &Motion) -> f64 {
    match motion.direction {
        Direction::CounterClockwise => 1.0,
        Direction::Clockwise => -1.0,
    }
}

fn circle(motion: &Motion, sense: f64) -> Twist {
    Twist { forward_m_s: motion.speed_m_s, yaw_rate_rad_s: sense * motion.speed_m_s / motion.radius_m }
}

/// The robot's place among those under the same rule, from 0, and how many they are.
fn rank(scenario: &Scenario, robot: RobotId) -> (u32, u32) {
    let policy = scenario.robots[&robot].motion.policy;
    let mut rank = 0;
    let mut count = 0;
    for (other, settings) in &scenario.robots {
        if settings.motion.policy == policy {
            rank += u32::from(*other < robot);
            count += 1;
        }
    }
    (rank, count)
}

/// The yaw rate that turns toward `heading_error_rad` within the robot's limit.
fn steer(motion: &Motion, heading_error_rad: f64) -> f64 {
    (STEERING_GAIN_HZ * heading_error_rad).clamp(-motion.max_yaw_rate_rad_s, motion.max_yaw_rate_rad_s)
}

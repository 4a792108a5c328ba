//! Drives the whole team through a scenario: commands, servo, slip. Robots take their ticks in order of
//! time, because those that wander look where the others are.

use std::collections::BTreeMap;

use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::Command;
use rand_chacha::ChaCha12Rng;

use super::policy::{Driver, Twist, View};
use super::random::{Channel, Seed, normal};
use super::track::Track;
use crate::Scenario;
use crate::scenario::RobotSettings;

/// Truth is resolved at least this finely, Hz.
const SLIP_HZ: f64 = 200.0;
/// A speed below which a robot told to stop stands still, m/s and rad/s.
const STANDSTILL: f64 = 1e-4;

/// What one robot did.
pub(super) struct Drive {
    pub(super) track: Track,
    pub(super) commands: Vec<Command>,
}

/// Drives every robot until its first tick at or after the end of the scenario.
pub(super) fn drive(
    scenario: &Scenario,
    starts: &BTreeMap<RobotId, Pose2>,
    seed: Seed,
) -> BTreeMap<RobotId, Drive> {
    let end = Timestamp::from_seconds(scenario.duration_s);
    let mut poses: Vec<(RobotId, Pose2)> = starts.iter().map(|(robot, start)| (*robot, *start)).collect();
    let mut bodies: Vec<Body> =
        poses.iter().map(|(robot, start)| Body::new(scenario, *robot, *start, seed)).collect();
    while let Some(index) = next(&bodies, end) {
        bodies[index].tick(&poses);
        poses[index].1 = bodies[index].track.end_pose();
    }
    bodies
        .into_iter()
        .map(|body| (body.robot, Drive { track: body.track, commands: body.commands }))
        .collect()
}

/// The robot whose tick comes first, the smaller number at equal times; none once all are past the end.
fn next(bodies: &[Body], end: Timestamp) -> Option<usize> {
    let due = |(index, body): (usize, &Body)| (body.track.end() < end).then(|| (body.track.end(), index));
    bodies.iter().enumerate().filter_map(due).min().map(|(_, index)| index)
}

struct Body<'a> {
    robot: RobotId,
    settings: &'a RobotSettings,
    driver: Driver,
    slip: ChaCha12Rng,
    /// Time of the first tick, seconds.
    first_s: f64,
    ticks: u32,
    ticks_per_command: u32,
    command: Twist,
    servo: Twist,
    track: Track,
    commands: Vec<Command>,
    /// Slip at the knots of the present tick.
    knots: Vec<Vector3>,
}

impl<'a> Body<'a> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rates are up to 1000 Hz")]
    fn new(scenario: &'a Scenario, robot: RobotId, start: Pose2, seed: Seed) -> Self {
        let settings = &scenario.robots[&robot];
        let rate_hz = settings.odometry.rate_hz;
        let first_s = seed.phase(robot, Channel::Odometry) / rate_hz;
        let knots = (SLIP_HZ / rate_hz).ceil().max(1.0) as usize;
        Self {
            robot,
            settings,
            driver: Driver::new(scenario, robot, start, seed.stream(robot, Channel::Waypoints)),
            slip: seed.stream(robot, Channel::Slip),
            first_s,
            ticks: 0,
            ticks_per_command: (rate_hz / settings.command_rate_hz).round().max(1.0) as u32,
            command: Twist::default(),
            servo: Twist::default(),
            track: Track::new(start, Timestamp::from_seconds(first_s), knots),
            commands: Vec::new(),
            knots: vec![Vector3::zeros(); knots],
        }
    }

    fn tick(&mut self, poses: &[(RobotId, Pose2)]) {
        let time = self.track.end();
        if self.ticks.is_multiple_of(self.ticks_per_command) {
            let view = View { robot: self.robot, time_s: time.seconds(), pose: self.track.end_pose(), poses };
            self.command = self.driver.command(&view);
            let Twist { forward_m_s, yaw_rate_rad_s } = self.command;
            self.commands.push(Command { time, forward_m_s, yaw_rate_rad_s });
        }
        self.ticks += 1;
        let rate_hz = self.settings.odometry.rate_hz;
        let until = Timestamp::from_seconds(self.first_s + f64::from(self.ticks) / rate_hz);
        let dt_s = until.seconds_since(time);
        let held = self.follow(dt_s);
        self.grow_slip(held, dt_s);
        self.track.push(held.forward_m_s, held.yaw_rate_rad_s, &self.knots, until);
    }

    /// Lets the servo follow the command for a tick; the wheels hold its mean speed over that tick.
    fn follow(&mut self, dt_s: f64) -> Twist {
        let Twist { forward_m_s, yaw_rate_rad_s } = self.command;
        Twist {
            forward_m_s: lag(
                &mut self.servo.forward_m_s,
                forward_m_s,
                dt_s,
                self.settings.servo_time_constant_s,
            ),
            yaw_rate_rad_s: lag(
                &mut self.servo.yaw_rate_rad_s,
                yaw_rate_rad_s,
                dt_s,
                self.settings.servo_time_constant_turn_s,
            ),
        }
    }

    /// Draws the Brownian slip of a tick. The variates are drawn even where their variance is zero, so
    /// that standing still does not shift what comes later.
    fn grow_slip(&mut self, held: Twist, dt_s: f64) {
        let noise = &self.settings.odometry.noise;
        let variance = noise.variance(held.forward_m_s * dt_s, held.yaw_rate_rad_s * dt_s, dt_s);
        let sigmas = variance.map(|whole| (whole / self.knots.len() as f64).sqrt());
        let mut sum = Vector3::zeros();
        for knot in &mut self.knots {
            for (component, sigma) in sum.iter_mut().zip(sigmas) {
                *component += sigma * normal(&mut self.slip);
            }
            *knot = sum;
        }
    }
}

/// A first-order lag behind `target`: advances `state` by `dt_s` and returns its mean on the way.
fn lag(state: &mut f64, target: f64, dt_s: f64, time_constant_s: f64) -> f64 {
    if target == 0.0 && state.abs() < STANDSTILL {
        *state = 0.0;
        return 0.0;
    }
    let behind = *state - target;
    let decay = (-dt_s / time_constant_s).exp();
    *state = target + behind * decay;
    target + behind * (1.0 - decay) * time_constant_s / dt_s
}

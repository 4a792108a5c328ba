//! One robot on its way through the signal chain, from its commands to its true path.
//!
//! The chain is integrated by the midpoint rule in steps of at most two milliseconds: effects of heading
//! and place act as in the middle of a step. Predictions of the same chain take the samples of the encoders
//! as their steps.

use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_physics::chain::actuator::{self, ActuatorState, Scheduled, schedule_next, turn};
use pleiad_physics::chain::body::{BodyState, increment};
use pleiad_physics::{Context, Effect, Motion, Pose, RobotModel, Surroundings};
use pleiad_recording::Command;
use rand_chacha::ChaCha12Rng;

use super::drive::Drive;
use super::model::{Firmware, true_model};
use super::policy::{Driver, Twist, View};
use super::random::{Channel, Seed, chance, uniform};
use super::slip::Slip;
use super::steering::Steering;
use super::track::{Track, wrapped};
use crate::Scenario;
use crate::scenario::RobotSettings;

/// The true path has a knot at least this often, Hz.
const KNOT_HZ: f64 = 200.0;
/// No step of the integration is longer, seconds.
const LONGEST_STEP_S: f64 = 0.002;
/// A speed below which a robot told to stop stands still, m/s and rad/s: friction, which no servo
/// that is linear has.
const STANDSTILL: f64 = 1e-6;

/// A robot as others see it: where it was at its last tick, and how fast.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    pub(super) robot: RobotId,
    pub(super) pose: Pose2,
    time_s: f64,
    velocity_m_s: Vector2,
}

impl Neighbour {
    fn position_at(&self, time_s: f64) -> Vector2 {
        self.pose.position() + self.velocity_m_s * (time_s - self.time_s)
    }
}

/// A robot that drives.
pub(super) struct Vehicle<'a> {
    robot: RobotId,
    settings: &'a RobotSettings,
    model: RobotModel<f64>,
    firmware: Firmware,
    driver: Driver,
    slip: Slip,
    chances: ChaCha12Rng,
    jitter: ChaCha12Rng,
    /// Time of the first tick, seconds.
    first_s: f64,
    ticks: u32,
    /// How often it has been carried off.
    carried_off: usize,
    /// Time of the first command, seconds.
    first_command_s: f64,
    commands: Vec<Command>,
    scheduled: Vec<Scheduled<f64>>,
    actuator: ActuatorState<f64>,
    body: BodyState<f64>,
    /// Its pose is the true one, but for the slip of the present tick.
    motion: Motion<f64>,
    steering: Steering,
    /// Whether any effect asks who is near.
    feels_partners: bool,
    track: Track,
    wheel_angles: Vec<[f64; 2]>,
    steer_rad: Vec<f64>,
    steps_per_knot: u32,
    /// Poses at the knots of the present tick, and the slip there.
    poses: Vec<Pose<f64>>,
}

impl<'a> Vehicle<'a> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rates are up to 1000 Hz")]
    pub(super) fn new(scenario: &'a Scenario, robot: RobotId, start: Pose2, seed: Seed) -> Self {
        let settings = &scenario.robots[&robot];
        let rate_hz = settings.odometry.rate_hz;
        let first_s = seed.phase(robot, Channel::Odometry) / rate_hz;
        let knots = (KNOT_HZ / rate_hz).ceil().max(1.0);
        let steps = (1.0 / (rate_hz * knots * LONGEST_STEP_S)).ceil().max(1.0);
        let partner =
            |effect: &pleiad_physics::ActiveEffect<f64>| effect.effect() == Effect::PartnerInfluence;
        Self {
            robot,
            settings,
            model: true_model(settings),
            firmware: Firmware::of(settings),
            driver: Driver::new(scenario, robot, start, seed.stream(robot, Channel::Waypoints)),
            slip: Slip::new(seed, robot, settings),
            chances: seed.stream(robot, Channel::Commands),
            jitter: seed.stream(robot, Channel::Jitter),
            first_s,
            ticks: 0,
            carried_off: 0,
            first_command_s: first_s + seed.phase(robot, Channel::Commands) / settings.command_rate_hz,
            commands: Vec::new(),
            scheduled: Vec::new(),
            actuator: ActuatorState::default(),
            body: BodyState::default(),
            motion: Motion::at_rest(Pose::new(start.x_m(), start.y_m(), start.yaw_rad())),
            steering: Steering::new(settings),
            feels_partners: settings.effects.iter().any(partner),
            track: Track::new(start, Timestamp::from_seconds(first_s), knots as usize),
            wheel_angles: vec![[0.0; 2]],
            steer_rad: vec![0.0],
            steps_per_knot: steps as u32,
            poses: vec![Pose::identity(); knots as usize],
        }
    }

    /// The instant of its next tick.
    pub(super) fn now(&self) -> Timestamp {
        self.track.end()
    }

    pub(super) fn seen_by_others(&self) -> Neighbour {
        Neighbour {
            robot: self.robot,
            pose: self.track.end_pose(),
            time_s: self.track.end().seconds(),
            velocity_m_s: self.track.end_velocity(),
        }
    }

    pub(super) fn into_drive(self) -> (RobotId, Drive) {
        let Self { robot, track, commands, wheel_angles, steer_rad, .. } = self;
        (robot, Drive { track, commands, wheel_angles, steer_rad })
    }

    /// Drives from one sample of the odometry to the next.
    pub(super) fn tick(&mut self, team: &[Neighbour]) {
        let begun = self.now();
        self.be_carried_off(begun.seconds());
        self.ticks += 1;
        let until =
            Timestamp::from_seconds(self.first_s + f64::from(self.ticks) / self.settings.odometry.rate_hz);
        self.take_commands(until, team);
        let begun_s = begun.seconds();
        let duration_s = until.seconds_since(begun);
        let step_s = duration_s / (self.poses.len() as f64 * f64::from(self.steps_per_knot));
        let mut step = 0_u32;
        for knot in 0..self.poses.len() {
            for _ in 0..self.steps_per_knot {
                self.step(begun_s + f64::from(step) * step_s, step_s, team);
                step += 1;
            }
            self.poses[knot] = self.motion.pose;
        }
        self.slip(duration_s);
        self.track.push(&self.poses, until);
        self.motion.pose = self.track.last();
        self.wheel_angles.push(self.motion.wheel_angle_rad);
        self.steer_rad.push(self.steering.angle_rad());
    }

    /// Puts the robot where it was carried to by now: its wheels do not turn, and its speed stays.
    fn be_carried_off(&mut self, now_s: f64) {
        while let Some(kidnap) =
            self.settings.kidnap.get(self.carried_off).filter(|kidnap| kidnap.time_s <= now_s)
        {
            self.motion.pose = Pose::new(kidnap.x_m, kidnap.y_m, kidnap.heading_rad);
            self.carried_off += 1;
        }
    }

    /// Takes the commands that are given before `until`, by what the operator sees now.
    fn take_commands(&mut self, until: Timestamp, team: &[Neighbour]) {
        loop {
            let time_s = self.first_command_s + self.commands.len() as f64 / self.settings.command_rate_hz;
            let time = Timestamp::from_seconds(time_s);
            if time >= until {
                return;
            }
            let pose = wrapped(self.motion.pose);
            let view = View { robot: self.robot, time_s: time.seconds(), pose, team };
            let given = self.steering.feasible(self.driver.command(&view));
            let Twist { forward_m_s, yaw_rate_rad_s } = given;
            self.commands.push(Command { time, forward_m_s, yaw_rate_rad_s });

            let late_s = self.settings.command_jitter_s * uniform(&mut self.jitter);
            let mut context = Context::new(&self.model.nominal, time.seconds(), self.motion);
            context.chance = chance(&mut self.chances);
            let executed = self.firmware.executed(given);
            let command = actuator::Command {
                time_s: time.seconds() + late_s,
                speed_m_s: executed.forward_m_s,
                yaw_rate_rad_s: executed.yaw_rate_rad_s,
            };
            schedule_next(&self.model, &context, command, &mut self.scheduled);
        }
    }

    /// One step of the integration.
    fn step(&mut self, time_s: f64, step_s: f64, team: &[Neighbour]) {
        let active = self.command_at(time_s + 0.5 * step_s);
        self.steering.follow(self.firmware.given(active), step_s);
        let mut middle = self.motion;
        middle.pose = self.motion.carried(0.5 * step_s);
        let surroundings = Surroundings {
            steer_rad: self.steering.angle_rad(),
            voltage_change_v: self.settings.voltage_rate_v_per_s * time_s,
            partner_m: self.nearest(time_s + 0.5 * step_s, &middle.pose, team),
        };
        let context =
            Context { surroundings, ..Context::new(&self.model.nominal, time_s, middle).over(step_s) };

        let before = self.actuator;
        let turned =
            turn(&self.model, &context, &self.scheduled, (time_s, time_s + step_s), &mut self.actuator);
        stop(active.forward_m_s, before.speed_m_s, &mut self.actuator.speed_m_s);
        stop(active.yaw_rate_rad_s, before.yaw_rate_rad_s, &mut self.actuator.yaw_rate_rad_s);

        let moved = increment(&self.model, &context, turned, &mut self.body);
        self.motion.pose = moved.applied_to(&self.motion.pose);
        self.motion.speed_m_s = moved.speed_m_s;
        self.motion.yaw_rate_rad_s = moved.yaw_rate_rad_s;
        self.motion.acceleration_m_s2 = moved.acceleration_m_s2;
        for (angle, turned) in self.motion.wheel_angle_rad.iter_mut().zip(turned) {
            *angle += turned;
        }
    }

    /// The command in effect; standing still before the first.
    fn command_at(&self, time_s: f64) -> Twist {
        let begun = self.scheduled.partition_point(|command| command.from_s <= time_s);
        let last = begun.checked_sub(1).map(|last| self.scheduled[last].command);
        last.map_or_else(Twist::default, |held| Twist {
            forward_m_s: held.speed_m_s,
            yaw_rate_rad_s: held.yaw_rate_rad_s,
        })
    }

    /// Where the nearest other robot is, if anything depends on it.
    fn nearest(&self, time_s: f64, pose: &Pose<f64>, team: &[Neighbour]) -> Option<[f64; 2]> {
        if !self.feels_partners {
            return None;
        }
        let here = Vector2::new(pose.x_m, pose.y_m);
        let others = team.iter().filter(|other| other.robot != self.robot);
        others
            .map(|other| other.position_at(time_s))
            .min_by(|a, b| (a - here).norm().total_cmp(&(b - here).norm()))
            .map(|nearest| [nearest.x, nearest.y])
    }

    /// Adds the slip of a tick to its poses.
    fn slip(&mut self, duration_s: f64) {
        let before = self.wheel_angles.last().copied().unwrap_or_default();
        let turned = [0, 1].map(|wheel| self.motion.wheel_angle_rad[wheel] - before[wheel]);
        let (forward_m, turn_rad) = self.firmware.moved(turned, self.steering.angle_rad());
        let variance = self.settings.odometry.noise.variance(forward_m, turn_rad, duration_s);
        let knots = self.poses.len();
        let sigmas = variance.map(|whole| (whole / knots as f64).sqrt());
        let moving = turned.iter().any(|angle| *angle != 0.0);
        let slips = self.slip.tick(knots, sigmas, duration_s / knots as f64, moving);
        for (pose, slip) in self.poses.iter_mut().zip(slips) {
            *pose = pose.compose(&Pose::exp(slip.x, slip.y, slip.z));
        }
    }
}

/// Brings a speed that dies out after a stop to rest.
fn stop(commanded: f64, before: f64, speed: &mut f64) {
    if commanded == 0.0 && speed.abs() < STANDSTILL && speed.abs() < before.abs() {
        *speed = 0.0;
    }
}

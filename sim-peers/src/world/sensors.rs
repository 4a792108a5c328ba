//! A robot's sensors of itself: odometry, gyro, GPS, heading, and the ground truth beside them.
//!
//! A reading is taken at an instant of common time, of the true path as far back as the sensor is late, and
//! stamped by the robot's clock. Effects act by the hooks of the signal chain.

use pleiad_estimation::geometry::{Vector3, wrap_angle};
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_physics::chain::sensors;
use pleiad_physics::{Context, RobotModel};
use pleiad_recording::{Command, SteerSample, TruthSample};

use super::OBSERVATIONS_FROM_S;
use super::drive::Drive;
use super::model::{Firmware, true_model};
use super::random::{Channel, Seed, Tails, chance, normal};
use super::track::{Track, wrapped};
use crate::scenario::{DriveKind, OdometryKind, RobotSettings};

/// The channels of one robot, to be sampled from its true path.
pub(super) struct Channels<'a> {
    pub(super) seed: Seed,
    pub(super) robot: RobotId,
    pub(super) settings: &'a RobotSettings,
    pub(super) model: RobotModel<f64>,
    drive: &'a Drive,
    /// The last instant of anything but odometry.
    until: Timestamp,
}

impl<'a> Channels<'a> {
    pub(super) fn new(
        seed: Seed,
        robot: RobotId,
        settings: &'a RobotSettings,
        drive: &'a Drive,
        until: Timestamp,
    ) -> Self {
        Self { seed, robot, settings, model: true_model(settings), drive, until }
    }

    pub(super) fn track(&self) -> &'a Track {
        &self.drive.track
    }

    /// The instants of a channel: from `from_s` plus its own phase to the end of the run; none at rate 0.
    pub(super) fn instants(
        &self,
        channel: Channel,
        rate_hz: f64,
        from_s: f64,
    ) -> impl Iterator<Item = Timestamp> {
        let phase = self.seed.phase(self.robot, channel);
        instants(from_s, phase, rate_hz, self.until)
    }

    /// What the hooks of effects look at: the true motion at an instant.
    pub(super) fn context(&self, time: Timestamp) -> Context<'_, f64> {
        Context::new(&self.model.nominal, time.seconds(), self.track().motion_at(time))
    }

    /// The tails of a channel's noise.
    fn tails(&self, channel: Channel) -> Tails {
        Tails::new(self.seed, self.robot, channel, self.settings.noise_degrees_of_freedom)
    }

    /// The stamp that the robot's clock gives to an instant.
    pub(super) fn stamp(&self, time: Timestamp) -> Timestamp {
        time.plus_seconds(sensors::clock_error_s(&self.model, &self.context(time)))
    }

    /// The commands as the firmware received them.
    pub(super) fn commands(&self) -> Vec<Command> {
        let stamped = |command: &Command| Command { time: self.stamp(command.time), ..*command };
        self.drive.commands.iter().map(stamped).collect()
    }

    /// Odometry at every tick, in the form asked for, from the encoders as they are read. The last velocity,
    /// which nothing follows, repeats the one before.
    pub(super) fn odometry(&self) -> Vec<Sample> {
        let firmware = Firmware::of(self.settings);
        let ticks: Vec<Timestamp> = self.track().ticks().collect();
        let angles: Vec<[f64; 2]> = ticks
            .iter()
            .zip(self.turned_angles(&ticks))
            .map(|(time, angles)| self.encoders(*time, angles))
            .collect();
        let moved = |tick: usize| {
            let turned = [0, 1].map(|wheel| angles[tick + 1][wheel] - angles[tick][wheel]);
            let [before, after] = [tick, tick + 1].map(|tick| self.drive.steer_rad[tick]);
            firmware.moved(turned, f64::midpoint(before, after))
        };
        let reading = |tick: usize| match self.settings.odometry.kind {
            OdometryKind::Wheels => {
                let [left_rad, right_rad] = angles[tick];
                Reading::Wheels { left_rad, right_rad }
            }
            OdometryKind::Velocity => {
                let tick = tick.min(ticks.len() - 2);
                let (forward_m, turn_rad) = moved(tick);
                let duration_s = ticks[tick + 1].seconds_since(ticks[tick]);
                let (forward_m_s, yaw_rate_rad_s) = (forward_m / duration_s, turn_rad / duration_s);
                Reading::Velocity { forward_m_s, yaw_rate_rad_s }
            }
            OdometryKind::Increment => {
                Reading::Increment(tick.checked_sub(1).map_or(Pose2::identity(), |before| {
                    let (forward_m, turn_rad) = moved(before);
                    Pose2::exp(Vector3::new(forward_m, 0.0, turn_rad))
                }))
            }
        };
        ticks
            .iter()
            .enumerate()
            .map(|(tick, time)| Sample { time: self.stamp(*time), reading: reading(tick) })
            .collect()
    }

    /// Angles of the wheels at every tick, with what they turn without rolling.
    fn turned_angles(&self, ticks: &[Timestamp]) -> Vec<[f64; 2]> {
        let noise = &self.settings.odometry.wheel_noise;
        let sigmas = [noise.left_m_per_sqrt_s, noise.right_m_per_sqrt_s];
        let rolled = &self.drive.wheel_angles;
        if sigmas.iter().all(|sigma| *sigma == 0.0) {
            return rolled.clone();
        }
        let mut streams =
            [Channel::LeftWheel, Channel::RightWheel].map(|channel| self.seed.stream(self.robot, channel));
        let mut idle = [0.0; 2];
        let mut angles = rolled.clone();
        for tick in 1..angles.len() {
            let duration_s = ticks[tick].seconds_since(ticks[tick - 1]);
            for wheel in 0..2 {
                let drawn = normal(&mut streams[wheel]);
                if rolled[tick][wheel].to_bits() != rolled[tick - 1][wheel].to_bits() {
                    idle[wheel] += sigmas[wheel] * duration_s.sqrt() * drawn / self.settings.wheel_radius_m;
                }
                angles[tick][wheel] += idle[wheel];
            }
        }
        angles
    }

    /// Wheel angles as the encoders read them.
    fn encoders(&self, time: Timestamp, angles: [f64; 2]) -> [f64; 2] {
        let mut context = self.context(time);
        context.motion.wheel_angle_rad = angles;
        sensors::encoders(&self.model, &context)
    }

    /// Steering angles of a car at every tick, as its servo holds them but for their noise; none of any other
    /// robot.
    pub(super) fn steer(&self) -> Vec<SteerSample> {
        if self.settings.drive.kind != DriveKind::CarLike {
            return Vec::new();
        }
        let mut stream = self.seed.stream(self.robot, Channel::Steer);
        let sigma_rad = self.settings.drive.steer_sigma_rad;
        let sample = |(time, angle_rad): (Timestamp, &f64)| SteerSample {
            time: self.stamp(time),
            angle_rad: *angle_rad + sigma_rad * normal(&mut stream),
        };
        self.track().ticks().zip(&self.drive.steer_rad).map(sample).collect()
    }

    /// Yaw rate of the body, the mean over one sampling period centred on the instant. The gyro turns with
    /// the body: it sees the slip that the wheels do not.
    pub(super) fn gyro(&self) -> Vec<Sample> {
        let gyro = &self.settings.gyro;
        let mut stream = self.seed.stream(self.robot, Channel::Gyro);
        let mut tails = self.tails(Channel::Gyro);
        let mut chances = self.seed.stream(self.robot, Channel::GyroChances);
        let mut walk_rad_s = 0.0;
        self.instants(Channel::Gyro, gyro.rate_hz, OBSERVATIONS_FROM_S)
            .map(|time| {
                let mut context = self.context(time).over(1.0 / gyro.rate_hz);
                context.motion.yaw_rate_rad_s = self.track().mean_velocity(time, 0.5 / gyro.rate_hz)[2];
                context.chance = chance(&mut chances);
                let rate = sensors::gyro(&self.model, &context, &mut walk_rad_s);
                let sigma = sensors::noise(&self.model, &context, 0.0, 0.0).gyro_sigma_rad_s;
                let yaw_rate_rad_s = rate + sigma * tails.factor() * normal(&mut stream);
                Sample { time: self.stamp(time), reading: Reading::Gyro { yaw_rate_rad_s } }
            })
            .collect()
    }

    /// Positions, where there is reception. Noise is drawn outside the windows too, so that a window
    /// changes nothing but what is heard.
    pub(super) fn gps(&self) -> Vec<Sample> {
        let gps = &self.settings.gps;
        let mut stream = self.seed.stream(self.robot, Channel::Gps);
        let mut tails = self.tails(Channel::Gps);
        let received = |time: Timestamp| {
            let within = |window: &[f64; 2]| (window[0]..window[1]).contains(&time.seconds());
            gps.windows_s.is_empty() || gps.windows_s.iter().any(within)
        };
        self.instants(Channel::Gps, gps.rate_hz, OBSERVATIONS_FROM_S)
            .filter_map(|time| {
                let noise = [(); 2].map(|()| gps.sigma_m * tails.factor() * normal(&mut stream));
                let how = sensors::gps_reading(&self.model, &self.context(time));
                let pose = self.track().unwrapped_at(time.plus_seconds(-how.latency_s));
                let [x, y] = sensors::antenna(&how, &pose);
                let reading = Reading::Gps { x_m: x + noise[0], y_m: y + noise[1] };
                received(time).then(|| Sample { time: self.stamp(time), reading })
            })
            .collect()
    }

    /// Absolute headings.
    pub(super) fn heading(&self) -> Vec<Sample> {
        let heading = &self.settings.heading;
        let mut stream = self.seed.stream(self.robot, Channel::Heading);
        let mut tails = self.tails(Channel::Heading);
        self.instants(Channel::Heading, heading.rate_hz, OBSERVATIONS_FROM_S)
            .map(|time| {
                let noise = heading.sigma_rad * tails.factor() * normal(&mut stream);
                let context = self.context(time);
                let read = sensors::heading_of(&self.model, &context, context.heading_rad());
                let reading = Reading::Heading { heading_rad: wrap_angle(read + noise) };
                Sample { time: self.stamp(time), reading }
            })
            .collect()
    }

    /// Ground truth, at the same instants for every robot and stamped by the clock of common time.
    pub(super) fn truth(&self, rate_hz: f64, sigma_m: f64, sigma_rad: f64) -> Vec<TruthSample> {
        let mut stream = self.seed.stream(self.robot, Channel::Truth);
        instants(0.0, 0.0, rate_hz, self.until)
            .map(|time| {
                let how = sensors::truth_reading(&self.model, &self.context(time));
                let pose = self.track().unwrapped_at(time.plus_seconds(-how.latency_s));
                let mut seen = pose.compose(&sensors::marker(&how));
                seen.x_m += sigma_m * normal(&mut stream);
                seen.y_m += sigma_m * normal(&mut stream);
                seen.yaw_rad += sigma_rad * normal(&mut stream);
                TruthSample { time, pose: wrapped(seen) }
            })
            .collect()
    }
}

/// Instants at `from_s + (phase + k) / rate_hz` up to and with `until`.
fn instants(from_s: f64, phase: f64, rate_hz: f64, until: Timestamp) -> impl Iterator<Item = Timestamp> {
    let count = if rate_hz > 0.0 { u32::MAX } else { 0 };
    (0..count)
        .map(move |k| Timestamp::from_seconds(from_s + (phase + f64::from(k)) / rate_hz))
        .take_while(move |time| *time <= until)
}

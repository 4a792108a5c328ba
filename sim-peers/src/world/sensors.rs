//! A robot's sensors of itself: odometry, gyro, GPS, heading, and the ground truth beside them.

use std::f64::consts::TAU;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::TruthSample;

use super::OBSERVATIONS_FROM_S;
use super::random::{Channel, Seed, normal};
use super::track::Track;
use crate::scenario::{OdometryKind, RobotSettings};

/// The channels of one robot, to be sampled from its true path.
pub(super) struct Channels<'a> {
    pub(super) seed: Seed,
    pub(super) robot: RobotId,
    pub(super) settings: &'a RobotSettings,
    pub(super) track: &'a Track,
    /// The last stamp allowed to anything but odometry.
    pub(super) until: Timestamp,
}

impl Channels<'_> {
    /// The stamps of a channel: from `from_s` plus its own phase to the end of the run; none at rate 0.
    pub(super) fn stamps(
        &self,
        channel: Channel,
        rate_hz: f64,
        from_s: f64,
    ) -> impl Iterator<Item = Timestamp> {
        let phase = self.seed.phase(self.robot, channel);
        stamps(from_s, phase, rate_hz, self.until)
    }

    /// Odometry at every tick, in the form asked for. It reports what the wheels did, exactly; the last
    /// velocity, which nothing follows, repeats the one before.
    pub(super) fn odometry(&self) -> Vec<Sample> {
        let steps = self.track.steps();
        let times = steps.iter().map(|step| step.time).chain([self.track.end()]);
        match self.settings.odometry.kind {
            OdometryKind::Velocity => times
                .zip(steps.iter().chain(steps.last()))
                .map(|(time, step)| Sample {
                    time,
                    reading: Reading::Velocity {
                        forward_m_s: step.forward_m_s,
                        yaw_rate_rad_s: step.yaw_rate_rad_s,
                    },
                })
                .collect(),
            OdometryKind::Wheels => {
                let angles =
                    std::iter::once([0.0; 2]).chain(self.wheel_turns().scan([0.0; 2], |sum, turn| {
                        *sum = [sum[0] + turn[0], sum[1] + turn[1]];
                        Some(*sum)
                    }));
                times
                    .zip(angles)
                    .map(|(time, angles)| {
                        let [left_rad, right_rad] = angles.map(|angle| self.count(angle));
                        Sample { time, reading: Reading::Wheels { left_rad, right_rad } }
                    })
                    .collect()
            }
            OdometryKind::Increment => {
                let increments = self.ticks().map(|(step, dt_s)| step.wheels(dt_s));
                times
                    .zip(std::iter::once(Pose2::identity()).chain(increments))
                    .map(|(time, increment)| Sample { time, reading: Reading::Increment(increment) })
                    .collect()
            }
        }
    }

    /// Yaw rate of the body, the mean over one sampling period centred on the stamp. The gyro turns with
    /// the body: it sees the slip that the wheels do not.
    pub(super) fn gyro(&self) -> Vec<Sample> {
        let gyro = &self.settings.gyro;
        let mut stream = self.seed.stream(self.robot, Channel::Gyro);
        self.stamps(Channel::Gyro, gyro.rate_hz, OBSERVATIONS_FROM_S)
            .map(|time| {
                let half_s = 0.5 / gyro.rate_hz;
                let (before, after) = (time.plus_seconds(-half_s), time.plus_seconds(half_s));
                let turned =
                    wrap_angle(self.track.pose_at(after).yaw_rad() - self.track.pose_at(before).yaw_rad());
                let rate = turned / after.seconds_since(before);
                let yaw_rate_rad_s = rate + gyro.bias_rad_s + gyro.sigma_rad_s * normal(&mut stream);
                Sample { time, reading: Reading::Gyro { yaw_rate_rad_s } }
            })
            .collect()
    }

    /// Positions, where there is reception. Noise is drawn outside the windows too, so that a window
    /// changes nothing but what is heard.
    pub(super) fn gps(&self) -> Vec<Sample> {
        let gps = &self.settings.gps;
        let mut stream = self.seed.stream(self.robot, Channel::Gps);
        let received = |time: Timestamp| {
            let within = |window: &[f64; 2]| (window[0]..window[1]).contains(&time.seconds());
            gps.windows_s.is_empty() || gps.windows_s.iter().any(within)
        };
        self.stamps(Channel::Gps, gps.rate_hz, OBSERVATIONS_FROM_S)
            .map(|time| {
                let position = self.track.pose_at(time).position();
                let x_m = position.x + gps.sigma_m * normal(&mut stream);
                let y_m = position.y + gps.sigma_m * normal(&mut stream);
                Sample { time, reading: Reading::Gps { x_m, y_m } }
            })
            .filter(|sample| received(sample.time))
            .collect()
    }

    /// Absolute headings.
    pub(super) fn heading(&self) -> Vec<Sample> {
        let heading = &self.settings.heading;
        let mut stream = self.seed.stream(self.robot, Channel::Heading);
        self.stamps(Channel::Heading, heading.rate_hz, OBSERVATIONS_FROM_S)
            .map(|time| {
                let noise = heading.sigma_rad * normal(&mut stream);
                let heading_rad = wrap_angle(self.track.pose_at(time).yaw_rad() + noise);
                Sample { time, reading: Reading::Heading { heading_rad } }
            })
            .collect()
    }

    /// Ground truth without error, at the same instants for every robot.
    pub(super) fn truth(&self, rate_hz: f64) -> Vec<TruthSample> {
        stamps(0.0, 0.0, rate_hz, self.until)
            .map(|time| TruthSample { time, pose: self.track.pose_at(time) })
            .collect()
    }

    /// Each step with its length in seconds.
    fn ticks(&self) -> impl Iterator<Item = (&super::track::Step, f64)> {
        let steps = self.track.steps();
        let ends = steps.iter().skip(1).map(|step| step.time).chain([self.track.end()]);
        steps.iter().zip(ends).map(|(step, end)| (step, end.seconds_since(step.time)))
    }

    /// How far the left and right wheel turned in each tick, radians.
    fn wheel_turns(&self) -> impl Iterator<Item = [f64; 2]> {
        let (radius_m, half_track_m) = (self.settings.wheel_radius_m, 0.5 * self.settings.track_width_m);
        self.ticks().map(move |(step, dt_s)| {
            let across = step.yaw_rate_rad_s * half_track_m;
            [step.forward_m_s - across, step.forward_m_s + across].map(|rim_m_s| rim_m_s * dt_s / radius_m)
        })
    }

    /// An angle as the encoder counts it.
    fn count(&self, angle_rad: f64) -> f64 {
        let ticks_per_rev = self.settings.encoder_ticks_per_rev;
        if ticks_per_rev == 0 {
            return angle_rad;
        }
        let tick_rad = TAU / f64::from(ticks_per_rev);
        (angle_rad / tick_rad).floor() * tick_rad
    }
}

/// Stamps at `from_s + (phase + k) / rate_hz` up to and with `until`.
fn stamps(from_s: f64, phase: f64, rate_hz: f64, until: Timestamp) -> impl Iterator<Item = Timestamp> {
    let count = if rate_hz > 0.0 { u32::MAX } else { 0 };
    (0..count)
        .map(move |k| Timestamp::from_seconds(from_s + (phase + f64::from(k)) / rate_hz))
        .take_while(move |time| *time <= until)
}

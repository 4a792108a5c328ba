//! One robot's odometry, commands and truth, asked for any instant.

mod recorded;

use std::ops::Range;

use pleiad_estimation::Timestamp;
use pleiad_physics::chain::actuator::Command;
use pleiad_physics::predict::{EncoderSample, Path};
use pleiad_physics::{Drive, Motion, Pose, RobotModel};
use pleiad_recording::RobotRecording;

use crate::reckoning::{Reckoned, Reckoning};
use crate::residual::{Omission, Regime};
use crate::search::first_not;
use crate::windows::Window;
pub(crate) use recorded::median_step;
use recorded::{
    changes, commands, encoder_sample, gap_s, held_steps, seen_steps, steer_wheels, stretches, truth_pose,
    velocities, wheel_steps,
};

/// Velocity is the motion from this long before an instant to this long after it, seconds: long enough
/// that a tick of a coarse encoder is small, short against any manoeuvre.
const VELOCITY_REACH_S: f64 = 0.05;
/// Velocity from truth is the motion over this, seconds: poses nearer to each other say mostly their noise.
const VELOCITY_STEP_S: f64 = 2.0 * VELOCITY_REACH_S;
/// A truth sample is carried no farther than this, seconds.
const TRUTH_REACH_S: f64 = 0.1;
/// By a clock's error or a latency a reference pose is carried no farther along the encoders, seconds.
const CARRY_REACH_S: f64 = 1.2;
/// A step between samples is a pause if it is longer than this many median steps.
const PAUSE_FACTOR: f64 = 5.0;
/// A step between commands is no gap up to this, seconds: a logger that is late now and then is usual.
const SHORTEST_GAP_S: f64 = 0.5;

/// What a robot's odometry, its commands and the reference system recorded, in seconds from the origin.
pub(crate) struct Track {
    /// Samples of the wheels; empty if odometry is of another kind.
    pub(crate) encoders: Vec<EncoderSample>,
    /// A longer step between encoder samples is a pause, seconds.
    pub(crate) pause_s: f64,
    /// Reference poses with their stamps.
    pub(crate) truth: Vec<(f64, Pose<f64>)>,
    /// What drove the robot: its commands, or else its velocity odometry. One that repeats the one before
    /// is left out.
    pub(crate) commands: Vec<Command>,
    /// From when to when commands are known, without gaps.
    pub(crate) commanded_s: Vec<(f64, f64)>,
    reckoning: Reckoning,
    /// Wheel radius and track width that the firmware believes, metres.
    pub(crate) geometry_m: [f64; 2],
    /// Where the nearest other robot is at every sample of the wheels, metres in the map; empty without others.
    pub(crate) partner_m: Vec<Option<[f64; 2]>>,
}

impl Track {
    /// Reckons by the encoders with the declared geometry; without encoders by how the reference system saw the
    /// robot move, because commands say what it was to do and not what it did; without either by the
    /// velocities. Over the few milliseconds that truth is carried, their errors do not matter.
    pub(crate) fn new(recording: &RobotRecording, model: &RobotModel<f64>, origin: Timestamp) -> Self {
        let mut encoders: Vec<_> =
            recording.odometry.iter().filter_map(|sample| encoder_sample(sample, origin)).collect();
        let steer = recording.steer.iter().map(|own| (own.time.seconds_since(origin), own.angle_rad));
        steer_wheels(&mut encoders, &steer.collect::<Vec<_>>());
        let ratio = match model.drive {
            Drive::SkidSteer { track_ratio } => track_ratio,
            Drive::Differential | Drive::CarLike { .. } => 1.0,
        };
        let geometry_m = [model.nominal.wheel_radius, model.nominal.track_width * ratio];
        let pause_s = PAUSE_FACTOR * median_step(encoders.iter().map(|sample| sample.time_s));
        let velocities = velocities(recording, origin);
        let mut commands = commands(recording, origin);
        if commands.is_empty() {
            commands.clone_from(&velocities);
        }
        let truth: Vec<_> = recording.truth.iter().map(|sample| truth_pose(sample, origin)).collect();
        let seen = seen_steps(&truth);
        let reckoning = if !encoders.is_empty() {
            Reckoning::new(wheel_steps(&encoders, geometry_m), pause_s)
        } else if let Some(steps) = seen {
            Reckoning::new(steps.into_iter(), PAUSE_FACTOR * VELOCITY_STEP_S)
        } else if !velocities.is_empty() {
            Reckoning::new(held_steps(&velocities), gap_s(&velocities))
        } else {
            Reckoning::new(held_steps(&commands), gap_s(&commands))
        };
        Self {
            encoders,
            pause_s,
            truth,
            commanded_s: stretches(&commands),
            commands: changes(commands),
            reckoning,
            geometry_m,
            partner_m: Vec::new(),
        }
    }

    /// What keeps wheels from being compared: none were recorded, or they are stuck.
    #[allow(clippy::float_cmp, reason = "a reading that is stuck repeats exactly")]
    pub(crate) fn wheels_missing(&self) -> Option<Omission> {
        if self.encoders.is_empty() {
            return Some(Omission::NotRecorded("wheel angles"));
        }
        let stuck = self.encoders.windows(2).all(|pair| pair[0].angle_rad == pair[1].angle_rad);
        stuck.then_some(Omission::Constant("wheel angles", self.encoders.len()))
    }

    /// What keeps truth from being compared.
    pub(crate) fn truth_missing(&self) -> Option<Omission> {
        if self.truth.is_empty() {
            return Some(Omission::NotRecorded("truth"));
        }
        let stuck = self.truth.windows(2).all(|pair| pair[0].1 == pair[1].1);
        stuck.then_some(Omission::Constant("true poses", self.truth.len()))
    }

    /// What keeps readings from being placed: truth, or the motion that carries it to their stamps.
    pub(crate) fn placing_missing(&self) -> Option<Omission> {
        let motion = if self.reckoning.is_empty() {
            Some(Omission::NotRecorded("wheel angles or velocities"))
        } else if self.encoders.is_empty() {
            None
        } else {
            self.wheels_missing()
        };
        motion.or_else(|| self.truth_missing())
    }

    /// The wheels' angles at an instant: encoders are nearly free of noise, so they may be interpolated, with
    /// the acceleration between the steps before and after. `None` outside the samples and in a pause.
    pub(crate) fn wheels_at(&self, time_s: f64) -> Option<EncoderSample> {
        let after = first_not(&self.encoders, |sample| sample.time_s, time_s, |stamp_s| stamp_s <= time_s);
        let before = *self.encoders.get(after.checked_sub(1)?)?;
        let since_s = time_s - before.time_s;
        if since_s <= 0.0 {
            return Some(before);
        }
        let next = self.encoders.get(after)?;
        let step_s = next.time_s - before.time_s;
        let share = since_s / step_s;
        let bend = self.bend_rad(after - 1);
        let angle = |wheel: usize| {
            let even = before.angle_rad[wheel] + share * (next.angle_rad[wheel] - before.angle_rad[wheel]);
            even + share * (1.0 - share) * bend[wheel]
        };
        let steer_rad = before.steer_rad + share * (next.steer_rad - before.steer_rad);
        (step_s <= self.pause_s).then(|| EncoderSample { time_s, angle_rad: [angle(0), angle(1)], steer_rad })
    }

    /// By how much more than evenly each wheel has turned in the middle of the step that begins at a sample,
    /// times four, radians.
    fn bend_rad(&self, from: usize) -> [f64; 2] {
        let samples = from.checked_sub(1).and_then(|first| self.encoders.get(first..from + 3));
        let Some([before, from, to, after]) = samples else { return [0.0; 2] };
        let spans_s = [from.time_s - before.time_s, to.time_s - from.time_s, after.time_s - to.time_s];
        if spans_s.iter().any(|span_s| *span_s <= 0.0 || *span_s > self.pause_s) {
            return [0.0; 2];
        }
        let reach_s = 0.5 * (spans_s[0] + spans_s[2]) + spans_s[1];
        [0, 1].map(|wheel| {
            let rate_before = (from.angle_rad[wheel] - before.angle_rad[wheel]) / spans_s[0];
            let rate_after = (after.angle_rad[wheel] - to.angle_rad[wheel]) / spans_s[2];
            -0.5 * spans_s[1] * spans_s[1] * (rate_after - rate_before) / reach_s
        })
    }

    fn reckoned_at(&self, time_s: f64) -> Option<Reckoned> {
        self.reckoning.at(time_s)
    }

    /// Where the odometry took the robot, in a frame of its own.
    pub(crate) fn path(&self) -> &Reckoning {
        &self.reckoning
    }

    /// The path in the map, by the truth sample nearest to an instant.
    pub(crate) fn path_in_map(&self, time_s: f64) -> Option<PathInMap<'_>> {
        self.map_from_path(time_s).map(|map_from_path| self.path_from(map_from_path))
    }

    /// Where the path begins in the map, by the truth sample nearest to an instant.
    pub(crate) fn map_from_path(&self, time_s: f64) -> Option<Pose<f64>> {
        let (stamp_s, pose) = self.truth_near(time_s)?;
        let path_from_robot = self.reckoned_at(stamp_s)?.pose;
        Some(pose.compose(&path_from_robot.between(&Pose::identity())))
    }

    /// The path in the map if it begins here.
    pub(crate) fn path_from(&self, map_from_path: Pose<f64>) -> PathInMap<'_> {
        PathInMap { map_from_path, path: &self.reckoning }
    }

    /// The encoder samples around a window that join it without a pause, as far as a reference pose may have
    /// to be carried.
    pub(crate) fn reach(&self, window: &Window) -> Range<usize> {
        let samples = &self.encoders;
        let joins = |index: usize| samples[index + 1].time_s - samples[index].time_s <= self.pause_s;
        let (mut begin, mut end) = (window.first, window.last);
        while begin > 0
            && joins(begin - 1)
            && samples[window.first].time_s - samples[begin].time_s < CARRY_REACH_S
        {
            begin -= 1;
        }
        while end + 1 < samples.len()
            && joins(end)
            && samples[end].time_s - samples[window.last].time_s < CARRY_REACH_S
        {
            end += 1;
        }
        begin..end + 1
    }

    /// Mean forward speed and yaw rate around an instant, over what of it was recorded.
    fn velocity_at(&self, time_s: f64) -> Option<(f64, f64)> {
        let (first_s, last_s) = self.reckoning.span_s()?;
        let from_s = (time_s - VELOCITY_REACH_S).max(first_s);
        let to_s = (time_s + VELOCITY_REACH_S).min(last_s);
        let (from, to) = (self.reckoning.travelled(from_s)?, self.reckoning.travelled(to_s)?);
        let lasted_s = to_s - from_s;
        let rates = ((to.0 - from.0) / lasted_s, (to.1 - from.1) / lasted_s);
        (lasted_s > 0.0).then_some(rates)
    }

    /// The truth sample with the nearest stamp, and its stamp. `None` where none is near.
    pub(crate) fn truth_near(&self, time_s: f64) -> Option<(f64, Pose<f64>)> {
        let after = first_not(&self.truth, |(stamp_s, _)| *stamp_s, time_s, |stamp_s| stamp_s < time_s);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let nearest = near
            .filter_map(|index| self.truth.get(index))
            .min_by(|(a, _), (b, _)| (a - time_s).abs().total_cmp(&(b - time_s).abs()))?;
        ((nearest.0 - time_s).abs() <= TRUTH_REACH_S).then_some(*nearest)
    }

    /// True positions at increasing times, straight between the reference poses; `None` where truth has a gap.
    pub(crate) fn positions_at(&self, times_s: impl Iterator<Item = f64>) -> Vec<Option<[f64; 2]>> {
        let mut after = 0;
        let at = |time_s: f64| {
            while self.truth.get(after).is_some_and(|(stamp_s, _)| *stamp_s < time_s) {
                after += 1;
            }
            let (next_s, next) = self.truth.get(after)?;
            let (last_s, last) = self.truth[after.saturating_sub(1)];
            let step_s = next_s - last_s;
            let share = if step_s > 0.0 { ((time_s - last_s) / step_s).max(0.0) } else { 0.0 };
            let known = step_s <= 2.0 * TRUTH_REACH_S && next_s - time_s <= 2.0 * TRUTH_REACH_S;
            let [from, to] = [last.position(), next.position()];
            known.then(|| [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])))
        };
        times_s.map(at).collect()
    }

    /// The true pose at an instant: the truth sample with the nearest stamp, carried by the odometry.
    ///
    /// Interpolated truth would be differentiated truth: its noise would depend on the sample's phase.
    /// `None` where no truth is near, or the odometry was not recorded.
    pub(crate) fn truth_at(&self, time_s: f64) -> Option<Pose<f64>> {
        let (stamp_s, pose) = self.truth_near(time_s)?;
        let moved = self.reckoned_at(stamp_s)?.pose.between(&self.reckoned_at(time_s)?.pose);
        Some(pose.compose(&moved))
    }

    /// What the robot was doing; `None` where the odometry was not recorded.
    pub(crate) fn regime_at(&self, time_s: f64) -> Option<Regime> {
        let (speed_m_s, yaw_rate_rad_s) = self.velocity_at(time_s)?;
        let change = self
            .velocity_at(time_s - VELOCITY_REACH_S)
            .zip(self.velocity_at(time_s + VELOCITY_REACH_S))
            .map_or(0.0, |((before, _), (after, _))| after - before);
        let acceleration_m_s2 = change / (2.0 * VELOCITY_REACH_S);
        Some(Regime { speed_m_s, yaw_rate_rad_s, acceleration_m_s2, pose: self.truth_at(time_s) })
    }
}

/// A robot's path in the map.
pub(crate) struct PathInMap<'a> {
    map_from_path: Pose<f64>,
    path: &'a Reckoning,
}

impl Path for PathInMap<'_> {
    fn motion_at(&self, time_s: f64) -> Option<Motion<f64>> {
        let motion = self.path.motion_at(time_s)?;
        Some(Motion { pose: self.map_from_path.compose(&motion.pose), ..motion })
    }
}

/// The motion of a regime at a pose.
pub(crate) fn motion(regime: &Regime, pose: Pose<f64>) -> Motion<f64> {
    Motion {
        speed_m_s: regime.speed_m_s,
        yaw_rate_rad_s: regime.yaw_rate_rad_s,
        acceleration_m_s2: regime.acceleration_m_s2,
        ..Motion::at_rest(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pleiad_estimation::Pose2;
    use pleiad_estimation::sample::{Reading, Sample};
    use pleiad_physics::Nominal;
    use pleiad_recording::TruthSample;

    /// Straight ahead at 0.5 m/s, wheels at 50 Hz without the samples in `(pause.0, pause.1)`.
    fn track(pause: (f64, f64), truth: &[(f64, f64)]) -> Track {
        let mut recording = RobotRecording::default();
        for index in 0..100 {
            let time_s = 0.02 * f64::from(index);
            if time_s > pause.0 && time_s < pause.1 {
                continue;
            }
            let angle = 0.5 * time_s / 0.05;
            let reading = Reading::Wheels { left_rad: angle, right_rad: angle };
            recording.push(Sample { time: Timestamp::from_seconds(time_s), reading });
        }
        for &(time_s, x) in truth {
            let (time, pose) = (Timestamp::from_seconds(time_s), Pose2::new(x, 0.0, 0.0));
            recording.truth.push(TruthSample { time, pose });
        }
        let model = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3));
        Track::new(&recording, &model, Timestamp(0))
    }

    #[test]
    fn truth_is_the_nearest_sample_carried_and_not_a_mean_of_two() {
        // Marks that do not lie on the motion show which one was taken.
        let track = track((9.0, 9.0), &[(0.50, 10.0), (0.52, 20.0)]);
        let at = |time_s| track.truth_at(time_s).unwrap().x_m;
        assert!((at(0.507) - (10.0 + 0.5 * 0.007)).abs() < 1e-9);
        assert!((at(0.513) - (20.0 - 0.5 * 0.007)).abs() < 1e-9);
        assert!(track.truth_at(0.7).is_none(), "no truth within reach");
    }

    #[test]
    fn positions_lie_between_reference_poses_and_in_no_gap() {
        let track = track((9.0, 9.0), &[(0.5, 10.0), (0.6, 20.0), (1.5, 30.0)]);
        let found = track.positions_at([0.2, 0.45, 0.5, 0.55, 1.0, 1.5, 1.6].into_iter());
        let expected = [None, Some(10.0), Some(10.0), Some(15.0), None, None, None];
        for (found, expected) in found.iter().zip(expected) {
            let x_m = found.map(|[x_m, _]| x_m);
            assert!(x_m.zip(expected).map_or(x_m == expected, |(a, b)| (a - b).abs() < 1e-9), "{x_m:?}");
        }
    }

    #[test]
    fn without_encoders_velocities_are_those_of_truth_and_not_of_commands() {
        let mut recording = RobotRecording::default();
        for index in 0..200 {
            let time_s = 0.01 * f64::from(index);
            let time = Timestamp::from_seconds(time_s);
            // On a circle of 0.5 m at 0.8 rad/s, to the left.
            let yaw = 0.8 * time_s;
            let pose = Pose2::new(0.5 * yaw.sin(), 0.5 * (1.0 - yaw.cos()), yaw);
            recording.truth.push(TruthSample { time, pose });
            let reading = Reading::Velocity { forward_m_s: -3.0, yaw_rate_rad_s: 2.0 };
            recording.push(Sample { time, reading });
        }
        let model = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3));
        let track = Track::new(&recording, &model, Timestamp(0));
        let regime = track.regime_at(1.0).unwrap();
        // A chord of 0.08 rad is shorter than its arc by 0.08^2 / 24.
        assert!((regime.speed_m_s - 0.4).abs() < 0.4 * 3e-4, "{}", regime.speed_m_s);
        assert!((regime.yaw_rate_rad_s - 0.8).abs() < 1e-9, "{}", regime.yaw_rate_rad_s);
    }

    #[test]
    fn nothing_is_known_in_a_pause_of_the_wheels() {
        let track = track((0.6, 1.0), &[]);
        assert!(track.wheels_at(0.8).is_none() && track.regime_at(0.8).is_none());
        let regime = track.regime_at(1.2).unwrap();
        assert!((regime.speed_m_s - 0.5).abs() < 1e-9 && regime.acceleration_m_s2.abs() < 1e-9);
        assert!(regime.pose.is_none());
    }
}

//! One robot's wheels and truth, asked for any instant.

use pleiad_estimation::sample::{Reading, Sample};
use pleiad_physics::predict::EncoderSample;
use pleiad_physics::{Drive, Motion, Pose, RobotModel};
use pleiad_recording::{RobotRecording, TruthSample};

use crate::residual::Regime;

/// Velocity is the motion from this long before an instant to this long after it, seconds: long enough
/// that a tick of a coarse encoder is small, short against any manoeuvre.
const VELOCITY_REACH_S: f64 = 0.05;
/// A truth sample is carried no farther than this, seconds.
const TRUTH_REACH_S: f64 = 0.1;
/// A step between encoder samples is a pause if it is longer than this many median steps.
const PAUSE_FACTOR: f64 = 5.0;

/// Dead reckoning at an instant, in the frame of its beginning.
#[derive(Clone, Copy)]
struct Reckoned {
    pose: Pose<f64>,
    path_m: f64,
}

/// What the wheels and the reference system recorded of one robot.
pub(crate) struct Track {
    /// Samples of the wheels; empty if odometry is of another kind.
    pub(crate) encoders: Vec<EncoderSample>,
    /// A longer step between encoder samples is a pause, seconds.
    pub(crate) pause_s: f64,
    /// Reference poses with their stamps in seconds.
    pub(crate) truth: Vec<(f64, Pose<f64>)>,
    reckoned: Vec<Reckoned>,
    radius_m: f64,
    axle_m: f64,
}

impl Track {
    /// Reckons with the declared geometry: over the few milliseconds that truth is carried, its errors
    /// do not matter.
    pub(crate) fn new(recording: &RobotRecording, model: &RobotModel<f64>) -> Self {
        let encoders: Vec<_> = recording.odometry.iter().filter_map(encoder_sample).collect();
        let ratio = match model.drive {
            Drive::SkidSteer { track_ratio } => track_ratio,
            Drive::Differential | Drive::CarLike { .. } => 1.0,
        };
        let mut track = Self {
            pause_s: PAUSE_FACTOR * median_step(encoders.iter().map(|sample| sample.time_s)),
            encoders,
            truth: recording.truth.iter().map(truth_pose).collect(),
            reckoned: Vec::new(),
            radius_m: model.nominal.wheel_radius,
            axle_m: model.nominal.track_width * ratio,
        };
        let mut here = Reckoned { pose: Pose::identity(), path_m: 0.0 };
        let mut reckoned = Vec::with_capacity(track.encoders.len());
        for (index, sample) in track.encoders.iter().enumerate() {
            if index > 0 {
                here = track.rolled(here, track.encoders[index - 1].angle_rad, sample.angle_rad);
            }
            reckoned.push(here);
        }
        track.reckoned = reckoned;
        track
    }

    fn rolled(&self, from: Reckoned, before: [f64; 2], after: [f64; 2]) -> Reckoned {
        let [left, right] = [0, 1].map(|wheel| self.radius_m * (after[wheel] - before[wheel]));
        let forward = f64::midpoint(left, right);
        let moved = Pose::exp(forward, 0.0, (right - left) / self.axle_m);
        Reckoned { pose: from.pose.compose(&moved), path_m: from.path_m + forward }
    }

    /// The wheels' angles at an instant: encoders are nearly free of noise, so they may be interpolated.
    /// `None` outside the samples and in a pause.
    pub(crate) fn wheels_at(&self, time_s: f64) -> Option<EncoderSample> {
        let (_, sample) = self.interpolated(time_s)?;
        Some(sample)
    }

    fn interpolated(&self, time_s: f64) -> Option<(usize, EncoderSample)> {
        let after = self.encoders.partition_point(|sample| sample.time_s <= time_s);
        let index = after.checked_sub(1)?;
        let before = self.encoders[index];
        let Some(next) = self.encoders.get(after) else {
            return (before.time_s >= time_s).then_some((index, before));
        };
        let step_s = next.time_s - before.time_s;
        let since_s = time_s - before.time_s;
        if since_s > 0.0 && step_s > self.pause_s {
            return None;
        }
        let share = since_s / step_s;
        let angle = |wheel: usize| {
            before.angle_rad[wheel] + share * (next.angle_rad[wheel] - before.angle_rad[wheel])
        };
        Some((index, EncoderSample { time_s, angle_rad: [angle(0), angle(1)] }))
    }

    fn reckoned_at(&self, time_s: f64) -> Option<Reckoned> {
        let (index, sample) = self.interpolated(time_s)?;
        Some(self.rolled(self.reckoned[index], self.encoders[index].angle_rad, sample.angle_rad))
    }

    /// Mean forward speed and yaw rate around an instant, over what of it was recorded.
    fn velocity_at(&self, time_s: f64) -> Option<(f64, f64)> {
        let first_s = self.encoders.first()?.time_s;
        let last_s = self.encoders.last()?.time_s;
        let from_s = (time_s - VELOCITY_REACH_S).max(first_s);
        let to_s = (time_s + VELOCITY_REACH_S).min(last_s);
        let (from, to) = (self.reckoned_at(from_s)?, self.reckoned_at(to_s)?);
        let lasted_s = to_s - from_s;
        let rates = ((to.path_m - from.path_m) / lasted_s, (to.pose.yaw_rad - from.pose.yaw_rad) / lasted_s);
        (lasted_s > 0.0).then_some(rates)
    }

    /// The true pose at an instant: the truth sample with the nearest stamp, carried by the encoders.
    ///
    /// Interpolated truth would be differentiated truth: its noise would depend on the sample's phase.
    /// `None` where no truth is near, or the wheels were not recorded.
    pub(crate) fn truth_at(&self, time_s: f64) -> Option<Pose<f64>> {
        let after = self.truth.partition_point(|(stamp_s, _)| *stamp_s < time_s);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let (stamp_s, pose) = near
            .filter_map(|index| self.truth.get(index))
            .min_by(|(a, _), (b, _)| (a - time_s).abs().total_cmp(&(b - time_s).abs()))?;
        if (stamp_s - time_s).abs() > TRUTH_REACH_S {
            return None;
        }
        let moved = self.reckoned_at(*stamp_s)?.pose.between(&self.reckoned_at(time_s)?.pose);
        Some(pose.compose(&moved))
    }

    /// What the robot was doing; `None` where the wheels were not recorded.
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

/// The motion of a regime at a pose.
pub(crate) fn motion(regime: &Regime, pose: Pose<f64>) -> Motion<f64> {
    Motion {
        speed_m_s: regime.speed_m_s,
        yaw_rate_rad_s: regime.yaw_rate_rad_s,
        acceleration_m_s2: regime.acceleration_m_s2,
        ..Motion::at_rest(pose)
    }
}

fn encoder_sample(sample: &Sample) -> Option<EncoderSample> {
    match sample.reading {
        Reading::Wheels { left_rad, right_rad } => {
            Some(EncoderSample { time_s: sample.time.seconds(), angle_rad: [left_rad, right_rad] })
        }
        _ => None,
    }
}

fn truth_pose(sample: &TruthSample) -> (f64, Pose<f64>) {
    let pose = &sample.pose;
    (sample.time.seconds(), Pose::new(pose.x_m(), pose.y_m(), pose.yaw_rad()))
}

/// The median step between increasing times, seconds; infinite below two.
pub(crate) fn median_step(times_s: impl Iterator<Item = f64>) -> f64 {
    let times: Vec<f64> = times_s.collect();
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pleiad_estimation::{Pose2, Timestamp};
    use pleiad_physics::Nominal;

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
        Track::new(&recording, &RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3)))
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
    fn nothing_is_known_in_a_pause_of_the_wheels() {
        let track = track((0.6, 1.0), &[]);
        assert!(track.wheels_at(0.8).is_none() && track.regime_at(0.8).is_none());
        let regime = track.regime_at(1.2).unwrap();
        assert!((regime.speed_m_s - 0.5).abs() < 1e-9 && regime.acceleration_m_s2.abs() < 1e-9);
        assert!(regime.pose.is_none());
    }
}

//! What the studies of one robot share: from a recording to scalar measurements, and how an estimate is judged.

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::linear::Gaussian;
use pleiad_estimation::motion::{DifferentialDrive, MotionModel, MotionNoise, YawSource};
use pleiad_estimation::sample::Reading;
use pleiad_estimation::single::{Ekf, Measurement, Process, Sensor};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::RobotRecording;
use pleiad_report::quantity;
use pleiad_sim_peers::scenario::{OdometryKind, RobotSettings};
use pleiad_sim_peers::{Prior, Scenario, SimulatedRun, simulate};

use crate::error::SurveyError;
use crate::monte_carlo::Estimate;
use crate::study::StudyOptions;

/// The robot of these studies.
pub(crate) const ROBOT: RobotId = RobotId(1);

/// What the wheels rolled from one tick of the odometry to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rolled {
    /// Stamp of the tick before.
    pub(crate) from: Timestamp,
    /// Duration, seconds.
    pub(crate) seconds: f64,
    /// Left and right, metres.
    pub(crate) tread_m: [f64; 2],
}

impl Rolled {
    /// The instant of which the mean speed says most: the middle. A filter that takes it there runs half a tick
    /// behind the encoders.
    pub(crate) fn middle(&self) -> Timestamp {
        self.from.plus_seconds(0.5 * self.seconds)
    }

    /// Mean speeds of the treads, m/s.
    pub(crate) fn speeds(&self) -> [f64; 2] {
        self.tread_m.map(|rolled| rolled / self.seconds)
    }
}

/// Ticks of a recording with wheel odometry; none of any other.
pub(crate) fn rolled(recorded: &RobotRecording, radius_m: f64) -> Vec<Rolled> {
    let pairs = recorded.odometry.windows(2);
    pairs
        .filter_map(|pair| match (pair[0].reading, pair[1].reading) {
            (
                Reading::Wheels { left_rad: left, right_rad: right },
                Reading::Wheels { left_rad, right_rad },
            ) => Some(Rolled {
                from: pair[0].time,
                seconds: pair[1].time.seconds_since(pair[0].time),
                tread_m: [radius_m * (left_rad - left), radius_m * (right_rad - right)],
            }),
            _ => None,
        })
        .collect()
}

/// Stamps and values of a channel that reads one number; none of another kind.
pub(crate) fn values(channel: &[pleiad_estimation::sample::Sample]) -> Vec<(Timestamp, f64)> {
    let value = |reading: &Reading| match *reading {
        Reading::Gyro { yaw_rate_rad_s } => Some(yaw_rate_rad_s),
        Reading::Heading { heading_rad } => Some(heading_rad),
        _ => None,
    };
    channel.iter().filter_map(|sample| Some((sample.time, value(&sample.reading)?))).collect()
}

/// Readings of one sensor with one noise.
pub(crate) fn readings<const N: usize>(
    values: &[(Timestamp, f64)],
    sensor: Sensor<N>,
    sigma: f64,
) -> Vec<Measurement<N>> {
    let variance = sigma * sigma;
    values.iter().map(|&(time, value)| Measurement { time, sensor, value, variance }).collect()
}

/// In the order of their instants; those of one instant stay in theirs.
pub(crate) fn in_order<const N: usize>(
    channels: impl IntoIterator<Item = Vec<Measurement<N>>>,
    from: Timestamp,
) -> Vec<Measurement<N>> {
    let mut all: Vec<_> = channels.into_iter().flatten().filter(|own| own.time >= from).collect();
    all.sort_by_key(|own| own.time);
    all
}

/// Takes every measurement and asks for the belief at each of `times`, which increase.
pub(crate) fn beliefs_at<P: Process<N>, const N: usize>(
    filter: &mut Ekf<P, N>,
    measurements: &[Measurement<N>],
    times: &[Timestamp],
    failed: impl Fn(String) -> SurveyError,
) -> Result<Vec<Gaussian<N>>, SurveyError> {
    let mut beliefs = Vec::with_capacity(times.len());
    for measurement in measurements {
        while times.get(beliefs.len()).is_some_and(|time| *time < measurement.time) {
            beliefs.push(filter.at(times[beliefs.len()]));
        }
        filter.take(measurement).map_err(|error| failed(error.to_string()))?;
    }
    while let Some(time) = times.get(beliefs.len()) {
        beliefs.push(filter.at(*time));
    }
    Ok(beliefs)
}

/// East, north and heading of an estimate less the true ones.
pub(crate) fn error_of(estimate: &Pose2, truth: &Pose2) -> [f64; 3] {
    [
        estimate.x_m() - truth.x_m(),
        estimate.y_m() - truth.y_m(),
        wrap_angle(estimate.yaw_rad() - truth.yaw_rad()),
    ]
}

/// The pose in a state that begins with east, north, heading.
pub(crate) fn pose_of<const N: usize>(belief: &Gaussian<N>) -> Pose2 {
    Pose2::new(belief.mean[0], belief.mean[1], belief.mean[2])
}

/// A scenario that is part of this program.
pub(crate) fn scenario(study: &'static str, text: &str) -> Result<Scenario, SurveyError> {
    Scenario::from_toml(text, &format!("scenarios/{study}.toml")).map_err(|error| failed(study, error))
}

/// One run of it.
pub(crate) fn simulated(
    study: &'static str,
    scenario: &Scenario,
    seed: u64,
) -> Result<SimulatedRun, SurveyError> {
    simulate(scenario, seed).map_err(|error| failed(study, error))
}

fn failed(study: &'static str, error: pleiad_sim_peers::Error) -> SurveyError {
    SurveyError::Scenario { study, source: Box::new(error) }
}

/// What the robot is told of where it is at an instant: the truth with the error of its prior.
pub(crate) fn told(run: &SimulatedRun, time: Timestamp) -> Option<Prior> {
    let (prior, track) = (run.priors.get(&ROBOT)?, run.tracks.get(&ROBOT)?);
    let error = track.start().between(&prior.pose);
    Some(Prior { pose: track.pose_at(time).compose(&error), ..*prior })
}

/// The seeds of a study.
pub(crate) fn seeds(
    study: &'static str,
    options: &StudyOptions,
    usual: usize,
    least: usize,
) -> Result<Vec<u64>, SurveyError> {
    let found = options.seeds.unwrap_or(usual);
    if found < least {
        return Err(SurveyError::TooFewSeeds { study, found, least });
    }
    Ok((options.first_seed..).take(found).collect())
}

/// How many times the first root mean square is the second, with its 95 % interval, from squared errors of the same
/// runs: the delta method on the logarithm of the ratio, Student's t. `None` for fewer than two runs.
pub(crate) fn times(first: &[f64], second: &[f64]) -> Option<(f64, [f64; 2])> {
    let mean = |own: &[f64]| own.iter().sum::<f64>() / own.len() as f64;
    let (a, b) = (mean(first), mean(second));
    let shares: Vec<f64> = first.iter().zip(second).map(|(x, y)| x / a - y / b).collect();
    let spread = Estimate::of(&shares)?;
    let half = 0.25 * (spread.interval[1] - spread.interval[0]);
    let ratio = (a / b).sqrt();
    Some((ratio, [ratio * (-half).exp(), ratio * half.exp()]))
}

/// In words: `2.7 (1.9..3.8) times`.
pub(crate) fn times_words((ratio, [low, high]): (f64, [f64; 2])) -> String {
    let decimals = if ratio < 10.0 { 2 } else { 1 };
    format!("{ratio:.decimals$} ({low:.decimals$}..{high:.decimals$}) times")
}

/// A length in metres or an angle in milliradians, for people.
pub(crate) fn small(value: f64, unit: &str) -> String {
    if unit == "rad" { quantity(1e3 * value, "mrad") } else { quantity(value, unit) }
}

/// The root of a mean square.
pub(crate) fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    (sum / count).sqrt()
}

/// The dead reckoning of a simulated robot: the law of its simulation.
pub(crate) fn motion(settings: &RobotSettings) -> MotionModel {
    let noise = &settings.odometry.noise;
    let drive = DifferentialDrive {
        wheel_radius_m: settings.wheel_radius_m,
        track_width_m: settings.drive.effective_track_m(settings.track_width_m),
    };
    MotionModel {
        drive: (settings.odometry.kind == OdometryKind::Wheels).then_some(drive),
        noise: MotionNoise {
            forward_m_per_sqrt_s: noise.speed_m_per_sqrt_s,
            lateral_m_per_sqrt_s: noise.lateral_m_per_sqrt_s,
            yaw_rad_per_sqrt_s: noise.yaw_rad_per_sqrt_s,
            forward_m_per_sqrt_m: noise.speed_m_per_sqrt_m,
            yaw_rad_per_sqrt_m: 0.0,
            yaw_rad_per_sqrt_rad: noise.yaw_rad_per_sqrt_rad,
            quiet_at_standstill: noise.quiet_at_standstill,
        },
        yaw: YawSource::Odometry,
        gyro_bias_rad_s: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha12Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn the_interval_of_a_ratio_holds_the_true_one_as_often_as_it_says() {
        // Squares of normals of standard deviations 2 and 1, which share half of their variance: 95 % of 400
        // intervals, give or take three standard deviations of a count (13).
        let mut random = ChaCha12Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut held = 0;
        for _ in 0..400 {
            let (mut first, mut second) = (Vec::new(), Vec::new());
            for _ in 0..100 {
                let shared = normal();
                let mut own = || (0.5_f64.sqrt() * (shared + normal())).powi(2);
                first.push(4.0 * own());
                second.push(own());
            }
            let (_, [low, high]) = times(&first, &second).unwrap();
            held += usize::from(low < 2.0 && 2.0 < high);
        }
        assert!((380 - 20..=393).contains(&held), "{held} of 400");
    }
}

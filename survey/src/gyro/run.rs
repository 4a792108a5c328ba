//! One run: a robot whose speeds wander, and the filters on what it recorded.

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::Timestamp;
use pleiad_estimation::linear::Gaussian;
use pleiad_estimation::single::{Ekf, Measurement, RandomWalks, Sensor, Unicycle};
use pleiad_estimation::statistics::NeesSummary;
use pleiad_sim_peers::{Scenario, SimulatedRun};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::NAME;
use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;
use crate::solo::{
    ROBOT, beliefs_at, error_of, in_order, pose_of, readings, rolled, scenario, simulated, told, values,
};

const SCENARIO: &str = include_str!("../../../scenarios/gyro.toml");
/// When the filter begins: the robot is up to speed.
const FROM_S: f64 = 1.0;
/// When it is judged.
pub(super) const JUDGED_S: [f64; 5] = [7.0, 13.0, 19.0, 25.0, 31.0];
/// By how much the speeds wander, per root of a second: what the robot does and what the filter is told.
const WALK_M_S: f64 = 0.03;
const WALK_RAD_S: f64 = 0.01;
/// Speeds at the beginning.
const SPEED_M_S: f64 = 0.5;
/// Clockwise: with the right wheel the worse one, a filter without the correlation trusts itself too much; the other way
/// round too little, and on a straight neither shows.
const YAW_RATE_RAD_S: f64 = -0.5;
/// Probability with which a consistent filter fails its judgement at any time.
const ALPHA: f64 = 0.01;

/// How the wheels come into the filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheels {
    /// Each wheel as a measurement of its own: the noises of `V` and `w` are correlated as they are.
    Each,
    /// `V` and `w` as if they were measured independently.
    Uncorrelated,
}

/// A filter of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// How the wheels come in.
    pub wheels: Wheels,
    /// Whether the gyro does.
    pub gyro: bool,
}

impl Variant {
    /// All four.
    pub const ALL: [Self; 4] = [
        Self { wheels: Wheels::Each, gyro: false },
        Self { wheels: Wheels::Uncorrelated, gyro: false },
        Self { wheels: Wheels::Each, gyro: true },
        Self { wheels: Wheels::Uncorrelated, gyro: true },
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match (self.wheels, self.gyro) {
            (Wheels::Each, false) => "wheels",
            (Wheels::Uncorrelated, false) => "wheels, correlation ignored",
            (Wheels::Each, true) => "wheels and gyro",
            (Wheels::Uncorrelated, true) => "wheels and gyro, correlation ignored",
        }
    }
}

/// Errors and beliefs of one run at the times of judgement, for every variant.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// By variant and time: error in east, north, heading, and its covariance.
    pub(super) judged: Vec<Vec<([f64; 3], Gaussian<5>)>>,
}

/// The recording of a seed.
pub(super) fn recorded(seed: u64) -> Result<(Scenario, SimulatedRun), SurveyError> {
    let mut scenario = scenario(NAME, SCENARIO)?;
    if let Some(robot) = scenario.robots.get_mut(&ROBOT) {
        robot.motion.script = wandering(seed, 1.0 / robot.command_rate_hz, scenario.duration_s + 1.0);
    }
    let run = simulated(NAME, &scenario, seed)?;
    Ok((scenario, run))
}

/// Commands that are random walks from `FROM_S` on: what a filter with random-walk speeds takes a robot for.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a run has some thousand commands"
)]
fn wandering(seed: u64, period_s: f64, until_s: f64) -> Vec<[f64; 3]> {
    let mut random = ChaCha12Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let (mut speed, mut rate) = (SPEED_M_S, YAW_RATE_RAD_S);
    let steps = (until_s / period_s) as usize;
    (0..steps)
        .map(|step| {
            if step as f64 * period_s > FROM_S {
                speed += WALK_M_S * period_s.sqrt() * normal();
                rate += WALK_RAD_S * period_s.sqrt() * normal();
            }
            [speed, rate, period_s]
        })
        .collect()
}

/// The measurements of a variant.
pub(super) fn measurements(scenario: &Scenario, run: &SimulatedRun, variant: Variant) -> Vec<Measurement<5>> {
    let (settings, recorded) = (&scenario.robots[&ROBOT], &run.recording.robots[&ROBOT]);
    let track_m = settings.track_width_m;
    let noise = &settings.odometry.wheel_noise;
    let variances = [noise.left_m_per_sqrt_s, noise.right_m_per_sqrt_s].map(|sigma| sigma * sigma);
    let both: f64 = variances.iter().sum();
    let mut wheels = Vec::new();
    for tick in rolled(recorded, settings.wheel_radius_m) {
        let [left, right] = tick.speeds();
        let mut push = |terms: &[(usize, f64)], value: f64, per_s: f64| {
            let variance = per_s / tick.seconds;
            wheels.push(Measurement { time: tick.middle(), sensor: Sensor::sum(terms), value, variance });
        };
        match variant.wheels {
            Wheels::Each => {
                let turning = 0.5 * track_m;
                push(&[(Unicycle::SPEED, 1.0), (Unicycle::YAW_RATE, -turning)], left, variances[0]);
                push(&[(Unicycle::SPEED, 1.0), (Unicycle::YAW_RATE, turning)], right, variances[1]);
            }
            Wheels::Uncorrelated => {
                push(&[(Unicycle::SPEED, 1.0)], 0.5 * (left + right), both / 4.0);
                push(&[(Unicycle::YAW_RATE, 1.0)], (right - left) / track_m, both / (track_m * track_m));
            }
        }
    }
    let gyro = if variant.gyro { values(&recorded.gyro) } else { Vec::new() };
    let gyro = readings(&gyro, Sensor::of(Unicycle::YAW_RATE), settings.gyro.sigma_rad_s);
    in_order([wheels, gyro], Timestamp::from_seconds(FROM_S))
}

/// The filter as it begins.
pub(super) fn begun(run: &SimulatedRun) -> Option<Ekf<Unicycle, 5>> {
    let from = Timestamp::from_seconds(FROM_S);
    let prior = told(run, from)?;
    let walks = RandomWalks { speed_m_s: WALK_M_S, yaw_rate_rad_s: WALK_RAD_S, ..RandomWalks::default() };
    let pose = prior.pose;
    // The robot has driven at these speeds up to now: a wider prior would be wrong, and lasts for seconds in the yaw rate.
    let belief = Gaussian::from_sigmas(
        [pose.x_m(), pose.y_m(), pose.yaw_rad(), SPEED_M_S, YAW_RATE_RAD_S],
        [prior.sigma_position_m, prior.sigma_position_m, prior.sigma_heading_rad, 1e-3, 1e-3],
    );
    Some(Ekf::new(Unicycle { walks }, from, belief))
}

/// All variants on the recording of a seed.
pub(super) fn one(seed: u64) -> Result<Outcome, SurveyError> {
    let (scenario, run) = recorded(seed)?;
    let failed = |what: String| SurveyError::Diverged { study: NAME, seed, what };
    let times = JUDGED_S.map(Timestamp::from_seconds);
    let judged = Variant::ALL
        .iter()
        .map(|variant| {
            let mut filter =
                begun(&run).ok_or_else(|| failed("the robot is not told its start".to_owned()))?;
            let taken = measurements(&scenario, &run, *variant);
            let beliefs = beliefs_at(&mut filter, &taken, &times, failed)?;
            let track = &run.tracks[&ROBOT];
            let judge = |(time, belief): (&Timestamp, Gaussian<5>)| {
                (error_of(&pose_of(&belief), &track.pose_at(*time)), belief)
            };
            Ok(times.iter().zip(beliefs).map(judge).collect())
        })
        .collect::<Result<_, SurveyError>>()?;
    Ok(Outcome { judged })
}

/// A variant over many seeds.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Which.
    pub variant: Variant,
    /// Normalized errors of the pose.
    pub nees: NeesSummary,
    /// Squared position error at the end of each run, m^2.
    pub position_m2: Vec<f64>,
    /// Squared heading error at the end of each run, rad^2.
    pub heading_rad2: Vec<f64>,
}

/// Every variant of [`Variant::ALL`] on the recordings of all seeds.
///
/// # Errors
/// [`SurveyError`] for a scenario that cannot be simulated or a measurement that cannot be used.
pub fn judged(seeds: &[u64]) -> Result<Vec<Judged>, SurveyError> {
    let outcomes = over_seeds(seeds, one)?;
    let nothing = || SurveyError::Diverged { study: NAME, seed: 0, what: "no runs to judge".to_owned() };
    let column = |index: usize| -> Result<Judged, SurveyError> {
        let runs: Vec<Vec<(DVector<f64>, DMatrix<f64>)>> = outcomes
            .iter()
            .map(|own| {
                let pose = |(error, belief): &([f64; 3], Gaussian<5>)| {
                    let covariance = DMatrix::from_fn(3, 3, |row, column| belief.covariance[(row, column)]);
                    (DVector::from_column_slice(error), covariance)
                };
                own.judged[index].iter().map(pose).collect()
            })
            .collect();
        let last = || outcomes.iter().filter_map(|own| Some(own.judged[index].last()?.0));
        Ok(Judged {
            variant: Variant::ALL[index],
            nees: NeesSummary::from_runs(&runs, ALPHA).ok_or_else(nothing)?,
            position_m2: last().map(|[x, y, _]| x * x + y * y).collect(),
            heading_rad2: last().map(|[_, _, heading]| heading * heading).collect(),
        })
    };
    (0..Variant::ALL.len()).map(column).collect()
}

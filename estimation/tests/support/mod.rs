//! A team with every kind of measurement, as the entries it would publish. True motion, noise and all
//! choices come from one seed; transcendental functions from `libm`, so that the entries are the same bits
//! everywhere.

#![allow(dead_code, reason = "each test target uses its part")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of a fixture")]
#![allow(clippy::expect_used, missing_docs, reason = "a fixture")]

pub mod wander;

use pleiad_estimation::fact::{
    Absolute, Answer, Body, Boot, Entry, EntryId, Half, Noise, NoiseRef, Observation, Profile, Quantity,
};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::motion::Step;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Which measurements a team makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kinds {
    /// Robots see robots, by every kind in turn.
    Relative,
    /// And GPS, heading, landmarks and poses.
    All,
}

pub struct Options {
    pub robots: u32,
    pub seconds: u32,
    pub kinds: Kinds,
    /// Restrict relative measurements to one kind, by its index in [`relative_kind`].
    pub only: Option<usize>,
    /// Largest distance from the origin at which the team starts, metres.
    pub spread_m: f64,
    pub config: FoldConfig,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            robots: 4,
            seconds: 20,
            kinds: Kinds::All,
            only: None,
            spread_m: 15.0,
            config: FoldConfig::default(),
        }
    }
}

pub const PRIOR_SIGMA_M: f64 = 0.1;
pub const PRIOR_SIGMA_RAD: f64 = 0.03;
const TICK_S: f64 = 0.05;
const FORWARD_SIGMA: f64 = 0.02;
const YAW_SIGMA: f64 = 0.01;
const SIGMAS: [&[f64]; 5] = [&[0.05, 0.05, 0.02], &[0.05, 0.05], &[0.05], &[0.02], &[0.05, 0.02]];
const GPS: u16 = 5;
const HEADING: u16 = 6;

struct Robot {
    truth: Pose2,
    forward: f64,
    rate: f64,
    trajectory: NominalTrajectory,
    entries: Vec<Entry>,
}

/// What the team did: entries in the order of their logs, and where the robots really ended.
pub struct Team {
    pub entries: Vec<Entry>,
    pub truth: Vec<Pose2>,
    /// Nominal states at the end, to publish estimates from.
    pub ends: Vec<pleiad_estimation::fact::NominalState>,
    pub end: Timestamp,
}

pub fn gaussian(random: &mut impl Rng) -> f64 {
    // Box-Muller through libm: portable bits.
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    libm::sqrt(-2.0 * libm::log(u)) * libm::cos(std::f64::consts::TAU * v)
}

impl Robot {
    fn push(&mut self, id: u32, body: Body) -> EntryId {
        let id =
            EntryId { robot: RobotId(id), boot: BootIndex(0), sequence: Sequence(self.entries.len() as u64) };
        self.entries.push(Entry { id, body, extension: Vec::new() });
        id
    }
}

/// What a sensor of the kind with this index reads, with its noise.
pub fn relative_kind(kind: usize, a: &Pose2, b: &Pose2, random: &mut impl Rng) -> Relative {
    let seen = a.between(b);
    let (x, y) = (seen.x_m(), seen.y_m());
    let (range, bearing) = (libm::hypot(x, y), libm::atan2(y, x));
    let mut noise = |index: usize| SIGMAS[kind][index] * gaussian(random);
    match kind {
        0 => {
            let noise = Vector3::new(noise(0), noise(1), noise(2));
            Relative::Pose(seen.compose(&Pose2::exp(noise)))
        }
        1 => Relative::Position { x_m: x + noise(0), y_m: y + noise(1) },
        2 => Relative::Range { range_m: range + noise(0) },
        3 => Relative::Bearing { bearing_rad: bearing + noise(0) },
        _ => Relative::RangeBearing { range_m: range + noise(0), bearing_rad: bearing + noise(1) },
    }
}

pub fn team(seed: u64, options: &Options) -> Team {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut robots: Vec<Robot> =
        (0..options.robots).map(|index| start(index, options, &mut random)).collect();
    let ticks = (f64::from(options.seconds) / TICK_S) as i64;
    let tick_ns = (TICK_S * 1e9) as i64;
    for tick in 0..ticks {
        let (from, to) = (Timestamp(tick * tick_ns), Timestamp((tick + 1) * tick_ns));
        for robot in &mut robots {
            robot.rate = (robot.rate + 0.1 * gaussian(&mut random)).clamp(-1.0, 1.0);
            move_one(robot, from, to, &mut random);
        }
        // Somebody sees somebody, between two ticks, so that interpolation takes part.
        if tick > 4 && tick % 5 == 0 {
            let time = Timestamp(to.0 - random.random_range(1..tick_ns));
            let observer = random.random_range(0..options.robots) as usize;
            observe(&mut robots, observer, time, tick / 5, options, &mut random);
        }
    }
    Team {
        truth: robots.iter().map(|robot| robot.truth).collect(),
        ends: robots.iter().map(|robot| robot.trajectory.end().1).collect(),
        end: Timestamp(ticks * tick_ns),
        entries: robots.into_iter().flat_map(|robot| robot.entries).collect(),
    }
}

fn start(index: u32, options: &Options, random: &mut ChaCha8Rng) -> Robot {
    let spread = options.spread_m;
    let truth = Pose2::new(
        random.random_range(-spread..spread),
        random.random_range(-spread..spread),
        random.random_range(-3.0..3.0),
    );
    let prior = Pose2::new(
        truth.x_m() + PRIOR_SIGMA_M * gaussian(random),
        truth.y_m() + PRIOR_SIGMA_M * gaussian(random),
        truth.yaw_rad() + PRIOR_SIGMA_RAD * gaussian(random),
    );
    let trajectory = NominalTrajectory::new(Timestamp(0), prior, 100_000);
    let observer = trajectory.end().1;
    let mut robot = Robot {
        truth,
        forward: random.random_range(0.3..1.2),
        rate: random.random_range(-0.5..0.5),
        trajectory,
        entries: Vec::new(),
    };
    let boot = Boot {
        time: Timestamp(0),
        nonce: random.random(),
        configuration: options.config.hash(),
        nominal: prior,
        continuation: None,
        calibration: None,
    };
    let id = index + 1;
    robot.push(id, Body::Boot(boot));
    let profiles = SIGMAS.iter().map(|sigmas| Noise::from_sigmas(sigmas));
    let others = [Noise::from_sigmas(&[0.5, 0.5]), Noise::from_sigmas(&[0.05])];
    for (index, noise) in profiles.chain(others).enumerate() {
        robot.push(id, Body::Profile(Profile { index: index as u16, noise }));
    }
    robot.push(
        id,
        Body::Observation(Observation {
            time: Timestamp(0),
            quantity: Quantity::Absolute(Absolute::Pose(prior)),
            noise: NoiseRef::Explicit(Noise::from_sigmas(&[PRIOR_SIGMA_M, PRIOR_SIGMA_M, PRIOR_SIGMA_RAD])),
            observer,
        }),
    );
    robot
}

/// The odometry reports the commanded motion; the truth moves by it and the noise, on the right.
fn move_one(robot: &mut Robot, from: Timestamp, to: Timestamp, random: &mut ChaCha8Rng) {
    let seconds = to.seconds_since(from);
    let motion = Vector3::new(robot.forward * seconds, 0.0, robot.rate * seconds);
    let root = libm::sqrt(seconds);
    let noise =
        Vector3::new(FORWARD_SIGMA * root * gaussian(random), 0.0, YAW_SIGMA * root * gaussian(random));
    robot.truth = robot.truth.compose(&Pose2::exp(motion)).compose(&Pose2::exp(noise));
    let covariance =
        Symmetric3::diagonal(FORWARD_SIGMA * FORWARD_SIGMA * seconds, 0.0, YAW_SIGMA * YAW_SIGMA * seconds);
    robot.trajectory.extend(&Step { from, to, motion, covariance });
}

/// An observation at `time`, which lies within the last tick, of the true poses then (the truth is carried
/// back along the commanded arc, a difference far below the sensors' noise).
fn observe(
    robots: &mut [Robot],
    a: usize,
    time: Timestamp,
    count: i64,
    options: &Options,
    random: &mut ChaCha8Rng,
) {
    let back = |robot: &Robot| {
        let (_, last) = robot.trajectory.end();
        let state = robot.trajectory.at(time).expect("within the last tick");
        robot.truth.compose(&last.nominal.between(&state.nominal))
    };
    let id = a as u32 + 1;
    let truth = back(&robots[a]);
    let observer = robots[a].trajectory.at(time).expect("within the last tick");
    let absolute = options.kinds == Kinds::All && count % 3 == 0;
    let kind = options.only.unwrap_or(count as usize % SIGMAS.len());
    let (quantity, profile) = if absolute {
        match random.random_range(0..4) {
            0 => {
                let mut sigma = || 0.5 * gaussian(random);
                let position = [truth.x_m() + sigma(), truth.y_m() + sigma()];
                (Quantity::Absolute(Absolute::Position(position)), GPS)
            }
            1 => {
                let heading = Pose2::new(0.0, 0.0, truth.yaw_rad() + 0.05 * gaussian(random)).yaw_rad();
                (Quantity::Absolute(Absolute::Heading(heading)), HEADING)
            }
            2 => {
                let noise =
                    Vector3::new(0.05 * gaussian(random), 0.05 * gaussian(random), 0.02 * gaussian(random));
                (Quantity::Absolute(Absolute::Pose(truth.compose(&Pose2::exp(noise)))), 0)
            }
            _ => {
                let position_m = [3.0, -4.0];
                let kind = kind.max(1);
                let relative = relative_kind(kind, &truth, &Pose2::new(3.0, -4.0, 0.0), random);
                (Quantity::Landmark { landmark: LandmarkId(7), position_m, relative }, kind as u16)
            }
        }
    } else {
        let b = (a + random.random_range(1..robots.len())) % robots.len();
        let relative = relative_kind(kind, &truth, &back(&robots[b]), random);
        (Quantity::Robot { robot: RobotId(b as u32 + 1), relative }, kind as u16)
    };
    let noise = NoiseRef::Profile(profile);
    let observation = Observation { time, quantity, noise, observer };
    let fact = robots[a].push(id, Body::Observation(observation));
    if let Quantity::Robot { robot: RobotId(b), .. } = quantity {
        let target = &mut robots[b as usize - 1];
        let state = target.trajectory.at(time).expect("within the last tick");
        let answer = Answer::State { boot: BootIndex(0), state };
        target.push(b, Body::Half(Half { observation: fact, answer }));
    }
}

/// A permutation that keeps nothing in place on purpose, with a share of the entries twice.
pub fn shuffled(entries: &[Entry], random: &mut ChaCha8Rng, duplicates: f64) -> Vec<Entry> {
    let mut shuffled: Vec<Entry> = entries.to_vec();
    let copies = entries.iter().filter(|_| random.random::<f64>() < duplicates).cloned().collect::<Vec<_>>();
    shuffled.extend(copies);
    for index in (1..shuffled.len()).rev() {
        shuffled.swap(index, random.random_range(0..=index));
    }
    shuffled
}

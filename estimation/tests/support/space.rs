//! A team in space: what it does, as facts and as the ticks of a filter that knows no facts. True motion, noise and all
//! choices come from one seed; transcendental functions from `libm`, so that the facts are the same bits everywhere.

#![allow(dead_code, reason = "each test target uses its part")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of a fixture")]
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a fixture")]

use pleiad_estimation::fact::EntryId;
use pleiad_estimation::fold::FactKey;
use pleiad_estimation::geometry::{LieGroup, Pose3, Tangent6, Vector3};
use pleiad_estimation::group_fold::{Fact, FactSet, Noise, NominalState, Quantity, Step, Trajectory};
use pleiad_estimation::spatial::{
    Absolute3, BodyRates, DeadReckoning, Direction, RateNoise, Relative3, tangent_basis,
};
use pleiad_estimation::{BootIndex, LandmarkId, RobotId, Sequence, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub type Fact3 = Fact<Pose3, 6>;
pub type State3 = NominalState<Pose3, 6>;

pub const TICK_NS: i64 = 50_000_000;
const PRIOR: [f64; 6] = [0.1, 0.1, 0.1, 0.03, 0.03, 0.03];
const WALK: RateNoise =
    RateNoise { velocity_m_per_sqrt_s: [0.02, 0.01, 0.01], angular_rad_per_sqrt_s: [0.005, 0.005, 0.01] };
const SIGMAS: [&[f64]; 5] =
    [&[0.05, 0.05, 0.05, 0.02, 0.02, 0.02], &[0.05, 0.05, 0.05], &[0.05], &[0.02, 0.02], &[0.05, 0.02, 0.02]];
const FIX: [f64; 3] = [0.2, 0.2, 0.3];

#[derive(Clone, Copy)]
pub struct Options {
    pub robots: u32,
    pub seconds: i64,
    /// All noises are multiplied by it.
    pub noise: f64,
    /// Process noise is multiplied by it besides.
    pub walk: f64,
    /// The first robot has absolute positions, and all see landmarks.
    pub absolute: bool,
    /// Observations fall between ticks.
    pub between: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { robots: 3, seconds: 20, noise: 1.0, walk: 1.0, absolute: true, between: true }
    }
}

/// What happened, in the order in which it did.
pub enum Event {
    Step(RobotId, Step<6>),
    Observation(RobotId, Quantity<Pose3, 6>, Noise<6>),
}

pub struct Run {
    pub facts: Vec<(FactKey, Fact3)>,
    pub events: Vec<Event>,
    /// At the end.
    pub truth: Vec<Pose3>,
    pub ends: Vec<State3>,
}

struct Robot {
    truth: Pose3,
    rates: Tangent6,
    reckoning: DeadReckoning,
    trajectory: Trajectory<Pose3, 6>,
    said: u64,
}

pub fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    // Box and Muller through libm: portable bits.
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    libm::sqrt(-2.0 * libm::log(u)) * libm::cos(std::f64::consts::TAU * v)
}

fn noise6(sigmas: [f64; 6], random: &mut ChaCha8Rng) -> Tangent6 {
    Tangent6::from(sigmas.map(|sigma| sigma * gaussian(random)))
}

impl Run {
    pub fn set(&self) -> FactSet<Pose3, 6> {
        let mut set = FactSet::new();
        for (key, fact) in &self.facts {
            set.insert(*key, *fact).expect("sound");
        }
        set
    }
}

pub fn run(seed: u64, options: &Options) -> Run {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut run = Run { facts: Vec::new(), events: Vec::new(), truth: Vec::new(), ends: Vec::new() };
    let mut robots: Vec<Robot> = (0..options.robots).map(|_| begin(options, &mut random)).collect();
    for index in 0..robots.len() {
        let prior =
            robots[index].truth.compose(&Pose3::exp(&noise6(PRIOR.map(|s| s * options.noise), &mut random)));
        let noise = Noise::from_sigmas(&PRIOR.map(|sigma| sigma * options.noise));
        say(&mut run, &mut robots, index, Timestamp(0), &Quantity::Absolute(Absolute3::Pose(prior)), &noise);
    }
    for tick in 1..=options.seconds * 1_000_000_000 / TICK_NS {
        for (robot, id) in robots.iter_mut().zip(1..) {
            if let Some(step) = advance(robot, Timestamp(tick * TICK_NS), &mut random) {
                run.events.push(Event::Step(RobotId(id), step));
            }
        }
        if tick % 4 == 0 {
            let back = if options.between { random.random_range(0..TICK_NS) } else { 0 };
            observe(&mut run, &mut robots, Timestamp(tick * TICK_NS - back), tick / 4, options, &mut random);
        }
    }
    run.truth = robots.iter().map(|robot| robot.truth).collect();
    run.ends = robots.iter().map(|robot| robot.trajectory.end().1).collect();
    run
}

fn begin(options: &Options, random: &mut ChaCha8Rng) -> Robot {
    let mut uniform = |reach: f64| random.random_range(-reach..reach);
    let (x, y, z) = (uniform(8.0), uniform(8.0), uniform(4.0));
    let turn = Vector3::new(uniform(0.5), uniform(0.5), uniform(3.0));
    let factor = options.noise * options.walk;
    let walk = RateNoise {
        velocity_m_per_sqrt_s: WALK.velocity_m_per_sqrt_s.map(|sigma| sigma * factor),
        angular_rad_per_sqrt_s: WALK.angular_rad_per_sqrt_s.map(|sigma| sigma * factor),
    };
    let mut robot = Robot {
        truth: Pose3::from_rotation_vector(Vector3::new(x, y, z), turn),
        rates: Tangent6::new(0.5, 0.0, 0.0, 0.0, 0.0, 0.2),
        reckoning: DeadReckoning::new(walk, 1.0),
        // A robot does not know where it is: its nominal trajectory begins anywhere.
        trajectory: Trajectory::new(Timestamp(0), Pose3::exp(&noise6([0.5; 6], random)), usize::MAX),
        said: 0,
    };
    advance(&mut robot, Timestamp(0), random);
    robot
}

/// A sample of rates that wander; the truth moves by the increment and the noise, on the right.
fn advance(robot: &mut Robot, time: Timestamp, random: &mut ChaCha8Rng) -> Option<Step<6>> {
    let home = robot.truth.rotate_back(&-robot.truth.position());
    let pull = 0.02 * Vector3::x().cross(&home);
    let wander = noise6([0.03, 0.02, 0.02, 0.03, 0.03, 0.08], random);
    let wanted = Tangent6::new(0.6, 0.0, 0.0, pull.x, pull.y, pull.z);
    robot.rates += (wanted - robot.rates) * 0.05 + wander;
    let [x, y, z, a, b, c] = <[f64; 6]>::from(robot.rates);
    let rates = BodyRates { time, velocity_m_s: [x, y, z], angular_rad_s: [a, b, c] };
    let step = robot.reckoning.sample(rates).expect("in order")?;
    robot.trajectory.extend(&step).expect("in order");
    let noise = Tangent6::from(std::array::from_fn::<f64, 6, _>(|axis| {
        libm::sqrt(step.covariance.entry(axis, axis)) * gaussian(random)
    }));
    robot.truth = robot.truth.compose(&Pose3::exp(&step.motion)).compose(&Pose3::exp(&noise));
    Some(step)
}

/// The true pose at a time within the last tick: carried back along the increment.
fn at(robot: &Robot, time: Timestamp) -> Pose3 {
    let (_, last) = robot.trajectory.end();
    let state = robot.trajectory.at(time).expect("within the last tick");
    robot.truth.compose(&last.nominal.between(&state.nominal))
}

fn observe(
    run: &mut Run,
    robots: &mut [Robot],
    time: Timestamp,
    count: i64,
    options: &Options,
    random: &mut ChaCha8Rng,
) {
    let kind = count as usize % SIGMAS.len();
    let mut observer = random.random_range(0..robots.len());
    let other = (observer + random.random_range(1..robots.len())) % robots.len();
    if options.absolute && count % 4 == 0 {
        observer = 0;
        let place = at(&robots[0], time).position();
        let z = place + Vector3::from(FIX.map(|sigma| sigma * options.noise * gaussian(random)));
        let noise = Noise::from_sigmas(&FIX.map(|sigma| sigma * options.noise));
        return say(run, robots, observer, time, &Quantity::Absolute(Absolute3::Position(z)), &noise);
    }
    let from = at(&robots[observer], time);
    let sigmas: Vec<f64> = SIGMAS[kind].iter().map(|sigma| sigma * options.noise).collect();
    let quantity = if options.absolute && count % 7 == 0 && kind > 0 {
        let position_m = Vector3::new(3.0, -4.0, 1.0);
        let place = Pose3::new(position_m, [1.0, 0.0, 0.0, 0.0]);
        let relative = reading(kind, &from.between(&place), &sigmas, random);
        Quantity::Landmark { landmark: LandmarkId(7), position_m, relative }
    } else {
        let relative = reading(kind, &from.between(&at(&robots[other], time)), &sigmas, random);
        Quantity::Robot { robot: RobotId(other as u32 + 1), relative }
    };
    say(run, robots, observer, time, &quantity, &Noise::from_sigmas(&sigmas));
}

fn reading(kind: usize, seen: &Pose3, sigmas: &[f64], random: &mut ChaCha8Rng) -> Relative3 {
    let mut noise = |index: usize| sigmas[index] * gaussian(random);
    let place = seen.position();
    match kind {
        0 => Relative3::Pose(seen.compose(&Pose3::exp(&Tangent6::from([0, 1, 2, 3, 4, 5].map(noise))))),
        1 => Relative3::Position(place + Vector3::new(noise(0), noise(1), noise(2))),
        2 => Relative3::Range(place.norm() + noise(0)),
        3 => Relative3::Bearing(deflected(&place, noise(0), noise(1))),
        _ => Relative3::RangeBearing(place.norm() + noise(0), deflected(&place, noise(1), noise(2))),
    }
}

/// A direction turned by two small angles across it, which are the same in all directions.
fn deflected(place: &Vector3, a: f64, b: f64) -> Direction {
    let unit = place.normalize();
    let [first, second] = tangent_basis(&unit);
    let angle = libm::hypot(a, b).max(1e-300);
    let across = (first * a + second * b) / angle;
    Direction::new(unit * libm::cos(angle) + across * libm::sin(angle)).expect("a unit vector")
}

fn say(
    run: &mut Run,
    robots: &mut [Robot],
    a: usize,
    time: Timestamp,
    quantity: &Quantity<Pose3, 6>,
    noise: &Noise<6>,
) {
    let state = |robot: &Robot| robot.trajectory.at(time).expect("within the last tick");
    let observer = state(&robots[a]);
    let other = match quantity {
        Quantity::Robot { robot: RobotId(b), .. } => Some((BootIndex(0), state(&robots[*b as usize - 1]))),
        Quantity::Landmark { .. } | Quantity::Absolute(_) => None,
    };
    let robot = RobotId(a as u32 + 1);
    let id = EntryId { robot, boot: BootIndex(0), sequence: Sequence(robots[a].said) };
    robots[a].said += 1;
    let (quantity, noise) = (*quantity, *noise);
    let fact = Fact::Observation { quantity, noise, observer, other };
    run.facts.push((FactKey::observation(time, id), fact));
    run.events.push(Event::Observation(robot, quantity, noise));
}

/// What is wrong with the estimates at the end, robot after robot: `xi` of `X = exp(xi) Xhat`.
pub fn errors(truth: &[Pose3], estimates: &[Pose3]) -> Vec<f64> {
    let pairs = truth.iter().zip(estimates);
    pairs.flat_map(|(x, xhat)| <[f64; 6]>::from(LieGroup::log(&x.compose(&xhat.inverse())))).collect()
}

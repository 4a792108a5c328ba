//! A team that wanders, and how what it does becomes readings. It knows of no derivative and no covariance: what it says is
//! true is an independent source for what the filter finds.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "a fixture"
)]
#![allow(missing_docs, reason = "a fixture")]

use pleiad_estimation::fact::{
    Absolute, Answer, Body, Boot, Calibration, Entry, EntryId, Half, Noise, NoiseRef, Observation, Quantity,
    extension_of_boot, extension_of_state,
};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::geometry::{Vector3, wrap_angle};
use pleiad_estimation::joint::Joint;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::motion::Step;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub const TICK_NS: i64 = 50_000_000;
pub const TICK_S: f64 = 0.05;
const NOISE: [f64; 3] = [0.01, 0.0, 0.01];
const PRIOR: [f64; 3] = [0.05, 0.05, 0.02];
const SIGHTING: [f64; 2] = [0.05, 0.01];
const GPS: f64 = 0.2;

/// What is wrong with a robot, in the units and order of [`Calibration`]; clocks are off by whole ticks.
#[derive(Clone, Copy, Default)]
pub struct Wrong {
    pub motion: [f64; 3],
    pub mount: [f64; 3],
    pub late_ticks: i64,
}

pub struct Robot {
    pub wrong: Wrong,
    pub told: Option<Calibration>,
    /// True poses by tick, from tick 0 at true time -20 ticks.
    pub truth: Vec<Pose2>,
    pub trajectory: NominalTrajectory,
    pub entries: Vec<Entry>,
}

pub const BEFORE: i64 = 20;

impl Robot {
    /// The true pose when its clock shows the end of a tick.
    pub fn at_label(&self, tick: i64) -> &Pose2 {
        &self.truth[(tick - self.wrong.late_ticks + BEFORE) as usize]
    }

    fn say(&mut self, robot: u32, body: Body, extension: Vec<u8>) -> EntryId {
        let sequence = Sequence(self.entries.len() as u64);
        let id = EntryId { robot: RobotId(robot), boot: BootIndex(0), sequence };
        self.entries.push(Entry { id, body, extension });
        id
    }

    fn extension(&self, tick: i64) -> Vec<u8> {
        let state = self.trajectory.at(Timestamp(tick * TICK_NS)).expect("kept");
        state.sensitivity.filter(|_| self.told.is_some()).map_or_else(Vec::new, |of| extension_of_state(&of))
    }
}

pub struct Run {
    pub robots: Vec<Robot>,
    pub ticks: i64,
}

pub fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// What a team may see.
#[derive(Clone, Copy)]
#[allow(clippy::struct_excessive_bools, reason = "each is one thing that may be so")]
pub struct World<'a> {
    /// The first robot has GPS.
    pub gps: bool,
    /// All have it.
    pub all_gps: bool,
    /// Landmarks that nobody knows the places of, unless they are `known`.
    pub landmarks: &'a [[f64; 2]],
    /// Everybody knows where the landmarks are.
    pub known: bool,
    /// So far the first of them is from where everybody thinks, m.
    pub misplaced_m: f64,
    /// Share of sightings of landmarks that name another one.
    pub misnamed: f64,
    /// Share of sightings of robots that name another one.
    pub mistaken: f64,
    /// Every robot answers every sighting.
    pub all_answer: bool,
    /// The first two landmarks, and the second robot and the third, always go by each other's names.
    pub swapped: bool,
    /// Share of sightings of robots that are of nothing: any range and any bearing.
    pub garbage: f64,
    /// Noise of the odometry, over [`NOISE`].
    pub slip: f64,
    /// By how much it is more than what is stated.
    pub understated: f64,
    /// Ticks between sightings of robots.
    pub every: i64,
    /// Which robots are told where they start: bit 0 is the first.
    pub told: u32,
    /// What sightings of robots measure.
    pub kind: Kind,
    /// A robot that does not say what it should, from a tick on.
    pub lie: Option<Lie>,
    /// A robot, counted from 0, that is shoved to its left at a tick, by so many metres: an honest one that errs.
    pub shove: Option<(usize, i64, f64)>,
}

/// What a robot says beside the truth.
#[derive(Clone, Copy, Debug)]
pub struct Lie {
    /// Which robot, counted from 0.
    pub robot: usize,
    /// From which tick on.
    pub from: i64,
    /// Added to its fixes, and to where it says that it starts, m.
    pub fix_m: [f64; 2],
    /// Added to range and bearing of what it sees.
    pub sighting: [f64; 2],
    /// Added to the nominal positions with which it answers, m.
    pub answer_m: f64,
    /// Added to the ranges of landmarks, m.
    pub landmark_m: f64,
}

impl Lie {
    /// A robot that says what it should.
    pub fn none(robot: usize, from: i64) -> Self {
        Self { robot, from, fix_m: [0.0; 2], sighting: [0.0; 2], answer_m: 0.0, landmark_m: 0.0 }
    }
}

impl World<'_> {
    fn lies(&self, robot: usize, tick: i64) -> Option<Lie> {
        self.lie.filter(|lie| lie.robot == robot && tick >= lie.from)
    }
}

/// What a sighting measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    RangeBearing,
    Range,
    Bearing,
    Position,
    Pose,
}

impl Default for World<'_> {
    fn default() -> Self {
        Self {
            gps: true,
            all_gps: false,
            landmarks: &[],
            known: false,
            misplaced_m: 0.0,
            misnamed: 0.0,
            mistaken: 0.0,
            all_answer: false,
            swapped: false,
            garbage: 0.0,
            slip: 1.0,
            understated: 1.0,
            every: 4,
            told: u32::MAX,
            kind: Kind::RangeBearing,
            lie: None,
            shove: None,
        }
    }
}

/// Robots that wander for `seconds`.
pub fn run(
    seed: u64,
    seconds: i64,
    config: &FoldConfig,
    world: World<'_>,
    robots: &[(Wrong, Option<Calibration>)],
) -> Run {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let ticks = seconds * 20;
    let mut run = Run { robots: Vec::new(), ticks };
    for (index, (wrong, told)) in robots.iter().enumerate() {
        let mut truth = vec![Pose2::new(3.0 * index as f64, 1.0, 0.5 * index as f64)];
        let (mut forward, mut rate): (f64, f64) = (0.5, 0.0);
        let mut steps = Vec::new();
        for _ in 0..ticks + 2 * BEFORE {
            // It keeps to the middle, and drives at changing speeds.
            let home = truth[truth.len() - 1];
            let wanted = wrap_angle((-home.y_m()).atan2(-home.x_m()) - home.yaw_rad());
            let pull = if home.position().norm() > 4.0 { 0.3 * wanted } else { 0.0 };
            rate = (0.95 * rate + 0.12 * gaussian(&mut random) + 0.1 * pull).clamp(-1.0, 1.0);
            forward = (forward + 0.05 * gaussian(&mut random)).clamp(0.1, 1.0);
            let noise = NOISE.map(|sigma| world.slip * sigma * TICK_S.sqrt() * gaussian(&mut random));
            let said = Vector3::new(forward * TICK_S, 0.0, rate * TICK_S);
            let [scale, turn, bias] = wrong.motion;
            let moved = Vector3::new(said.x * (1.0 + scale), 0.0, said.z * (1.0 + turn) - bias * TICK_S);
            truth.push(home.compose(&Pose2::exp(moved)).compose(&Pose2::exp(Vector3::from(noise))));
            if let (Some((who, tick, by)), Some(last)) = (world.shove, truth.last_mut())
                && (who, tick + BEFORE) == (index, steps.len() as i64)
            {
                *last = last.compose(&Pose2::new(0.0, by, 0.0));
            }
            steps.push(said);
        }
        let nominal = NominalTrajectory::new(Timestamp(0), Pose2::identity(), usize::MAX).calibrated();
        let mut robot = Robot { wrong: *wrong, told: *told, truth, trajectory: nominal, entries: Vec::new() };
        let first = BEFORE - wrong.late_ticks;
        for tick in 0..=ticks {
            let [x, y, yaw] = NOISE.map(|sigma| (world.slip / world.understated * sigma).powi(2) * TICK_S);
            robot.trajectory.extend(&Step {
                from: Timestamp(tick * TICK_NS),
                to: Timestamp((tick + 1) * TICK_NS),
                motion: steps[(tick + first) as usize],
                covariance: Symmetric3::diagonal(x, y, yaw),
            });
        }
        let boot = Boot {
            time: Timestamp(0),
            nonce: 1,
            configuration: config.hash(),
            nominal: Pose2::identity(),
            continuation: None,
            calibration: None,
        };
        let extension = told.map_or_else(Vec::new, |told| extension_of_boot(&told, None));
        let number = index as u32 + 1;
        robot.say(number, Body::Boot(boot), extension);
        let error = PRIOR.map(|sigma| sigma * gaussian(&mut random));
        let prior = robot.at_label(0).compose(&Pose2::exp(Vector3::from(error)));
        let [x, y] = world.lies(index, 0).map_or([0.0; 2], |lie| lie.fix_m);
        let prior = Pose2::new(x, y, 0.0).compose(&prior);
        let prior = Quantity::Absolute(Absolute::Pose(prior));
        if world.told >> index & 1 == 1 {
            observation(&mut robot, number, 0, prior, &PRIOR);
        }
        run.robots.push(robot);
    }
    for tick in 1..ticks {
        let observer = random.random_range(0..robots.len());
        let other = (observer + random.random_range(1..robots.len())) % robots.len();
        if tick % world.every == 0 {
            sight(&mut run, observer, other, tick, &world, &mut random);
        }
        for (landmark, place) in world.landmarks.iter().enumerate() {
            // Each robot looks at each now and then, at ticks of its own.
            for robot in 0..robots.len() {
                if (tick + 7 * robot as i64 + 3 * landmark as i64) % 20 == 0 {
                    see_landmark(&mut run, robot, landmark, *place, tick, &world, &mut random);
                }
            }
        }
        if world.gps && tick % 20 == 0 {
            let with = if world.all_gps { robots.len() } else { 1 };
            for robot in 0..with {
                let truth = run.robots[robot].at_label(tick);
                let mut read = [truth.x_m(), truth.y_m()].map(|p| p + GPS * gaussian(&mut random));
                if let Some(Lie { fix_m: [x, y], .. }) = world.lies(robot, tick) {
                    read = [read[0] + x, read[1] + y];
                }
                let gps = Quantity::Absolute(Absolute::Position(read));
                observation(&mut run.robots[robot], robot as u32 + 1, tick, gps, &[GPS; 2]);
            }
        }
    }
    run
}

fn observation(robot: &mut Robot, number: u32, tick: i64, quantity: Quantity, sigmas: &[f64]) -> EntryId {
    let time = Timestamp(tick * TICK_NS);
    let observer = robot.trajectory.at(time).expect("kept");
    let noise = NoiseRef::Explicit(Noise::from_sigmas(sigmas));
    let extension = robot.extension(tick);
    robot.say(number, Body::Observation(Observation { time, quantity, noise, observer }), extension)
}

fn reading(seen: pleiad_estimation::geometry::Vector2, random: &mut ChaCha8Rng) -> Relative {
    Relative::RangeBearing {
        range_m: seen.norm() + SIGHTING[0] * gaussian(random),
        bearing_rad: seen.y.atan2(seen.x) + SIGHTING[1] * gaussian(random),
    }
}

const VIEW_M: f64 = 5.0;

fn see_landmark(
    run: &mut Run,
    robot: usize,
    landmark: usize,
    [x, y]: [f64; 2],
    tick: i64,
    world: &World<'_>,
    random: &mut ChaCha8Rng,
) {
    let seen = run.robots[robot].at_label(tick).between(&Pose2::new(x, y, 0.0)).position();
    if seen.norm() < VIEW_M {
        let told = world.lies(robot, tick).map_or(0.0, |lie| lie.landmark_m);
        let relative = reading(seen * (1.0 + told / seen.norm()), random);
        let mut name = landmark;
        if world.swapped && landmark < 2 {
            name = 1 - landmark;
        }
        if world.misnamed > 0.0 && random.random::<f64>() < world.misnamed {
            name = (landmark + random.random_range(1..world.landmarks.len())) % world.landmarks.len();
        }
        let landmark = LandmarkId(name as u32);
        let quantity = if world.known {
            let [x, y] = world.landmarks[name];
            let off = if name == 0 { world.misplaced_m } else { 0.0 };
            Quantity::Landmark { landmark, position_m: [x + off, y], relative }
        } else {
            Quantity::Feature { landmark, relative }
        };
        observation(&mut run.robots[robot], robot as u32 + 1, tick, quantity, &SIGHTING);
    }
}

fn sight(
    run: &mut Run,
    observer: usize,
    other: usize,
    tick: i64,
    world: &World<'_>,
    random: &mut ChaCha8Rng,
) {
    let [x, y, yaw] = run.robots[observer].wrong.mount;
    let from = run.robots[observer].at_label(tick).compose(&Pose2::new(x, y, yaw));
    // Where the other one is at that true instant.
    let late = run.robots[other].wrong.late_ticks - run.robots[observer].wrong.late_ticks;
    let whole = from.between(run.robots[other].at_label(tick + late));
    let seen = whole.position();
    let mut relative = reading(seen, random);
    let (luck, range_m, bearing_rad) =
        (random.random::<f64>(), random.random_range(0.3..8.0), random.random_range(-3.1..3.1));
    if luck < world.garbage {
        relative = Relative::RangeBearing { range_m, bearing_rad };
    }
    let Relative::RangeBearing { mut range_m, mut bearing_rad } = relative else { unreachable!() };
    if let Some(Lie { sighting: [range, bearing], .. }) = world.lies(observer, tick) {
        range_m += range;
        bearing_rad += bearing;
    }
    let (relative, sigmas): (Relative, &[f64]) = match world.kind {
        Kind::RangeBearing => (Relative::RangeBearing { range_m, bearing_rad }, &SIGHTING),
        Kind::Range => (Relative::Range { range_m }, &SIGHTING[..1]),
        Kind::Bearing => (Relative::Bearing { bearing_rad }, &SIGHTING[1..]),
        Kind::Position => {
            let [x_m, y_m] = [seen.x, seen.y].map(|axis| axis + SIGHTING[0] * gaussian(random));
            (Relative::Position { x_m, y_m }, &[SIGHTING[0]; 2])
        }
        Kind::Pose => {
            let sigmas = &[SIGHTING[0], SIGHTING[0], SIGHTING[1]];
            let error = sigmas.map(|sigma| sigma * gaussian(random));
            (Relative::Pose(whole.compose(&Pose2::exp(Vector3::from(error)))), sigmas)
        }
    };
    let mut named = other;
    if world.swapped && [1, 2].contains(&other) && observer + other != 3 {
        named = 3 - other;
    }
    if world.mistaken > 0.0 && random.random::<f64>() < world.mistaken {
        let wrong: Vec<usize> =
            (0..run.robots.len()).filter(|robot| ![observer, other].contains(robot)).collect();
        named = wrong[random.random_range(0..wrong.len())];
    }
    let quantity = Quantity::Robot { robot: RobotId(named as u32 + 1), relative };
    let id = observation(&mut run.robots[observer], observer as u32 + 1, tick, quantity, sigmas);
    for robot in 0..run.robots.len() {
        if robot == named || (world.all_answer && robot != observer) {
            let mut state = run.robots[robot].trajectory.at(Timestamp(tick * TICK_NS)).expect("kept");
            if let Some(Lie { answer_m, .. }) = world.lies(robot, tick) {
                state.nominal = Pose2::new(answer_m, 0.0, 0.0).compose(&state.nominal);
            }
            let answer = Answer::State { boot: BootIndex(0), state };
            let extension = run.robots[robot].extension(tick);
            run.robots[robot].say(robot as u32 + 1, Body::Half(Half { observation: id, answer }), extension);
        }
    }
}

impl Run {
    /// All that was said, by robot.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.robots.iter().flat_map(|robot| &robot.entries)
    }

    pub fn ledger(&self, config: FoldConfig) -> Ledger {
        let mut ledger = Ledger::new(config);
        for entry in self.entries() {
            ledger.insert(entry.clone());
        }
        ledger
    }

    /// Errors of position of all robots at the end, by what is published, root mean square in metres.
    pub fn error_m(&self, joint: &Joint) -> f64 {
        self.error_without_m(joint, 0)
    }

    /// The same without one of them.
    pub fn error_without_m(&self, joint: &Joint, without: u32) -> f64 {
        let of = || self.robots.iter().zip(1..).filter(|(_, number)| *number != without);
        let square = of().map(|(robot, number)| {
            let time = Timestamp(self.ticks * TICK_NS);
            let state = robot.trajectory.at(time).expect("kept");
            let (pose, _) = joint.estimate(RobotId(number), time, &state).expect("placed");
            // Published is where the robot is when the time is what its clock shows, not when its clock shows it.
            let truth = &robot.truth[(self.ticks + BEFORE) as usize];
            (pose.position() - truth.position()).norm_squared()
        });
        (square.sum::<f64>() / of().count() as f64).sqrt()
    }

    /// Normalized squared errors of position of all robots at the end, over their dimension: 1 if the filter is right about itself.
    pub fn nees_of_positions(&self, joint: &Joint) -> f64 {
        let time = Timestamp(self.ticks * TICK_NS);
        let of = |(robot, number): (&Robot, u32)| {
            let state = robot.trajectory.at(time).expect("kept");
            let (pose, covariance) = joint.estimate(RobotId(number), time, &state).expect("placed");
            let [xx, xy, yy, ..] = covariance.0;
            let error = robot.at_label(self.ticks).position() - pose.position();
            (error.x * error.x * yy - 2.0 * error.x * error.y * xy + error.y * error.y * xx)
                / (xx * yy - xy * xy)
        };
        self.robots.iter().zip(1..).map(of).sum::<f64>() / (2 * self.robots.len()) as f64
    }
}

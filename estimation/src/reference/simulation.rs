//! A seeded team for the tests of this module: truth, ticks, measurements, and the same as entries.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::models::adjoint;
use super::{Tick, TimedMeasurement};
use crate::fact::{
    Absolute, Answer, Body, Boot, Entry, EntryId, Half, Noise, NoiseRef, NominalState, Observation, Profile,
    Quantity,
};
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};

/// What is observed, in turn.
#[derive(Clone, Copy, PartialEq)]
pub enum Kinds {
    All,
    RelativeOnly,
}

/// What to simulate.
#[derive(Clone, Copy)]
pub struct Scenario {
    pub seed: u64,
    pub robots: u32,
    pub ticks: u32,
    pub tick_s: f64,
    /// Somebody observes something every so many ticks.
    pub every: u32,
    pub kinds: Kinds,
    /// Scales odometry noise.
    pub odometry: f64,
    /// Standard deviations of the priors.
    pub prior: [f64; 3],
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            seed: 1,
            robots: 3,
            ticks: 600,
            tick_s: 0.05,
            every: 5,
            kinds: Kinds::All,
            odometry: 1.0,
            prior: [0.05, 0.05, 0.02],
        }
    }
}

/// A simulated run.
pub struct Simulated {
    pub entries: Vec<Entry>,
    pub measurements: Vec<(EntryId, TimedMeasurement)>,
    pub priors: BTreeMap<RobotId, (Pose2, Matrix3)>,
    pub ticks: BTreeMap<RobotId, Vec<Tick>>,
    /// At the end.
    pub truth: BTreeMap<RobotId, Pose2>,
    /// At the end.
    pub nominal: BTreeMap<RobotId, NominalState>,
}

/// What a perfect sensor reads; the kind is that of the template.
pub fn observe(template: &Quantity, observer: &Pose2, observed: Option<&Pose2>) -> Quantity {
    let seen = |relative: &Relative, target: &Pose2| {
        let p = observer.between(target).position();
        let (range_m, bearing_rad) = (p.norm(), p.y.atan2(p.x));
        match relative {
            Relative::Pose(_) => Relative::Pose(observer.between(target)),
            Relative::Position { .. } => Relative::Position { x_m: p.x, y_m: p.y },
            Relative::Range { .. } => Relative::Range { range_m },
            Relative::Bearing { .. } => Relative::Bearing { bearing_rad },
            Relative::RangeBearing { .. } => Relative::RangeBearing { range_m, bearing_rad },
        }
    };
    match template {
        Quantity::Robot { robot, relative } => {
            Quantity::Robot { robot: *robot, relative: seen(relative, observed.unwrap()) }
        }
        Quantity::Landmark { landmark, position_m, relative } => Quantity::Landmark {
            landmark: *landmark,
            position_m: *position_m,
            relative: seen(relative, &Pose2::new(position_m[0], position_m[1], 0.0)),
        },
        Quantity::Feature { .. } => *template,
        Quantity::Absolute(absolute) => Quantity::Absolute(match absolute {
            Absolute::Pose(_) => Absolute::Pose(*observer),
            Absolute::Position(_) => Absolute::Position([observer.x_m(), observer.y_m()]),
            Absolute::Heading(_) => Absolute::Heading(observer.yaw_rad()),
        }),
    }
}

/// One template of every relative kind.
pub fn relative_templates() -> [Relative; 5] {
    [
        Relative::Pose(Pose2::identity()),
        Relative::Position { x_m: 0.0, y_m: 0.0 },
        Relative::Range { range_m: 0.0 },
        Relative::Bearing { bearing_rad: 0.0 },
        Relative::RangeBearing { range_m: 0.0, bearing_rad: 0.0 },
    ]
}

/// One template of every measurement there is, relative ones towards `robot`.
pub fn templates(robot: RobotId) -> Vec<Quantity> {
    let landmark =
        |relative| Quantity::Landmark { landmark: LandmarkId(1), position_m: [6.0, 5.0], relative };
    let mut all: Vec<Quantity> =
        relative_templates().into_iter().map(|relative| Quantity::Robot { robot, relative }).collect();
    all.extend(relative_templates().into_iter().skip(1).map(landmark));
    all.push(Quantity::Absolute(Absolute::Position([0.0; 2])));
    all.push(Quantity::Absolute(Absolute::Heading(0.0)));
    all.push(Quantity::Absolute(Absolute::Pose(Pose2::identity())));
    all
}

/// Standard deviations of a kind's noise.
pub fn sigmas(quantity: &Quantity) -> Vec<f64> {
    match quantity {
        Quantity::Robot { relative, .. }
        | Quantity::Landmark { relative, .. }
        | Quantity::Feature { relative, .. } => match relative {
            Relative::Pose(_) => vec![0.05, 0.05, 0.03],
            Relative::Position { .. } => vec![0.06, 0.04],
            Relative::Range { .. } => vec![0.05],
            Relative::Bearing { .. } => vec![0.03],
            Relative::RangeBearing { .. } => vec![0.05, 0.03],
        },
        Quantity::Absolute(Absolute::Pose(_)) => vec![0.1, 0.1, 0.05],
        Quantity::Absolute(Absolute::Position(_)) => vec![0.2, 0.2],
        Quantity::Absolute(Absolute::Heading(_)) => vec![0.05],
    }
}

/// A reading with noise added, for a pose in its right frame.
pub fn disturbed(quantity: &Quantity, n: &[f64]) -> Quantity {
    let shaken = |relative: &Relative| match relative {
        Relative::Pose(pose) => Relative::Pose(pose.compose(&Pose2::exp(Vector3::from_column_slice(n)))),
        Relative::Position { x_m, y_m } => Relative::Position { x_m: x_m + n[0], y_m: y_m + n[1] },
        Relative::Range { range_m } => Relative::Range { range_m: range_m + n[0] },
        Relative::Bearing { bearing_rad } => Relative::Bearing { bearing_rad: bearing_rad + n[0] },
        Relative::RangeBearing { range_m, bearing_rad } => {
            Relative::RangeBearing { range_m: range_m + n[0], bearing_rad: bearing_rad + n[1] }
        }
    };
    match quantity {
        Quantity::Robot { robot, relative } => Quantity::Robot { robot: *robot, relative: shaken(relative) },
        Quantity::Feature { landmark, relative } => {
            Quantity::Feature { landmark: *landmark, relative: shaken(relative) }
        }
        Quantity::Landmark { landmark, position_m, relative } => {
            Quantity::Landmark { landmark: *landmark, position_m: *position_m, relative: shaken(relative) }
        }
        Quantity::Absolute(absolute) => Quantity::Absolute(match absolute {
            Absolute::Pose(pose) => Absolute::Pose(pose.compose(&Pose2::exp(Vector3::from_column_slice(n)))),
            Absolute::Position([x, y]) => Absolute::Position([x + n[0], y + n[1]]),
            Absolute::Heading(heading) => Absolute::Heading(heading + n[0]),
        }),
    }
}

/// Logs under construction, one per robot, all in boot 0.
#[derive(Default)]
pub struct Logs {
    pub entries: Vec<Entry>,
    next: BTreeMap<(RobotId, BootIndex), u64>,
}

impl Logs {
    pub fn push(&mut self, robot: RobotId, boot: BootIndex, body: Body) -> EntryId {
        let next = self.next.entry((robot, boot)).or_default();
        let id = EntryId { robot, boot, sequence: Sequence(*next) };
        *next += 1;
        self.entries.push(Entry { id, body, extension: Vec::new() });
        id
    }

    pub fn boot(&mut self, robot: RobotId, boot: &Boot, index: u32) -> EntryId {
        self.push(robot, BootIndex(index), Body::Boot(*boot))
    }

    /// A plain first boot at time 0 with the nominal pose at the origin.
    pub fn first_boot(&mut self, robot: RobotId) -> EntryId {
        let boot = Boot {
            time: Timestamp(0),
            nonce: 1,
            configuration: 0,
            nominal: Pose2::identity(),
            continuation: None,
            calibration: None,
        };
        self.boot(robot, &boot, 0)
    }

    /// An observation with its half, both in boot 0.
    pub fn observation(
        &mut self,
        robot: RobotId,
        time: Timestamp,
        quantity: Quantity,
        noise: NoiseRef,
        observer: NominalState,
        observed: Option<NominalState>,
    ) -> EntryId {
        let id = self.push(
            robot,
            BootIndex(0),
            Body::Observation(Observation { time, quantity, noise, observer }),
        );
        if let (Quantity::Robot { robot: other, .. }, Some(state)) = (quantity, observed) {
            let half = Half { observation: id, answer: Answer::State { boot: BootIndex(0), state } };
            self.push(other, BootIndex(0), Body::Half(half));
        }
        id
    }
}

impl Scenario {
    /// Runs the scenario.
    pub fn run(self) -> Simulated {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut draw = |sigmas: &[f64]| -> Vec<f64> {
            let normal = |sigma: &f64| -> f64 {
                let unit: f64 = StandardNormal.sample(&mut random);
                unit * sigma
            };
            sigmas.iter().map(normal).collect()
        };
        let robots: Vec<RobotId> = (1..=self.robots).map(RobotId).collect();
        let tick_sigmas = [0.05, 0.02, 0.03].map(|sigma: f64| sigma * self.odometry * self.tick_s.sqrt());
        let step_covariance = Noise::from_sigmas(&tick_sigmas);
        let step_covariance = Symmetric3(step_covariance.lower);

        let mut logs = Logs::default();
        let mut truth = BTreeMap::new();
        let mut nominal = BTreeMap::new();
        let mut priors = BTreeMap::new();
        let mut ticks: BTreeMap<RobotId, Vec<Tick>> = BTreeMap::new();
        let mut measurements: Vec<(EntryId, TimedMeasurement)> = Vec::new();
        for (index, robot) in robots.iter().enumerate() {
            let start = Pose2::new(3.0 * index as f64, (index % 2) as f64 * 2.0, 0.4 * index as f64);
            let prior = start.compose(&Pose2::exp(Vector3::from_column_slice(&draw(&self.prior))));
            let noise = Noise::from_sigmas(&self.prior);
            let state = NominalState::new(Pose2::identity(), Symmetric3::zero());
            logs.first_boot(*robot);
            for (index, quantity) in templates(*robot).iter().enumerate() {
                let noise = Noise::from_sigmas(&sigmas(quantity));
                let index = u16::try_from(index).unwrap();
                logs.push(*robot, BootIndex(0), Body::Profile(Profile { index, noise }));
            }
            logs.observation(
                *robot,
                Timestamp(0),
                Quantity::Absolute(Absolute::Pose(prior)),
                NoiseRef::Explicit(noise),
                state,
                None,
            );
            truth.insert(*robot, start);
            nominal.insert(*robot, state);
            priors.insert(*robot, (prior, Symmetric3(noise.lower).to_matrix()));
        }

        for tick in 1..=self.ticks {
            let time = Timestamp::from_seconds(f64::from(tick) * self.tick_s);
            for (index, robot) in robots.iter().enumerate() {
                let rate = 0.35 * (0.2 * time.seconds() + index as f64).sin();
                let increment = Pose2::exp(Vector3::new(0.5, 0.0, rate) * self.tick_s);
                let w = Vector3::from_column_slice(&draw(&tick_sigmas));
                let pose: &mut Pose2 = truth.get_mut(robot).unwrap();
                *pose = pose.compose(&increment).compose(&Pose2::exp(w));
                let state: &mut NominalState = nominal.get_mut(robot).unwrap();
                state.nominal = state.nominal.compose(&increment);
                let ad = adjoint(&state.nominal);
                state.noise_sum = state.noise_sum.plus(step_covariance.congruence(&ad));
                let covariance = step_covariance.to_matrix();
                ticks.entry(*robot).or_default().push(Tick { time, increment, covariance });
            }
            if tick % self.every != 0 {
                continue;
            }
            let turn = (tick / self.every) as usize;
            let observer = robots[turn % robots.len()];
            let other = robots[(turn + 1 + turn / robots.len() % (robots.len() - 1)) % robots.len()];
            let kinds = match self.kinds {
                Kinds::All => templates(other).len(),
                Kinds::RelativeOnly => relative_templates().len(),
            };
            let profile = turn % kinds;
            let template = templates(other)[profile];
            let exact = observe(&template, &truth[&observer], Some(&truth[&other]));
            let quantity = disturbed(&exact, &draw(&sigmas(&template)));
            let reference = NoiseRef::Profile(u16::try_from(profile).unwrap());
            let id = logs.observation(
                observer,
                time,
                quantity,
                reference,
                nominal[&observer],
                Some(nominal[&other]),
            );
            let noise = Noise::from_sigmas(&sigmas(&template));
            measurements.push((id, TimedMeasurement { time, observer, quantity, noise }));
        }
        Simulated { entries: logs.entries, measurements, priors, ticks, truth, nominal }
    }
}

/// The error `truth = exp(xi) estimate`, or the differences of the coordinates.
pub fn additive_error(truth: &Pose2, estimate: &Pose2) -> Vector3 {
    let shift: Vector2 = truth.position() - estimate.position();
    Vector3::new(shift.x, shift.y, super::models::wrapped(truth.yaw_rad() - estimate.yaw_rad()))
}

//! One simulated robot with its hypotheses.

use pleiad_estimation::fact::{Noise, NominalState};
use pleiad_estimation::geometry::{Vector2, Vector3, wrap_angle};
use pleiad_estimation::hypotheses::{
    Belief, KindOfLandmark, KindedMap, Localizer, MappedLandmark, Settings, Sighting, Standing,
};
use pleiad_estimation::motion::DeadReckoning;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::statistics::nees;
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_sim_peers::scenario::{Kidnap, RobotSettings};
use pleiad_sim_peers::{Scenario, SimulatedRun, simulate};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardUniform};

use super::NAME;
use crate::{SurveyError, solo};

/// The only robot.
pub(super) const ROBOT: RobotId = RobotId(1);
/// A pose counts as the right one from this near: five sigmas of a range, and of a bearing with some left for where
/// it was seen from.
const RIGHT_M: f64 = 0.5;
const RIGHT_RAD: f64 = 0.2;
/// From this far it is another place: no two landmarks of the maps are nearer to each other.
const ANOTHER_M: f64 = 2.0;
/// Streams of chance beside those of the world.
const RECOGNITION: u64 = 1;
const DESTINATION: u64 = 2;

/// How recognition errs: it says the right kind with this probability, else any other.
#[derive(Clone, Copy)]
pub(super) struct Recognition {
    pub right: f64,
    pub kinds: usize,
}

impl Recognition {
    /// Says a kind, and how probable it was to say it of each.
    fn say(&self, kind: usize, random: &mut ChaCha12Rng) -> Vec<f64> {
        let draw: f64 = StandardUniform.sample(random);
        let wrong = if self.kinds > 1 { (1.0 - self.right) / (self.kinds - 1) as f64 } else { 0.0 };
        let mut said = kind;
        if draw >= self.right && wrong > 0.0 {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "below the number of kinds"
            )]
            let step = ((draw - self.right) / wrong) as usize;
            said = (kind + 1 + step.min(self.kinds - 2)) % self.kinds;
        }
        (0..self.kinds).map(|of| if of == said { self.right } else { wrong }).collect()
    }
}

/// What stood after a scan.
pub(super) struct Moment {
    pub time_s: f64,
    /// Whether one hypothesis is believed.
    pub one: bool,
    /// Whether the heaviest is where the robot is.
    pub right: bool,
    pub count: usize,
    /// Weight of the heaviest.
    pub heaviest: f64,
    /// Weight of all that are where the robot is, and where the image of the robot under half a turn of the map is.
    pub at_truth: f64,
    pub at_image: f64,
    /// The heaviest.
    pub pose: Pose2,
    pub truth: Pose2,
}

/// A run.
pub(super) struct Run {
    pub moments: Vec<Moment>,
    pub most: usize,
    /// Position error of the heaviest at the end, and its NEES of three degrees.
    pub error_m: f64,
    pub nees: f64,
    /// All hypotheses after the first few scans, for the map.
    pub early: Vec<Vec<Standing>>,
}

/// A world and the nominal trajectory of its robot.
pub(super) struct World {
    pub run: SimulatedRun,
    pub nominal: NominalTrajectory,
    pub noise: Noise,
}

impl World {
    pub(super) fn new(scenario: &Scenario, seed: u64) -> Result<Self, SurveyError> {
        let run = simulate(scenario, seed)
            .map_err(|source| SurveyError::Scenario { study: NAME, source: Box::new(source) })?;
        let settings = settings(scenario, seed)?;
        let diverged = |what: String| SurveyError::Diverged { study: NAME, seed, what };
        let samples = run.recording.robots.get(&ROBOT).map(|own| own.odometry.as_slice()).unwrap_or_default();
        let first = samples.first().ok_or_else(|| diverged("no odometry".into()))?.time;
        let mut reckoning = DeadReckoning::new(solo::motion(settings));
        let mut nominal = NominalTrajectory::new(first, Pose2::identity(), samples.len() + 2);
        for sample in samples {
            if let Some(step) = reckoning.odometry(*sample).map_err(|error| diverged(error.to_string()))? {
                nominal.extend(&step);
            }
        }
        let relative = &settings.relative;
        let noise = Noise::from_sigmas(&[relative.sigma_range_m, relative.sigma_bearing_rad]);
        Ok(Self { run, nominal, noise })
    }

    /// Landmark sightings with the nominal state at their time.
    pub(super) fn sightings(
        &self,
    ) -> impl Iterator<Item = (Timestamp, NominalState, LandmarkId, Relative)> + '_ {
        let all = self.run.recording.robots.get(&ROBOT).into_iter().flat_map(|own| &own.sightings);
        all.filter_map(|sample| match sample.reading {
            Reading::Sighting { target: Target::Landmark(landmark), relative } => {
                Some((sample.time, self.nominal.at(sample.time).ok()?, landmark, relative))
            }
            _ => None,
        })
    }

    pub(super) fn truth(&self, time: Timestamp) -> Pose2 {
        self.run.tracks.get(&ROBOT).map_or(Pose2::identity(), |track| track.pose_at(time))
    }
}

fn settings(scenario: &Scenario, seed: u64) -> Result<&RobotSettings, SurveyError> {
    let missing = || SurveyError::Diverged { study: NAME, seed, what: "the scenario has no robot 1".into() };
    scenario.robots.get(&ROBOT).ok_or_else(missing)
}

/// The map as it is known.
pub(super) fn map_of(scenario: &Scenario) -> KindedMap {
    let landmark = |(id, [x, y]): (&LandmarkId, &[f64; 2])| MappedLandmark {
        id: *id,
        kind: KindOfLandmark(scenario.landmark_kinds.get(id).map_or(0, |kind| *kind as usize)),
        position_m: Vector2::new(*x, *y),
    };
    KindedMap {
        landmarks: scenario.landmarks.iter().map(landmark).collect(),
        bounds_m: scenario.arena.bounds_m(),
    }
}

/// The scenario with its kidnapping drawn anew: anywhere in the map, with any heading.
pub(super) fn carried_off(scenario: &Scenario, seed: u64) -> Scenario {
    let mut scenario = scenario.clone();
    let mut random = stream(seed, DESTINATION);
    let mut between = |low: f64, high: f64| low + (high - low) * uniform(&mut random);
    let [left, right, bottom, top] = scenario.arena.bounds_m();
    for kidnap in scenario.robots.values_mut().flat_map(|own| &mut own.kidnap) {
        *kidnap = Kidnap {
            time_s: kidnap.time_s,
            x_m: between(left + 1.0, right - 1.0),
            y_m: between(bottom + 1.0, top - 1.0),
            heading_rad: between(-std::f64::consts::PI, std::f64::consts::PI),
        };
    }
    scenario
}

/// The scenario without its kidnapping.
pub(super) fn left_alone(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    scenario.robots.values_mut().for_each(|own| own.kidnap.clear());
    scenario
}

fn stream(seed: u64, purpose: u64) -> ChaCha12Rng {
    let mut random = ChaCha12Rng::seed_from_u64(seed);
    random.set_stream(purpose);
    random
}

fn uniform(random: &mut ChaCha12Rng) -> f64 {
    StandardUniform.sample(random)
}

/// Runs a localizer that may be anywhere through the sightings of a world.
pub(super) fn localize(
    scenario: &Scenario,
    seed: u64,
    recognition: Recognition,
    settings: Settings,
    keep: usize,
) -> Result<Run, SurveyError> {
    let diverged = |what: String| SurveyError::Diverged { study: NAME, seed, what };
    let world = World::new(scenario, seed)?;
    let map = map_of(scenario);
    let mut localizer = Localizer::anywhere(map, settings);
    let mut random = stream(seed, RECOGNITION);
    let mut run = Run { moments: Vec::new(), most: 0, error_m: f64::NAN, nees: f64::NAN, early: Vec::new() };
    let mut sightings = world.sightings().peekable();
    while let Some((time, observer, landmark, relative)) = sightings.next() {
        let kind = scenario.landmark_kinds.get(&landmark).map_or(0, |kind| *kind as usize);
        let said = recognition.say(kind, &mut random);
        let sighting = Sighting { time, observer, relative, noise: world.noise, recognition: &said };
        localizer.sighted(&sighting).map_err(|error| diverged(error.to_string()))?;
        // A moment is what stands once a scan is over.
        if sightings.peek().is_some_and(|(next, ..)| *next == time) {
            continue;
        }
        let standings = localizer.standings(&observer);
        let truth = world.truth(time);
        if let Some(moment) = moment(time, &standings, &localizer.belief(&observer), &truth) {
            run.moments.push(moment);
        }
        if run.early.len() < keep {
            run.early.push(standings);
        }
    }
    run.most = localizer.most_so_far();
    let (end, state) = world.nominal.end();
    if let Some(heaviest) = localizer.standings(&state).first() {
        let truth = world.truth(end);
        let offset = truth.position() - heaviest.pose.position();
        let turn = wrap_angle(truth.yaw_rad() - heaviest.pose.yaw_rad());
        run.error_m = offset.norm();
        let error = Vector3::new(offset.x, offset.y, turn);
        let covariance = heaviest.covariance.to_matrix();
        let dynamic = nalgebra::DMatrix::from_column_slice(3, 3, covariance.as_slice());
        run.nees =
            nees(&nalgebra::DVector::from_column_slice(error.as_slice()), &dynamic).unwrap_or(f64::NAN);
    }
    Ok(run)
}

fn moment(time: Timestamp, standings: &[Standing], belief: &Belief, truth: &Pose2) -> Option<Moment> {
    let heaviest = standings.first()?;
    let image = Pose2::new(0.0, 0.0, std::f64::consts::PI).compose(truth);
    let weight_at = |pose: &Pose2| {
        standings.iter().filter(|standing| near(&standing.pose, pose)).map(|standing| standing.weight).sum()
    };
    Some(Moment {
        time_s: time.seconds(),
        one: matches!(belief, Belief::One(_)),
        right: near(&heaviest.pose, truth),
        count: standings.len(),
        heaviest: heaviest.weight,
        at_truth: weight_at(truth),
        at_image: weight_at(&image),
        pose: heaviest.pose,
        truth: *truth,
    })
}

fn near(pose: &Pose2, truth: &Pose2) -> bool {
    (pose.position() - truth.position()).norm() < RIGHT_M
        && wrap_angle(pose.yaw_rad() - truth.yaw_rad()).abs() < RIGHT_RAD
}

impl Run {
    /// When one hypothesis, the right one, was believed within a stretch of time and then until its end.
    pub(super) fn settled_s(&self, from_s: f64, until_s: f64) -> Option<f64> {
        self.beginning(from_s, until_s, |moment| moment.one && moment.right)
    }

    /// When any hypothesis was believed within a stretch of time and then some one until its end.
    pub(super) fn decided_s(&self, from_s: f64, until_s: f64) -> Option<f64> {
        self.beginning(from_s, until_s, |moment| moment.one)
    }

    fn beginning(&self, from_s: f64, until_s: f64, holds: impl Fn(&Moment) -> bool) -> Option<f64> {
        let within = self.moments.iter().filter(|moment| (from_s..until_s).contains(&moment.time_s));
        let mut since = None;
        for moment in within {
            since = if holds(moment) { since.or(Some(moment.time_s)) } else { None };
        }
        since
    }

    /// Whether another place was believed after the right one had been.
    pub(super) fn strayed(&self) -> bool {
        self.farthest_believed_m() > ANOTHER_M
    }

    /// Largest distance from the truth of any place that was believed after the right one had been, metres.
    pub(super) fn farthest_believed_m(&self) -> f64 {
        let after = self.moments.iter().skip_while(|moment| !(moment.one && moment.right));
        let off = after
            .filter(|moment| moment.one)
            .map(|moment| (moment.pose.position() - moment.truth.position()).norm());
        off.fold(0.0, f64::max)
    }

    /// Whether another place was ever believed.
    pub(super) fn ever_wrong(&self) -> bool {
        let off = |moment: &Moment| (moment.pose.position() - moment.truth.position()).norm();
        self.moments.iter().any(|moment| moment.one && off(moment) > ANOTHER_M)
    }
}

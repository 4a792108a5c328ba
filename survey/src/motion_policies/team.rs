//! One team under one rule of motion, through one filter.

use std::collections::BTreeMap;

use pleiad_estimation::sample::{Reading, Sample, Target};
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_sim_peers::scenario::Policy;
use pleiad_sim_peers::strategies::{StrategyOptions, run};
use pleiad_sim_peers::world::Track;
use pleiad_sim_peers::{Scenario, SimulatedRun, agents, simulate};

use super::NAME;
use crate::SurveyError;

/// Path lengths are sums over steps of this length, seconds.
const STEP_S: f64 = 0.2;
/// A robot slower than this over half a second stands, m/s.
const STANDING_M_S: f64 = 0.02;

/// A rule of motion with the filter it goes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Case {
    Independent,
    AllMoving,
    Portable,
    OneMover,
    Watched,
}

impl Case {
    pub(super) const ALL: [Self; 5] =
        [Self::Independent, Self::AllMoving, Self::Portable, Self::OneMover, Self::Watched];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Independent => "all move, no exchange",
            Self::AllMoving => "all move, joint filter",
            Self::Portable => "portable landmarks",
            Self::OneMover => "one mover, triangle of beacons",
            Self::Watched => "two watched by two that are parked",
        }
    }

    /// Name in the numbers.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::AllMoving => "all_moving",
            Self::Portable => "portable_landmarks",
            Self::OneMover => "one_mover",
            Self::Watched => "watched",
        }
    }

    fn strategy(self) -> StrategyKind {
        if self == Self::Independent { StrategyKind::Independent } else { StrategyKind::Exact }
    }

    /// How many standing robots a moving one must be in sight of, as its system has it: both that stand with
    /// portable landmarks, the triangle, the one camera. None where the filter asks for nothing.
    pub(super) fn needs(self) -> Option<usize> {
        match self {
            Self::Independent | Self::AllMoving => None,
            Self::Portable => Some(2),
            Self::OneMover => Some(3),
            Self::Watched => Some(1),
        }
    }

    /// The scenario under this rule.
    pub(super) fn scenario(self, base: &Scenario) -> Scenario {
        let mut scenario = base.clone();
        for (robot, own) in &mut scenario.robots {
            match self {
                Self::Independent | Self::AllMoving => own.motion.policy = Policy::WaypointsRandom,
                Self::Portable => own.motion.policy = Policy::PortableLandmarks,
                Self::OneMover => own.motion.policy = Policy::OneMover,
                // The first half stands and looks; the other half moves, and sees nobody.
                Self::Watched if robot.0 <= 2 => own.motion.policy = Policy::Parked,
                Self::Watched => {
                    own.motion.policy = Policy::WaypointsRandom;
                    own.relative.rate_hz = 0.0;
                }
            }
        }
        scenario
    }
}

/// At one look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    pub t_s: f64,
    /// Path length of the whole team so far.
    pub distance_m: f64,
    /// Mean square of the position errors of the robots that move in the run.
    pub square_m2: f64,
}

/// How a run went.
pub(super) struct Run {
    pub looks: Vec<Look>,
    /// Of the time in which robots move, the share with the sight that the rule needs.
    pub in_sight: Option<f64>,
    /// Of all time of all robots, the share in which a robot is in sight of none.
    pub alone: f64,
    /// By sight alone a robot knows where it was last seen: root mean square of how far the moving ones are from
    /// there when the sight comes back, metres.
    pub off_by_sight_m: Option<f64>,
}

/// Runs a case; sight is blocked within the window, seconds.
pub(super) fn play(
    base: &Scenario,
    case: Case,
    seed: u64,
    blocked_s: Option<[f64; 2]>,
) -> Result<Run, SurveyError> {
    let scenario = case.scenario(base);
    let world = simulate(&scenario, seed).map_err(|error| failed(error.into()))?;
    let nodes = agents::nodes(&scenario, &world, case.strategy()).map_err(|error| failed(error.into()))?;
    let blind = |sample: &Sample| {
        let robot_seen = matches!(sample.reading, Reading::Sighting { target: Target::Robot(_), .. });
        robot_seen && blocked_s.is_some_and(|[from, until]| (from..until).contains(&sample.time.seconds()))
    };
    let samples: BTreeMap<RobotId, Vec<Sample>> = world
        .recording
        .robots
        .iter()
        .map(|(robot, own)| (*robot, own.samples().into_iter().filter(|sample| !blind(sample)).collect()))
        .collect();
    let options = StrategyOptions { seed, ..StrategyOptions::new(case.strategy()) };
    let outcome = run(&nodes, &samples, &options).map_err(|error| failed(error.into()))?;

    let moves =
        |robot: &RobotId| scenario.robots.get(robot).is_some_and(|own| own.motion.policy != Policy::Parked);
    let first = samples.values().flatten().map(|sample| sample.time).min();
    let origin_s = first.map_or(0.0, Timestamp::seconds);
    let mut distance = Distance::new(&world.tracks);
    let mut looks = Vec::new();
    for snapshot in &outcome.snapshots {
        let t_s = origin_s + snapshot.t_s;
        let squares: Vec<f64> = snapshot
            .views
            .iter()
            .filter(|(robot, _)| moves(robot))
            .filter_map(|(robot, (time, view))| {
                let truth = world.tracks.get(robot)?.pose_at(*time);
                Some((truth.position() - view.pose.position()).norm_squared())
            })
            .collect();
        let square_m2 = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        looks.push(Look { t_s, distance_m: distance.until(t_s), square_m2 });
    }
    let reach_m = scenario.robots.values().map(|own| own.relative.max_range_m).fold(0.0, f64::max);
    let (in_sight, alone) = sight(&world, case, reach_m, scenario.duration_s);
    let off_by_sight_m = blocked_s.and_then(|window| off_by_sight(&world, window));
    Ok(Run { looks, in_sight, alone, off_by_sight_m })
}

fn failed(source: Box<dyn std::error::Error + Send + Sync>) -> SurveyError {
    SurveyError::Scenario { study: NAME, source }
}

/// Path length of all tracks, step by step.
struct Distance<'a> {
    tracks: &'a BTreeMap<RobotId, Track>,
    reached_s: f64,
    sum_m: f64,
}

impl<'a> Distance<'a> {
    fn new(tracks: &'a BTreeMap<RobotId, Track>) -> Self {
        Self { tracks, reached_s: 0.0, sum_m: 0.0 }
    }

    fn until(&mut self, t_s: f64) -> f64 {
        while self.reached_s + STEP_S <= t_s {
            let (from, to) = (self.reached_s, self.reached_s + STEP_S);
            for track in self.tracks.values() {
                let [before, after] =
                    [from, to].map(|t_s| track.pose_at(Timestamp::from_seconds(t_s)).position());
                self.sum_m += (after - before).norm();
            }
            self.reached_s = to;
        }
        self.sum_m
    }
}

fn standing(track: &Track, t_s: f64) -> bool {
    let [before, after] = [t_s - 0.25, t_s + 0.25].map(|t_s| track.pose_at(Timestamp::from_seconds(t_s)));
    let turned = pleiad_estimation::geometry::wrap_angle(after.yaw_rad() - before.yaw_rad()).abs();
    (after.position() - before.position()).norm() + turned < 0.5 * STANDING_M_S
}

/// Shares of time in which moving robots have the sight they need, and in which a robot sees nobody.
fn sight(world: &SimulatedRun, case: Case, reach_m: f64, duration_s: f64) -> (Option<f64>, f64) {
    let (mut moving, mut seen, mut all, mut alone) = (0_u32, 0_u32, 0_u32, 0_u32);
    let mut t_s = 1.0;
    while t_s < duration_s - 1.0 {
        let at = Timestamp::from_seconds(t_s);
        let robots: Vec<_> = world
            .tracks
            .iter()
            .map(|(robot, track)| (robot, track.pose_at(at).position(), standing(track, t_s)))
            .collect();
        for (robot, place, stands) in &robots {
            let near =
                robots.iter().filter(|(other, there, _)| other != robot && (place - there).norm() <= reach_m);
            let (beacons, others) = near
                .fold((0, 0), |(beacons, others), (.., stands)| (beacons + usize::from(*stands), others + 1));
            all += 1;
            alone += u32::from(others == 0);
            if !stands {
                moving += 1;
                seen += u32::from(case.needs().is_some_and(|needs| beacons >= needs));
            }
        }
        t_s += 1.0;
    }
    let share = |part: u32, of: u32| f64::from(part) / f64::from(of.max(1));
    (case.needs().map(|_| share(seen, moving)), share(alone, all))
}

/// How far robots get while nobody sees them.
fn off_by_sight(world: &SimulatedRun, [from_s, until_s]: [f64; 2]) -> Option<f64> {
    let mut squares = Vec::new();
    for track in world.tracks.values() {
        let [before, after] = [from_s, until_s].map(|t_s| track.pose_at(Timestamp::from_seconds(t_s)));
        let moved = (after.position() - before.position()).norm();
        if moved > STANDING_M_S {
            squares.push(moved * moved);
        }
    }
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

impl Run {
    /// When the team had driven so far in all.
    pub(super) fn time_to_s(&self, distance_m: f64) -> Option<f64> {
        self.looks.iter().find(|look| look.distance_m >= distance_m).map(|look| look.t_s)
    }

    /// Team distance per time over the whole run, m/s.
    pub(super) fn pace_m_s(&self) -> f64 {
        self.looks.last().map_or(f64::NAN, |last| last.distance_m / last.t_s)
    }

    /// Root mean square of the errors at the looks that pass.
    pub(super) fn rmse_m(&self, passes: impl Fn(&Look) -> bool) -> Option<f64> {
        let squares: Vec<f64> =
            self.looks.iter().filter(|look| passes(look)).map(|look| look.square_m2).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

//! The simulated world: true motion first, then every sensor of every robot, sampled from it.
//!
//! A command goes through the signal chain of `physics`: servo, wheels, body, with the effects that act on
//! the robot. Besides, the body departs from what its wheels do by the noise of the odometry: over a tick in
//! which they say `U = exp((v dt, 0, w dt))` it moves by `U exp(n)`, `n ~ N(0, Q dt)` white from tick to
//! tick and independent of everything else; odometry reports `U` without error. So a filter that integrates
//! the reports and adds `Ad_N Q dt Ad_N^T` (N after the step) has the law of this world, but for changes of
//! speed within a tick (`docs/scenario.md`); slip that lasts is none of its law. Within a tick `n` grows as a Brownian motion, whose variance is
//! the linear `C(t)` such a filter interpolates.

mod connectivity;
mod drive;
mod model;
mod nominal;
mod placement;
mod policy;
mod random;
mod scan;
mod sensors;
mod sighting;
mod slip;
mod steering;
mod track;
mod vehicle;

use std::collections::BTreeMap;

use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_physics::ActiveEffect;
use pleiad_recording::{Recording, RobotRecording};

pub use connectivity::{Disconnection, connectivity};
pub(crate) use nominal::true_nominal;
pub use track::Track;

use crate::{Error, Scenario};
use random::{Channel, Seed, normal};

/// No observation is stamped earlier, seconds: the slowest odometry allowed has begun by then, on
/// whichever robot is seen.
pub const OBSERVATIONS_FROM_S: f64 = 0.25;

/// A simulated run.
#[derive(Clone, Debug)]
pub struct SimulatedRun {
    /// The seed it came from.
    pub seed: u64,
    /// What the robots recorded, with truth, landmarks, nominal and commands.
    pub recording: Recording,
    /// What each robot is told of its start, at time 0; robots that are told nothing are absent.
    pub priors: BTreeMap<RobotId, Prior>,
    /// Where each robot truly was, at any time.
    pub tracks: BTreeMap<RobotId, Track>,
    /// What acted on each robot besides; no recording says it.
    pub injected: BTreeMap<RobotId, Vec<ActiveEffect<f64>>>,
}

/// What a robot is told of its start: `pose = truth exp(n)` with independent components of `n`, the
/// noise in the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// The pose told, `map_from_robot`.
    pub pose: Pose2,
    /// Standard deviation of its position per axis, metres.
    pub sigma_position_m: f64,
    /// Standard deviation of its heading, radians.
    pub sigma_heading_rad: f64,
}

/// Simulates a scenario from a seed. The same scenario and seed give the same run, bit for bit.
///
/// Stamps are team time from 0. Every robot stands still until its first odometry, which comes before
/// [`OBSERVATIONS_FROM_S`]; observations end at the scenario's duration, odometry at its first tick from
/// there on, so that every observation lies within the odometry of everyone involved.
///
/// # Errors
/// [`Error::Value`] if the scenario is not valid, [`Error::Placement`] if a robot finds no start.
///
/// # Example
/// ```
/// use pleiad_sim_peers::{Scenario, simulate};
///
/// let text = "name = \"pair\"\nduration_s = 5.0\nteam_size = 2\n[defaults.relative]\nrate_hz = 2.0\n";
/// let scenario = Scenario::from_toml(text, "pair.toml")?;
/// let run = simulate(&scenario, 7)?;
/// assert_eq!(run.recording.robots.len(), 2);
/// # Ok::<(), pleiad_sim_peers::Error>(())
/// ```
pub fn simulate(scenario: &Scenario, seed: u64) -> Result<SimulatedRun, Error> {
    scenario.validate()?;
    let source = Seed(seed);
    let starts = placement::starts(scenario, source)?;
    let landmarks = placement::landmarks(scenario, source);
    let drives = drive::drive(scenario, &starts, source);
    let tracks: BTreeMap<_, _> = drives.iter().map(|(robot, drive)| (*robot, drive.track.clone())).collect();

    let until = Timestamp::from_seconds(scenario.duration_s);
    let mut robots = BTreeMap::new();
    for (robot, drive) in &drives {
        let channels = sensors::Channels::new(source, *robot, &scenario.robots[robot], drive, until);
        let mut recorded = RobotRecording {
            odometry: channels.odometry(),
            gyro: channels.gyro(),
            gps: channels.gps(),
            heading: channels.heading(),
            sightings: sighting::sightings(&channels, &tracks, &landmarks),
            steer: channels.steer(),
            scans: scan::scans(&channels, &scenario.walls_m),
            truth: channels.truth(scenario.truth_rate_hz, scenario.truth_sigma_m, scenario.truth_sigma_rad),
            commands: channels.commands(),
        };
        sort(&mut recorded);
        robots.insert(*robot, recorded);
    }
    let recording = Recording {
        name: scenario.name.clone(),
        landmarks,
        walls: scenario.walls_m.clone(),
        nominal: Some(nominal::nominal(scenario)),
        robots,
    };
    let injected = scenario.robots.iter().map(|(robot, own)| (*robot, own.effects.clone())).collect();
    Ok(SimulatedRun { seed, recording, priors: priors(scenario, &starts, source), tracks, injected })
}

/// Brings every channel into the order of its stamps, which a clock that is set back loses.
fn sort(recorded: &mut RobotRecording) {
    let RobotRecording { commands, odometry, gyro, gps, heading, sightings, steer, scans, truth: _ } =
        recorded;
    commands.sort_by_key(|command| command.time);
    steer.sort_by_key(|steer| steer.time);
    scans.sort_by_key(|beam| beam.time);
    for channel in [odometry, gyro, gps, heading, sightings] {
        channel.sort_by_key(|sample| sample.time);
    }
}

fn priors(scenario: &Scenario, starts: &BTreeMap<RobotId, Pose2>, seed: Seed) -> BTreeMap<RobotId, Prior> {
    let mut priors = BTreeMap::new();
    for (robot, start) in starts {
        let settings = scenario.robots[robot].prior;
        if !settings.known {
            continue;
        }
        let mut stream = seed.stream(*robot, Channel::Prior);
        let error = Vector3::new(
            settings.sigma_position_m * normal(&mut stream),
            settings.sigma_position_m * normal(&mut stream),
            settings.sigma_heading_rad * normal(&mut stream),
        );
        let prior = Prior {
            pose: start.compose(&Pose2::exp(error)),
            sigma_position_m: settings.sigma_position_m,
            sigma_heading_rad: settings.sigma_heading_rad,
        };
        priors.insert(*robot, prior);
    }
    priors
}

/// The map of a run.
type Landmarks = BTreeMap<LandmarkId, [f64; 2]>;

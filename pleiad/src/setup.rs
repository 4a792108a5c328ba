//! From a scenario or a recording to the configurations of a team's agents and the samples they get.

mod beside;
mod input;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use pleiad_agent::config::{
    AgentConfig, AngleNoise, BusSection, CalibrationSection, ClockSection, FilterSection, LandmarkRow,
    LedgerSection, LengthNoise, MotionSection, OutputSection, PriorSection, RangeBearingNoise,
    RobotCorrection, SensorsSection, UnknownLandmarks,
};
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_physics::Drive;
use pleiad_recording::{Recording, RobotRecording};
use pleiad_sim_peers::agents;
use pleiad_sim_peers::scenario::RobotSettings;
use pleiad_sim_peers::{Scenario, SimulatedRun};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

pub use beside::{MODEL, beside_texts, copy_model, texts_beside, write_beside};
use beside::{model_for, priors_beside};
pub use input::{Input, is_recording, open};

use crate::cli::{AbsoluteArg, FilterArgs, LandmarksArg};

/// Truth is interpolated across holes up to this long.
pub const TRUTH_GAP_S: f64 = 0.3;
/// What a robot is told of its start when a recording with ground truth is replayed.
const START_SIGMA_M: f64 = 0.02;
const START_SIGMA_RAD: f64 = 0.02;

const MRCLAM_NOISE: &str = include_str!("../noise/mrclam.toml");

/// The part of an agent's configuration that describes the robot rather than the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseFile {
    /// As in an agent's configuration.
    pub filter: FilterSection,
    /// As in an agent's configuration.
    pub motion: MotionSection,
    /// As in an agent's configuration.
    pub sensors: SensorsSection,
    /// As in an agent's configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationSection>,
}

/// The recording in a run folder, or the folder itself.
pub fn recording_folder(folder: &Path) -> PathBuf {
    let within = folder.join("recording");
    if within.is_dir() { within } else { folder.to_owned() }
}

/// A team ready to run.
pub struct Team {
    /// Configuration per robot, without network and disk.
    pub agents: BTreeMap<RobotId, AgentConfig>,
    /// What each robot is fed.
    pub samples: BTreeMap<RobotId, Vec<Sample>>,
    /// What the run is judged by, and where its data came from.
    pub recording: Recording,
    /// Remarks, for people.
    pub notes: Vec<String>,
}

impl Team {
    /// The strategy that all its agents are to follow.
    pub fn strategy(&self) -> anyhow::Result<StrategyKind> {
        Ok(self.agents.values().next().context("the team has no robot")?.strategy)
    }

    /// First and last sample.
    pub fn span(&self) -> Option<(Timestamp, Timestamp)> {
        let times = self.samples.values().flatten().map(|sample| sample.time);
        times.clone().min().zip(times.max())
    }
}

fn configuration(
    robot: RobotId,
    noise: &NoiseFile,
    filter: &FilterArgs,
    landmarks: &[LandmarkRow],
) -> AgentConfig {
    AgentConfig {
        team: "pleiad".to_owned(),
        robot: robot.0,
        strategy: filter.strategy,
        filter: filter.apply(&noise.filter),
        model: None,
        prior: None,
        motion: noise.motion.clone(),
        sensors: noise.sensors.clone(),
        calibration: filter.calibrate.map(|given| given.0).or(noise.calibration),
        clock: ClockSection::default(),
        landmarks: landmarks.to_vec(),
        bus: BusSection::default(),
        ledger: LedgerSection::default(),
        output: OutputSection::default(),
        faults: None,
    }
}

/// Where clocks are asked for, that of the first robot is the team's: only differences can be told from one another.
fn keep_time<'a>(robot: RobotId, agent: &mut AgentConfig, mut team: impl Iterator<Item = &'a RobotId>) {
    if let Some(calibration) = &mut agent.calibration
        && team.next() == Some(&robot)
    {
        calibration.sigma_clock_offset_s = 0.0;
        calibration.sigma_clock_drift_ppm = 0.0;
    }
}

fn map(recording: &Recording) -> Vec<LandmarkRow> {
    let rows = recording.landmarks.iter();
    rows.map(|(id, [x_m, y_m])| LandmarkRow { id: id.0, x_m: *x_m, y_m: *y_m }).collect()
}

/// A simulated team, told what the scenario tells it.
pub fn simulated(scenario: &Scenario, run: SimulatedRun, filter: &FilterArgs) -> Team {
    let landmarks = map(&run.recording);
    let mut configured = BTreeMap::new();
    for (robot, settings) in &scenario.robots {
        let mut agent = configuration(*robot, &noise_of(settings), filter, &landmarks);
        keep_time(*robot, &mut agent, scenario.robots.keys());
        agent.prior = run.priors.get(robot).filter(|_| filter.tells(*robot)).map(agents::prior);
        configured.insert(*robot, agent);
    }
    let samples = run.recording.robots.iter().map(|(robot, channels)| (*robot, channels.samples())).collect();
    Team { agents: configured, samples, recording: run.recording, notes: Vec::new() }
}

/// What a simulated robot's agent has to know: the noises the world was made with.
pub fn noise_of(settings: &RobotSettings) -> NoiseFile {
    let (motion, sensors) = (agents::motion(settings), agents::sensors(settings));
    NoiseFile { motion, sensors, ..NoiseFile::default() }
}

/// How a recording is to be replayed.
pub struct ReplayOptions<'a> {
    pub filter: FilterArgs,
    pub landmarks: &'a LandmarksArg,
    pub absolute: &'a [AbsoluteArg],
    pub start_s: f64,
    pub seconds: Option<f64>,
    pub seed: u64,
    pub noise: Option<&'a Path>,
    /// A model of the robots.
    pub model: Option<&'a Path>,
    /// The folder the recording came from, which may hold a `noise.toml` and a `model.toml`.
    pub folder: &'a Path,
    pub mrclam: bool,
}

/// A recorded team, started as it was told if the recording says how and is replayed from its beginning,
/// else where the ground truth says.
pub fn recorded(recording: &Recording, options: &ReplayOptions) -> anyhow::Result<Team> {
    if !(options.start_s.is_finite() && options.start_s >= 0.0) {
        bail!("--start {}: expected zero or a positive number of seconds", options.start_s);
    }
    let told = if options.start_s > 0.0 { None } else { priors_beside(options.folder)? };
    let (first, last) = if told.is_some() {
        let times = || recording.robots.values().flat_map(RobotRecording::samples).map(|sample| sample.time);
        times().min().zip(times().max()).context("there is not a single sample in the recording")?
    } else {
        recording.common_time().context(
            "the robots' odometry and ground truth have no time in common; a replay starts from ground truth",
        )?
    };
    let start = first.plus_seconds(options.start_s);
    let end = match options.seconds {
        Some(seconds) if seconds.is_finite() && seconds > 0.0 => start.plus_seconds(seconds).min(last),
        Some(seconds) => bail!("--seconds {seconds}: expected a positive number"),
        None => last,
    };
    if start >= end {
        let length = last.seconds_since(first);
        bail!("--start {}: the robots' common time is only {length:.1} s long", options.start_s);
    }
    let mut recording = recording.slice(start, end);
    recording = match options.landmarks {
        LandmarksArg::Known | LandmarksArg::Team => recording,
        LandmarksArg::None => recording.with_landmarks(&BTreeSet::new()),
        LandmarksArg::Only(ids) => {
            if let Some(unknown) = ids.iter().find(|id| !recording.landmarks.contains_key(id)) {
                let known: Vec<_> = recording.landmarks.keys().map(ToString::to_string).collect();
                bail!("--landmarks: {unknown} is not in the map, which has {}", known.join(", "));
            }
            recording.with_landmarks(&ids.iter().copied().collect())
        }
    };
    let mut notes = Vec::new();
    let model = model_for(options.model, options.folder)?;
    add_fixes(&mut recording, options, (start, end))?;
    let unknown = *options.landmarks == LandmarksArg::Team;
    let landmarks = if unknown { Vec::new() } else { map(&recording) };
    let mut agents = BTreeMap::new();
    let mut samples = BTreeMap::new();
    for (robot, channels) in &recording.robots {
        let noise = noise_for(*robot, &recording, options)?;
        let mut agent = configuration(*robot, &noise, &options.filter, &landmarks);
        keep_time(*robot, &mut agent, recording.robots.keys());
        agent.model.clone_from(&model);
        if unknown {
            agent.sensors.unknown_landmarks = UnknownLandmarks::Map;
        }
        let correction = agent.correction()?;
        for remark in correction.iter().flat_map(|correction| &correction.remarks) {
            // Much the same for every robot of a team.
            let note = format!("model: {remark}");
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        let mut fed = channels.samples();
        if let Some(told) = &told {
            agent.prior = told.get(robot).cloned();
        } else if let Some((time, prior)) = prior(channels, correction.as_ref()) {
            let before = fed.len();
            fed.retain(|sample| sample.time >= time);
            if fed.len() < before {
                let count = before - fed.len();
                notes.push(format!(
                    "robot {robot}: {count} samples before the first with ground truth left out"
                ));
            }
            agent.prior = Some(prior);
        } else {
            notes.push(format!("robot {robot}: no ground truth at any odometry, so no place in the map"));
        }
        if !options.filter.tells(*robot) {
            agent.prior = None;
        }
        for fix in options.absolute.iter().filter(|fix| fix.robot == *robot) {
            agent.sensors.gps = Some(LengthNoise { sigma_m: fix.sigma_m });
        }
        agents.insert(*robot, agent);
        samples.insert(*robot, fed);
    }
    Ok(Team { agents, samples, recording, notes })
}

/// The true pose at the first odometry that has one, with its stamp.
fn prior(
    channels: &RobotRecording,
    correction: Option<&RobotCorrection>,
) -> Option<(Timestamp, PriorSection)> {
    channels.odometry.iter().find_map(|sample| {
        // The robot's clock may be known to be ahead of that of the truth.
        let ahead_s = correction.map_or(0.0, |own| own.correction.clock_error_s(sample.time.seconds()));
        let pose = channels.truth_at(sample.time.plus_seconds(-ahead_s), TRUTH_GAP_S)?;
        let prior = PriorSection {
            x_m: pose.x_m(),
            y_m: pose.y_m(),
            heading_rad: pose.yaw_rad(),
            sigma_position_m: START_SIGMA_M,
            sigma_heading_rad: START_SIGMA_RAD,
            for_boot: 0,
        };
        Some((sample.time, prior))
    })
}

/// Position fixes from ground truth and seeded noise; they replace what the robot recorded.
fn add_fixes(
    recording: &mut Recording,
    options: &ReplayOptions,
    (start, end): (Timestamp, Timestamp),
) -> anyhow::Result<()> {
    for fix in options.absolute {
        let Some(channels) = recording.robots.get_mut(&fix.robot) else {
            bail!("--absolute: the recording has no robot {}", fix.robot);
        };
        let mut random = rand_chacha::ChaCha12Rng::seed_from_u64(options.seed);
        random.set_stream(u64::from(fix.robot.0));
        let mut fixes = Vec::new();
        for count in 1.. {
            let time = start.plus_seconds(f64::from(count) / fix.rate_hz);
            if time > end {
                break;
            }
            let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
            if let Some(pose) = channels.truth_at(time, TRUTH_GAP_S) {
                let reading =
                    Reading::Gps { x_m: pose.x_m() + fix.sigma_m * dx, y_m: pose.y_m() + fix.sigma_m * dy };
                fixes.push(Sample { time, reading });
            }
        }
        channels.gps = fixes;
    }
    Ok(())
}

fn noise_for(robot: RobotId, recording: &Recording, options: &ReplayOptions) -> anyhow::Result<NoiseFile> {
    let beside = options.folder.join("noise.toml");
    let own = options.folder.join(format!("noise-r{robot}.toml"));
    let path = match options.noise {
        Some(path) => Some(path),
        None if own.is_file() => Some(own.as_path()),
        None if beside.is_file() => Some(beside.as_path()),
        None => None,
    };
    if let Some(path) = path {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        return toml::from_str(&text).with_context(|| format!("{}", path.display()));
    }
    if options.mrclam {
        return toml::from_str(MRCLAM_NOISE).context("the built-in noise of MRCLAM");
    }
    let Some(nominal) = &recording.nominal else {
        bail!(
            "the recording says nothing about its noise: write noise.toml into it with the sections [motion] \
             and [sensors] of docs/agent.md, or name such a file with --noise"
        );
    };
    let noise = &nominal.noise;
    let (wheel_radius_m, track_width_m) = match nominal.robots.get(&robot) {
        Some(own) => (Some(own.wheel_radius), Some(own.track_width * track_ratio(own.drive))),
        None => (None, None),
    };
    let positive = |sigma_m: f64| (sigma_m > 0.0).then_some(LengthNoise { sigma_m });
    Ok(NoiseFile {
        motion: MotionSection {
            wheel_radius_m,
            track_width_m,
            // The declared floors of rolling contact over one second, with room for what they leave out.
            forward_m_per_sqrt_s: (3.0 * noise.odometry_floor_pos_sigma_m_per_1s).max(1e-3),
            lateral_m_per_sqrt_s: (3.0 * noise.odometry_floor_pos_sigma_m_per_1s).max(1e-3),
            yaw_rad_per_sqrt_s: (3.0 * noise.odometry_floor_heading_sigma_rad_per_1s).max(1e-3),
            ..MotionSection::default()
        },
        sensors: SensorsSection {
            range_bearing: (noise.range_sigma_m > 0.0 && noise.bearing_sigma_rad > 0.0).then_some(
                RangeBearingNoise {
                    sigma_range_m: noise.range_sigma_m,
                    sigma_range_per_m: 0.0,
                    sigma_bearing_rad: noise.bearing_sigma_rad,
                },
            ),
            range_bias_m: nominal.robots.get(&robot).map_or(0.0, |own| own.range_bias_m),
            gps: positive(noise.gps_sigma_m),
            heading: (noise.heading_sigma_rad > 0.0)
                .then_some(AngleNoise { sigma_rad: noise.heading_sigma_rad }),
            ..SensorsSection::default()
        },
        ..NoiseFile::default()
    })
}

/// Effective over geometric track: wheels that skid in turns turn the robot less.
fn track_ratio(drive: Drive) -> f64 {
    match drive {
        Drive::SkidSteer { track_ratio } => track_ratio,
        Drive::Differential | Drive::CarLike { .. } => 1.0,
    }
}

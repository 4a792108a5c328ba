//! The command line, as clap sees it.

mod calibrate;
mod concealed;
mod evaluate;
mod export;
mod filter;
mod reading;
mod slam;
mod survey;
mod tune;
mod values;
mod why;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use pleiad_estimation::strategy::StrategyKind;
use pleiad_sim_peers::scenario::ManoeuvreKind;

pub use calibrate::{Calibrate, MapArgs, UmbmarkArgs};
pub use concealed::{Benchmark, ConcealedArgs};
pub use evaluate::{EvaluateArgs, VariantArg, VariantFilter};
pub use export::{ExportArgs, ExportForm};
pub use filter::FilterArgs;
pub use reading::ReadingArgs;
pub use slam::{AssociationArg, MeasureArg, SlamArgs};
pub use survey::SurveyArgs;
pub use tune::{AlsoArg, TuneArgs};
pub use values::{
    AbsoluteArg, CalibrateArg, ClutterArg, InflateArg, LandmarksArg, QuarantineArg, RelinearizeArg, ToldArg,
};
pub use why::WhyArgs;

const AFTER: &str = "\
Examples:
  pleiad demo --seconds 120 --out demo
  pleiad init team.toml
  pleiad run team.toml --out run

Exit codes: 0 done, 1 failed (stderr says why), 2 wrong usage.
Logs go to stderr; PLEIAD_LOG=info shows more. NO_COLOR is respected.";

/// A team of robots localized as one distributed Kalman filter over a message bus.
#[derive(Debug, Parser)]
#[command(name = "pleiad", version, after_help = AFTER)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// The observability demonstration: the same team without and with one GPS receiver.
    #[command(after_help = "Examples:\n  pleiad demo --seconds 120 --robots 3 --out demo")]
    Demo(DemoArgs),
    /// A scenario to begin with, with comments.
    #[command(after_help = "Examples:\n  pleiad init team.toml")]
    Init(InitArgs),
    /// Run a scenario: simulated robots, one agent process each.
    #[command(
        after_help = "Examples:\n  pleiad run team.toml --out run\n  pleiad run team.toml --seed 7 --strategy pairwise --out approximate --json"
    )]
    Run(RunArgs),
    /// Replay a recording through the agents of a team.
    #[command(
        after_help = "Examples:\n  pleiad replay run --out again\n  pleiad replay recording --absolute 2@1.0:0.3 --seconds 30 --out fixes"
    )]
    Replay(ReplayArgs),
    /// Why observations of a recording were not used.
    #[command(
        after_help = "Examples:\n  pleiad why run\n  pleiad why run --robot 2 --at 30 --within 5 --json"
    )]
    Why(WhyArgs),
    /// Noise levels from a recording, without its ground truth: those under which its innovations are likeliest.
    #[command(after_help = "Examples:\n  pleiad tune recording --out noise.toml")]
    Tune(TuneArgs),
    /// What a scenario or a recording lets the team know of itself.
    #[command(
        after_help = "Examples:\n  pleiad observability team.toml\n  pleiad observability recording --seconds 20 --json"
    )]
    Observability(ObservabilityArgs),
    /// A recording of a scenario; or what the nominal model predicts of one, and what was measured instead.
    #[command(after_help = "Examples:\n  pleiad simulate team.toml --out recording")]
    Simulate(SimulateArgs),
    /// A recording, and the estimates in a run, for other tools: csv, TUM, MCAP.
    #[command(
        after_help = "Examples:\n  pleiad export run --to tum --out tum\n  pleiad export run --to mcap --out run.mcap"
    )]
    Export(ExportArgs),
    /// What physics the nominal model leaves out: where, what, how sure, and the corrected model.
    Diagnose(DiagnoseArgs),
    /// How good the diagnosis is, where the answers are known.
    #[command(subcommand)]
    Benchmark(Benchmark),
    /// What loss and partitions do to each strategy: the table of strategies by fault level.
    #[command(
        after_help = "Examples:\n  pleiad faults team.toml --strategies exact,naive --loss 50 --burst 1 --seeds 1 --out faults"
    )]
    Faults(FaultsArgs),
    /// Whether the filter is as good as it says, over many runs of a scenario, beside variants of it.
    #[command(
        after_help = "Examples:\n  pleiad evaluate team.toml --seeds 4 --seconds 30 --variants additive,invariant --out evaluated"
    )]
    Evaluate(EvaluateArgs),
    /// The systems that the joint filter grew from, each as a study with its claims: Kalman filter, gyro, rover and others.
    Survey(SurveyArgs),
    /// Vehicle and map at once: EKF SLAM on a scenario or a recording.
    Slam(SlamArgs),
    /// Odometry calibrated by published procedures: squares in both directions, scans against a map.
    #[command(subcommand)]
    Calibrate(Calibrate),
    /// The physics a simulation can leave out: names, parameters, equations.
    #[command(after_help = "Examples:\n  pleiad effects\n  pleiad effects longitudinal_slip")]
    Effects(EffectsArgs),
    /// One robot's agent.
    Agent(AgentArgs),
    /// Launch and watch the agents of a configuration.
    Coordinator(CoordinatorArgs),
    /// Have a robot that will not come back evicted, so that its team can close its past without it.
    Evict(EvictArgs),
    /// Feed samples into running agents through their sensor keys.
    #[command(name = "sim-peers")]
    SimPeers(SimPeersArgs),
    /// Shell completions.
    #[command(after_help = "Examples:\n  pleiad completions bash")]
    Completions {
        /// For which shell.
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Number of robots.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=50))]
    pub robots: u32,
    /// Length of the run in simulated seconds, at least 120.
    #[arg(long, default_value_t = 300.0)]
    pub seconds: f64,
    /// Simulated seconds per second; as fast as the agents can if absent.
    #[arg(long)]
    pub speed: Option<f64>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for the report and all data; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct InitArgs {
    /// File to write; one that exists is not overwritten.
    #[arg(default_value = "team.toml")]
    pub file: PathBuf,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    /// The scenario; docs/scenario.md lists its keys.
    pub scenario: PathBuf,
    /// Seed; the scenario's own if absent.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Simulated seconds per second; as fast as the agents can if absent.
    #[arg(long)]
    pub speed: Option<f64>,
    #[command(flatten)]
    pub filter: FilterArgs,
    /// A file of fault tables: what goes wrong between the robots and with their processes (docs/faults.md);
    /// those of the scenario itself if absent.
    #[arg(long, value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Restart an agent that ends by itself.
    #[arg(long)]
    pub restart: bool,
    /// Folder for the report and all data; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// A recording folder, a run folder, an MRCLAM folder, an .mcap file, or a ROS 2 bag or .csv files with a mapping.
    /// The robots of a run start as they were told then (priors.toml), others where the ground truth says.
    pub recording: PathBuf,
    #[command(flatten)]
    pub filter: FilterArgs,
    /// Which landmarks the robots know: known, none, numbers as in 6,7, or team: none, and the team maps them.
    #[arg(long, default_value = "known")]
    pub landmarks: LandmarksArg,
    /// Position fixes made from ground truth, as in 1@1.0:0.3 (robot 1, 1 Hz, sigma 0.3 m). Repeatable.
    #[arg(long, value_name = "ROBOT@HZ:SIGMA_M")]
    pub absolute: Vec<AbsoluteArg>,
    /// Begin this many seconds into the time that all robots cover, from ground truth.
    #[arg(long, default_value_t = 0.0)]
    pub start: f64,
    /// Length in seconds; to the end if absent.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// One agent process per robot over zenoh, instead of all in one process.
    #[arg(long)]
    pub processes: bool,
    /// Seed of position fixes made from ground truth.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Noise and geometry of the robots: a file with the sections filter, motion and sensors of an
    /// agent's configuration. Default: noise.toml in the recording, or what is built in for its form.
    #[arg(long)]
    pub noise: Option<PathBuf>,
    /// A model of the robots, such as a corrected.toml: its effects are taken out of what they read.
    /// Default: model.toml in the recording, if it is there.
    #[arg(long)]
    pub model: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Folder for the report and all data; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct ObservabilityArgs {
    /// A scenario (a TOML file) or a recording (a folder or an .mcap file).
    pub input: PathBuf,
    /// Seed of a scenario; its own if absent.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Which landmarks of a recording are known: known, none, or numbers as in 6,7.
    #[arg(long, default_value = "known")]
    pub landmarks: LandmarksArg,
    /// Only this many seconds from the start.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// The scenario to record; docs/scenario.md lists its keys.
    #[arg(required_unless_present = "from", conflicts_with = "from")]
    pub scenario: Option<PathBuf>,
    /// Seed of the scenario; its own if absent.
    #[arg(long, conflicts_with = "from")]
    pub seed: Option<u64>,
    /// Drive these manoeuvres instead, as in straight,turn: standstill, straight, turn, turn_steps, circle, arc,
    /// figure_eight, square, steps, ramp, weave, crawl (docs/scenario.md).
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with = "from")]
    pub manoeuvre: Vec<ManoeuvreKind>,
    /// How long, seconds; as the scenario says if absent.
    #[arg(long, conflicts_with = "from")]
    pub seconds: Option<f64>,
    /// The recording to predict, a folder with nominal.toml in it.
    #[arg(long, value_name = "RECORDING")]
    pub from: Option<PathBuf>,
    /// Another model of the robots, such as a corrected.toml, in place of the recording's nominal.toml.
    #[arg(long, conflicts_with = "scenario")]
    pub model: Option<PathBuf>,
    /// Folder for the recording, or for the residuals; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct DiagnoseArgs {
    /// Recording folders, run folders, MRCLAM folders, .mcap files, or bags with mappings; several are diagnosed together.
    #[arg(required = true, value_name = "RECORDING")]
    pub recordings: Vec<PathBuf>,
    /// What the nominal simulation believes, instead of the recordings' own nominal.toml.
    #[arg(long, value_name = "NOMINAL.TOML")]
    pub model: Option<PathBuf>,
    /// Whether ground truth is used. Without it robots are where the whole team measured them, and one true pose per
    /// robot says where it began.
    #[arg(long, value_enum, default_value_t = TruthArg::Auto)]
    pub truth: TruthArg,
    /// Leave out sightings of landmarks.
    #[arg(long)]
    pub without_landmarks: bool,
    /// Recordings to fit on, by the names of their folders, as in a,b. Default: those that are not tested on.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub fit_on: Vec<String>,
    /// Recordings to test on, by the names of their folders. Default: those that are not fitted on; if there
    /// are none, parts of the recordings that are left out of the fit.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub test_on: Vec<String>,
    /// Effects of the catalogue that are not tried, as in lateral_skid,crab: what is said of them without a name.
    #[arg(long, value_name = "EFFECT,...", value_delimiter = ',')]
    pub without: Vec<String>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Folder for report.html, findings.json and corrected.toml; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// The object of findings.json on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct FaultsArgs {
    /// A scenario (a TOML file, with fault tables if it has any) or a recording (a folder).
    pub input: PathBuf,
    /// Which strategies: exact, factored, pairwise, intersection, split_intersection, naive, independent.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "exact,factored,pairwise,intersection,split_intersection,naive,independent"
    )]
    pub strategies: Vec<StrategyKind>,
    /// Shares of messages lost during the fault, percent.
    #[arg(long, value_delimiter = ',', default_value = "0,10,30,50,70,90")]
    pub loss: Vec<f64>,
    /// Mean number of messages lost in a row; 1 is independent loss.
    #[arg(long, value_delimiter = ',', default_value = "1,10,100")]
    pub burst: Vec<f64>,
    /// How many seeds: worlds of a scenario, and lucks of the network.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// The first seed; a scenario's own if absent.
    #[arg(long)]
    pub seed: Option<u64>,
    /// A file with fault tables, in place of those of the scenario.
    #[arg(long)]
    pub faults: Option<PathBuf>,
    /// Which landmarks of a recording are known: known, none, or numbers as in 6,7.
    #[arg(long, default_value = "known")]
    pub landmarks: LandmarksArg,
    /// Position fixes of a recording made from ground truth, as in 1@1.0:0.3. Repeatable.
    #[arg(long, value_name = "ROBOT@HZ:SIGMA_M")]
    pub absolute: Vec<AbsoluteArg>,
    /// Begin a recording this many seconds into the time that all robots cover.
    #[arg(long, default_value_t = 0.0)]
    pub start: f64,
    /// Only this many seconds from the start.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// Folder for the report and the table; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct EffectsArgs {
    /// Only this effect, with its parameters and what it is confounded with.
    pub name: Option<String>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct AgentArgs {
    /// The agent's configuration; docs/agent.md lists its keys.
    #[arg(long)]
    pub config: PathBuf,
}

#[derive(Debug, Args)]
pub struct CoordinatorArgs {
    /// The coordinator's configuration; docs/coordinator.md lists its keys.
    #[arg(long)]
    pub config: PathBuf,
}

#[derive(Debug, Args)]
pub struct EvictArgs {
    /// The team.
    pub team: String,
    /// The robot that will not come back.
    pub robot: u32,
    /// Endpoints of agents of the team (or of a router).
    #[arg(long, required = true)]
    pub connect: Vec<String>,
    /// Evict it although it answers.
    #[arg(long)]
    pub anyway: bool,
    /// How long the others may take to decide it, seconds.
    #[arg(long, default_value_t = 30.0)]
    pub within: f64,
}

#[derive(Debug, Args)]
pub struct SimPeersArgs {
    /// A scenario to simulate, or a recording folder to play.
    pub input: PathBuf,
    /// The team whose agents are fed.
    #[arg(long)]
    pub team: String,
    /// Endpoints of the agents (or of a router).
    #[arg(long, required = true)]
    pub connect: Vec<String>,
    /// Seed of a scenario; its own if absent.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Seconds of team time per second; as fast as the agents can if absent.
    #[arg(long)]
    pub speed: Option<f64>,
    /// An agent that has not acknowledged samples after so many seconds loses them; the others wait as long.
    #[arg(long, default_value_t = 5.0)]
    pub patience: f64,
    /// Print the team time reached, a line per second of it.
    #[arg(long)]
    pub progress: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TruthArg {
    /// Where it was recorded.
    Auto,
    /// Not at all.
    No,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ErrorArg {
    /// Right-invariant.
    Invariant,
    /// Additive: the textbook filter.
    Additive,
}

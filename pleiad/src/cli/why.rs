//! Arguments of `pleiad why`.

use std::path::PathBuf;

use clap::Args;

use super::{AbsoluteArg, FilterArgs, LandmarksArg, ReadingArgs};

#[derive(Debug, Args)]
pub struct WhyArgs {
    /// A recording folder, a run folder, an MRCLAM folder, an .mcap file, or a ROS 2 bag or .csv files with a mapping.
    pub recording: PathBuf,
    /// Only observations that this robot made.
    #[arg(long)]
    pub robot: Option<u32>,
    /// Only around this time, seconds from the start of what is replayed.
    #[arg(long, value_name = "SECONDS")]
    pub at: Option<f64>,
    /// How far around --at, seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, requires = "at")]
    pub within: f64,
    /// How many observations are listed; all are counted.
    #[arg(long, default_value_t = 20)]
    pub limit: usize,
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
    /// Seed of position fixes made from ground truth.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Noise and geometry of the robots, as for `pleiad replay`.
    #[arg(long)]
    pub noise: Option<PathBuf>,
    /// A model of the robots, as for `pleiad replay`.
    #[arg(long)]
    pub model: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

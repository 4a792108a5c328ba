//! Arguments of `pleiad slam`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{ErrorArg, ReadingArgs};

#[derive(Debug, Args)]
pub struct SlamArgs {
    /// A scenario (a TOML file), a recording folder, a run folder, an MRCLAM folder, an .mcap file, or a bag.
    pub input: PathBuf,
    /// How sightings find their landmarks.
    #[arg(long, value_enum, default_value_t = AssociationArg::Identity)]
    pub association: AssociationArg,
    /// What is measured of a landmark; without ranges, landmarks wait until their bearings cross.
    #[arg(long, value_enum, default_value_t = MeasureArg::RangeBearing)]
    pub measure: MeasureArg,
    /// Coordinates of the filter's error.
    #[arg(long, value_enum, default_value_t = ErrorArg::Invariant)]
    pub error: ErrorArg,
    /// Number of seeds of a scenario.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Only this robot of a recording; each one alone if absent.
    #[arg(long)]
    pub robot: Option<u32>,
    /// Begin a recording this many seconds into the time that all robots cover, from ground truth.
    #[arg(long, default_value_t = 0.0)]
    pub start: f64,
    /// Length of a recording in seconds; to the end if absent.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// Noise and geometry of the robots of a recording, as for `pleiad replay`.
    #[arg(long)]
    pub noise: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Folder for the report and the numbers; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AssociationArg {
    /// By the names that sightings carry.
    Identity,
    /// Nearest neighbour under a gate; names are only used to judge.
    Nearest,
    /// Several maps side by side until later sightings tell them apart; names are only used to judge.
    Joint,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MeasureArg {
    /// As the recording has it.
    #[value(name = "range_bearing")]
    RangeBearing,
    /// Bearings alone.
    Bearing,
}

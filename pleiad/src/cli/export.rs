//! Arguments of `pleiad export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::ReadingArgs;

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A recording folder, a run folder, an MRCLAM folder, an .mcap file, or a ROS 2 bag or .csv files with a mapping.
    pub recording: PathBuf,
    /// The form to write.
    #[arg(long, value_enum)]
    pub to: ExportForm,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Folder to write, a new one under runs/ if absent; for mcap the file, the recording's name if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportForm {
    /// A recording folder, with the estimates of a run in estimate/.
    Csv,
    /// Trajectories for evo: truth/ and, of a run, estimate/.
    Tum,
    /// One file for Foxglove and Lichtblick, that Pleiad reads back.
    Mcap,
}

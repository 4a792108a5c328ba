//! How a recording is to be read, for every command that reads one.

use std::path::PathBuf;

use clap::Args;

#[derive(Clone, Debug, Args)]
pub struct ReadingArgs {
    /// What is what in a ROS 2 bag or in .csv files (docs/interchange.md). Default: mapping.toml beside them.
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Leave out rows that cannot be read; they are counted and reported.
    #[arg(long)]
    pub skip_bad_rows: bool,
}

//! Arguments of the commands that run what the joint filter grew from.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
pub struct SurveyArgs {
    /// The study; all are listed if absent.
    pub study: Option<String>,
    /// Number of seeds; as many as the study needs for its intervals if absent.
    #[arg(long)]
    pub seeds: Option<usize>,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Folder for the report and the numbers; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

//! Arguments of the commands that calibrate odometry.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Debug, Subcommand)]
pub enum Calibrate {
    /// Wheel diameters and track from squares driven in both directions (Borenstein and Feng 1996).
    Umbmark(UmbmarkArgs),
    /// Errors per metre driven from range scans against a map (Hoseinnezhad, Moshiri and Asharif 2003).
    Map(MapArgs),
}

#[derive(Debug, Args)]
pub struct UmbmarkArgs {
    /// Recordings of one run each: squares in both directions; straight lines and turns on the spot besides.
    #[arg(value_name = "RECORDING", required_unless_present = "simulate", conflicts_with = "simulate")]
    pub recordings: Vec<PathBuf>,
    /// Drive the procedure in simulation instead, correct, and drive it again.
    #[arg(long)]
    pub simulate: bool,
    /// The robot to simulate, alone in a scenario; a ready one if absent.
    #[arg(long, value_name = "SCENARIO", requires = "simulate")]
    pub scenario: Option<PathBuf>,
    /// Number of seeds; as many as the intervals need if absent.
    #[arg(long, requires = "simulate")]
    pub seeds: Option<usize>,
    /// The first seed.
    #[arg(long, default_value_t = 1, requires = "simulate")]
    pub first_seed: u64,
    /// The robot that is calibrated, where recordings hold several.
    #[arg(long, conflicts_with = "simulate")]
    pub robot: Option<u32>,
    /// What is what in a ROS 2 bag or in .csv files (docs/interchange.md). Default: mapping.toml beside them.
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Leave out rows that cannot be read.
    #[arg(long, conflicts_with = "simulate")]
    pub skip_bad_rows: bool,
    /// Folder for the report, the numbers and corrected.toml; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct MapArgs {
    /// A recording with scan.csv and walls.csv; a simulated robot over many seeds if absent.
    #[arg(value_name = "RECORDING")]
    pub recording: Option<PathBuf>,
    /// Number of seeds; as many as the intervals need if absent.
    #[arg(long, conflicts_with = "recording")]
    pub seeds: Option<usize>,
    /// The first seed.
    #[arg(long, default_value_t = 1, conflicts_with = "recording")]
    pub first_seed: u64,
    /// The robot that is calibrated, where the recording holds several.
    #[arg(long, requires = "recording")]
    pub robot: Option<u32>,
    /// Weight of what is believed against what a stretch says: 1 never adapts, 0 follows every stretch.
    #[arg(long, default_value_t = 0.9, requires = "recording")]
    pub gamma: f64,
    /// A stretch counts only where what is occupied adds up to this, over the cells of both grids.
    #[arg(long, default_value_t = 10.0, requires = "recording")]
    pub mu_min: f64,
    /// Driven between matches, metres.
    #[arg(long, default_value_t = 1.0, requires = "recording")]
    pub stretch_m: f64,
    /// Side of a grid's cell, metres.
    #[arg(long, default_value_t = 0.1, requires = "recording")]
    pub cell_m: f64,
    /// Believed at first: a_trans.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "recording")]
    pub a_trans: f64,
    /// Believed at first: a_rot, rad/m.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "recording")]
    pub a_rot: f64,
    /// What is what in a ROS 2 bag or in .csv files (docs/interchange.md). Default: mapping.toml beside them.
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Leave out rows that cannot be read.
    #[arg(long, requires = "recording")]
    pub skip_bad_rows: bool,
    /// Folder for the report, the numbers and corrected.toml; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

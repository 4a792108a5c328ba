//! Arguments of `pleiad benchmark`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use pleiad_benchmark::Asked;

#[derive(Debug, Subcommand)]
pub enum Benchmark {
    /// The diagnosis on data in which something is concealed: named, missed, invented; beside other methods.
    Concealed(ConcealedArgs),
}

#[allow(clippy::struct_excessive_bools, reason = "switches of the command line")]
#[derive(Debug, Args)]
pub struct ConcealedArgs {
    /// How many seeds: recordings of every case of a class.
    #[arg(long, default_value_t = 1)]
    pub seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    pub first_seed: u64,
    /// Which classes: clean, single, masked, absorbed, cancelling, buried, rare, out_of_catalogue,
    /// unidentifiable, decoy; with a number of seeds of its own as in clean:100. Default: all.
    #[arg(long, value_name = "CLASS", num_args = 1.., value_delimiter = ',')]
    pub class: Vec<Asked>,
    /// Only cases with one of these in their names, as in single/crab/x1/white/1.
    #[arg(long, value_name = "TEXT", num_args = 1..)]
    pub only: Vec<String>,
    /// Also diagnose without something: no_blocks of time, no_scans for places and onsets, no_sets, no_truth, no_landmarks
    /// (and no truth). All if none is named.
    #[arg(long, value_name = "NAME", num_args = 0.., value_delimiter = ',')]
    pub ablations: Option<Vec<String>>,
    /// Leave away the other methods: sparse regression, lasso, joint fit.
    #[arg(long)]
    pub no_baselines: bool,
    /// Take up a run that stopped, in the folder of --out; cases that have a result are not run again.
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Folder for the sealed answers, the results, summary.json and concealed.md; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

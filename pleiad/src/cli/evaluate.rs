//! Arguments of `pleiad evaluate`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use pleiad_agent::config::RelinearizeSection;

use super::RelinearizeArg;

#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// The scenario; docs/scenario.md lists its keys.
    pub scenario: PathBuf,
    /// How many runs, each a world of its own.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    pub seeds: u64,
    /// The first seed; the scenario's own if absent.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Length of a run in simulated seconds; the scenario's own if absent.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// Filters, all on the same facts: additive, invariant, iterated:N (the measurements of each instant in N
    /// passes), or
    /// BLOCK_S:AHEAD_S:PASSES (facts linearized together). What is said of errors is said relative to the first.
    #[arg(long, value_delimiter = ',', default_value = "additive,invariant,iterated:4,5:5:4")]
    pub variants: Vec<VariantArg>,
    /// How many times of a run it is judged at, equally far apart.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub times: u32,
    /// Folder for the report and the numbers; a new one under runs/ if absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// A filter to be judged, as it was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct VariantArg {
    pub name: String,
    pub filter: VariantFilter,
}

/// What a variant does with the facts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VariantFilter {
    Additive,
    Invariant,
    /// The measurements of each instant in so many passes.
    Iterated(u32),
    Relinearized(RelinearizeSection),
}

impl FromStr for VariantArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let filter = match text.split_once(':') {
            None if text == "additive" => Some(VariantFilter::Additive),
            None if text == "invariant" => Some(VariantFilter::Invariant),
            Some(("iterated", passes)) => passes.parse().ok().map(VariantFilter::Iterated),
            _ => text.parse().ok().map(|RelinearizeArg(how)| VariantFilter::Relinearized(how)),
        };
        let filter = filter.ok_or_else(|| {
            format!("found {text:?}, expected additive, invariant, iterated:N, or BLOCK_S:AHEAD_S:PASSES as in 5:5:4")
        });
        Ok(Self { name: text.to_owned(), filter: filter? })
    }
}

//! `pleiad evaluate`: whether the filter is as good as it says, over many runs of a scenario, beside variants of it.
//!
//! The facts of a run do not depend on the filter, so that each team runs once and every variant folds what it said.

mod rows;
mod trial;
mod words;

use anyhow::{Context, bail};
use indicatif::ProgressBar;
use pleiad_agent::config::{AgentConfig, ErrorName, FilterSection, RelinearizeSection};
use pleiad_estimation::fold::FoldConfig;
use pleiad_recording::parallel;
use pleiad_report::write_summary;
use pleiad_sim_peers::{Scenario, simulate};
use serde::Serialize;

use crate::cli::{ErrorArg, EvaluateArgs, FilterArgs, VariantArg, VariantFilter};
use crate::commands::replay::command_line;
use crate::commands::worlds::{Truth, World};
use crate::output;
use crate::setup;
use rows::Row;
use trial::Trial;

/// Shorter than any two facts are apart that are not of one instant.
const INSTANT_S: f64 = 1e-9;

/// `evaluate --json` and `summary.json`.
#[derive(Debug, Serialize)]
pub struct EvaluateJson {
    pub scenario: String,
    pub command: String,
    pub out: String,
    pub seconds: f64,
    pub seeds: u64,
    pub first_seed: u64,
    /// When it was judged, s from the beginning of a run.
    pub times_s: Vec<f64>,
    /// Complete facts of a run, on average.
    pub facts: f64,
    pub rows: Vec<Row>,
}

pub fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let mut scenario = Scenario::load(&args.scenario)?;
    if let Some(seconds) = args.seconds {
        if !(seconds.is_finite() && seconds > 0.0) {
            bail!("--seconds {seconds}: expected a positive number");
        }
        scenario.duration_s = seconds;
    }
    let seconds = scenario.duration_s;
    let times_s: Vec<f64> =
        (1..=args.times).map(|index| seconds * f64::from(index) / f64::from(args.times)).collect();
    let first_seed = args.seed.unwrap_or(scenario.seed);
    let seeds: Vec<u64> = (first_seed..first_seed.saturating_add(args.seeds)).collect();
    let bar = output::progress("runs", seeds.len() as f64);
    let trials = parallel::map(&seeds, |seed| trial(&scenario, *seed, &args.variants, &times_s, &bar));
    bar.finish_and_clear();
    let trials: Vec<Trial> = trials.into_iter().collect::<anyhow::Result<_>>()?;
    let facts = trials.iter().map(|trial| trial.facts as f64).sum::<f64>() / trials.len() as f64;
    let name = args.scenario.file_stem().map_or("run".into(), |stem| stem.to_string_lossy().into_owned());
    let out = crate::folder::create(args.out.as_deref(), &format!("evaluate-{name}"))?;
    let json = EvaluateJson {
        scenario: args.scenario.display().to_string(),
        command: command_line(),
        out: out.display().to_string(),
        seconds,
        seeds: args.seeds,
        first_seed,
        times_s,
        facts,
        rows: rows::rows(&args.variants, &trials),
    };
    write_summary(&out.join("summary.json"), &json)?;
    words::page(&json)?.write(&out.join("report.html"))?;
    output::print(args.json, &json, &words::text(&json))
}

fn trial(
    scenario: &Scenario,
    seed: u64,
    variants: &[VariantArg],
    times_s: &[f64],
    bar: &ProgressBar,
) -> anyhow::Result<Trial> {
    let run = simulate(scenario, seed)?;
    let truth = Truth::Tracks(run.tracks.clone());
    let filter = FilterArgs::exact(ErrorArg::Invariant);
    let team = setup::simulated(scenario, run, &filter);
    let agent = team.agents.values().next().context("the scenario has no robot")?.clone();
    let configs: Vec<FoldConfig> =
        variants.iter().map(|variant| configuration(&agent, variant)).collect::<anyhow::Result<_>>()?;
    let world = World::new(team, truth, seed)?;
    let trial = trial::play(&world, &configs, times_s).with_context(|| format!("seed {seed}"));
    bar.inc(1);
    trial
}

/// How a variant folds, checked as the configuration of an agent is.
fn configuration(agent: &AgentConfig, variant: &VariantArg) -> anyhow::Result<FoldConfig> {
    let (error, relinearize) = match variant.filter {
        VariantFilter::Additive => (ErrorName::Additive, None),
        VariantFilter::Invariant => (ErrorName::Invariant, None),
        VariantFilter::Iterated(passes) => {
            (ErrorName::Invariant, Some(RelinearizeSection { block_s: INSTANT_S, ahead_s: 0.0, passes }))
        }
        VariantFilter::Relinearized(how) => (ErrorName::Invariant, Some(how)),
    };
    let filter = FilterSection { error, relinearize, ..agent.filter.clone() };
    let node = AgentConfig { filter, ..agent.clone() }.node();
    Ok(node.with_context(|| format!("--variants {}", variant.name))?.fold)
}

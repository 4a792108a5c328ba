//! `pleiad run`: a scenario with one agent process per robot, fed by a process that simulates the robots.

use std::path::Path;

use anyhow::{Context, bail};
use pleiad_bus::FaultPlan;
use pleiad_bus::faults::Fault;
use pleiad_coordinator::Schedule;
use pleiad_sim_peers::{Scenario, simulate};

use super::replay::{command_line, text, write_run};
use super::runner::{self, Faults, Feeder, ProcessOptions};
use crate::cli::RunArgs;
use crate::setup::{self, Team};
use crate::{folder, output};

pub fn run(args: &RunArgs) -> anyhow::Result<()> {
    if let Some(speed) = args.speed.filter(|speed| !(speed.is_finite() && *speed > 0.0)) {
        bail!("--speed {speed}: expected a positive number");
    }
    let scenario = Scenario::load(&args.scenario)?;
    let seed = args.seed.unwrap_or(scenario.seed);
    let world = simulate(&scenario, seed)?;
    let team = setup::simulated(&scenario, world, &args.filter);
    let file = args.faults.as_ref().or_else(|| (!scenario.faults.rules.is_empty()).then_some(&args.scenario));
    let faults = file.map(|file| faults(file, &team, seed)).transpose()?;
    let out = folder::create(args.out.as_deref(), &scenario.name)?;
    std::fs::copy(&args.scenario, out.join("scenario.toml"))?;
    let options = ProcessOptions {
        feeder: Feeder::Scenario { path: &args.scenario, seed },
        speed: args.speed,
        restart: args.restart,
        label: &scenario.name,
        faults,
    };
    let result = runner::as_processes(&team, &out, &options)?;
    let json = write_run(&team, &result, &out, &command_line(), None)?;
    output::print(args.json, &json, &text(&json))
}

/// Share of a run after which nothing happens at random any more, so that the team can come to itself.
const RANDOM_UNTIL: f64 = 0.9;

/// The faults of a file, with everything random drawn.
fn faults(file: &Path, team: &Team, seed: u64) -> anyhow::Result<Faults> {
    let plan = FaultPlan::load(file)?;
    if plan.rules.is_empty() {
        bail!("--faults {}: found no [[fault]] table; docs/faults.md lists their keys", file.display());
    }
    if let Some(index) = plan.rules.iter().position(|rule| matches!(rule.fault, Fault::Clock { .. })) {
        bail!(
            "{}: fault[{index}] is of a clock, which agent processes do not feign; remove it, or use pleiad faults",
            file.display()
        );
    }
    let (first, last) = team.span().context("there is not a single sample to run on")?;
    let robots = team.agents.keys().copied().collect();
    let plan = plan.scripted(seed, &robots, RANDOM_UNTIL * last.seconds_since(first));
    let schedule = Schedule::new(&plan, &robots).with_context(|| file.display().to_string())?;
    Ok(Faults { plan, seed, schedule })
}

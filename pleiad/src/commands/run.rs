//! `pleiad run`: a scenario with one agent process per robot, fed by a process that simulates the robots.

use anyhow::bail;
use pleiad_agent::config::FaultsSection;
use pleiad_bus::FaultPlan;
use pleiad_bus::faults::Fault;
use pleiad_sim_peers::{Scenario, simulate};

use super::replay::{command_line, text, write_run};
use super::runner::{self, Feeder, ProcessOptions};
use crate::cli::RunArgs;
use crate::setup::{self, FilterArgs};
use crate::{folder, output};

pub fn run(args: &RunArgs) -> anyhow::Result<()> {
    if let Some(speed) = args.speed.filter(|speed| !(speed.is_finite() && *speed > 0.0)) {
        bail!("--speed {speed}: expected a positive number");
    }
    let scenario = Scenario::load(&args.scenario)?;
    let seed = args.seed.unwrap_or(scenario.seed);
    let world = simulate(&scenario, seed)?;
    let filter = FilterArgs { strategy: args.strategy, error: args.error };
    let mut team = setup::simulated(&scenario, world, filter);
    let plan = args.faults.as_ref().or_else(|| (!scenario.faults.rules.is_empty()).then_some(&args.scenario));
    if let Some(plan) = plan {
        let rules = FaultPlan::load(plan)?.rules;
        if rules.is_empty() {
            bail!("--faults {}: found no [[fault]] table; docs/faults.md lists their keys", plan.display());
        }
        if let Some(index) = rules.iter().position(|rule| matches!(rule.fault, Fault::Clock { .. })) {
            bail!(
                "{}: fault[{index}] is of a clock, which agent processes do not feign; remove it, or use pleiad faults",
                plan.display()
            );
        }
        for agent in team.agents.values_mut() {
            agent.faults = Some(FaultsSection { plan: plan.clone(), seed });
        }
    }
    let out = folder::create(args.out.as_deref(), &scenario.name)?;
    std::fs::copy(&args.scenario, out.join("scenario.toml"))?;
    let options = ProcessOptions {
        feeder: Feeder::Scenario { path: &args.scenario, seed },
        speed: args.speed,
        restart: args.restart,
        label: &scenario.name,
    };
    let result = runner::as_processes(&team, &out, &options)?;
    let json = write_run(&team, &result, &out, &command_line(), None)?;
    output::print(args.json, &json, &text(&json))
}

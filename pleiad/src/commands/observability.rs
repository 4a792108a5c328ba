//! `pleiad observability`: what a scenario or a recording lets the team know of itself.

use std::fmt::Write as _;

use anyhow::{Context, bail};
use pleiad_estimation::RobotId;
use pleiad_estimation::observability::{Observability, of_entries};
use pleiad_sim_peers::{Scenario, connectivity, simulate};
use serde::Serialize;

use super::runner;
use crate::cli::{ErrorArg, FilterArgs, LandmarksArg, ObservabilityArgs};
use crate::evaluation::RunResult;
use crate::output;
use crate::setup::{self, Input, ReplayOptions, Team};

/// Window within which a sighting links two robots, seconds.
const CONNECTIVITY_WINDOW_S: f64 = 10.0;

#[derive(Debug, Serialize)]
struct ObservabilityJson {
    input: String,
    rank: usize,
    dimension: usize,
    singular_values: Vec<f64>,
    unobservable: Vec<String>,
    robots: Vec<BoundsJson>,
    disconnected: Vec<String>,
}

#[derive(Debug, Serialize)]
struct BoundsJson {
    robot: u32,
    position_bounded: bool,
    heading_bounded: bool,
}

/// Observability of the facts of a run, linearized along the estimated trajectories.
pub fn of_run(result: &RunResult) -> anyhow::Result<Observability> {
    let entries: Vec<_> = result.entries().cloned().collect();
    let joint =
        result.ledger.as_ref().context("observability is that of facts, which only exact keeps")?.joint();
    Ok(of_entries(&entries, |robot: RobotId, boot, state| {
        let member = joint.member(robot).filter(|member| member.boot == boot)?;
        Some(member.correction.compose(&state.nominal))
    }))
}

pub fn run(args: &ObservabilityArgs) -> anyhow::Result<()> {
    let filter = FilterArgs::exact(ErrorArg::Invariant);
    let team = if setup::is_recording(&args.input) {
        if args.seed.is_some() {
            bail!("--seed: a recording has none; it is for scenarios");
        }
        let input = setup::open(&args.input, None, false)?;
        let Input { recording, ingest, folder, .. } = &input;
        setup::recorded(
            recording,
            &ReplayOptions {
                filter,
                landmarks: &args.landmarks,
                absolute: &[],
                start_s: 0.0,
                seconds: args.seconds,
                seed: 1,
                noise: None,
                model: None,
                folder,
                mrclam: ingest.form == pleiad_recording::Form::Mrclam,
            },
        )?
    } else {
        if args.landmarks != LandmarksArg::Known {
            bail!("--landmarks: it is for recordings; a scenario says itself what its robots see");
        }
        let mut scenario = Scenario::load(&args.input)?;
        if let Some(seconds) = args.seconds {
            scenario.duration_s = seconds;
        }
        let run = simulate(&scenario, args.seed.unwrap_or(scenario.seed))?;
        setup::simulated(&scenario, run, &filter)
    };
    let result = runner::in_process(&team, "observing")?;
    let json = describe(args, &of_run(&result)?, &team);
    output::print(args.json, &json, &text(&json))
}

fn describe(args: &ObservabilityArgs, observability: &Observability, team: &Team) -> ObservabilityJson {
    let bounds = observability.bounds.iter().map(|bounds| BoundsJson {
        robot: bounds.robot.0,
        position_bounded: bounds.position,
        heading_bounded: bounds.heading,
    });
    let apart = connectivity(&team.recording, CONNECTIVITY_WINDOW_S);
    ObservabilityJson {
        input: args.input.display().to_string(),
        rank: observability.rank,
        dimension: observability.states,
        singular_values: observability.singular_values.clone(),
        unobservable: observability.unobservable.clone(),
        robots: bounds.collect(),
        disconnected: apart.iter().map(ToString::to_string).collect(),
    }
}

fn text(json: &ObservabilityJson) -> String {
    let mut text = format!("{}: rank {} of {}\n", json.input, json.rank, json.dimension);
    if json.unobservable.is_empty() {
        text.push_str("everything is observable\n");
    }
    for direction in &json.unobservable {
        let _ = writeln!(text, "unobservable: {direction}");
    }
    for robot in &json.robots {
        let word = |bounded: bool| if bounded { "bounded" } else { "unbounded" };
        let _ = writeln!(
            text,
            "robot {}: position {}, heading {}",
            robot.robot,
            word(robot.position_bounded),
            word(robot.heading_bounded)
        );
    }
    let numbers: Vec<_> = json.singular_values.iter().map(|value| format!("{value:.3e}")).collect();
    let _ = writeln!(text, "singular values: {}", numbers.join(" "));
    let shown = json.disconnected.iter().take(5);
    for stretch in shown {
        let _ = writeln!(text, "within {CONNECTIVITY_WINDOW_S} s windows: {stretch}");
    }
    if json.disconnected.len() > 5 {
        let _ = writeln!(text, "... and {} more such stretches", json.disconnected.len() - 5);
    }
    text
}

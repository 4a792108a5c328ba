//! `pleiad demo`: the observability demonstration. The same seeded scenario runs twice with one agent
//! process per robot, without and with a GPS receiver on robot 1.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};
use pleiad_estimation::RobotId;
use pleiad_report::{DemoCase, DemoReport, demo_report, write_summary};
use pleiad_sim_peers::{Scenario, connectivity, simulate};
use serde::Serialize;

use super::observability::of_run;
use super::replay::{command_line, write_run};
use super::runner::{self, Feeder, ProcessOptions};
use crate::cli::{DemoArgs, ErrorArg, FilterArgs};
use crate::evaluation::{self, RunResult};
use crate::setup::{self, Team};
use crate::{folder, output};

/// The two cases: name, and the scenario they start from.
const CASES: [(&str, &str); 2] = [
    ("relative_only", include_str!("../../../scenarios/five_relative.toml")),
    ("with_absolute", include_str!("../../../scenarios/five_gps.toml")),
];
/// The robot that has the GPS receiver in the second case.
const GPS_ROBOT: RobotId = RobotId(1);
/// Windows of the team's position sigma, seconds.
const EARLY_S: (f64, f64) = (60.0, 90.0);
const LATE_S: f64 = 30.0;
/// Shorter runs have no late window that is later than the early one.
const SHORTEST_S: f64 = 120.0;
/// A robot not linked to the GPS robot for this long is worth a remark, seconds.
const CUT_OFF_S: f64 = 10.0;

#[derive(Debug, Serialize)]
struct DemoJson {
    command: String,
    out: String,
    robots: u32,
    seconds: f64,
    seed: u64,
    cases: Vec<CaseJson>,
    wall_s: f64,
}

#[derive(Debug, Serialize)]
struct CaseJson {
    name: String,
    rank: usize,
    dimension: usize,
    unobservable: Vec<String>,
    team_sigma_early_m: f64,
    team_sigma_late_m: f64,
    final_position_sigma_m: Vec<f64>,
    position_rmse_m: Vec<f64>,
    processes: usize,
    facts: usize,
    messages: u64,
    bytes: u64,
    wall_s: f64,
    notes: Vec<String>,
}

pub fn run(args: &DemoArgs) -> anyhow::Result<()> {
    if !(args.seconds.is_finite() && args.seconds >= SHORTEST_S) {
        bail!(
            "--seconds {}: expected at least {SHORTEST_S}, so that early and late can be told apart",
            args.seconds
        );
    }
    if let Some(speed) = args.speed.filter(|speed| !(speed.is_finite() && *speed > 0.0)) {
        bail!("--speed {speed}: expected a positive number");
    }
    let out = folder::create(args.out.as_deref(), "demo")?;
    let (mut cases, mut drawn) = (Vec::new(), Vec::new());
    for (name, text) in CASES {
        let (json, case) = run_case(args, name, text, &out.join(name))?;
        cases.push(json);
        drawn.push(case);
    }
    let command = command_line();
    let json = DemoJson {
        command: command.clone(),
        out: out.display().to_string(),
        robots: args.robots,
        seconds: args.seconds,
        seed: args.seed,
        wall_s: cases.iter().map(|case| case.wall_s).sum(),
        cases,
    };
    write_summary(&out.join("summary.json"), &json)?;
    let robots = args.robots as usize;
    let report = DemoReport { seconds: args.seconds, seed: args.seed, robots, cases: drawn, command };
    demo_report(&report)?.write(&out.join("report.html"))?;
    output::print(args.json, &json, &text(&json))
}

/// The scenario of a case with the team and the length asked for.
fn scenario_text(args: &DemoArgs, text: &str) -> anyhow::Result<String> {
    let mut table: toml::Table = text.parse().context("the built-in scenario")?;
    table.insert("team_size".to_owned(), i64::from(args.robots).into());
    table.insert("duration_s".to_owned(), args.seconds.into());
    Ok(toml::to_string(&table)?)
}

fn run_case(args: &DemoArgs, name: &str, text: &str, out: &Path) -> anyhow::Result<(CaseJson, DemoCase)> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    let path = out.join("scenario.toml");
    std::fs::write(&path, scenario_text(args, text)?)
        .with_context(|| format!("cannot write {}", path.display()))?;
    let scenario = Scenario::load(&path)?;
    let world = simulate(&scenario, args.seed)?;
    let filter = FilterArgs::exact(ErrorArg::Invariant);
    let mut team = setup::simulated(&scenario, world, &filter);
    team.notes.extend(cut_off(&team));
    let options = ProcessOptions {
        feeder: Feeder::Scenario { path: &path, seed: args.seed },
        speed: args.speed,
        restart: false,
        label: name,
        faults: None,
    };
    let result = runner::as_processes(&team, out, &options)?;
    write_run(&team, &result, out, &command_line(), None)?;
    describe(args, name, &team, result)
}

/// Stretches in which robots had no chain of sightings to the one with GPS.
fn cut_off(team: &Team) -> Vec<String> {
    let stretches = connectivity(&team.recording, CUT_OFF_S);
    let lost = stretches.iter().filter(|stretch| !stretch.cut_off_from(GPS_ROBOT).is_empty());
    lost.map(|stretch| format!("no chain of sightings to robot {GPS_ROBOT} within {CUT_OFF_S} s: {stretch}"))
        .collect()
}

fn describe(
    args: &DemoArgs,
    name: &str,
    team: &Team,
    result: RunResult,
) -> anyhow::Result<(CaseJson, DemoCase)> {
    let (start, _) = team.span().context("there is not a single sample")?;
    let sigma = |from, to| {
        evaluation::team_sigma_m(&result, start, from, to)
            .context("no estimate in the window of the team's sigma")
    };
    let early = sigma(EARLY_S.0, EARLY_S.1)?;
    let late = sigma(args.seconds - LATE_S, args.seconds)?;
    let observability = of_run(&result)?;
    let last = |robot: &evaluation::RobotResult| {
        robot.settled.last().map_or(f64::NAN, |estimate| evaluation::position_sigma_m(&estimate.covariance))
    };
    let finals: Vec<f64> = result.robots.values().map(last).collect();
    let scores: Vec<_> =
        result.robots.iter().map(|(robot, own)| evaluation::score(*robot, own, &team.recording)).collect();
    let rmse: Vec<f64> = scores
        .iter()
        .map(|score| score.settled.map_or(f64::NAN, |accuracy| accuracy.position_rmse_m))
        .collect();
    let counts = result.ledger.as_ref().context("the demo's team keeps facts")?.counts();
    let (messages, bytes) = result.robots.values().fold((0, 0), |(messages, bytes), robot| {
        (messages + robot.summary.messages, bytes + robot.summary.bytes)
    });
    let facts = counts.relative + counts.absolute;
    let root_mean_square =
        |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
    let case = DemoCase {
        name: name.to_owned(),
        series: evaluation::series(&result, &team.recording, start),
        rank: observability.rank,
        dimension: observability.states,
        unobservable: observability.unobservable.clone(),
        team_sigma_early_m: early,
        team_sigma_late_m: late,
        final_position_sigma_m: finals.iter().copied().fold(f64::NAN, f64::max),
        position_rmse_m: root_mean_square(&rmse),
        processes: result.processes,
        facts: facts as u64,
        messages,
        bytes,
        notes: result.notes.clone(),
    };
    let json = CaseJson {
        name: name.to_owned(),
        rank: observability.rank,
        dimension: observability.states,
        unobservable: observability.unobservable,
        team_sigma_early_m: early,
        team_sigma_late_m: late,
        final_position_sigma_m: finals,
        position_rmse_m: rmse,
        processes: result.processes,
        facts,
        messages,
        bytes,
        wall_s: result.wall_s,
        notes: result.notes,
    };
    Ok((json, case))
}

fn text(json: &DemoJson) -> String {
    let mut text = format!(
        "{} robots, {} s, seed {}: the same team without and with one GPS receiver\n\n",
        json.robots, json.seconds, json.seed
    );
    let _ = writeln!(
        text,
        "case            rank     team sigma 60-90 s   last 30 s   ratio   mean RMSE   facts  agents"
    );
    for case in &json.cases {
        let _ = writeln!(
            text,
            "{:<14}  {:>2} of {:<2} {:>16.2} m {:>9.2} m {:>7.2} {:>9.2} m {:>7} {:>7}",
            case.name,
            case.rank,
            case.dimension,
            case.team_sigma_early_m,
            case.team_sigma_late_m,
            case.team_sigma_late_m / case.team_sigma_early_m,
            case.position_rmse_m.iter().sum::<f64>() / case.position_rmse_m.len() as f64,
            case.facts,
            case.processes
        );
    }
    for case in &json.cases {
        if !case.unobservable.is_empty() {
            let _ = write!(text, "\n{}: unobservable: {}", case.name, case.unobservable.join("; "));
        }
        for note in &case.notes {
            let _ = write!(text, "\n{}: note: {note}", case.name);
        }
    }
    let _ = writeln!(text, "\n\nreport: {}/report.html", json.out);
    text
}

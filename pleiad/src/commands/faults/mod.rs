//! `pleiad faults`: what loss does to each strategy, on identical runs.

mod levels;
mod rows;
mod run;
mod words;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, bail};
use pleiad_bus::FaultPlan;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_report::write_summary;
use pleiad_sim_peers::{Scenario, simulate};
use serde::Serialize;

use crate::cli::{ErrorArg, FaultsArgs, FilterArgs, LandmarksArg};
use crate::commands::replay::command_line;
use crate::commands::worlds::{Truth, World};
use crate::output;
use crate::setup::{self, Input, ReplayOptions};
use levels::Level;
use rows::Row;
use run::{RunScore, Window};

/// `faults --json` and `summary.json`.
#[derive(Debug, Serialize)]
pub struct FaultsJson {
    pub input: String,
    pub command: String,
    pub out: String,
    pub seconds: f64,
    pub fault_start_s: f64,
    pub fault_end_s: f64,
    /// Whether the seeds are worlds of their own; of a recording they are lucks of the network alone, and
    /// ANEES is a description of one realization.
    pub independent_worlds: bool,
    pub rows: Vec<Row>,
    pub notes: Vec<String>,
}

pub fn run(args: &FaultsArgs) -> anyhow::Result<()> {
    let (base, worlds, notes) = worlds(args)?;
    let seconds = worlds.iter().map(|world| world.seconds).fold(f64::INFINITY, f64::min);
    let base = of_messages(&base, args, &worlds, seconds)?;
    let levels = levels::levels(&base, &args.loss, &args.burst, seconds)?;
    let window = Window::of(&levels[0].plan, seconds);
    if window.end_s <= window.start_s {
        bail!("the faults begin at {} s, but the run ends at {seconds:.1} s", window.start_s);
    }
    let name = args.input.file_stem().map_or("run".into(), |stem| stem.to_string_lossy().into_owned());
    let out = crate::folder::create(args.out.as_deref(), &format!("faults-{name}"))?;
    let rows = table(args, &worlds, &levels, window)?;
    let json = FaultsJson {
        input: args.input.display().to_string(),
        command: command_line(),
        out: out.display().to_string(),
        seconds,
        fault_start_s: window.start_s,
        fault_end_s: window.end_s,
        independent_worlds: !setup::is_recording(&args.input),
        rows,
        notes,
    };
    write_summary(&out.join("summary.json"), &json)?;
    words::page(&json)?.write(&out.join("report.html"))?;
    output::print(args.json, &json, &words::text(&json))
}

/// The worlds, one per seed, and the faults of the file.
fn worlds(args: &FaultsArgs) -> anyhow::Result<(FaultPlan, Vec<World>, Vec<String>)> {
    let filter = FilterArgs::exact(ErrorArg::Invariant);
    let own = args.faults.as_deref().map(FaultPlan::load).transpose()?;
    if setup::is_recording(&args.input) {
        let input = setup::open(&args.input, None, false)?;
        let Input { recording, ingest, folder, .. } = &input;
        let options = ReplayOptions {
            filter,
            landmarks: &args.landmarks,
            absolute: &args.absolute,
            start_s: args.start,
            seconds: args.seconds,
            seed: 1,
            noise: None,
            model: None,
            folder,
            mrclam: ingest.form == pleiad_recording::Form::Mrclam,
        };
        let mut notes = Vec::new();
        let first = args.seed.unwrap_or(1);
        let worlds = (first..first.saturating_add(args.seeds)).map(|seed| {
            let team = setup::recorded(recording, &options)?;
            notes.clone_from(&team.notes);
            let truth = Truth::Recorded(Box::new(team.recording.clone()));
            World::new(team, truth, seed)
        });
        let worlds = worlds.collect::<anyhow::Result<_>>()?;
        return Ok((own.unwrap_or_default(), worlds, notes));
    }
    if args.landmarks != LandmarksArg::Known || !args.absolute.is_empty() || args.start > 0.0 {
        bail!("--landmarks, --absolute and --start are for recordings; a scenario says these things itself");
    }
    let mut scenario = Scenario::load(&args.input)?;
    if let Some(seconds) = args.seconds {
        if !(seconds.is_finite() && seconds > 0.0) {
            bail!("--seconds {seconds}: expected a positive number");
        }
        scenario.duration_s = seconds;
    }
    let first = args.seed.unwrap_or(scenario.seed);
    let worlds = (first..first.saturating_add(args.seeds)).map(|seed| {
        let run = simulate(&scenario, seed)?;
        let truth = Truth::Tracks(run.tracks.clone());
        World::new(setup::simulated(&scenario, run, &filter), truth, seed)
    });
    let worlds = worlds.collect::<anyhow::Result<_>>()?;
    Ok((own.unwrap_or(scenario.faults), worlds, Vec::new()))
}

/// The faults with everything random drawn, by the first seed; those of processes are refused, since there are
/// none.
fn of_messages(
    plan: &FaultPlan,
    args: &FaultsArgs,
    worlds: &[World],
    seconds: f64,
) -> anyhow::Result<FaultPlan> {
    let file = args.faults.as_ref().unwrap_or(&args.input).display();
    if let Some(index) = plan.rules.iter().position(|rule| rule.fault.is_of_processes()) {
        let word = plan.rules[index].fault.word();
        bail!(
            "{file}: fault[{index}] is `{word}`, of processes, and pleiad faults has none; remove it, or use pleiad run"
        );
    }
    let robots = worlds.iter().flat_map(|world| world.samples.keys().copied()).collect();
    let seed = worlds.first().map_or(1, |world| world.seed);
    Ok(plan.scripted(seed, &robots, seconds))
}

/// One run to be made: a strategy, a level (`None`: no fault at all), a world.
type Job = (StrategyKind, Option<usize>, usize);

fn table(args: &FaultsArgs, worlds: &[World], levels: &[Level], window: Window) -> anyhow::Result<Vec<Row>> {
    let mut kinds = args.strategies.clone();
    kinds.sort_unstable();
    kinds.dedup();
    // The exact strategy without faults is what the others are compared with.
    let mut jobs: Vec<Job> = Vec::new();
    let reference = if kinds.contains(&StrategyKind::Exact) { None } else { Some(StrategyKind::Exact) };
    for kind in kinds.iter().copied().chain(reference) {
        jobs.extend((0..worlds.len()).map(|world| (kind, None, world)));
    }
    for kind in &kinds {
        for level in 0..levels.len() {
            jobs.extend((0..worlds.len()).map(|world| (*kind, Some(level), world)));
        }
    }
    let scores = play_all(&jobs, worlds, levels, window)?;
    let of = |kind: StrategyKind, level: Option<usize>| -> Vec<RunScore> {
        let matching = jobs.iter().zip(&scores).filter(|((k, l, _), _)| *k == kind && *l == level);
        matching.map(|(_, score)| score.clone()).collect()
    };
    let exact = of(StrategyKind::Exact, None);
    let mut rows = Vec::new();
    for kind in kinds {
        let lossless = of(kind, None);
        for (index, level) in levels.iter().enumerate() {
            let runs = of(kind, Some(index));
            rows.push(rows::row(
                kind,
                (level.loss_percent, level.burst),
                &runs,
                &lossless,
                &exact,
                !setup::is_recording(&args.input),
            ));
        }
    }
    Ok(rows)
}

/// Makes all runs, on all processors; the results are in the order of the jobs whoever made them.
fn play_all(
    jobs: &[Job],
    worlds: &[World],
    levels: &[Level],
    window: Window,
) -> anyhow::Result<Vec<RunScore>> {
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<anyhow::Result<RunScore>>>> =
        Mutex::new(jobs.iter().map(|_| None).collect());
    let bar = output::progress("runs", jobs.len() as f64);
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((kind, level, world)) = jobs.get(index) else { return };
                    let none = FaultPlan::default();
                    let plan = level.map_or(&none, |level| &levels[level].plan);
                    let score = run::play(&worlds[*world], *kind, plan, window);
                    if let Ok(mut results) = results.lock() {
                        results[index] = Some(score);
                    }
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let results = results.into_inner().ok().context("a run panicked")?;
    results.into_iter().map(|result| result.context("a run was not made")?).collect()
}

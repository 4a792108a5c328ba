//! A team run to its end: in this process under virtual time, or as agent processes.

mod conduct;
mod survived;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use pleiad_agent::config::{AgentConfig, BusSection, FaultsSection};
use pleiad_agent::journal::Journal;
use pleiad_agent::results::{self, AgentSummary};
use pleiad_agent::{Approximate, ConfigError, Event, NodeConfig, Record, driver};
use pleiad_bus::{Bus, FaultPlan, ZenohBus};
use pleiad_coordinator::{AgentEntry, CoordinatorConfig, Restart, Schedule, endpoints};
use pleiad_estimation::RobotId;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_recording::{Overwrite, Recording, RobotRecording, write_folder};
use pleiad_sim_peers::strategies::{self, StrategyOptions};
use pleiad_sim_peers::{Fleet, FleetOptions};

use super::agent::runtime;
use crate::evaluation::{RobotResult, RunResult};
use crate::setup::{self, Team};
use crate::{folder, output};
use conduct::Conduct;
pub use survived::Survived;
use survived::survived;

/// The plan of faults beside a run.
const FAULTS: &str = "faults.toml";
/// Digest rounds granted after the last sample; without faults one is enough.
const SETTLING_ROUNDS: u32 = 50;
/// For a machine that is very busy; a run that goes well never comes near it.
const ENDED_WITHIN: Duration = Duration::from_secs(30);

/// Runs all robots in this process.
pub fn in_process(team: &Team, label: &str) -> anyhow::Result<RunResult> {
    match team.strategy()? {
        StrategyKind::Exact => nodes_in_process(team, label),
        kind => approximate_in_process(team, kind),
    }
}

/// Runs all robots of an approximate strategy in this process, over a network without faults.
fn approximate_in_process(team: &Team, kind: StrategyKind) -> anyhow::Result<RunResult> {
    let began = Instant::now();
    let configs = team.agents.iter().map(|(robot, agent)| Ok((*robot, agent.node()?)));
    let configs = configs.collect::<Result<BTreeMap<_, _>, ConfigError>>()?;
    // Nothing is looked at on the way: the robots keep their own estimates.
    let options = StrategyOptions { look_every_s: 1e9, ..StrategyOptions::new(kind) };
    let outcome = strategies::run(&configs, &team.samples, &options)?;
    let mut notes = team.notes.clone();
    let mut robots = BTreeMap::new();
    for (robot, mut participant) in outcome.participants {
        let Some(approximate) = participant.approximate_mut() else { continue };
        let (messages, bytes) = outcome.sent.get(&robot).copied().unwrap_or_default();
        let summary = results::approximate_summary(approximate, messages, bytes);
        notes.extend(refusals(robot, &summary));
        let settled = approximate.settled().to_vec();
        robots.insert(robot, RobotResult { online: settled.clone(), settled, summary });
    }
    let wall_s = began.elapsed().as_secs_f64();
    Ok(RunResult { robots, ledger: None, notes, wall_s, processes: 0, survived: None })
}

fn nodes_in_process(team: &Team, label: &str) -> anyhow::Result<RunResult> {
    let configs = team.agents.values().map(AgentConfig::node).collect::<Result<_, _>>()?;
    let (first, last) = team.span().context("there is not a single sample to run on")?;
    let began = Instant::now();
    let mut fleet = Fleet::new(configs, &FleetOptions::default())?;
    let bar = output::progress(label, last.seconds_since(first));
    fleet.feed(&team.samples, |now| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds of a run")]
        bar.set_position(now.seconds_since(first).max(0.0) as u64);
    });
    let agreed = fleet.settle(last, SETTLING_ROUNDS);
    bar.finish_and_clear();
    let mut notes = team.notes.clone();
    if !agreed {
        notes.push(
            "the robots did not agree at the end: some observations stayed without their other half"
                .to_owned(),
        );
    }
    let mut robots = BTreeMap::new();
    let mut ledger = None;
    for (robot, mut outcome) in fleet.into_outcomes() {
        for notice in &outcome.notices {
            notes.push(format!("robot {robot}: {notice}"));
        }
        let summary = results::summary(&mut outcome.node, outcome.messages, outcome.bytes);
        notes.extend(refusals(robot, &summary));
        let result = RobotResult { settled: outcome.node.settled(), online: outcome.online, summary };
        ledger.get_or_insert_with(|| outcome.node.ledger().clone());
        robots.insert(robot, result);
    }
    Ok(RunResult {
        robots,
        ledger,
        notes,
        wall_s: began.elapsed().as_secs_f64(),
        processes: 0,
        survived: None,
    })
}

/// Where the process that feeds the agents gets its samples from.
pub enum Feeder<'a> {
    /// A scenario, simulated anew by that process.
    Scenario {
        /// The file.
        path: &'a Path,
        /// The seed.
        seed: u64,
    },
    /// The samples of the team, written as a recording first.
    Samples,
}

/// What is to go wrong in a run.
pub struct Faults {
    /// All of it, with nothing left to chance.
    pub plan: FaultPlan,
    /// Of the links' luck.
    pub seed: u64,
    /// What befalls processes.
    pub schedule: Schedule,
}

/// How agent processes are run.
pub struct ProcessOptions<'a> {
    /// Where the samples come from.
    pub feeder: Feeder<'a>,
    /// Seconds of team time per second; `None` as fast as the agents can.
    pub speed: Option<f64>,
    /// Whether an agent that ends by itself is restarted.
    pub restart: bool,
    /// For the progress bar.
    pub label: &'a str,
    /// What is to go wrong.
    pub faults: Option<Faults>,
}

/// Runs one agent process per robot over zenoh on loopback, fed by one more process.
pub fn as_processes(team: &Team, out: &Path, options: &ProcessOptions) -> anyhow::Result<RunResult> {
    let began = Instant::now();
    let robots: Vec<RobotId> = team.agents.keys().copied().collect();
    let endpoints = endpoints(&robots)?;
    // A name of its own, so that runs on one machine do not hear one another.
    let name = format!("run-{:016x}", getrandom::u64().context("the system gives no random number")?);
    // Beside the run, so that it can be looked at and run again.
    if let Some(model) = team.agents.values().find_map(|agent| agent.model.as_ref()) {
        setup::copy_model(model, &out.join(setup::MODEL))?;
    }
    if let Some(faults) = &options.faults {
        let to = out.join(FAULTS);
        std::fs::write(&to, faults.plan.to_toml())
            .with_context(|| format!("cannot write {}", to.display()))?;
    }
    let span = team.span().context("there is not a single sample to run on")?;
    let of_links = |faults: &&Faults| !faults.plan.rules.iter().all(|rule| rule.fault.is_of_processes());
    let on_links = options.faults.as_ref().filter(of_links);
    let mut entries = Vec::new();
    for (robot, agent) in &team.agents {
        let mut agent = agent.clone();
        // From the first sample of the team on, also for an agent that starts again.
        agent.faults = on_links.map(|faults| FaultsSection {
            plan: Path::new("../..").join(FAULTS),
            seed: faults.seed,
            origin_s: Some(span.0.seconds()),
        });
        agent.model = agent.model.map(|_| Path::new("../..").join(setup::MODEL));
        let endpoint = endpoints.get(robot).context("an endpoint for every robot")?;
        agent.team.clone_from(&name);
        agent.bus = BusSection {
            listen: vec![endpoint.listen.clone()],
            connect: endpoint.connect.clone(),
            ..agent.bus
        };
        let folder = folder::agent(out, *robot);
        std::fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
        agent.output.directory = Some(folder.clone());
        let path = folder.join("agent.toml");
        let text = toml::to_string(&agent).context("writing an agent's configuration")?;
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        entries.push(AgentEntry { robot: robot.0, config: path, log: Some(folder.join("agent.log")) });
    }
    let input = feeder_input(team, out, &options.feeder)?;
    let connect: Vec<String> = endpoints.values().map(|endpoint| endpoint.listen.clone()).collect();
    let config = CoordinatorConfig {
        team: name.clone(),
        executable: Some(executable()?),
        restart: if options.restart { Restart::OnFailure } else { Restart::Never },
        detached: false,
        status_period_s: 0.1,
        shutdown_timeout_s: ENDED_WITHIN.as_secs_f64(),
        record: None,
        backoff: pleiad_coordinator::Backoff::default(),
        bus: pleiad_coordinator::BusSection { connect: connect.clone(), ..Default::default() },
        agents: entries,
    };
    let befallen = runtime()?.block_on(async {
        let bus = Arc::new(ZenohBus::open(&config.bus.zenoh()).await?);
        let run =
            Conduct { config: &config, bus: &bus, input: &input, options, connect: &connect, span, out };
        let outcome = run.to_the_end().await;
        bus.close().await;
        outcome
    })?;
    let mut result = collect(team, out, began)?;
    // Only facts can be followed from one journal to another.
    if let Some(faults) = options.faults.as_ref().filter(|_| result.ledger.is_some()) {
        let partitions = survived::partitions(&faults.plan);
        result.survived = Some(survived(team, out, befallen, &result, partitions)?);
    }
    Ok(result)
}

fn executable() -> anyhow::Result<PathBuf> {
    std::env::current_exe().context("cannot find this program's own file, which the agents run")
}

/// What the feeding process is told to read.
fn feeder_input(team: &Team, out: &Path, feeder: &Feeder) -> anyhow::Result<Vec<String>> {
    Ok(match feeder {
        Feeder::Scenario { path, seed } => {
            vec![path.display().to_string(), "--seed".to_owned(), seed.to_string()]
        }
        Feeder::Samples => {
            let folder = out.join("fed");
            write_folder(&with_samples(&team.recording, &team.samples), &folder, Overwrite::Refuse)?;
            vec![folder.display().to_string()]
        }
    })
}

/// The recording with these samples in place of its own; truth, commands and map stay.
pub fn with_samples(recording: &Recording, samples: &BTreeMap<RobotId, Vec<Sample>>) -> Recording {
    let mut replaced = recording.clone();
    replaced.robots.retain(|robot, _| samples.get(robot).is_some_and(|samples| !samples.is_empty()));
    for (robot, channels) in &mut replaced.robots {
        let commands = std::mem::take(&mut channels.commands);
        let truth = std::mem::take(&mut channels.truth);
        *channels = RobotRecording { commands, truth, ..RobotRecording::default() };
        for sample in samples.get(robot).into_iter().flatten() {
            channels.push(*sample);
        }
    }
    replaced
}

/// What the agents left in their folders.
fn collect(team: &Team, out: &Path, began: Instant) -> anyhow::Result<RunResult> {
    let wall_s = began.elapsed().as_secs_f64();
    let mut robots = BTreeMap::new();
    let mut ledger: Option<Ledger> = None;
    let mut notes = team.notes.clone();
    let mut received = BTreeMap::new();
    for (robot, agent) in &team.agents {
        let folder = folder::agent(out, *robot);
        let records = Journal::read(&folder.join(driver::JOURNAL))?;
        let summary: AgentSummary = results::read_summary(&folder)?;
        let samples = records.iter().filter_map(|record| match record {
            Record::Sample(sample) => Some(*sample),
            _ => None,
        });
        let mut samples: Vec<Sample> = samples.collect();
        samples.sort_by_key(|sample| sample.time);
        received.insert(*robot, samples);
        // What the agent wrote down, taken again here, must give the bits it announced.
        let (again, own) = estimate_of(&agent.node()?, records);
        if again != summary.estimate {
            bail!(
                "robot {robot}: the agent ended with estimate {}, its journal gives {again}",
                summary.estimate
            );
        }
        notes.extend(refusals(*robot, &summary));
        let settled = results::read_estimates(&folder.join(results::SETTLED))?;
        let online = results::read_estimates(&folder.join(results::ONLINE))?;
        ledger = ledger.or(own);
        robots.insert(*robot, RobotResult { settled, online, summary });
    }
    let recording = out.join("recording");
    write_folder(&with_samples(&team.recording, &received), &recording, Overwrite::Refuse)?;
    setup::write_beside(&team.agents, &recording)?;
    let processes = robots.len();
    Ok(RunResult { robots, ledger, notes, wall_s, processes, survived: None })
}

/// Hash of the estimate that a journal gives, and the facts it holds where the strategy keeps any. The facts are
/// folded by themselves, apart from the node that wrote them. A run keeps all its facts, so that there is nothing
/// closed in its journals.
fn estimate_of(config: &NodeConfig, records: Vec<Record>) -> (String, Option<Ledger>) {
    if let Some(mut robot) = Approximate::recover(config.strategy, config.clone(), records.iter().cloned()) {
        // As the agent did: what waited for odometry waits no longer.
        let _ = robot.handle(Event::InputEnded);
        return (robot.fingerprint().to_string(), None);
    }
    let mut ledger = Ledger::new(config.fold);
    for record in records {
        if let Record::Entry(entry) = record {
            ledger.insert(entry);
        }
    }
    (ledger.fingerprint().to_string(), Some(ledger))
}

/// What an agent did not take of its samples.
fn refusals(robot: RobotId, summary: &AgentSummary) -> Vec<String> {
    let told =
        |(reason, count): (&String, &u64)| format!("robot {robot}: {count} samples refused ({reason})");
    summary.samples_refused.iter().map(told).collect()
}

//! The driver: connects a robot ([`Role`]) to a bus, a clock and a journal on disk. Everything an agent process
//! does besides thinking is here.

mod asking;
mod inbox;
mod publisher;

use std::collections::BTreeSet;
use std::future::Future;
use std::path::PathBuf;
use std::time::Duration;

use pleiad_bus::{Bus, BusError, Incoming, Query};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Entry;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{Message, SensorAck, SnapshotPart, TeamName};
use publisher::Publisher;
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;

use crate::config::{AgentConfig, ConfigError, NodeConfig};
use crate::journal::{self, Journal, JournalError};
use crate::node::{Command, Event, Notice, Record};
use crate::results::{self, ResultsError, Trajectories};
use crate::role::Role;

/// Why an agent ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriverError {
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The journal cannot be read or written: nothing may be published without it.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The results could not be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The journal is of another strategy.
    #[error(
        "{path}: found the journal of a robot of strategy {found}, expected that of {expected}; move it away to start anew, or set the strategy back"
    )]
    OtherStrategy {
        /// Which file.
        path: PathBuf,
        /// What it holds.
        found: &'static str,
        /// What is configured.
        expected: StrategyKind,
    },
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The bus closed a channel that an agent cannot do without.
    #[error("the bus closed the channel of {what}")]
    Closed {
        /// Which.
        what: &'static str,
    },
}

/// A journal is not replaced for less than this many bytes of it that are closed.
const SMALLEST_COMPACTION_BYTES: u64 = 1 << 20;

/// File name of the journal in the agent's folder.
pub const JOURNAL: &str = "journal.bin";

/// An agent's process, apart from its bus.
struct Agent<'a, B: Bus> {
    role: Role,
    journal: Option<Journal>,
    folder: Option<PathBuf>,
    publisher: Publisher<'a, B>,
    bus: &'a B,
    team: TeamName,
    /// What is written of its estimates as it goes; `None` without a folder.
    trajectories: Option<Trajectories>,
    /// The last batch and its acknowledgement: a batch sent again is answered again, and taken once.
    last_batch: Option<(Vec<u8>, SensorAck)>,
    /// Peers with an unanswered request.
    asked: BTreeSet<RobotId>,
    answers: mpsc::Sender<(RobotId, Option<Vec<Entry>>)>,
    /// Peers with an unanswered request for a snapshot.
    asked_snapshot: BTreeSet<RobotId>,
    parts: mpsc::Sender<(RobotId, Option<SnapshotPart>)>,
    /// Size of the journal after it was replaced last.
    compacted_bytes: u64,
    misattributed: u64,
}

/// The channels an agent listens to.
struct Inputs {
    facts: mpsc::Receiver<Incoming>,
    statuses: mpsc::Receiver<Incoming>,
    said: mpsc::Receiver<Incoming>,
    samples: mpsc::Receiver<Incoming>,
    batches: mpsc::Receiver<Query>,
    requests: mpsc::Receiver<Query>,
    control: mpsc::Receiver<Query>,
    answers: mpsc::Receiver<(RobotId, Option<Vec<Entry>>)>,
    parts: mpsc::Receiver<(RobotId, Option<SnapshotPart>)>,
}

/// Runs an agent until it is told to shut down, by its control key or by `stop`. Its results are written
/// then.
///
/// # Errors
/// [`DriverError`].
pub async fn run<B: Bus + Clone>(
    config: &AgentConfig,
    bus: &B,
    nonce: u64,
    stop: impl Future<Output = ()> + Send,
) -> Result<(), DriverError> {
    let node_config = config.node()?;
    let team = config.team()?;
    let robot = node_config.robot;
    for remark in node_config.correction.iter().flat_map(|correction| &correction.remarks) {
        tracing::warn!(robot = robot.0, %remark, "model");
    }
    let folder = config.output.directory.clone();
    let (journal, records) = open_journal(folder.as_ref())?;
    check_records(&node_config, folder.as_ref(), &records)?;
    let trajectories =
        folder.as_ref().map(|folder| Trajectories::open(folder, records.is_empty())).transpose()?;
    let role = Role::recover(node_config, nonce, records);
    let fresh = role.may_have_lived();
    let (answers_in, answers) = mpsc::channel(64);
    let (parts_in, parts) = mpsc::channel(8);
    let mut agent = Agent {
        role,
        journal,
        folder,
        publisher: Publisher::new(bus, team.clone(), robot),
        bus,
        team,
        trajectories,
        last_batch: None,
        asked: BTreeSet::new(),
        answers: answers_in,
        asked_snapshot: BTreeSet::new(),
        parts: parts_in,
        compacted_bytes: 0,
        misattributed: 0,
    };
    if fresh {
        agent.ask_for_former_life().await?;
    }
    let inputs = agent.listen(answers, parts).await?;
    let _token = bus.announce(&keys::of(&agent.team, robot, Kind::Alive)).await?;
    tracing::info!(robot = robot.0, fresh, "agent is up");
    let period = Duration::from_secs_f64(config.bus.status_period_s);
    let sync = Duration::from_secs_f64(config.output.fsync_period_s.max(0.001));
    let outcome = agent.serve(inputs, period, sync, stop).await;
    // Whatever ended it, what it knows is worth keeping.
    let written = agent.finish();
    outcome.and(written)
}

fn open_journal(folder: Option<&PathBuf>) -> Result<(Option<Journal>, Vec<Record>), DriverError> {
    let Some(folder) = folder else { return Ok((None, Vec::new())) };
    let (journal, found) = Journal::open(&folder.join(JOURNAL))?;
    if found.torn_bytes > 0 {
        tracing::warn!(bytes = found.torn_bytes, "the journal's last frame was cut off and is dropped");
    }
    Ok((Some(journal), found.records))
}

/// The exact strategy's journal always has entries, that of another strategy never.
fn check_records(
    config: &NodeConfig,
    folder: Option<&PathBuf>,
    records: &[Record],
) -> Result<(), DriverError> {
    let exact = config.strategy == StrategyKind::Exact;
    let found = records.iter().find_map(|record| match record {
        Record::Entry(_)
        | Record::Tick { .. }
        | Record::Closed(_)
        | Record::Checkpoint(_)
        | Record::Earlier(_)
            if !exact =>
        {
            Some("exact")
        }
        Record::Said(..) if exact => Some("pairwise, intersection, split_intersection or naive"),
        _ => None,
    });
    match (found, folder) {
        (Some(found), Some(folder)) => {
            Err(DriverError::OtherStrategy { path: folder.join(JOURNAL), found, expected: config.strategy })
        }
        _ => Ok(()),
    }
}

impl<B: Bus + Clone> Agent<'_, B> {
    fn key(&self, kind: Kind) -> String {
        keys::of(&self.team, self.role.robot(), kind)
    }

    async fn listen(
        &self,
        answers: mpsc::Receiver<(RobotId, Option<Vec<Entry>>)>,
        parts: mpsc::Receiver<(RobotId, Option<SnapshotPart>)>,
    ) -> Result<Inputs, DriverError> {
        Ok(Inputs {
            facts: self.bus.subscribe(&keys::all(&self.team, Kind::Fact)).await?,
            statuses: self.bus.subscribe(&keys::all(&self.team, Kind::Status)).await?,
            said: self
                .bus
                .subscribe(&keys::all(&self.team, Kind::Strategy { to: self.role.robot() }))
                .await?,
            samples: self.bus.subscribe(&keys::sensors(&self.team, self.role.robot())).await?,
            batches: self.bus.serve(&self.key(Kind::SensorBatch)).await?,
            requests: self.bus.serve(&self.key(Kind::Facts)).await?,
            control: self.bus.serve(&self.key(Kind::Control)).await?,
            answers,
            parts,
        })
    }

    async fn serve(
        &mut self,
        mut inputs: Inputs,
        period: Duration,
        sync: Duration,
        stop: impl Future<Output = ()> + Send,
    ) -> Result<(), DriverError> {
        let mut status_due = tokio::time::interval(period);
        let mut sync_due = tokio::time::interval(sync);
        for interval in [&mut status_due, &mut sync_due] {
            interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        }
        tokio::pin!(stop);
        loop {
            // Facts before samples: an estimate rests on what has already arrived.
            tokio::select! {
                biased;
                () = &mut stop => return Ok(()),
                query = inputs.control.recv() => {
                    if self.control(query.ok_or(DriverError::Closed { what: "control" })?).await? {
                        return Ok(());
                    }
                }
                incoming = inputs.facts.recv() => {
                    self.fact(incoming.ok_or(DriverError::Closed { what: "facts" })?).await?;
                }
                incoming = inputs.said.recv() => {
                    self.said(incoming.ok_or(DriverError::Closed { what: "strategy" })?).await?;
                }
                Some((peer, entries)) = inputs.answers.recv() => {
                    self.asked.remove(&peer);
                    if let Some(entries) = entries {
                        self.act(Event::Entries(entries)).await?;
                    }
                }
                Some((peer, part)) = inputs.parts.recv() => {
                    self.asked_snapshot.remove(&peer);
                    if let Some(part) = part {
                        self.act(Event::SnapshotPart(peer, part)).await?;
                    }
                }
                query = inputs.requests.recv() => {
                    self.request(query.ok_or(DriverError::Closed { what: "requests" })?);
                }
                incoming = inputs.statuses.recv() => {
                    self.status(incoming.ok_or(DriverError::Closed { what: "statuses" })?).await?;
                }
                incoming = inputs.samples.recv() => {
                    self.single_sample(incoming.ok_or(DriverError::Closed { what: "samples" })?).await?;
                }
                query = inputs.batches.recv() => {
                    self.batch(query.ok_or(DriverError::Closed { what: "batches" })?).await?;
                }
                _ = status_due.tick() => {
                    let status = self.role.status();
                    self.publisher.publish(Kind::Status, &Message::Status(status)).await;
                }
                _ = sync_due.tick() => {
                    if let Some(journal) = &mut self.journal {
                        journal.sync()?;
                    }
                }
            }
        }
    }

    /// Handles an event and does what follows from it.
    async fn act(&mut self, event: Event) -> Result<(), DriverError> {
        let commands = self.role.handle(event);
        self.execute(commands).await
    }

    async fn execute(&mut self, commands: Vec<Command>) -> Result<(), DriverError> {
        let robot = self.role.robot();
        for command in commands {
            match command {
                Command::Journal(records) => {
                    if let Some(journal) = &mut self.journal {
                        journal.append(&records)?;
                        if journal::must_sync(&records, robot) {
                            journal.sync()?;
                        }
                    }
                }
                Command::Closed { cut, settled, .. } => {
                    tracing::debug!(cut = cut.0, "the past is closed");
                    if let Some(trajectories) = &mut self.trajectories {
                        trajectories.closed(&settled)?;
                    }
                    self.compact()?;
                }
                Command::AskSnapshot { peer, request } => self.ask_snapshot(peer, request),
                Command::Publish(entries) => self.publisher.entries(&entries).await,
                Command::Estimate(estimate) => {
                    if let Some(trajectories) = &mut self.trajectories {
                        trajectories.online(&results::online(&estimate))?;
                    }
                    self.publisher.publish(Kind::Estimate, &Message::Estimate(estimate)).await;
                }
                Command::Ask { peer, request } => self.ask(peer, request),
                Command::Notice(notice) => report(&notice),
                Command::Say { to: Some(to), message } => {
                    self.publisher.publish(Kind::Strategy { to }, &Message::Strategy(message)).await;
                }
                // Only `factored` speaks to everybody, which a configuration cannot choose.
                Command::Say { to: None, .. } => {}
            }
        }
        Ok(())
    }

    /// Replaces the journal once most of it is closed: its size stays within twice of what is needed.
    fn compact(&mut self) -> Result<(), DriverError> {
        let Some(journal) = &mut self.journal else { return Ok(()) };
        if journal.bytes() > 2 * self.compacted_bytes + SMALLEST_COMPACTION_BYTES {
            journal.replace(&self.role.compacted())?;
            self.compacted_bytes = journal.bytes();
        }
        Ok(())
    }

    /// Puts the journal on the disk and writes the results.
    fn finish(&mut self) -> Result<(), DriverError> {
        if let Some(journal) = &mut self.journal {
            journal.sync()?;
        }
        if let (Some(folder), Some(trajectories)) = (&self.folder, &self.trajectories) {
            let (messages, bytes) = self.publisher.sent();
            trajectories.finish(&self.role.settled())?;
            results::write_summary(folder, &self.role.summary(messages, bytes))?;
        }
        Ok(())
    }
}

/// A notice in the log, at the level of its audience.
fn report(notice: &Notice) {
    match notice {
        Notice::Equivocation { .. }
        | Notice::Fork { .. }
        | Notice::OwnLogAhead { .. }
        | Notice::Superseded { .. }
        | Notice::SnapshotDisagreement { .. } => {
            tracing::error!(%notice, "the team contradicts itself");
        }
        Notice::OdometryGap { .. } | Notice::SnapshotTaken { .. } => tracing::info!(%notice, "recovery"),
        _ => tracing::warn!(%notice, "degraded"),
    }
}

//! One schedule from beginning to end.

mod agreement;
mod processes;
mod working;

use std::collections::BTreeMap;

use pleiad_agent::{Command, Event, Node, NodeConfig, Notice, Record, journal};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::{Message, limits};

use super::Options;
use super::chance::Chance;
use super::check::{Checks, Violation};
use super::disk::Disk;
use super::network::{Network, Weather};
use super::plan::{Blow, Plan};
use super::team::{TICK_S, World, config};

pub use working::{Hour, operate};

/// Between two statuses of a node, s.
const STATUS_S: f64 = 1.0;
/// Between two syncs of a journal, s.
const SYNC_S: f64 = 0.2;
/// How long the team goes on after everything has healed, s.
const HEALED_S: f64 = 15.0;
/// Statuses within which a healed team must agree.
const ROUNDS: u32 = 60;
/// Records after which a journal is replaced when the past has been closed.
const MOST_RECORDS: usize = 200;

/// What a schedule came to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Robots of the team.
    pub robots: u32,
    /// Virtual time, s.
    pub seconds: f64,
    /// Messages sent.
    pub messages: u64,
    /// Facts used in the end.
    pub facts: usize,
    /// Processes that died.
    pub deaths: u64,
    /// Cuts closed, by all robots together.
    pub cuts: u64,
    /// Snapshots taken over from peers.
    pub taken_over: u64,
    /// Evictions a robot learned of.
    pub evictions: u64,
    /// Most entries, facts and answers a node kept at a time.
    pub most_kept: usize,
    /// Most records in a journal.
    pub most_records: usize,
    /// Facts that were lost beyond a cut, and counted.
    pub expired: usize,
}

struct Robot {
    config: NodeConfig,
    node: Option<Node>,
    disk: Disk,
    /// Dies after so many more commands, and comes back after seconds.
    doomed: Option<(u32, f64)>,
}

#[derive(Clone, Debug)]
enum Due {
    Tick(RobotId),
    Status(RobotId),
    Sync(RobotId),
    Blow(Blow),
    Start(RobotId),
    DiskFree(RobotId),
}

struct Run<'a> {
    #[cfg_attr(not(feature = "planted"), allow(dead_code, reason = "only mistakes are asked of it"))]
    options: &'a Options,
    plan: Plan,
    now: Timestamp,
    network: Network,
    world: World,
    robots: BTreeMap<RobotId, Robot>,
    due: BTreeMap<(Timestamp, u64), Due>,
    count: u64,
    chance: Chance,
    checks: Checks,
    outcome: Outcome,
}

/// Runs the schedule of a seed.
///
/// # Errors
/// The first invariant that did not hold.
pub fn run(seed: u64, options: &Options) -> Result<Outcome, Violation> {
    let mut run = Run::new(seed, Plan::new(seed, options), options);
    run.set_up()?;
    run.live()?;
    run.heal()?;
    run.agree()?;
    Ok(run.finish())
}

impl<'a> Run<'a> {
    /// A team that has not begun.
    fn new(seed: u64, plan: Plan, options: &'a Options) -> Self {
        Self {
            options,
            now: Timestamp(0),
            network: Network::new(Chance::new(seed, 3), plan.weather),
            world: World::new(seed, plan.robots),
            robots: BTreeMap::new(),
            due: BTreeMap::new(),
            count: 0,
            chance: Chance::new(seed, 4),
            checks: Checks::new(plan.robots).keeping(plan.most_allowed()),
            outcome: Outcome { robots: plan.robots, ..Outcome::default() },
            plan,
        }
    }

    fn set_up(&mut self) -> Result<(), Violation> {
        for number in 1..=self.plan.robots {
            let robot = RobotId(number);
            let config = config(&self.plan, number, &self.world.place(robot))
                .map_err(|problem| self.checks.violation(Some(robot), problem))?;
            self.robots.insert(robot, Robot { config, node: None, disk: Disk::default(), doomed: None });
            self.start(robot)?;
            let phase = 0.01 * f64::from(number);
            self.at(phase, Due::Tick(robot));
            self.at(0.5 + phase, Due::Status(robot));
            self.at(SYNC_S + phase, Due::Sync(robot));
        }
        for (time, blow) in std::mem::take(&mut self.plan.blows) {
            self.at(time, Due::Blow(blow.clone()));
            self.plan.blows.push((time, blow));
        }
        Ok(())
    }

    fn at(&mut self, time_s: f64, due: Due) {
        self.count += 1;
        self.due.insert((Timestamp::from_seconds(time_s), self.count), due);
    }

    fn after(&mut self, seconds: f64, due: Due) {
        self.count += 1;
        self.due.insert((self.now.plus_seconds(seconds), self.count), due);
    }

    fn live(&mut self) -> Result<(), Violation> {
        self.until(Timestamp::from_seconds(self.plan.seconds))
    }

    /// Everything due up to `end`, in the order of time.
    fn until(&mut self, end: Timestamp) -> Result<(), Violation> {
        loop {
            let message = self.network.next_due();
            let other = self.due.first_key_value().map(|((time, _), _)| *time);
            let Some(next) = message.into_iter().chain(other).min().filter(|next| *next <= end) else {
                self.now = end;
                return Ok(());
            };
            self.now = self.now.max(next);
            self.checks.now = self.now;
            if message == Some(next) {
                self.deliver()?;
            } else if let Some((_, due)) = self.due.pop_first() {
                self.happen(due)?;
            }
        }
    }

    fn happen(&mut self, due: Due) -> Result<(), Violation> {
        match due {
            Due::Tick(robot) => {
                for sample in self.world.tick(robot, self.now) {
                    self.act(robot, Event::Sample(sample))?;
                }
                self.after(TICK_S, Due::Tick(robot));
            }
            Due::Status(robot) => {
                self.tell(robot)?;
                self.after(STATUS_S, Due::Status(robot));
            }
            Due::Sync(robot) => {
                if let Some(robot) = self.robots.get_mut(&robot) {
                    robot.disk.sync();
                }
                self.after(SYNC_S, Due::Sync(robot));
            }
            Due::Start(robot) => self.start(robot)?,
            Due::DiskFree(robot) => {
                if let Some(robot) = self.robots.get_mut(&robot) {
                    robot.disk.full = false;
                }
            }
            Due::Blow(blow) => self.strike(blow)?,
        }
        Ok(())
    }

    /// A node tells the others what it holds; what it holds is checked.
    fn tell(&mut self, id: RobotId) -> Result<(), Violation> {
        let Some(node) = self.robots.get_mut(&id).and_then(|robot| robot.node.as_mut()) else {
            return Ok(());
        };
        self.checks.node(node)?;
        let status = Message::Status(node.status());
        self.broadcast(id, &status);
        Ok(())
    }

    fn broadcast(&mut self, from: RobotId, message: &Message) {
        for to in self.robots.keys().filter(|to| **to != from) {
            self.network.send(self.now, from, *to, message);
        }
    }

    fn deliver(&mut self) -> Result<(), Violation> {
        let Some(delivery) = self.network.take() else { return Ok(()) };
        let (from, to) = (delivery.from, delivery.to);
        let node = self.robots.get_mut(&to).and_then(|robot| robot.node.as_mut());
        let Some(node) = node else { return Ok(()) };
        match delivery.message {
            Message::Entries(entries) => self.act(to, Event::Entries(entries)),
            Message::Status(status) => self.act(to, Event::Status(status)),
            Message::SnapshotPart(part) => self.act(to, Event::SnapshotPart(from, part)),
            Message::FactsRequest(request) => {
                let reply = Message::Entries(node.serve(&request, limits::ENTRIES));
                self.network.send(self.now, to, from, &reply);
                Ok(())
            }
            Message::SnapshotRequest(request) => {
                if let Some(part) = node.serve_snapshot(&request) {
                    self.network.send(self.now, to, from, &Message::SnapshotPart(part));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Hands an event to a node and does what follows, as far as its process lives.
    fn act(&mut self, id: RobotId, event: Event) -> Result<(), Violation> {
        let Some(node) = self.robots.get_mut(&id).and_then(|robot| robot.node.as_mut()) else {
            return Ok(());
        };
        let commands = node.handle(event);
        // He knows it from now on, even if he dies before he has said it.
        if commands.iter().any(|command| matches!(command, Command::Notice(Notice::Evicted { .. }))) {
            self.checks.damages(id);
        }
        for command in commands {
            if let Some(robot) = self.robots.get_mut(&id)
                && let Some((commands, back_s)) = robot.doomed
            {
                if commands == 0 {
                    self.die(id, back_s);
                    return Ok(());
                }
                robot.doomed = Some((commands - 1, back_s));
            }
            if !self.execute(id, command)? {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Does what a node wants; `false` if its process has ended over it.
    fn execute(&mut self, id: RobotId, command: Command) -> Result<bool, Violation> {
        match command {
            Command::Journal(records) => {
                let sync = journal::must_sync(&records, id);
                let Some(robot) = self.robots.get_mut(&id) else { return Ok(false) };
                if !robot.disk.full {
                    for record in &records {
                        if let Record::Entry(entry) = record
                            && entry.id.robot == id
                        {
                            self.checks.says(entry)?;
                        }
                    }
                }
                if !robot.disk.append(records) {
                    self.die(id, 1.0);
                    return Ok(false);
                }
                self.outcome.most_records = self.outcome.most_records.max(robot.disk.records);
                if sync {
                    robot.disk.sync();
                }
            }
            Command::Publish(entries) => {
                for entry in &entries {
                    self.checks.says(entry)?;
                }
                for chunk in entries.chunks(limits::ENTRIES) {
                    self.broadcast(id, &Message::Entries(chunk.to_vec()));
                }
            }
            Command::Ask { peer, request } => {
                self.network.send(self.now, id, peer, &Message::FactsRequest(request));
            }
            Command::AskSnapshot { peer, request } => {
                self.network.send(self.now, id, peer, &Message::SnapshotRequest(request));
            }
            Command::Closed { cut, hash, .. } => {
                let Some(robot) = self.robots.get_mut(&id) else { return Ok(false) };
                let Some(node) = &robot.node else { return Ok(false) };
                self.checks.closes(id, cut, hash);
                if robot.disk.records > MOST_RECORDS {
                    robot.disk.replace(node.compacted());
                }
            }
            // A node is of the exact strategy.
            Command::Estimate(_) | Command::Say { .. } => {}
            Command::Notice(notice) => self.notice(id, &notice)?,
        }
        Ok(true)
    }

    fn notice(&mut self, id: RobotId, notice: &Notice) -> Result<(), Violation> {
        match notice {
            Notice::Evicted { .. } => {
                self.outcome.evictions += 1;
            }
            Notice::SnapshotTaken { .. } => {
                self.outcome.taken_over += 1;
            }
            Notice::Equivocation { .. }
            | Notice::Fork { .. }
            | Notice::OwnLogAhead { .. }
            | Notice::Superseded { .. }
            | Notice::SnapshotRefused { .. }
            | Notice::SnapshotDisagreement { .. }
            | Notice::OtherConfiguration { .. } => {
                return Err(self.checks.violation(Some(id), notice.to_string()));
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(self) -> Outcome {
        Outcome {
            seconds: self.now.seconds(),
            messages: self.network.sent(),
            cuts: self.checks.cuts,
            most_kept: self.checks.most_kept,
            ..self.outcome
        }
    }
}

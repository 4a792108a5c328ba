//! The node: one robot's part of the team's filter as a pure state machine. Events in, commands out; no
//! clock, no file, no network.

mod boots;
mod closing;
mod commands;
mod corrector;
mod intake;
mod joining;
mod reckoning;
mod recovery;
mod segments;
mod transfer;
mod views;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

pub use commands::{Command, Event, Notice, Record, Standing};
pub use views::SettledEstimate;

use closing::Membership;
use corrector::Corrector;
use pleiad_estimation::fact::{
    Answer, Body, Entry, EntryId, Half, LogId, NoiseRef, Observation, Quantity, VoidReason,
    extension_of_state,
};
use pleiad_estimation::ledger::{Insertion, Ledger, Refusal};
use pleiad_estimation::motion::DeadReckoning;
use pleiad_estimation::nominal::Outside;
use pleiad_estimation::sample::{Reading, Sample, SampleRefusal, Tally, Target};
use pleiad_estimation::{BootIndex, RobotId, Sequence, Timestamp};
use pleiad_protocol::{FactsRequest, LogRange, Status};
use segments::Segments;

use crate::config::{NodeConfig, SensorsSection};

/// An observation stamped further ahead of the seen robot's odometry than this has a wrong clock, s.
const LARGEST_CLOCK_ERROR_S: f64 = 2.0;
/// Own observations that may wait for odometry to reach them.
const MOST_WAITING: usize = 4096;

/// One robot's part of the team's filter.
#[derive(Debug)]
pub struct Node {
    config: NodeConfig,
    ledger: Ledger,
    dead_reckoning: DeadReckoning,
    /// Takes out of readings what a model knows of them; absent without a model.
    corrector: Option<Corrector>,
    /// Nominal trajectories of this robot's boots, the last one current once `booted`.
    segments: Segments,
    /// Random for this start of the process; each boot's nonce derives from it.
    nonce: u64,
    /// The boot of this start: none before the first odometry.
    boot: Option<BootIndex>,
    /// Own observations stamped after the last odometry, by time.
    waiting: VecDeque<Sample>,
    next_estimate: Option<i64>,
    counts: Tally,
    input_ended: bool,
    /// The highest boot of this robot that anyone is known to hold a log of.
    known_boot: Option<BootIndex>,
    /// Logs written under another configuration: known not to be of use, and not asked for.
    foreign: BTreeSet<LogId>,
    /// Dead reckoning has gone on without a gap since the last boot began in this process.
    lived: bool,
    /// The boot before the current one, if its trajectory was only begun anew elsewhere: observations of its
    /// time still go into its log.
    rebased: Option<BootIndex>,
    first_odometry: Option<Timestamp>,
    /// Boots that began in this process: of their logs nothing can have been lost.
    lived_boots: BTreeSet<BootIndex>,
    /// Another agent runs as this robot.
    superseded: bool,
    membership: Membership,
    /// Robots of which entries were refused because of the membership, and were told so.
    outsiders: BTreeSet<RobotId>,
    /// How far robots are believed that are not believed in everything, as told last.
    standings: BTreeMap<RobotId, Standing>,
    #[cfg(feature = "planted")]
    planted: Option<pleiad_estimation::ledger::Planted>,
    /// Filled while an event is handled.
    out: Outbox,
}

/// What one event leads to, in the order in which it must happen: journal first.
#[derive(Debug, Default)]
struct Outbox {
    records: Vec<Record>,
    entries: Vec<Entry>,
    rest: Vec<Command>,
}

impl Node {
    /// A node that has seen nothing. `nonce` is random and new for every start of the process.
    pub fn new(config: NodeConfig, nonce: u64) -> Self {
        Self {
            ledger: Self::empty_ledger(&config),
            dead_reckoning: DeadReckoning::new(config.motion),
            corrector: config
                .correction
                .as_ref()
                .map(|correction| Corrector::new(config.robot, correction, config.fold)),
            segments: Segments::new(config.calibration.is_some()),
            config,
            nonce,
            boot: None,
            waiting: VecDeque::new(),
            next_estimate: None,
            counts: Tally::default(),
            input_ended: false,
            known_boot: None,
            foreign: BTreeSet::new(),
            lived: false,
            rebased: None,
            first_odometry: None,
            lived_boots: BTreeSet::new(),
            superseded: false,
            membership: Membership::default(),
            outsiders: BTreeSet::new(),
            standings: BTreeMap::new(),
            #[cfg(feature = "planted")]
            planted: None,
            out: Outbox::default(),
        }
    }

    /// Handles one event. The commands are to be carried out in their order; a `Journal` is to be on its
    /// way to the disk before the `Publish` after it.
    pub fn handle(&mut self, event: Event) -> Vec<Command> {
        match event {
            Event::Sample(sample) => self.sample(sample),
            Event::Entries(entries) => self.entries(entries),
            Event::Status(status) => self.peer_status(&status),
            Event::InputEnded => self.end_input(),
            Event::SnapshotPart(peer, part) => self.snapshot_part(peer, &part),
            Event::Evict(robot) => self.evict(robot),
            // Of an approximate strategy: nothing that a node could use.
            Event::Said(..) => {}
        }
        self.carry_on_at_the_end();
        self.advance();
        let Outbox { records, entries, rest } = std::mem::take(&mut self.out);
        let mut commands = Vec::with_capacity(rest.len() + 2);
        #[cfg(feature = "planted")]
        if self.planted == Some(pleiad_estimation::ledger::Planted::PublishFirst) {
            commands.push(Command::Publish(entries));
            commands.push(Command::Journal(records));
            commands.extend(rest);
            return commands;
        }
        if !records.is_empty() {
            commands.push(Command::Journal(records));
        }
        if !entries.is_empty() {
            commands.push(Command::Publish(entries));
        }
        commands.extend(rest);
        commands
    }

    /// Whether this robot has moved in a life that its journal tells of. If not, peers may know more of its
    /// boots than it does, and are to be asked before the first odometry.
    pub fn has_lived(&self) -> bool {
        self.segments.last().is_some()
    }

    /// Makes a mistake from now on.
    #[cfg(feature = "planted")]
    pub fn plant(&mut self, planted: pleiad_estimation::ledger::Planted) {
        self.planted = Some(planted);
        self.ledger.plant(planted);
    }

    /// This robot.
    pub fn robot(&self) -> RobotId {
        self.config.robot
    }

    /// The configuration.
    pub fn config(&self) -> &NodeConfig {
        &self.config
    }

    /// All facts held.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The entries a peer asked for, at most `most`.
    pub fn serve(&self, request: &FactsRequest, most: usize) -> Vec<Entry> {
        let mut entries = Vec::new();
        for range in &request.ranges {
            let wanted = usize::try_from(range.to.saturating_sub(range.from)).unwrap_or(usize::MAX);
            let held = self.ledger.entries(range.log, range.from);
            let room = most.saturating_sub(entries.len());
            entries.extend(held.iter().take(wanted.min(room)).cloned());
        }
        entries
    }

    fn entries(&mut self, entries: Vec<Entry>) {
        let mut added = false;
        for entry in entries {
            let id = entry.id;
            if self.foreign.contains(&id.log()) || (id.robot == self.config.robot && !self.take_own(id)) {
                continue;
            }
            let trusted = !self.ledger.quarantined().contains(&id.robot);
            match self.ledger.insert(entry.clone()) {
                Insertion::Added { .. } => {
                    added = true;
                    self.hear_vote(&entry);
                    self.out.records.push(Record::Entry(entry));
                }
                Insertion::Waiting => {
                    self.out.records.push(Record::Entry(entry));
                    self.ask_for_gap(id);
                }
                Insertion::Duplicate => {}
                // A robot that does not know yet that its time is closed, or that it was evicted, says much.
                Insertion::Refused(Refusal::Expired | Refusal::NotAMember)
                    if !self.outsiders.insert(id.robot) => {}
                Insertion::Refused(refusal) => {
                    if refusal == Refusal::Configuration {
                        self.foreign.insert(id.log());
                    }
                    self.notice(Notice::EntryRefused { id, refusal });
                }
                Insertion::Equivocation => {
                    // A contradiction is knowledge too: after a restart it must lead to the same ledger.
                    let counts = self.ledger.entries(id.log(), id.sequence.0).first() == Some(&entry);
                    if trusted || counts {
                        self.out.records.push(Record::Entry(entry));
                    }
                    self.notice(Notice::Equivocation { id });
                }
            }
        }
        if added {
            // Whoever has just learned that he was evicted says nothing any more.
            self.check_membership();
            self.answer();
        }
    }

    /// Own entries come back from peers after a journal was lost; those of the current boot can only be
    /// copies of what is held.
    fn take_own(&mut self, id: EntryId) -> bool {
        if self.is_superseded_by(id) {
            return false;
        }
        if self.boot == Some(id.boot) {
            if self.ledger.log(id.log()).is_none_or(|log| log.held() <= id.sequence.0) {
                self.notice(Notice::OwnLogAhead { id });
            }
            return false;
        }
        self.known_boot = self.known_boot.max(Some(id.boot));
        true
    }

    fn ask_for_gap(&mut self, id: EntryId) {
        let from = self.ledger.log(id.log()).map_or(0, pleiad_estimation::ledger::Log::held);
        let range = LogRange { log: id.log(), from, to: id.sequence.0 };
        self.out.rest.push(Command::Ask { peer: id.robot, request: FactsRequest { ranges: vec![range] } });
    }

    fn peer_status(&mut self, status: &Status) {
        if status.robot == self.config.robot {
            return;
        }
        if status.configuration != self.ledger.configuration() {
            let (theirs, ours) = (status.configuration, self.ledger.configuration());
            self.notice(Notice::OtherConfiguration { robot: status.robot, theirs, ours });
            return;
        }
        self.peer_closure(status);
        let held: BTreeMap<LogId, _> = self.ledger.digests().map(|digest| (digest.log, digest)).collect();
        let mut ranges = Vec::new();
        for theirs in &status.logs {
            let LogId { robot, boot } = theirs.log;
            let own = robot == self.config.robot;
            if own {
                self.known_boot = self.known_boot.max(Some(boot));
            }
            let ours = held.get(&theirs.log);
            let from = ours.map_or(0, |ours| ours.held);
            if theirs.held > from {
                let useless =
                    self.foreign.contains(&theirs.log) || self.ledger.quarantined().contains(&robot);
                let next = EntryId { robot, boot, sequence: Sequence(from) };
                if own && self.boot == Some(boot) {
                    let id = EntryId { robot, boot, sequence: Sequence(theirs.held - 1) };
                    self.notice(Notice::OwnLogAhead { id });
                } else if !useless && self.ledger.outside(next).is_none() {
                    ranges.push(LogRange { log: theirs.log, from, to: theirs.held });
                }
            } else if ours.is_some_and(|ours| ours.held == theirs.held && ours.chain != theirs.chain) {
                self.notice(Notice::Fork { log: theirs.log, peer: status.robot });
            }
        }
        if !ranges.is_empty() {
            self.out.rest.push(Command::Ask { peer: status.robot, request: FactsRequest { ranges } });
        }
    }

    fn end_input(&mut self) {
        self.input_ended = true;
        for sample in std::mem::take(&mut self.waiting) {
            self.refuse_waiting(SampleRefusal::AfterLastOdometry { time: sample.time });
        }
        self.answer();
    }

    fn notice(&mut self, notice: Notice) {
        self.out.rest.push(Command::Notice(notice));
    }

    /// Says something in this robot's own log.
    fn say(&mut self, boot: BootIndex, body: Body) {
        // How a state depends on what is calibrated goes beside it.
        let state = match &body {
            Body::Observation(observation) => observation.observer.sensitivity,
            Body::Half(Half { answer: Answer::State { state, .. }, .. }) => state.sensitivity,
            _ => None,
        };
        let odometry = self.config.calibration.is_some_and(|of| of.motion.iter().any(|sigma| *sigma > 0.0));
        let extension = state.map_or_else(Vec::new, |mut sensitivity| {
            if !odometry {
                sensitivity.motion.fill(0.0);
            }
            extension_of_state(&sensitivity)
        });
        self.say_more(boot, body, extension);
    }

    fn say_more(&mut self, boot: BootIndex, body: Body, extension: Vec<u8>) {
        let log = LogId { robot: self.config.robot, boot };
        let sequence = Sequence(self.ledger.log(log).map_or(0, pleiad_estimation::ledger::Log::held));
        let id = EntryId { robot: log.robot, boot, sequence };
        let entry = Entry { id, body, extension };
        // The own log has no gap and no second author: this always extends it.
        self.ledger.insert(entry.clone());
        self.hear(&entry);
        self.out.records.push(Record::Entry(entry.clone()));
        self.out.entries.push(entry);
    }

    /// The corrector learns what this robot says.
    fn hear(&mut self, entry: &Entry) {
        if let Some(corrector) = &mut self.corrector {
            corrector.hear(entry);
        }
    }

    /// Makes a fact of an own observation that the odometry has reached.
    fn observe(&mut self, sample: &Sample) -> Result<(), SampleRefusal> {
        let robot = match sample.reading {
            Reading::Sighting { target: Target::Robot(robot), .. } => Some(robot),
            _ => None,
        };
        self.check_observation(sample.time, robot)?;
        let current = self.boot.ok_or(SampleRefusal::BeforeBoot { time: sample.time })?;
        let state = match self.segments.current(sample.time) {
            Err(Outside::Before) => match self.rebased.and_then(|old| Some((old, self.segments.of(old)?))) {
                Some((old, trajectory)) => trajectory.at(sample.time).map(|state| (old, state)),
                None => Err(Outside::Before),
            },
            state => state.map(|state| (current, state)),
        };
        let (boot, observer) = state.map_err(|outside| match outside {
            Outside::Before => SampleRefusal::BeforeBoot { time: sample.time },
            Outside::Forgotten => SampleRefusal::TooOld { time: sample.time },
            Outside::After => SampleRefusal::AfterLastOdometry { time: sample.time },
        })?;
        let sample = &self.as_nominal(sample, (boot, &observer.nominal))?;
        let (quantity, profile) = self.quantity(sample)?;
        if self.config.sensors.profiles()[usize::from(profile)].is_none() {
            return Err(SampleRefusal::NoNoise { kind: SensorsSection::profile_name(profile) });
        }
        let varying = match &quantity {
            Quantity::Robot { relative, .. }
            | Quantity::Landmark { relative, .. }
            | Quantity::Feature { relative, .. } => self.config.sensors.varying_noise(relative),
            Quantity::Absolute(_) => None,
        };
        let noise = varying.map_or(NoiseRef::Profile(profile), NoiseRef::Explicit);
        self.say(boot, Body::Observation(Observation { time: sample.time, quantity, noise, observer }));
        Ok(())
    }

    /// Answers every observation that names this robot and can be answered now: exactly one answer each.
    fn answer(&mut self) {
        let Some(boot) = self.boot else { return };
        let open: Vec<_> = self.ledger.unanswered(self.config.robot).collect();
        for (observation, time) in open {
            let answer = match self.segments.find(time) {
                Ok((boot, state)) => Answer::State { boot, state },
                Err(VoidReason::Clock) => {
                    let end = self.segments.last().map_or(time, |(_, trajectory)| trajectory.end().0);
                    if self.input_ended {
                        // The odometry will never reach it.
                        Answer::Void(VoidReason::OdometryGap)
                    } else if time.seconds_since(end) > LARGEST_CLOCK_ERROR_S {
                        Answer::Void(VoidReason::Clock)
                    } else {
                        continue;
                    }
                }
                Err(reason) => Answer::Void(reason),
            };
            self.say(boot, Body::Half(Half { observation, answer }));
        }
    }
}

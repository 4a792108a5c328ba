//! A robot of an approximate strategy as its agent runs it: the strategy's state machine, with what an agent
//! keeps around it.
//!
//! A strategy's state follows from its samples and from what it heard, in their order. So these are what its
//! journal holds, and a robot that was killed is, after they have been taken again, the robot it was. What
//! others said to it in between is lost to it, as on a bad link.

use pleiad_estimation::fact::Fingerprint;
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::sample::{Sample, SampleRefusal};
use pleiad_estimation::strategy::{self, Peer, Setup, Strategy, StrategyKind, View};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, RobotId};
use pleiad_protocol::{Estimate, FactCounts, SampleCounts, Status};

use crate::config::NodeConfig;
use crate::node::{Command, Event, Notice, Record, SettledEstimate};
use crate::results;

/// One robot's part in a team of an approximate strategy.
#[derive(Debug)]
pub struct Approximate {
    config: NodeConfig,
    peer: Peer,
    /// The grid of estimate times: the next cell.
    next_estimate: Option<i64>,
    settled: Vec<SettledEstimate>,
}

/// What a robot of an approximate strategy has to know, from the configuration of its agent. A model
/// (`model = ...`) is not applied by these strategies.
fn setup(config: &NodeConfig) -> Setup {
    let [relative_pose, relative_position, range, bearing, range_bearing, position, heading] =
        config.sensors.profiles();
    Setup {
        robot: config.robot,
        motion: config.motion,
        prior: config.prior.map(|prior| (prior.pose, prior.noise)),
        noises: strategy::Noises {
            relative_pose,
            relative_position,
            range,
            bearing,
            range_bearing,
            position,
            heading,
        },
        range_bias_m: config.sensors.range_bias_m,
        landmarks: config.landmarks.clone(),
        gate: config.fold.gate,
        history_samples: config.history_samples,
        longest_gap_s: config.longest_gap_s,
        motion_limits: config.motion_limits,
    }
}

impl Approximate {
    /// A robot that has seen nothing; `None` for [`StrategyKind::Exact`], which is a [`crate::Node`].
    pub fn new(kind: StrategyKind, config: NodeConfig) -> Option<Self> {
        let peer = Peer::new(kind, setup(&config))?;
        let config = NodeConfig { strategy: kind, ..config };
        Some(Self { config, peer, next_estimate: None, settled: Vec::new() })
    }

    /// The robot that a journal tells of. Entries and snapshots, which only the exact strategy keeps, are left
    /// out.
    pub fn recover(
        kind: StrategyKind,
        config: NodeConfig,
        records: impl IntoIterator<Item = Record>,
    ) -> Option<Self> {
        let mut recovered = Self::new(kind, config)?;
        for record in records {
            match record {
                Record::Sample(sample) => {
                    let _ = recovered.peer.sample(sample);
                    let _ = recovered.next_estimate();
                }
                Record::Said(from, message) => {
                    let _ = recovered.peer.handle(strategy::Event::Received { from, message });
                }
                Record::Entry(_)
                | Record::Tick { .. }
                | Record::Closed(_)
                | Record::Checkpoint(_)
                | Record::Earlier(_) => {}
            }
        }
        Some(recovered)
    }

    /// Handles an event; the commands are to be carried out in their order.
    pub fn handle(&mut self, event: Event) -> Vec<Command> {
        match event {
            Event::Sample(sample) => self.sample(sample),
            Event::Said(from, message) => {
                let record = Record::Said(from, message.clone());
                let said = self.peer.handle(strategy::Event::Received { from, message });
                let mut commands = vec![Command::Journal(vec![record])];
                commands.extend(said.into_iter().map(say));
                commands
            }
            Event::InputEnded => self.peer.handle(strategy::Event::InputEnded).into_iter().map(say).collect(),
            // What belongs to the exact strategy.
            Event::Entries(_) | Event::Status(_) | Event::SnapshotPart(..) | Event::Evict(_) => Vec::new(),
        }
    }

    fn sample(&mut self, sample: Sample) -> Vec<Command> {
        let sample = Sample { time: self.config.clock.team_time(sample.time), ..sample };
        let (taken, said) = self.peer.sample(sample);
        let mut commands = match taken {
            Ok(()) => vec![Command::Journal(vec![Record::Sample(sample)])],
            Err(refusal) => self.first_of_its_kind(refusal).into_iter().collect(),
        };
        commands.extend(said.into_iter().map(say));
        commands.extend(self.next_estimate().map(Command::Estimate));
        commands
    }

    fn first_of_its_kind(&self, refusal: SampleRefusal) -> Option<Command> {
        let tally = self.peer.samples();
        let kind = |reason: &str| format!("{refusal:?}").starts_with(reason);
        let first = tally.reasons.iter().any(|(reason, count)| *count == 1 && kind(reason));
        first.then_some(Command::Notice(Notice::SampleRefused(refusal)))
    }

    /// An estimate whenever the odometry enters a new cell of the grid of estimate times.
    fn next_estimate(&mut self) -> Option<Estimate> {
        let (time, _) = self.peer.trajectory()?.end();
        #[allow(clippy::cast_possible_truncation, reason = "seconds times a rate")]
        let cell = (time.seconds() * self.config.estimate_rate_hz).floor() as i64;
        if self.next_estimate.is_some_and(|next| cell < next) {
            return None;
        }
        self.next_estimate = Some(cell + 1);
        let estimate = self.estimate()?;
        self.settled.push(results::online(&estimate));
        Some(estimate)
    }

    /// The estimate at the last odometry; `None` while the robot has no place in the map.
    pub fn estimate(&mut self) -> Option<Estimate> {
        let (time, state) = self.peer.trajectory()?.end();
        let view = self.peer.view()?;
        let covariance = Symmetric3::from_lower(&view.published());
        let [xx, _, yy, _, _, yaw] = covariance.0;
        let counts = self.peer.counts();
        Some(Estimate {
            robot: self.config.robot,
            boot: BootIndex::default(),
            time,
            map_from_odom: view.pose.compose(&state.nominal.inverse()),
            odom_from_robot: state.nominal,
            map_from_robot: view.pose,
            covariance,
            sigma: [xx, yy, yaw].map(|variance| variance.max(0.0).sqrt()),
            facts_used: counts.used + counts.absolute,
        })
    }

    /// The estimates so far, on the grid of estimate times. Nothing is repaired, so that they are final as they
    /// are made.
    pub fn settled(&self) -> &[SettledEstimate] {
        &self.settled
    }

    /// The state machine.
    pub fn peer(&self) -> &Peer {
        &self.peer
    }

    /// The same, to be asked for what it computes when asked.
    pub fn peer_mut(&mut self) -> &mut Peer {
        &mut self.peer
    }

    /// What this robot does, for operators. It holds no logs, and no estimate of the team.
    pub fn status(&mut self) -> Status {
        let counts = self.peer.counts();
        let samples = self.peer.samples();
        Status {
            robot: self.config.robot,
            boot: BootIndex::default(),
            configuration: configuration(self.config.strategy, &self.config.fold),
            logs: Vec::new(),
            facts: FactCounts {
                relative: counts.relative,
                absolute: counts.absolute,
                used: counts.used + counts.absolute,
                rejected: counts.rejected,
                pending: counts.pending,
                void: 0,
            },
            estimate: Fingerprint::default(),
            odometry_until: self.peer.trajectory().map(|trajectory| trajectory.end().0),
            samples: SampleCounts { accepted: samples.accepted, refused: samples.refused },
            input_ended: self.peer.ended(),
            drained: self.peer.ended(),
            closure: None,
        }
    }

    /// Hash of the bits of its own estimate and of all it keeps with it.
    pub fn fingerprint(&mut self) -> Fingerprint {
        Fingerprint::of_words(self.peer.view().as_ref().map(words).unwrap_or_default())
    }

    /// This robot.
    pub fn robot(&self) -> RobotId {
        self.config.robot
    }
}

fn words(view: &View) -> Vec<u64> {
    let pose = [view.pose.x_m(), view.pose.y_m(), view.pose.yaw_rad()];
    let mut words = vec![view.time.0.cast_unsigned()];
    words.extend(pose.into_iter().chain(view.covariance.iter().copied()).map(f64::to_bits));
    for (robot, factor) in &view.row {
        words.push(u64::from(robot.0));
        if let Some(version) = factor.version {
            words.extend([u64::from(version.observer.0), version.number]);
        }
        words.extend(factor.matrix.iter().map(|entry| entry.to_bits()));
    }
    words
}

/// Hash of what has to be the same for all robots of a team.
fn configuration(kind: StrategyKind, fold: &FoldConfig) -> u64 {
    let name = kind.name().bytes().map(u64::from);
    let Fingerprint(bytes) = Fingerprint::of_words(std::iter::once(fold.hash()).chain(name));
    bytes[..8].iter().fold(0, |hash, byte| hash << 8 | u64::from(*byte))
}

fn say(command: strategy::Command<strategy::Message>) -> Command {
    match command {
        strategy::Command::Send { to, message } => Command::Say { to: Some(to), message },
        strategy::Command::Broadcast(message) => Command::Say { to: None, message },
    }
}

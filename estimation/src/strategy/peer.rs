//! A robot that follows an approximate strategy: dead reckoning, stamps and waiting are the same for all of
//! them, what they do with a measurement is their [`Core`].

use std::collections::{BTreeSet, VecDeque};
use std::fmt::Debug;

use super::block::Instant;
use super::factored::Factored;
use super::one_way::OneWay;
use super::pairwise::Pairwise;
use super::setup::Setup;
use super::{Command, Counts, Event, MeetingId, Message, Strategy, StrategyKind, View};
use crate::fact::{Absolute, Noise, Quantity};
use crate::geometry::{Vector3, wrap_angle};
use crate::motion::{DeadReckoning, OdometryRefusal, Step};
use crate::nominal::{NominalTrajectory, Outside};
use crate::sample::{Reading, Relative, Sample, SampleRefusal, Tally, Target};
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

/// Observations or messages that may wait for odometry.
const MOST_WAITING: usize = 4096;
/// A message about a time further ahead of this robot's odometry comes from a wrong clock, s.
const LARGEST_CLOCK_ERROR_S: f64 = 2.0;
/// A message about a time this long before this robot's last update is no longer of use, s: the motion
/// between, which counts as if it had come first, is then no longer small.
const LATEST_S: f64 = 1.0;

/// What is to be sent.
pub(super) type Out = Vec<Command<Message>>;

/// The part in which the approximate strategies differ.
pub(super) trait Core: Debug + Send + Sync {
    /// The robot starts here.
    fn place(&mut self, at: &Instant, pose: &Pose2, noise: &Noise);
    /// A measurement of the robot against the map.
    fn absolute(&mut self, at: &Instant, quantity: &Quantity, noise: &Noise, out: &mut Out);
    /// This robot saw another.
    fn sight(&mut self, at: &Instant, robot: RobotId, relative: &Relative, noise: &Noise, out: &mut Out);
    /// The odometry has been extended, and what waited for it handled.
    fn tick(&mut self, _trajectory: &NominalTrajectory, _out: &mut Out) {}
    /// A message whose time the odometry has reached.
    fn receive(&mut self, from: RobotId, message: Message, trajectory: &NominalTrajectory, out: &mut Out);
    /// The estimate at an instant.
    fn view(&self, at: &Instant) -> Option<View>;
    /// What became of it all.
    fn counts(&self) -> Counts;
}

/// Whether something about `time` comes too late for a robot whose last update was at `last`.
pub(super) fn too_late(last: Timestamp, time: Timestamp) -> bool {
    last.seconds_since(time) > LATEST_S
}

/// Which meetings have been heard of, so that a copy of a message is known as one.
#[derive(Debug, Default)]
pub(super) struct Seen {
    known: BTreeSet<MeetingId>,
    order: VecDeque<MeetingId>,
}

impl Seen {
    /// Whether it has been heard of before; remembers it, and forgets the oldest of too many.
    pub fn repeated(&mut self, id: MeetingId) -> bool {
        if !self.known.insert(id) {
            return true;
        }
        self.order.push_back(id);
        if self.order.len() > MOST_WAITING
            && let Some(oldest) = self.order.pop_front()
        {
            self.known.remove(&oldest);
        }
        false
    }
}

/// A robot that follows one of the approximate strategies.
#[derive(Debug)]
pub struct Peer {
    setup: Setup,
    core: Box<dyn Core>,
    dead_reckoning: DeadReckoning,
    trajectory: Option<NominalTrajectory>,
    /// Own observations stamped after the last odometry, by time.
    observations: VecDeque<Sample>,
    /// Messages about times after the last odometry, by time.
    messages: VecDeque<(Timestamp, RobotId, Message)>,
    ended: bool,
    refused: u64,
    samples: Tally,
    distance_m: f64,
}

impl Peer {
    /// A robot that has seen nothing; `None` for [`StrategyKind::Exact`], which is the agent's node.
    pub fn new(kind: StrategyKind, setup: Setup) -> Option<Self> {
        let (robot, gate) = (setup.robot, setup.gate);
        let core: Box<dyn Core> = match kind {
            StrategyKind::Exact => return None,
            StrategyKind::Factored => Box::new(Factored::new(robot, gate)),
            StrategyKind::Pairwise => Box::new(Pairwise::new(robot, gate)),
            StrategyKind::Intersection
            | StrategyKind::SplitIntersection
            | StrategyKind::Naive
            | StrategyKind::Independent => Box::new(OneWay::new(robot, kind, gate)),
        };
        Some(Self {
            dead_reckoning: DeadReckoning::new(setup.motion),
            core,
            setup,
            trajectory: None,
            observations: VecDeque::new(),
            messages: VecDeque::new(),
            ended: false,
            refused: 0,
            samples: Tally::default(),
            distance_m: 0.0,
        })
    }

    /// The nominal trajectory, once there is odometry.
    pub fn trajectory(&self) -> Option<&NominalTrajectory> {
        self.trajectory.as_ref()
    }

    /// What became of the samples.
    pub fn samples(&self) -> &Tally {
        &self.samples
    }

    /// Distance travelled by dead reckoning, m.
    pub fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// Whether there will be no more samples.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// Takes a sample stamped in team time; what follows from it is to be sent even if it is refused.
    pub fn sample(&mut self, sample: Sample) -> (Result<(), SampleRefusal>, Vec<Command<Message>>) {
        let mut out = Vec::new();
        let taken = self.take(sample, &mut out);
        match &taken {
            Ok(()) => self.samples.accepted += 1,
            Err(refusal) => {
                self.samples.refuse(refusal);
            }
        }
        (taken, out)
    }

    fn take(&mut self, sample: Sample, out: &mut Out) -> Result<(), SampleRefusal> {
        match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => {
                sample.check()?;
                self.dead_reckoning.gyro(sample.time, yaw_rate_rad_s);
                Ok(())
            }
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                self.odometry(sample, out)
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {
                self.observation(sample, out)
            }
        }
    }

    fn odometry(&mut self, sample: Sample, out: &mut Out) -> Result<(), SampleRefusal> {
        let end = self.trajectory.as_ref().map(|trajectory| trajectory.end().0);
        if let Some(last) = end.filter(|last| sample.time <= *last) {
            return Err(OdometryRefusal::OutOfOrder { time: sample.time, last }.into());
        }
        match end {
            Some(end) if sample.time.seconds_since(end) > self.setup.longest_gap_s => {
                self.dead_reckoning.restart(sample);
                let gap_s = sample.time.seconds_since(end);
                let [x, y, yaw] = self.setup.motion_limits.map(|limit| limit * gap_s * (limit * gap_s));
                let covariance = Symmetric3::diagonal(x, y, yaw);
                self.extend(&Step { from: end, to: sample.time, motion: Vector3::zeros(), covariance });
            }
            _ => match self.dead_reckoning.odometry(sample)? {
                None => self.begin(sample.time),
                Some(step) => self.extend(&step),
            },
        }
        self.catch_up(sample.time, out);
        if let Some(trajectory) = &self.trajectory {
            self.core.tick(trajectory, out);
        }
        Ok(())
    }

    fn extend(&mut self, step: &Step) {
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.extend(step);
            self.distance_m += libm::hypot(step.motion[0], step.motion[1]);
        }
    }

    fn begin(&mut self, time: Timestamp) {
        let nominal = self.setup.prior.as_ref().map_or_else(Pose2::identity, |(pose, _)| *pose);
        let trajectory = NominalTrajectory::new(time, nominal, self.setup.history_samples);
        if let Some((pose, noise)) = &self.setup.prior {
            let (time, state) = trajectory.end();
            self.core.place(&Instant { time, state }, pose, noise);
        }
        self.trajectory = Some(trajectory);
    }

    /// Handles what has waited for the odometry to reach it, in the order of time.
    fn catch_up(&mut self, now: Timestamp, out: &mut Out) {
        loop {
            let observation = self.observations.front().map(|sample| sample.time).filter(|time| *time <= now);
            let message = self.messages.front().map(|(time, ..)| *time).filter(|time| *time <= now);
            match (observation, message) {
                (None, None) => return,
                (Some(own), other) if other.is_none_or(|other| own <= other) => {
                    if let Some(sample) = self.observations.pop_front()
                        && let Err(refusal) = self.observe(&sample, out)
                    {
                        self.samples.refuse_accepted(&refusal);
                    }
                }
                _ => {
                    if let Some((_, from, message)) = self.messages.pop_front() {
                        self.deliver(from, message, out);
                    }
                }
            }
        }
    }

    fn observation(&mut self, sample: Sample, out: &mut Out) -> Result<(), SampleRefusal> {
        let sample = sample.without_range_bias(self.setup.range_bias_m);
        sample.check()?;
        if self.trajectory.as_ref().is_some_and(|trajectory| sample.time <= trajectory.end().0) {
            return self.observe(&sample, out);
        }
        if self.ended {
            return Err(SampleRefusal::AfterLastOdometry { time: sample.time });
        }
        if self.observations.len() >= MOST_WAITING {
            return Err(SampleRefusal::TooManyWaiting { time: sample.time });
        }
        let place = self.observations.partition_point(|other| other.time <= sample.time);
        self.observations.insert(place, sample);
        Ok(())
    }

    /// Uses an own observation that the odometry has reached.
    fn observe(&mut self, sample: &Sample, out: &mut Out) -> Result<(), SampleRefusal> {
        let time = sample.time;
        let trajectory = self.trajectory.as_ref().ok_or(SampleRefusal::BeforeBoot { time })?;
        let state = trajectory.at(time).map_err(|outside| match outside {
            Outside::Before => SampleRefusal::BeforeBoot { time },
            Outside::Forgotten => SampleRefusal::TooOld { time },
            Outside::After => SampleRefusal::AfterLastOdometry { time },
        })?;
        let at = Instant { time, state };
        let noises = &self.setup.noises;
        let no_noise = |kind| SampleRefusal::NoNoise { kind };
        match sample.reading {
            Reading::Gps { x_m, y_m } => {
                let noise = noises.position.ok_or(no_noise("gps"))?;
                let quantity = Quantity::Absolute(Absolute::Position([x_m, y_m]));
                self.core.absolute(&at, &quantity, &noise, out);
            }
            Reading::Heading { heading_rad } => {
                let noise = noises.heading.ok_or(no_noise("heading"))?;
                let quantity = Quantity::Absolute(Absolute::Heading(wrap_angle(heading_rad)));
                self.core.absolute(&at, &quantity, &noise, out);
            }
            Reading::Sighting { target: Target::Robot(robot), relative } => {
                if robot == self.setup.robot {
                    return Err(SampleRefusal::Itself(robot));
                }
                let noise = noises.of(&relative)?;
                self.core.sight(&at, robot, &relative, &noise, out);
            }
            Reading::Sighting { target: Target::Landmark(landmark), relative } => {
                let known = self.setup.landmarks.get(&landmark);
                let position_m = *known.ok_or(SampleRefusal::UnknownLandmark(landmark))?;
                if matches!(relative, Relative::Pose(_)) {
                    return Err(SampleRefusal::LandmarkPose(landmark));
                }
                let noise = noises.of(&relative)?;
                let quantity = Quantity::Landmark { landmark, position_m, relative };
                self.core.absolute(&at, &quantity, &noise, out);
            }
            // Odometry is no observation.
            Reading::Velocity { .. }
            | Reading::Wheels { .. }
            | Reading::Increment(_)
            | Reading::Gyro { .. } => {}
        }
        Ok(())
    }

    /// A message: at once, or when the odometry has reached the time it is about.
    fn message(&mut self, from: RobotId, message: Message, out: &mut Out) {
        let about = match &message {
            Message::Sighting(sighting) => sighting.time,
            Message::Question(question) => question.time,
            Message::Answer(_) | Message::Verdict(_) | Message::RowAnswer(_) | Message::TeamUpdate(_) => {
                return self.deliver(from, message, out);
            }
        };
        let end = self.trajectory.as_ref().map(|trajectory| trajectory.end().0);
        if end.is_some_and(|end| about <= end) {
            return self.deliver(from, message, out);
        }
        let wrong = end.is_some_and(|end| about.seconds_since(end) > LARGEST_CLOCK_ERROR_S);
        if wrong || self.ended || self.messages.len() >= MOST_WAITING {
            self.refused += 1;
            return;
        }
        let place = self.messages.partition_point(|(time, ..)| *time <= about);
        self.messages.insert(place, (about, from, message));
    }

    fn deliver(&mut self, from: RobotId, message: Message, out: &mut Out) {
        match &self.trajectory {
            Some(trajectory) if from != self.setup.robot => {
                self.core.receive(from, message, trajectory, out);
            }
            _ => self.refused += 1,
        }
    }
}

impl Strategy for Peer {
    type Message = Message;

    fn handle(&mut self, event: Event<Message>) -> Out {
        let mut out = Vec::new();
        match event {
            Event::Sample(sample) => return self.sample(sample).1,
            Event::Received { from, message } => self.message(from, message, &mut out),
            // Nothing is repaired: that is what sets them apart from the exact strategy.
            Event::Period => {}
            Event::InputEnded => {
                self.ended = true;
                for sample in std::mem::take(&mut self.observations) {
                    self.samples.refuse_accepted(&SampleRefusal::AfterLastOdometry { time: sample.time });
                }
                self.refused += self.messages.len() as u64;
                self.messages.clear();
            }
        }
        out
    }

    fn robot(&self) -> RobotId {
        self.setup.robot
    }

    fn view(&mut self) -> Option<View> {
        let (time, state) = self.trajectory.as_ref()?.end();
        self.core.view(&Instant { time, state })
    }

    fn counts(&mut self) -> Counts {
        let counts = self.core.counts();
        Counts {
            pending: counts.pending + (self.observations.len() + self.messages.len()) as u64,
            refused: counts.refused + self.refused,
            samples_refused: self.samples.refused,
            ..counts
        }
    }
}

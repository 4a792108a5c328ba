//! A robot that follows an approximate strategy: dead reckoning, stamps and waiting are the same for all of
//! them, what they do with a measurement is their [`Core`].

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Debug;

use super::block::Instant;
use super::factored::Factored;
use super::one_way::OneWay;
use super::pairwise::Pairwise;
use super::{Command, Counts, Event, MeetingId, Message, Strategy, StrategyKind, View};
use crate::fact::{Absolute, ClockMap, Noise, Quantity};
use crate::geometry::{Vector3, wrap_angle};
use crate::motion::{DeadReckoning, MotionModel, Step};
use crate::nominal::NominalTrajectory;
use crate::sample::{Reading, Relative, Sample, Target};
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, RobotId, Timestamp};

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
pub(super) trait Core: Debug + Send {
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

/// The noise of each kind of measurement; readings of a kind without are refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noises {
    /// Full relative pose.
    pub relative_pose: Option<Noise>,
    /// Relative position.
    pub relative_position: Option<Noise>,
    /// Range alone.
    pub range: Option<Noise>,
    /// Bearing alone.
    pub bearing: Option<Noise>,
    /// Range and bearing.
    pub range_bearing: Option<Noise>,
    /// Absolute position.
    pub position: Option<Noise>,
    /// Absolute heading.
    pub heading: Option<Noise>,
}

impl Noises {
    fn of(&self, relative: &Relative) -> Option<Noise> {
        match relative {
            Relative::Pose(_) => self.relative_pose,
            Relative::Position { .. } => self.relative_position,
            Relative::Range { .. } => self.range,
            Relative::Bearing { .. } => self.bearing,
            Relative::RangeBearing { .. } => self.range_bearing,
        }
    }
}

/// What a robot has to know of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Who.
    pub robot: RobotId,
    /// Dead reckoning.
    pub motion: MotionModel,
    /// Where it starts, with noise in the frame of the pose; without it the robot has no place in the map.
    pub prior: Option<(Pose2, Noise)>,
    /// How well it measures.
    pub noises: Noises,
    /// Known bias of every range reading, subtracted, m.
    pub range_bias_m: f64,
    /// The map, m.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Gate on the normalized innovation squared by dimension, 1 to 3.
    pub gate: [f64; 3],
    /// Local clock to team time.
    pub clock: ClockMap,
    /// Odometry samples kept.
    pub history_samples: usize,
    /// A longer silence of the odometry counts as unknown motion, s.
    pub longest_gap_s: f64,
    /// Fastest possible motion: m/s, m/s, rad/s.
    pub motion_limits: [f64; 3],
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
    samples_refused: u64,
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
            samples_refused: 0,
        })
    }

    /// The nominal trajectory, once there is odometry.
    pub fn trajectory(&self) -> Option<&NominalTrajectory> {
        self.trajectory.as_ref()
    }

    fn sample(&mut self, sample: Sample, out: &mut Out) {
        let sample = Sample { time: team_time(&self.setup.clock, sample.time), ..sample };
        let taken = match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => {
                self.dead_reckoning.gyro(sample.time, yaw_rate_rad_s);
                yaw_rate_rad_s.is_finite()
            }
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                self.odometry(sample, out)
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {
                self.observation(sample, out)
            }
        };
        self.samples_refused += u64::from(!taken);
    }

    fn odometry(&mut self, sample: Sample, out: &mut Out) -> bool {
        let end = self.trajectory.as_ref().map(|trajectory| trajectory.end().0);
        match end {
            Some(end) if sample.time <= end => return false,
            Some(end) if sample.time.seconds_since(end) > self.setup.longest_gap_s => {
                self.dead_reckoning.restart(sample);
                let gap_s = sample.time.seconds_since(end);
                let [x, y, yaw] = self.setup.motion_limits.map(|limit| limit * gap_s * (limit * gap_s));
                let covariance = Symmetric3::diagonal(x, y, yaw);
                let step = Step { from: end, to: sample.time, motion: Vector3::zeros(), covariance };
                if let Some(trajectory) = &mut self.trajectory {
                    trajectory.extend(&step);
                }
            }
            _ => match self.dead_reckoning.odometry(sample) {
                Err(_) => return false,
                Ok(None) => self.begin(sample.time),
                Ok(Some(step)) => {
                    if let Some(trajectory) = &mut self.trajectory {
                        trajectory.extend(&step);
                    }
                }
            },
        }
        self.catch_up(sample.time, out);
        if let Some(trajectory) = &self.trajectory {
            self.core.tick(trajectory, out);
        }
        true
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
                    if let Some(sample) = self.observations.pop_front() {
                        let taken = self.observe(&sample, out);
                        self.samples_refused += u64::from(!taken);
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

    fn observation(&mut self, mut sample: Sample, out: &mut Out) -> bool {
        if let Reading::Sighting { relative, .. } = &mut sample.reading
            && let Relative::Range { range_m } | Relative::RangeBearing { range_m, .. } = relative
        {
            *range_m -= self.setup.range_bias_m;
        }
        if !is_sound(&sample.reading) {
            return false;
        }
        if self.trajectory.as_ref().is_some_and(|trajectory| sample.time <= trajectory.end().0) {
            return self.observe(&sample, out);
        }
        if self.ended || self.observations.len() >= MOST_WAITING {
            return false;
        }
        let place = self.observations.partition_point(|other| other.time <= sample.time);
        self.observations.insert(place, sample);
        true
    }

    /// Uses an own observation that the odometry has reached.
    fn observe(&mut self, sample: &Sample, out: &mut Out) -> bool {
        let Some(Ok(state)) = self.trajectory.as_ref().map(|trajectory| trajectory.at(sample.time)) else {
            return false;
        };
        let at = Instant { time: sample.time, state };
        let noises = &self.setup.noises;
        let (quantity, noise) = match sample.reading {
            Reading::Gps { x_m, y_m } => {
                (Quantity::Absolute(Absolute::Position([x_m, y_m])), noises.position)
            }
            Reading::Heading { heading_rad } => {
                (Quantity::Absolute(Absolute::Heading(wrap_angle(heading_rad))), noises.heading)
            }
            Reading::Sighting { target: Target::Robot(robot), relative } if robot != self.setup.robot => {
                let Some(noise) = noises.of(&relative) else { return false };
                self.core.sight(&at, robot, &relative, &noise, out);
                return true;
            }
            Reading::Sighting { target: Target::Landmark(landmark), relative } => {
                let Some(position_m) = self.setup.landmarks.get(&landmark) else { return false };
                let quantity = Quantity::Landmark { landmark, position_m: *position_m, relative };
                (quantity, noises.of(&relative))
            }
            _ => return false,
        };
        let Some(noise) = noise else { return false };
        self.core.absolute(&at, &quantity, &noise, out);
        true
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
            Event::Sample(sample) => self.sample(sample, &mut out),
            Event::Received { from, message } => self.message(from, message, &mut out),
            // Nothing is repaired: that is what sets them apart from the exact strategy.
            Event::Period => {}
            Event::InputEnded => {
                self.ended = true;
                self.samples_refused += self.observations.len() as u64;
                self.refused += self.messages.len() as u64;
                self.observations.clear();
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
            samples_refused: self.samples_refused,
            ..counts
        }
    }
}

/// Local to team time.
fn team_time(clock: &ClockMap, local: Timestamp) -> Timestamp {
    let since = i128::from(local.0) - i128::from(clock.reference.0);
    let drift = since * i128::from(clock.rate_ppb) / 1_000_000_000;
    let team = i128::from(local.0) + i128::from(clock.offset_ns) + drift;
    Timestamp(i64::try_from(team).unwrap_or(if team > 0 { i64::MAX } else { i64::MIN }))
}

/// Numbers finite, ranges positive.
fn is_sound(reading: &Reading) -> bool {
    let range = |range_m: f64| range_m.is_finite() && range_m > 0.0;
    match reading {
        Reading::Gps { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
        Reading::Heading { heading_rad } => heading_rad.is_finite(),
        Reading::Sighting { relative, .. } => match relative {
            Relative::Pose(pose) => pose.is_finite(),
            Relative::Position { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
            Relative::Range { range_m } => range(*range_m),
            Relative::Bearing { bearing_rad } => bearing_rad.is_finite(),
            Relative::RangeBearing { range_m, bearing_rad } => range(*range_m) && bearing_rad.is_finite(),
        },
        Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) | Reading::Gyro { .. } => {
            true
        }
    }
}

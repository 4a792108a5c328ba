//! Readings through the model of the robot: what is known of its effects is taken out before anything else
//! sees them.
//!
//! What depends on the heading or the place takes them from an estimate on this robot's *own* facts alone,
//! so that a corrected reading is a function of the robot's own samples: the same in one process and in
//! many, whatever arrives from peers, and when.

use pleiad_estimation::fact::{Body, Entry, EntryId, Quantity};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::ledger::{Ledger, Log};
use pleiad_estimation::motion::OdometryRefusal;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};
use pleiad_physics::Pose;
use pleiad_physics::correct::{Correction, OdometryCorrection, OdometryReading, Place, Polar};
use pleiad_physics::signal::Target as Seen;
use pleiad_recording::effect_epoch;

use crate::config::{RobotCorrection, VelocityName};

/// A robot's correction, and what it remembers.
#[derive(Debug)]
pub(super) struct Corrector {
    robot: RobotId,
    correction: Correction,
    velocity: VelocityName,
    odometry: OdometryCorrection,
    /// The last odometry as it was read.
    last: Option<Reading>,
    /// This robot's facts that need nobody else.
    own: Ledger,
    /// From when times in effects count; known with the first sample.
    epoch: Option<Timestamp>,
}

impl Corrector {
    pub(super) fn new(robot: RobotId, config: &RobotCorrection, fold: FoldConfig) -> Self {
        Self {
            robot,
            correction: config.correction.clone(),
            velocity: config.velocity,
            odometry: OdometryCorrection::default(),
            last: None,
            own: Ledger::new(fold),
            epoch: None,
        }
    }

    /// A time as effects count it: seconds from the first sample if stamps count from a foreign epoch. The
    /// journal holds that sample, so that a second life counts alike.
    fn effect_time_s(&mut self, time: Timestamp) -> f64 {
        time.seconds_since(*self.epoch.get_or_insert_with(|| effect_epoch(time)))
    }

    /// Hears what this robot has said in its log.
    pub(super) fn hear(&mut self, entry: &Entry) {
        let alone = match &entry.body {
            Body::Half(_) => false,
            Body::Observation(observation) => !matches!(observation.quantity, Quantity::Robot { .. }),
            _ => true,
        };
        if alone {
            let sequence = Sequence(self.own.log(entry.id.log()).map_or(0, Log::held));
            self.own.insert(Entry { id: EntryId { sequence, ..entry.id }, ..entry.clone() });
        }
    }

    /// A sample with its stamp as it would be by a perfect clock and without latency.
    pub(super) fn on_time(&mut self, sample: &Sample, at: Option<(BootIndex, &NominalTrajectory)>) -> Sample {
        let time_s = self.effect_time_s(sample.time);
        let clock_s = self.correction.clock_error_s(time_s);
        let time = sample.time.plus_seconds(-clock_s);
        let place = self.last_place(time, at);
        let latency_s = match sample.reading {
            Reading::Gps { .. } => self.correction.gps_latency_s(&place),
            Reading::Sighting { target, .. } => self.correction.sighting_latency_s(&place, seen(target)),
            _ => 0.0,
        };
        Sample { time: time.plus_seconds(-latency_s), reading: sample.reading }
    }

    /// The yaw rate of a gyro.
    pub(super) fn gyro(
        &mut self,
        time: Timestamp,
        rate_rad_s: f64,
        at: Option<(BootIndex, &NominalTrajectory)>,
    ) -> f64 {
        let place = self.last_place(time, at);
        self.correction.gyro(&place, rate_rad_s)
    }

    /// The first odometry of a boot, as an increment from nowhere.
    pub(super) fn begin(&mut self, sample: &Sample) -> Result<Sample, OdometryRefusal> {
        let reading = self.reading(sample)?;
        let time_s = self.effect_time_s(sample.time);
        self.odometry.restart(&self.correction, time_s, reading);
        self.last = Some(sample.reading);
        Ok(Sample { time: sample.time, reading: Reading::Increment(Pose2::identity()) })
    }

    /// The next odometry of a boot, as an increment: how the body moved.
    pub(super) fn next(
        &mut self,
        sample: &Sample,
        at: Option<(BootIndex, &NominalTrajectory)>,
    ) -> Result<Sample, OdometryRefusal> {
        let reading = self.reading(sample)?;
        let kind = std::mem::discriminant(&sample.reading);
        if self.last.is_some_and(|last| std::mem::discriminant(&last) != kind) {
            return Err(OdometryRefusal::KindChanged { time: sample.time });
        }
        let start = self.last_place(sample.time, at).pose;
        // What is refused leaves no trace.
        let mut odometry = self.odometry.clone();
        let time_s = self.effect_time_s(sample.time);
        let moved = odometry.step(&self.correction, start, time_s, reading);
        if ![moved.x_m, moved.y_m, moved.yaw_rad].iter().all(|number| number.is_finite()) {
            return Err(OdometryRefusal::NotFinite { time: sample.time });
        }
        (self.odometry, self.last) = (odometry, Some(sample.reading));
        let increment = Pose2::new(moved.x_m, moved.y_m, moved.yaw_rad);
        Ok(Sample { time: sample.time, reading: Reading::Increment(increment) })
    }

    fn reading(&self, sample: &Sample) -> Result<OdometryReading, OdometryRefusal> {
        let (reading, numbers) = match sample.reading {
            Reading::Wheels { left_rad, right_rad } => {
                (OdometryReading::Wheels([left_rad, right_rad]), [left_rad, right_rad, 0.0])
            }
            Reading::Velocity { forward_m_s, yaw_rate_rad_s } => {
                let numbers = [forward_m_s, yaw_rate_rad_s, 0.0];
                match self.velocity {
                    VelocityName::Commanded => {
                        (OdometryReading::Commanded { speed_m_s: forward_m_s, yaw_rate_rad_s }, numbers)
                    }
                    VelocityName::Measured => {
                        (OdometryReading::Measured { speed_m_s: forward_m_s, yaw_rate_rad_s }, numbers)
                    }
                }
            }
            Reading::Increment(increment) => {
                let motion = increment.log();
                let numbers = [motion.x, motion.y, motion.z];
                (OdometryReading::Motion(numbers), numbers)
            }
            _ => return Err(OdometryRefusal::KindChanged { time: sample.time }),
        };
        if numbers.iter().all(|number| number.is_finite()) {
            Ok(reading)
        } else {
            Err(OdometryRefusal::NotFinite { time: sample.time })
        }
    }

    /// An observation as a nominal sensor would have made it. `nominal` is dead reckoning at its time.
    pub(super) fn observation(
        &mut self,
        sample: &Sample,
        (boot, nominal): (BootIndex, &Pose2),
        known_m: impl Fn(LandmarkId) -> Option<[f64; 2]>,
    ) -> Sample {
        let place = self.place(sample.time, boot, nominal);
        let reading = match sample.reading {
            Reading::Gps { x_m, y_m } => {
                let [x_m, y_m] = self.correction.gps(&place, [x_m, y_m]);
                Reading::Gps { x_m, y_m }
            }
            Reading::Heading { heading_rad } => {
                Reading::Heading { heading_rad: self.correction.heading(&place, heading_rad) }
            }
            Reading::Sighting { target, relative } => {
                let target = named(self.correction.target(&place, seen(target)));
                let known_m = match target {
                    Target::Landmark(landmark) => known_m(landmark),
                    Target::Robot(_) => None,
                };
                let relative = relative_of(&self.correction, &place, target, known_m, relative);
                Reading::Sighting { target, relative }
            }
            odometry => odometry,
        };
        Sample { time: sample.time, reading }
    }

    /// The place at the last odometry, with another time.
    fn last_place(&mut self, time: Timestamp, at: Option<(BootIndex, &NominalTrajectory)>) -> Place {
        match at {
            Some((boot, trajectory)) => self.place(time, boot, &trajectory.end().1.nominal),
            None => Place { time_s: self.effect_time_s(time), pose: Pose::identity() },
        }
    }

    /// Where the robot is by its own facts; by dead reckoning as long as it has no place in the map.
    fn place(&mut self, time: Timestamp, boot: BootIndex, nominal: &Pose2) -> Place {
        let joint = self.own.settle();
        let member = joint.member(self.robot).filter(|member| member.boot == boot);
        let pose = member.map_or(*nominal, |member| member.correction.compose(nominal));
        Place { time_s: self.effect_time_s(time), pose: Pose::new(pose.x_m(), pose.y_m(), pose.yaw_rad()) }
    }
}

fn relative_of(
    correction: &Correction,
    place: &Place,
    target: Target,
    known_m: Option<[f64; 2]>,
    relative: Relative,
) -> Relative {
    let target = seen(target);
    let position = |[x_m, y_m]: [f64; 2]| correction.sighting(place, target, Polar::of([x_m, y_m])).point();
    match relative {
        Relative::Pose(pose) => {
            let [x_m, y_m] = position([pose.x_m(), pose.y_m()]);
            let yaw_rad = correction.relative_yaw(place, target, pose.yaw_rad());
            Relative::Pose(Pose2::new(x_m, y_m, yaw_rad))
        }
        Relative::Position { x_m, y_m } => {
            let [x_m, y_m] = position([x_m, y_m]);
            Relative::Position { x_m, y_m }
        }
        Relative::Range { range_m } => {
            Relative::Range { range_m: correction.range(place, target, known_m, range_m) }
        }
        Relative::Bearing { bearing_rad } => {
            Relative::Bearing { bearing_rad: correction.bearing(place, target, known_m, bearing_rad) }
        }
        Relative::RangeBearing { range_m, bearing_rad } => {
            let Polar { range_m, bearing_rad } =
                correction.sighting(place, target, Polar { range_m, bearing_rad });
            Relative::RangeBearing { range_m, bearing_rad }
        }
    }
}

fn seen(target: Target) -> Seen {
    match target {
        Target::Robot(robot) => Seen::Robot(robot.0),
        Target::Landmark(landmark) => Seen::Landmark(landmark.0),
    }
}

fn named(seen: Seen) -> Target {
    match seen {
        Seen::Robot(robot) => Target::Robot(RobotId(robot)),
        Seen::Landmark(landmark) => Target::Landmark(LandmarkId(landmark)),
    }
}

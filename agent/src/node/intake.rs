//! Samples: checked, stamped in team time, and turned into motion or facts.

use std::collections::BTreeMap;

use pleiad_estimation::fact::{Absolute, ClockMap, Quantity};
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::motion::OdometryRefusal;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, RobotId, Timestamp};

use super::{Command, MOST_WAITING, Node, Notice, Record};
use crate::config::{SensorsSection, Strategy};

/// Why a sample was not taken.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SampleRefusal {
    /// NaN, infinite, or a range that is not positive.
    #[error("the reading stamped {time} is not a finite number in its range")]
    BadValue {
        /// Its stamp.
        time: Timestamp,
    },
    /// Odometry that cannot be used.
    #[error(transparent)]
    Odometry(#[from] OdometryRefusal),
    /// From before this boot's first odometry.
    #[error("stamped {time}, before the first odometry of this boot")]
    BeforeBoot {
        /// Its stamp.
        time: Timestamp,
    },
    /// From so long ago that the trajectory is no longer kept.
    #[error("stamped {time}, longer ago than motion.history_samples reaches")]
    TooOld {
        /// Its stamp.
        time: Timestamp,
    },
    /// From after the last odometry there will be.
    #[error("stamped {time}, after the last odometry")]
    AfterLastOdometry {
        /// Its stamp.
        time: Timestamp,
    },
    /// Too many observations wait for odometry.
    #[error("stamped {time}: too many observations wait for odometry; is its driver running?")]
    TooManyWaiting {
        /// Its stamp.
        time: Timestamp,
    },
    /// From a time that this robot has promised not to observe in any more.
    #[error("stamped {time}, which is sealed: it came later than ledger.late_s allows")]
    Sealed {
        /// Its stamp.
        time: Timestamp,
    },
    /// Another agent runs as this robot.
    #[error("stamped {time}, but another agent runs as this robot")]
    Superseded {
        /// Its stamp.
        time: Timestamp,
    },
    /// This robot does not belong to the team at present.
    #[error("stamped {time}, while this robot does not belong to the team")]
    NotAMember {
        /// Its stamp.
        time: Timestamp,
    },
    /// The robot that was seen has not answered for long.
    #[error("robot {robot} has left too many observations of it unanswered")]
    Unanswered {
        /// Who was seen.
        robot: RobotId,
    },
    /// No noise is configured for the kind.
    #[error("no noise for {kind} in the configuration: add [sensors.{kind}]")]
    NoNoise {
        /// Kind of measurement.
        kind: &'static str,
    },
    /// The landmark is not in the map.
    #[error("landmark {0} is not in the map: add it to [[landmarks]]")]
    UnknownLandmark(LandmarkId),
    /// A robot saw itself.
    #[error("robot {0} was reported as seen by itself")]
    Itself(RobotId),
    /// A full pose of a landmark: a point has no heading.
    #[error("a full pose was reported of landmark {0}; a landmark has no heading")]
    LandmarkPose(LandmarkId),
}

/// How many samples were taken, left out on purpose, and refused for which reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Counts {
    pub accepted: u64,
    pub refused: u64,
    pub reasons: BTreeMap<String, u64>,
    pub last: Option<SampleRefusal>,
}

impl Counts {
    /// Counts a refusal; `true` for the first of its kind, which is worth a notice.
    pub(super) fn refuse(&mut self, refusal: &SampleRefusal) -> bool {
        self.refused += 1;
        self.last = Some(*refusal);
        let debug = format!("{refusal:?}");
        let kind = debug.split([' ', '(', '{']).next().unwrap_or_default();
        let count = self.reasons.entry(kind.to_owned()).or_insert(0);
        *count += 1;
        *count == 1
    }
}

/// Local to team time.
fn to_team_time(clock: &ClockMap, local: Timestamp) -> Timestamp {
    let since = i128::from(local.0) - i128::from(clock.reference.0);
    let drift = since * i128::from(clock.rate_ppb) / 1_000_000_000;
    let team = i128::from(local.0) + i128::from(clock.offset_ns) + drift;
    Timestamp(i64::try_from(team).unwrap_or(if team > 0 { i64::MAX } else { i64::MIN }))
}

impl Node {
    pub(super) fn sample(&mut self, sample: Sample) {
        let sample = Sample { time: to_team_time(&self.config.clock, sample.time), ..sample };
        match self.take(sample) {
            Ok(()) => {
                self.counts.accepted += 1;
                // After the entries it led to: a boot's entries stand before the sample that began it.
                self.out.records.push(Record::Sample(sample));
            }
            Err(refusal) => self.refuse(refusal),
        }
    }

    fn refuse(&mut self, refusal: SampleRefusal) {
        if self.counts.refuse(&refusal) {
            self.notice(Notice::SampleRefused(refusal));
        }
    }

    /// Refuses an observation that had been accepted to wait for odometry.
    pub(super) fn refuse_waiting(&mut self, refusal: SampleRefusal) {
        self.counts.accepted = self.counts.accepted.saturating_sub(1);
        self.refuse(refusal);
    }

    fn take(&mut self, sample: Sample) -> Result<(), SampleRefusal> {
        if self.superseded {
            return Err(SampleRefusal::Superseded { time: sample.time });
        }
        let sample = self.on_time(sample);
        match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => {
                if !yaw_rate_rad_s.is_finite() {
                    return Err(SampleRefusal::BadValue { time: sample.time });
                }
                self.gyro(sample.time, yaw_rate_rad_s);
                Ok(())
            }
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                self.odometry(sample)
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {
                let sample = without_bias(sample, self.config.sensors.range_bias_m);
                check_reading(&sample)?;
                let robot_seen = matches!(sample.reading, Reading::Sighting { target: Target::Robot(_), .. });
                if robot_seen && self.config.strategy == Strategy::Independent {
                    return Ok(());
                }
                let reached = self.segments.last().is_some_and(|(_, t)| sample.time <= t.end().0);
                if self.boot.is_some() && reached {
                    return self.observe(&sample);
                }
                if self.input_ended {
                    return Err(SampleRefusal::AfterLastOdometry { time: sample.time });
                }
                if self.waiting.len() >= MOST_WAITING {
                    return Err(SampleRefusal::TooManyWaiting { time: sample.time });
                }
                let place = self.waiting.partition_point(|other| other.time <= sample.time);
                self.waiting.insert(place, sample);
                Ok(())
            }
        }
    }

    fn odometry(&mut self, sample: Sample) -> Result<(), SampleRefusal> {
        let end = self.segments.last().map(|(_, trajectory)| trajectory.end().0);
        if let Some(last) = end.filter(|last| sample.time <= *last) {
            return Err(OdometryRefusal::OutOfOrder { time: sample.time, last }.into());
        }
        let gap = end.filter(|last| sample.time.seconds_since(*last) > self.config.longest_gap_s);
        let begins = self.membership.joining.is_some() || self.boot.is_none();
        if begins && !self.may_begin(sample.time) {
            return self.reckon_alone(sample, gap.is_some());
        }
        if self.membership.joining.is_some() && self.lived && gap.is_none() {
            self.reckon(sample)?;
            self.carry_on_joined();
        } else if self.boot.is_none() || gap.is_some() {
            self.check_begin(sample.time)?;
            self.restart(sample)?;
            self.begin_boot(sample.time);
            if let (Some(from), Some(boot)) = (gap, self.boot) {
                self.notice(Notice::OdometryGap { from, to: sample.time, boot });
            }
        } else {
            self.reckon(sample)?;
        }
        while self.waiting.front().is_some_and(|first| first.time <= sample.time) {
            let Some(observation) = self.waiting.pop_front() else { break };
            if let Err(refusal) = self.observe(&observation) {
                self.refuse_waiting(refusal);
            }
        }
        self.answer();
        self.emit_estimate();
        self.rebase();
        Ok(())
    }

    /// An estimate whenever the odometry enters a new cell of the grid of estimate times.
    pub(super) fn emit_estimate(&mut self) {
        let Some((_, trajectory)) = self.segments.last() else { return };
        let (time, _) = trajectory.end();
        #[allow(clippy::cast_possible_truncation, reason = "seconds times a rate")]
        let cell = (time.seconds() * self.config.estimate_rate_hz).floor() as i64;
        if self.next_estimate.is_some_and(|next| cell < next) {
            return;
        }
        self.next_estimate = Some(cell + 1);
        if let Some(estimate) = self.estimate() {
            self.out.rest.push(Command::Estimate(estimate));
        }
    }

    /// What an observation says, and which noise profile it refers to.
    pub(super) fn quantity(&self, sample: &Sample) -> Result<(Quantity, u16), SampleRefusal> {
        match sample.reading {
            Reading::Gps { x_m, y_m } => {
                Ok((Quantity::Absolute(Absolute::Position([x_m, y_m])), SensorsSection::GPS_PROFILE))
            }
            Reading::Heading { heading_rad } => {
                let heading = Absolute::Heading(wrap_angle(heading_rad));
                Ok((Quantity::Absolute(heading), SensorsSection::HEADING_PROFILE))
            }
            Reading::Sighting { target, relative } => {
                let profile = SensorsSection::relative_profile(&relative);
                match target {
                    Target::Robot(robot) if robot == self.config.robot => Err(SampleRefusal::Itself(robot)),
                    Target::Robot(robot) => Ok((Quantity::Robot { robot, relative }, profile)),
                    Target::Landmark(landmark) => {
                        if matches!(relative, Relative::Pose(_)) {
                            return Err(SampleRefusal::LandmarkPose(landmark));
                        }
                        let position_m = self.config.landmarks.get(&landmark).copied();
                        let position_m = position_m.ok_or(SampleRefusal::UnknownLandmark(landmark))?;
                        Ok((Quantity::Landmark { landmark, position_m, relative }, profile))
                    }
                }
            }
            Reading::Velocity { .. }
            | Reading::Wheels { .. }
            | Reading::Increment(_)
            | Reading::Gyro { .. } => Err(SampleRefusal::BadValue { time: sample.time }),
        }
    }
}

/// A range as it would be without its known bias.
fn without_bias(mut sample: Sample, bias_m: f64) -> Sample {
    if let Reading::Sighting { relative, .. } = &mut sample.reading
        && let Relative::Range { range_m } | Relative::RangeBearing { range_m, .. } = relative
    {
        *range_m -= bias_m;
    }
    sample
}

/// Numbers finite, ranges positive.
pub(super) fn check_reading(sample: &Sample) -> Result<(), SampleRefusal> {
    let range = |range: f64| range.is_finite() && range > 0.0;
    let good = match sample.reading {
        Reading::Gps { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
        Reading::Heading { heading_rad } => heading_rad.is_finite(),
        Reading::Sighting { relative, .. } => match relative {
            Relative::Pose(pose) => pose.is_finite(),
            Relative::Position { x_m, y_m } => x_m.is_finite() && y_m.is_finite(),
            Relative::Range { range_m } => range(range_m),
            Relative::Bearing { bearing_rad } => bearing_rad.is_finite(),
            Relative::RangeBearing { range_m, bearing_rad } => range(range_m) && bearing_rad.is_finite(),
        },
        _ => true,
    };
    if good { Ok(()) } else { Err(SampleRefusal::BadValue { time: sample.time }) }
}

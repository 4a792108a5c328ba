//! Samples: checked, stamped in team time, and turned into motion or facts.

use pleiad_estimation::fact::{Absolute, Quantity};
use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::motion::OdometryRefusal;
use pleiad_estimation::sample::{Reading, Relative, Sample, SampleRefusal, Target};

use super::{Command, MOST_WAITING, Node, Notice, Record};
use crate::config::{SensorsSection, UnknownLandmarks};

impl Node {
    pub(super) fn sample(&mut self, sample: Sample) {
        let sample = Sample { time: self.config.clock.team_time(sample.time), ..sample };
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
        if self.counts.refuse_accepted(&refusal) {
            self.notice(Notice::SampleRefused(refusal));
        }
    }

    fn take(&mut self, sample: Sample) -> Result<(), SampleRefusal> {
        if self.superseded {
            return Err(SampleRefusal::Superseded { time: sample.time });
        }
        let sample = self.on_time(sample);
        match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => {
                sample.check()?;
                self.gyro(sample.time, yaw_rate_rad_s);
                Ok(())
            }
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                self.odometry(sample)
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {
                let sample = sample.without_range_bias(self.config.sensors.range_bias_m);
                sample.check()?;
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
        if self.boot.is_none() && self.lived && gap.is_none() {
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
        self.tell_standings();
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
                        let quantity = match self.config.landmarks.get(&landmark) {
                            Some(position_m) => {
                                Quantity::Landmark { landmark, position_m: *position_m, relative }
                            }
                            None if self.config.sensors.unknown_landmarks == UnknownLandmarks::Map => {
                                Quantity::Feature { landmark, relative }
                            }
                            None => return Err(SampleRefusal::UnknownLandmark(landmark)),
                        };
                        Ok((quantity, profile))
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

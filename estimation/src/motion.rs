//! Dead reckoning: from odometry samples to body motion and its process noise.

use crate::Timestamp;
use crate::geometry::Vector3;
use crate::sample::{Reading, Sample};
use crate::symmetric::Symmetric3;

/// Process noise of odometry, body frame (forward, left, yaw): a white part that grows with the root of
/// time and one that grows with the root of the distance travelled or angle turned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionNoise {
    /// Forward, m per square root of a second.
    pub forward_m_per_sqrt_s: f64,
    /// Sideways, m per square root of a second.
    pub lateral_m_per_sqrt_s: f64,
    /// Yaw, rad per square root of a second.
    pub yaw_rad_per_sqrt_s: f64,
    /// Forward, m per square root of a metre travelled.
    pub forward_m_per_sqrt_m: f64,
    /// Yaw, rad per square root of a metre travelled.
    pub yaw_rad_per_sqrt_m: f64,
    /// Yaw, rad per square root of a radian turned.
    pub yaw_rad_per_sqrt_rad: f64,
    /// No noise at all while the odometry reports no motion.
    pub quiet_at_standstill: bool,
}

impl MotionNoise {
    /// Covariance of a body motion (m, m, rad) that took `seconds`.
    pub fn covariance(&self, motion: &Vector3, seconds: f64) -> Symmetric3 {
        let distance_m = (motion.x * motion.x + motion.y * motion.y).sqrt();
        let turn_rad = motion.z.abs();
        if self.quiet_at_standstill && distance_m == 0.0 && turn_rad == 0.0 {
            return Symmetric3::zero();
        }
        let square = |x: f64| x * x;
        Symmetric3::diagonal(
            square(self.forward_m_per_sqrt_s) * seconds + square(self.forward_m_per_sqrt_m) * distance_m,
            square(self.lateral_m_per_sqrt_s) * seconds,
            square(self.yaw_rad_per_sqrt_s) * seconds
                + square(self.yaw_rad_per_sqrt_m) * distance_m
                + square(self.yaw_rad_per_sqrt_rad) * turn_rad,
        )
    }
}

/// The two lengths that turn wheel angles into motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    /// Loaded rolling radius of both wheels, m.
    pub wheel_radius_m: f64,
    /// Distance between the contact points, m.
    pub track_width_m: f64,
}

impl DifferentialDrive {
    /// Body motion of wheel increments in radians: `(r (R + L)/2, 0, r (R - L)/b)`.
    pub fn motion(&self, left_rad: f64, right_rad: f64) -> Vector3 {
        let (left_m, right_m) = (self.wheel_radius_m * left_rad, self.wheel_radius_m * right_rad);
        Vector3::new(0.5 * (left_m + right_m), 0.0, (right_m - left_m) / self.track_width_m)
    }
}

/// Which sensor the yaw of dead reckoning comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum YawSource {
    /// The odometry itself.
    #[default]
    Odometry,
    /// The gyro, integrated between two odometry samples; its last rate holds until the next.
    Gyro,
}

/// What dead reckoning needs to know of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionModel {
    /// Geometry for wheel readings; without it they are refused.
    pub drive: Option<DifferentialDrive>,
    /// Process noise.
    pub noise: MotionNoise,
    /// Where yaw comes from.
    pub yaw: YawSource,
    /// Constant rate the gyro shows at standstill, subtracted, rad/s.
    pub gyro_bias_rad_s: f64,
}

/// Motion between two odometry samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Stamp of the earlier sample.
    pub from: Timestamp,
    /// Stamp of the later sample.
    pub to: Timestamp,
    /// Body motion, tangent order (m, m, rad): the pose moves by `exp(motion)`.
    pub motion: Vector3,
    /// Its process noise in the body frame.
    pub covariance: Symmetric3,
}

/// Why an odometry sample was not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OdometryRefusal {
    /// Stamped at or before one already used.
    #[error("odometry stamped {time} is not after the last at {last}")]
    OutOfOrder {
        /// Its stamp.
        time: Timestamp,
        /// The last stamp used.
        last: Timestamp,
    },
    /// NaN or infinite.
    #[error("odometry stamped {time} is not finite")]
    NotFinite {
        /// Its stamp.
        time: Timestamp,
    },
    /// Wheel angles without the robot's geometry.
    #[error("wheel angles need wheel_radius_m and track_width_m in the robot's configuration")]
    NoGeometry,
    /// Velocity, wheel and increment odometry of one robot cannot be mixed.
    #[error("odometry stamped {time} is of another kind than before")]
    KindChanged {
        /// Its stamp.
        time: Timestamp,
    },
}

/// Turns odometry and gyro samples into steps.
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    model: MotionModel,
    last: Option<Sample>,
    gyro: Option<GyroHold>,
}

/// The gyro's last rate, and the angle integrated since the last odometry sample.
#[derive(Clone, Copy, Debug)]
struct GyroHold {
    since: Timestamp,
    rate_rad_s: f64,
    angle_rad: f64,
}

impl GyroHold {
    fn advance(&mut self, to: Timestamp) {
        if to > self.since {
            self.angle_rad += self.rate_rad_s * to.seconds_since(self.since);
            self.since = to;
        }
    }
}

impl DeadReckoning {
    /// Begins before the first sample.
    pub fn new(model: MotionModel) -> Self {
        Self { model, last: None, gyro: None }
    }

    /// Stamp of the last odometry sample used.
    pub fn last_time(&self) -> Option<Timestamp> {
        self.last.map(|sample| sample.time)
    }

    /// Takes a gyro reading; ignored where yaw comes from the odometry.
    pub fn gyro(&mut self, time: Timestamp, yaw_rate_rad_s: f64) {
        if self.model.yaw == YawSource::Odometry || !yaw_rate_rad_s.is_finite() {
            return;
        }
        let rate_rad_s = yaw_rate_rad_s - self.model.gyro_bias_rad_s;
        match &mut self.gyro {
            Some(hold) => {
                hold.advance(time);
                hold.rate_rad_s = rate_rad_s;
            }
            None => self.gyro = Some(GyroHold { since: time, rate_rad_s, angle_rad: 0.0 }),
        }
    }

    /// Takes an odometry sample; gives the motion since the one before, or `None` for the first.
    ///
    /// # Errors
    /// [`OdometryRefusal`]; the sample then leaves no trace.
    pub fn odometry(&mut self, sample: Sample) -> Result<Option<Step>, OdometryRefusal> {
        let time = sample.time;
        let Some(last) = self.last else {
            Self::motion_between(&self.model, &sample, &sample, 0.0)?;
            self.restart(sample);
            return Ok(None);
        };
        if time <= last.time {
            return Err(OdometryRefusal::OutOfOrder { time, last: last.time });
        }
        let seconds = time.seconds_since(last.time);
        let mut motion = Self::motion_between(&self.model, &last, &sample, seconds)?;
        if let Some(hold) = &mut self.gyro {
            hold.advance(time);
            motion.z = hold.angle_rad;
            hold.angle_rad = 0.0;
        }
        self.last = Some(sample);
        let covariance = self.model.noise.covariance(&motion, seconds);
        Ok(Some(Step { from: last.time, to: time, motion, covariance }))
    }

    /// Starts anew at `sample`: what lies between it and the last one is not motion of this trajectory.
    pub fn restart(&mut self, sample: Sample) {
        self.last = Some(sample);
        if let Some(hold) = &mut self.gyro {
            hold.advance(sample.time);
            hold.angle_rad = 0.0;
        }
    }

    fn motion_between(
        model: &MotionModel,
        last: &Sample,
        sample: &Sample,
        seconds: f64,
    ) -> Result<Vector3, OdometryRefusal> {
        let time = sample.time;
        let motion = match (last.reading, sample.reading) {
            (
                Reading::Velocity { forward_m_s, yaw_rate_rad_s },
                Reading::Velocity { forward_m_s: new_forward, yaw_rate_rad_s: new_rate },
            ) => {
                if !(new_forward.is_finite() && new_rate.is_finite()) {
                    return Err(OdometryRefusal::NotFinite { time });
                }
                Vector3::new(forward_m_s * seconds, 0.0, yaw_rate_rad_s * seconds)
            }
            (
                Reading::Wheels { left_rad, right_rad },
                Reading::Wheels { left_rad: new_left, right_rad: new_right },
            ) => {
                let drive = model.drive.ok_or(OdometryRefusal::NoGeometry)?;
                drive.motion(new_left - left_rad, new_right - right_rad)
            }
            (Reading::Increment(_), Reading::Increment(increment)) => increment.log(),
            _ => return Err(OdometryRefusal::KindChanged { time }),
        };
        if motion.iter().all(|component| component.is_finite()) {
            Ok(motion)
        } else {
            Err(OdometryRefusal::NotFinite { time })
        }
    }
}

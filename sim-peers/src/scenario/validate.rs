//! Whether the values of a scenario make sense, each and together.

use std::f64::consts::PI;

use pleiad_estimation::RobotId;

use super::{DriveKind, RobotSettings, Scenario};
use crate::Error;

/// Odometry slower than this would hold the wheels for too long to steer, Hz; observations start after
/// its first tick wherever that falls ([`crate::world::OBSERVATIONS_FROM_S`]).
const LEAST_ODOMETRY_HZ: f64 = 5.0;
/// No channel is faster, Hz.
const GREATEST_RATE_HZ: f64 = 1000.0;

/// More beams to a scan would be a picture.
const GREATEST_BEAMS: f64 = 10_000.0;

/// A wheel steered farther than this would not roll, radians.
const GREATEST_STEER_RAD: f64 = 1.5;

/// A value that makes no sense, without its place.
#[derive(Debug)]
pub(super) struct Invalid {
    pub(super) robot: Option<RobotId>,
    pub(super) key: String,
    pub(super) found: String,
    pub(super) expected: String,
}

impl Scenario {
    /// Checks every value; a scenario read from a file has passed already.
    ///
    /// # Errors
    /// [`Error::Value`] naming the first key whose value makes no sense.
    pub fn validate(&self) -> Result<(), Error> {
        self.check().map_err(|Invalid { robot, key, found, expected }| Error::Value {
            place: format!("scenario `{}`", self.name),
            key: robot.map_or_else(|| key.clone(), |robot| format!("robot {robot}: {key}")),
            found,
            expected,
        })
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        let team = Check { robot: None };
        team.above_zero("duration_s", self.duration_s)?;
        team.above_zero("arena.width_m", self.arena.width_m)?;
        team.above_zero("arena.height_m", self.arena.height_m)?;
        team.rate("truth_rate_hz", self.truth_rate_hz, f64::MIN_POSITIVE)?;
        team.not_negative("truth_sigma_m", self.truth_sigma_m)?;
        team.not_negative("truth_sigma_rad", self.truth_sigma_rad)?;
        if self.robots.is_empty() {
            return Err(team.invalid("robots", "empty", "at least one robot: give team_size or [[robots]]"));
        }
        for (landmark, position) in &self.landmarks {
            if !position.iter().all(|coordinate| coordinate.is_finite()) {
                let found = format!("landmark {landmark} at {position:?}");
                return Err(team.invalid("landmarks", &found, "finite coordinates"));
            }
        }
        if let Some(wall) = self.walls_m.iter().find(|wall| !wall.iter().all(|end| end.is_finite())) {
            return Err(team.invalid("walls_m", &format!("{wall:?}"), "[x0, y0, x1, y1], finite"));
        }
        for (robot, settings) in &self.robots {
            let check = Check { robot: Some(*robot) };
            if robot.0 == 0 {
                return Err(check.invalid("id", "0", "a whole number from 1"));
            }
            check.body(settings)?;
            check.places(settings, self.arena.bounds_m())?;
            check.motion(settings)?;
            check.sensors(settings)?;
            check.relative(settings)?;
            check.scan(settings)?;
        }
        Ok(())
    }
}

struct Check {
    robot: Option<RobotId>,
}

impl Check {
    fn body(&self, settings: &RobotSettings) -> Result<(), Invalid> {
        self.above_zero("wheel_radius_m", settings.wheel_radius_m)?;
        self.above_zero("track_width_m", settings.track_width_m)?;
        self.above_zero("servo_time_constant_s", settings.servo_time_constant_s)?;
        self.above_zero("servo_time_constant_turn_s", settings.servo_time_constant_turn_s)?;
        self.rate("command_rate_hz", settings.command_rate_hz, f64::MIN_POSITIVE)?;
        self.not_negative("command_jitter_s", settings.command_jitter_s)?;
        self.finite("voltage_rate_v_per_s", settings.voltage_rate_v_per_s)?;
        self.above_zero("drive.track_ratio", settings.drive.track_ratio)?;
        self.above_zero("drive.wheelbase_m", settings.drive.wheelbase_m)?;
        self.above_zero("drive.max_steer_rad", settings.drive.max_steer_rad)?;
        self.between("drive.max_steer_rad", settings.drive.max_steer_rad, 0.0, GREATEST_STEER_RAD)?;
        self.not_negative("drive.steer_sigma_rad", settings.drive.steer_sigma_rad)?;
        for (key, value) in settings.declared.values() {
            let key = format!("declared.{key}");
            if key.ends_with("wheel_radius") || key.ends_with("track_width") || key.ends_with("gyro_scale") {
                self.above_zero(&key, value)?;
            } else if key.contains("servo") || key.contains("ticks") {
                self.not_negative(&key, value)?;
            } else {
                self.finite(&key, value)?;
            }
        }
        self.above_zero("prior.sigma_position_m", settings.prior.sigma_position_m)?;
        self.above_zero("prior.sigma_heading_rad", settings.prior.sigma_heading_rad)
    }

    fn places(&self, settings: &RobotSettings, bounds: [f64; 4]) -> Result<(), Invalid> {
        let [x_min, x_max, y_min, y_max] = bounds;
        if let Some(start) = settings.start {
            self.between("start.x_m", start.x_m, x_min, x_max)?;
            self.between("start.y_m", start.y_m, y_min, y_max)?;
            self.finite("start.heading_rad", start.heading_rad)?;
        }
        let mut last_s = 0.0;
        for kidnap in &settings.kidnap {
            if !(kidnap.time_s.is_finite() && kidnap.time_s > last_s) {
                let expected = format!("a time after {last_s}: above 0, and one later than the other");
                return Err(self.invalid("kidnap.time_s", &kidnap.time_s.to_string(), &expected));
            }
            last_s = kidnap.time_s;
            self.between("kidnap.x_m", kidnap.x_m, x_min, x_max)?;
            self.between("kidnap.y_m", kidnap.y_m, y_min, y_max)?;
            self.finite("kidnap.heading_rad", kidnap.heading_rad)?;
        }
        if let Some(area) = settings.motion.area_m {
            let [left, right, bottom, top] = area;
            let inside = x_min <= left && left < right && right <= x_max;
            if !(inside && y_min <= bottom && bottom < top && top <= y_max) {
                let expected = format!("[x_min, x_max, y_min, y_max] within the arena {bounds:?}");
                return Err(self.invalid("motion.area_m", &format!("{area:?}"), &expected));
            }
        }
        Ok(())
    }

    fn motion(&self, settings: &RobotSettings) -> Result<(), Invalid> {
        let motion = &settings.motion;
        self.above_zero("motion.speed_m_s", motion.speed_m_s)?;
        self.above_zero("motion.min_speed_m_s", motion.min_speed_m_s)?;
        if motion.min_speed_m_s > motion.speed_m_s {
            let expected = format!("at most motion.speed_m_s = {}", motion.speed_m_s);
            return Err(self.invalid("motion.min_speed_m_s", &motion.min_speed_m_s.to_string(), &expected));
        }
        self.above_zero("motion.max_yaw_rate_rad_s", motion.max_yaw_rate_rad_s)?;
        self.above_zero("motion.radius_m", motion.radius_m)?;
        self.above_zero("motion.side_m", motion.side_m)?;
        self.above_zero("motion.move_s", motion.move_s)?;
        for row in &motion.script {
            if !(row.iter().all(|value| value.is_finite()) && row[2] > 0.0) {
                let expected = "finite numbers [forward m/s, yaw rate rad/s, seconds] with seconds above 0";
                return Err(self.invalid("motion.script", &format!("{row:?}"), expected));
            }
        }
        let nothing = !motion.manoeuvres.is_empty()
            && settings.drive.kind == DriveKind::CarLike
            && motion.manoeuvres.iter().all(|kind| kind.on_the_spot());
        if nothing {
            let names: Vec<_> = motion.manoeuvres.iter().map(|kind| kind.name()).collect();
            let expected = "a manoeuvre without turning on the spot, which a car cannot do";
            return Err(self.invalid("motion.manoeuvres", &format!("{names:?}"), expected));
        }
        self.not_negative("motion.keep_away_m", motion.keep_away_m)
    }

    fn sensors(&self, settings: &RobotSettings) -> Result<(), Invalid> {
        self.rate("odometry.rate_hz", settings.odometry.rate_hz, LEAST_ODOMETRY_HZ)?;
        let noise = &settings.odometry.noise;
        self.not_negative("odometry.noise.speed_m_per_sqrt_s", noise.speed_m_per_sqrt_s)?;
        self.not_negative("odometry.noise.lateral_m_per_sqrt_s", noise.lateral_m_per_sqrt_s)?;
        self.not_negative("odometry.noise.yaw_rad_per_sqrt_s", noise.yaw_rad_per_sqrt_s)?;
        self.not_negative("odometry.noise.speed_m_per_sqrt_m", noise.speed_m_per_sqrt_m)?;
        self.not_negative("odometry.noise.yaw_rad_per_sqrt_rad", noise.yaw_rad_per_sqrt_rad)?;
        let wheels = &settings.odometry.wheel_noise;
        self.not_negative("odometry.wheel_noise.left_m_per_sqrt_s", wheels.left_m_per_sqrt_s)?;
        self.not_negative("odometry.wheel_noise.right_m_per_sqrt_s", wheels.right_m_per_sqrt_s)?;
        let lasting = &settings.odometry.lasting;
        self.not_negative("odometry.lasting.speed_m_s", lasting.speed_m_s)?;
        self.not_negative("odometry.lasting.lateral_m_s", lasting.lateral_m_s)?;
        self.not_negative("odometry.lasting.yaw_rad_s", lasting.yaw_rad_s)?;
        self.above_zero("odometry.lasting.time_constant_s", lasting.time_constant_s)?;
        let degrees = settings.noise_degrees_of_freedom;
        let known = degrees == 0.0 || (degrees.is_finite() && degrees > 2.0);
        self.require(
            known,
            "noise_degrees_of_freedom",
            degrees,
            "a finite number above 2, or 0 for normal noise",
        )?;
        self.rate("gyro.rate_hz", settings.gyro.rate_hz, 0.0)?;
        self.above_zero("gyro.sigma_rad_s", settings.gyro.sigma_rad_s)?;
        self.finite("gyro.bias_rad_s", settings.gyro.bias_rad_s)?;
        self.rate("gps.rate_hz", settings.gps.rate_hz, 0.0)?;
        self.above_zero("gps.sigma_m", settings.gps.sigma_m)?;
        for window in &settings.gps.windows_s {
            let [from, until] = *window;
            if !(from >= 0.0 && until > from && until.is_finite()) {
                let found = format!("{window:?}");
                return Err(self.invalid("gps.windows_s", &found, "[from, until] with 0 <= from < until"));
            }
        }
        self.rate("heading.rate_hz", settings.heading.rate_hz, 0.0)?;
        self.above_zero("heading.sigma_rad", settings.heading.sigma_rad)
    }

    fn relative(&self, settings: &RobotSettings) -> Result<(), Invalid> {
        let relative = &settings.relative;
        self.rate("relative.rate_hz", relative.rate_hz, 0.0)?;
        self.above_zero("relative.sigma_range_m", relative.sigma_range_m)?;
        self.above_zero("relative.sigma_bearing_rad", relative.sigma_bearing_rad)?;
        self.above_zero("relative.sigma_position_m", relative.sigma_position_m)?;
        self.above_zero("relative.sigma_yaw_rad", relative.sigma_yaw_rad)?;
        self.not_negative("relative.min_range_m", relative.min_range_m)?;
        self.above_zero("relative.max_range_m", relative.max_range_m)?;
        if relative.max_range_m <= relative.min_range_m {
            let expected = format!("more than relative.min_range_m = {}", relative.min_range_m);
            return Err(self.invalid("relative.max_range_m", &relative.max_range_m.to_string(), &expected));
        }
        self.above_zero("relative.half_fov_rad", relative.half_fov_rad)?;
        self.between("relative.half_fov_rad", relative.half_fov_rad, 0.0, PI + 1e-4)?;
        self.between("relative.drop_out", relative.drop_out, 0.0, 1.0)
    }

    fn scan(&self, settings: &RobotSettings) -> Result<(), Invalid> {
        let scan = &settings.scan;
        self.rate("scan.rate_hz", scan.rate_hz, 0.0)?;
        self.between("scan.beams", f64::from(scan.beams), 1.0, GREATEST_BEAMS)?;
        self.above_zero("scan.half_fov_rad", scan.half_fov_rad)?;
        self.between("scan.half_fov_rad", scan.half_fov_rad, 0.0, PI + 1e-4)?;
        self.above_zero("scan.max_range_m", scan.max_range_m)?;
        self.not_negative("scan.sigma_m", scan.sigma_m)
    }

    fn finite(&self, key: &str, value: f64) -> Result<(), Invalid> {
        self.require(value.is_finite(), key, value, "a finite number")
    }

    fn above_zero(&self, key: &str, value: f64) -> Result<(), Invalid> {
        self.require(value.is_finite() && value > 0.0, key, value, "a finite number above 0")
    }

    fn not_negative(&self, key: &str, value: f64) -> Result<(), Invalid> {
        self.require(value.is_finite() && value >= 0.0, key, value, "a finite number, 0 or more")
    }

    fn between(&self, key: &str, value: f64, least: f64, greatest: f64) -> Result<(), Invalid> {
        let expected = format!("a number from {least} to {greatest}");
        self.require(value >= least && value <= greatest, key, value, &expected)
    }

    /// A channel's rate; `least` 0 allows for its absence.
    fn rate(&self, key: &str, value: f64, least: f64) -> Result<(), Invalid> {
        let expected = match least {
            0.0 => format!("a rate up to {GREATEST_RATE_HZ} Hz, or 0 for none"),
            f64::MIN_POSITIVE => format!("a rate above 0 and up to {GREATEST_RATE_HZ} Hz"),
            _ => format!("a rate from {least} to {GREATEST_RATE_HZ} Hz"),
        };
        self.require(value >= least && value <= GREATEST_RATE_HZ, key, value, &expected)
    }

    fn require(&self, holds: bool, key: &str, value: f64, expected: &str) -> Result<(), Invalid> {
        if holds { Ok(()) } else { Err(self.invalid(key, &value.to_string(), expected)) }
    }

    fn invalid(&self, key: &str, found: &str, expected: &str) -> Invalid {
        Invalid {
            robot: self.robot,
            key: key.to_owned(),
            found: found.to_owned(),
            expected: expected.to_owned(),
        }
    }
}

//! Reads and writes `nominal.toml`: what the nominal simulation believes.

mod extras;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use pleiad_estimation::RobotId;
use toml::{Table, Value};

use crate::error::RecordingError;
use crate::folder::{load_toml, robot_folder, robot_of, write_whole};
use crate::types::{Nominal, NominalNoise, NominalRangeSensor, NominalRobot};

/// The version of `nominal.toml` that is read and written.
const VERSION: i64 = 1;
/// The one model the nominal simulation knows.
const MODEL: &str = "ideal_unicycle";
const RATE_SUFFIX: &str = "_rate_hz";
/// The first line of a nominal model.
pub(crate) const COMMENT: &str = "What the nominal simulation believes. SI units, radians.";

/// What a key without an entry means.
#[derive(Clone, Copy)]
enum Absent {
    /// An error: nobody can know it.
    Refused,
    /// The sensor or motion is taken as ideal in this respect, with a warning.
    Ideal(f64),
}

/// The values that make sense.
#[derive(Clone, Copy)]
enum Domain {
    Any,
    NotNegative,
    Positive,
    Probability,
}

impl Domain {
    fn holds(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Any => true,
                Self::NotNegative => value >= 0.0,
                Self::Positive => value > 0.0,
                Self::Probability => (0.0..=1.0).contains(&value),
            }
    }

    fn description(self) -> &'static str {
        match self {
            Self::Any => "a finite number",
            Self::NotNegative => "a finite number, at least 0",
            Self::Positive => "a finite number above 0",
            Self::Probability => "a probability from 0 to 1",
        }
    }
}

/// One key of a section and the field that it fills.
struct Key<T> {
    name: &'static str,
    absent: Absent,
    domain: Domain,
    field: fn(&mut T) -> &mut f64,
}

/// Lists the keys of a section, each named as its field.
macro_rules! keys {
    ($section:ty; $($name:ident, $absent:expr, $domain:expr;)*) => {
        &[$(Key {
            name: stringify!($name),
            absent: $absent,
            domain: $domain,
            field: |section: &mut $section| &mut section.$name,
        }),*]
    };
}

const NOISE: &[Key<NominalNoise>] = keys! { NominalNoise;
    gyro_sigma_rad_s, Absent::Refused, Domain::NotNegative;
    gps_sigma_m, Absent::Refused, Domain::NotNegative;
    heading_sigma_rad, Absent::Refused, Domain::NotNegative;
    range_sigma_m, Absent::Refused, Domain::NotNegative;
    bearing_sigma_rad, Absent::Refused, Domain::NotNegative;
    truth_sigma_m, Absent::Refused, Domain::NotNegative;
    truth_sigma_rad, Absent::Refused, Domain::NotNegative;
    odometry_floor_pos_sigma_m_per_1s, Absent::Ideal(0.0), Domain::NotNegative;
    odometry_floor_heading_sigma_rad_per_1s, Absent::Ideal(0.0), Domain::NotNegative;
    odometry_floor_lateral_slip_s, Absent::Ideal(0.0), Domain::NotNegative;
    gyro_floor_lag_s, Absent::Ideal(0.0), Domain::NotNegative;
    command_floor_lag_s, Absent::Ideal(0.0), Domain::NotNegative;
    command_floor_wheel_speed_offset_rad_s, Absent::Ideal(0.0), Domain::NotNegative;
    clean_drift_fraction_of_distance, Absent::Ideal(0.0), Domain::NotNegative;
    command_jitter_s, Absent::Ideal(0.0), Domain::NotNegative;
    command_floor_wheel_angle_sigma_rad_per_0p2s, Absent::Ideal(0.0), Domain::NotNegative;
};

const RANGE_SENSOR: &[Key<NominalRangeSensor>] = keys! { NominalRangeSensor;
    max_range_m, Absent::Refused, Domain::Positive;
    min_range_m, Absent::Refused, Domain::NotNegative;
    half_fov_rad, Absent::Refused, Domain::Positive;
    detection_probability, Absent::Ideal(1.0), Domain::Probability;
    mount_x_m, Absent::Ideal(0.0), Domain::Any;
    mount_y_m, Absent::Ideal(0.0), Domain::Any;
    mount_yaw_rad, Absent::Ideal(0.0), Domain::Any;
    latency_s, Absent::Ideal(0.0), Domain::Any;
    range_scale, Absent::Ideal(1.0), Domain::Positive;
};

const ROBOT: &[Key<NominalRobot>] = keys! { NominalRobot;
    wheel_radius, Absent::Refused, Domain::Positive;
    track_width, Absent::Refused, Domain::Positive;
    encoder_ticks_per_rev, Absent::Refused, Domain::NotNegative;
    servo_time_constant_s, Absent::Refused, Domain::NotNegative;
    servo_time_constant_turn_s, Absent::Refused, Domain::NotNegative;
    command_latency_s, Absent::Ideal(0.0), Domain::Any;
    range_bias_m, Absent::Ideal(0.0), Domain::Any;
    gyro_bias_rad_s, Absent::Ideal(0.0), Domain::Any;
    gyro_scale, Absent::Ideal(1.0), Domain::Positive;
    gps_mount_x_m, Absent::Ideal(0.0), Domain::Any;
    gps_mount_y_m, Absent::Ideal(0.0), Domain::Any;
    gps_latency_s, Absent::Ideal(0.0), Domain::Any;
    clock_offset_s, Absent::Ideal(0.0), Domain::Any;
    clock_drift_ppm, Absent::Ideal(0.0), Domain::Any;
};

/// Reads a `nominal.toml`; `None` if there is no such file. Unknown keys, and keys whose absence was taken
/// as ideal, are named in `warnings`.
///
/// # Errors
/// The file is no TOML; a key is of the wrong type, outside its range, or missing though nothing can stand
/// in for it; the model or the version is unknown.
pub fn read_nominal(path: &Path, warnings: &mut Vec<String>) -> Result<Option<Nominal>, RecordingError> {
    let Some(table) = load_toml(path)? else { return Ok(None) };
    nominal_of(path, &table, warnings).map(Some)
}

/// What the table of a `nominal.toml` says; `path` is for messages.
pub(crate) fn nominal_of(
    path: &Path,
    table: &Table,
    warnings: &mut Vec<String>,
) -> Result<Nominal, RecordingError> {
    let mut reader = Reader { path, file: file_name(path), warnings };
    reader.head(table)?;
    let noise = reader.section(table, "noise", "noise", NOISE, |_, _, _| Ok(false))?;
    let range_sensor =
        reader.section(table, "range_sensor", "range_sensor", RANGE_SENSOR, |_, _, _| Ok(false))?;
    let team_drive = extras::drive(table).map_err(|wrong| reader.wrong("", wrong))?;
    let robots_table = reader.table(table, "robots", "robots")?;
    let mut robots = BTreeMap::new();
    for name in robots_table.keys() {
        let section = format!("robots.{name}");
        let robot: RobotId = robot_of(name).ok_or_else(|| {
            reader.refused(&section, "this name".to_owned(), "a robot's section, such as robots.r1")
        })?;
        let mut read: NominalRobot = reader.section(robots_table, name, &section, ROBOT, read_rate)?;
        let own = reader.table(robots_table, name, &section)?;
        let drive = extras::drive(own).map_err(|wrong| reader.wrong(&section, wrong))?;
        read.drive = drive.or(team_drive).unwrap_or_default();
        read.effects = extras::effects(own).map_err(|wrong| reader.wrong(&section, wrong))?;
        robots.insert(robot, read);
    }
    Ok(Nominal { noise, range_sensor, robots })
}

/// Channel rates go by the suffix of their keys; drive and effects are read apart; `Ok(false)` for any other
/// key.
fn read_rate(robot: &mut NominalRobot, key: &str, value: &Value) -> Result<bool, Domain> {
    if !key.ends_with(RATE_SUFFIX) {
        return Ok(key == extras::EFFECTS || extras::DRIVE.contains(&key));
    }
    let rate = number(value).filter(|&rate| Domain::NotNegative.holds(rate)).ok_or(Domain::NotNegative)?;
    robot.rates_hz.insert(key.to_owned(), rate);
    Ok(true)
}

/// Writes a `nominal.toml`, whole or not at all; `duration_s` is the length of the recording.
///
/// # Errors
/// A value is outside its range, or the file system refuses.
pub fn write_nominal(path: &Path, nominal: &Nominal, duration_s: f64) -> Result<(), RecordingError> {
    let text = nominal_text(nominal, COMMENT, Some(duration_s))
        .map_err(|reason| RecordingError::Unwritable { reason })?;
    write_whole(path, &text)
}

/// The text of `nominal.toml`, or which value cannot be written.
pub(crate) fn nominal_text(
    nominal: &Nominal,
    comment: &str,
    duration_s: Option<f64>,
) -> Result<String, String> {
    let mut text = String::new();
    // Writing to a string cannot fail, here and below.
    for line in comment.lines() {
        let _ = writeln!(text, "{}", format!("# {line}").trim_end());
    }
    let _ = writeln!(text, "format_version = {VERSION}");
    if let Some(duration_s) = duration_s {
        let _ = writeln!(text, "duration_s = {duration_s:?}");
    }
    let _ = writeln!(text, "model = \"{MODEL}\"");
    push_section(&mut text, "noise", NOISE, &nominal.noise)?;
    push_section(&mut text, "range_sensor", RANGE_SENSOR, &nominal.range_sensor)?;
    // Says that the section is there even when it is empty.
    text.push_str("\n[robots]\n");
    for (robot, values) in &nominal.robots {
        let section = format!("robots.{}", robot_folder(*robot));
        push_section(&mut text, &section, ROBOT, values)?;
        for (key, rate) in &values.rates_hz {
            let bare = key.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
            if !bare || !key.ends_with(RATE_SUFFIX) || !Domain::NotNegative.holds(*rate) {
                return Err(format!("nominal `{section}.{key}` = {rate} is not a channel's rate"));
            }
            let _ = writeln!(text, "{key} = {rate:?}");
        }
        extras::push(&mut text, &section, values.drive, &values.effects)?;
    }
    Ok(text)
}

fn push_section<T: Clone>(
    text: &mut String,
    section: &str,
    keys: &[Key<T>],
    values: &T,
) -> Result<(), String> {
    let mut values = values.clone();
    let _ = writeln!(text, "\n[{section}]");
    for key in keys {
        let value = *(key.field)(&mut values);
        if !key.domain.holds(value) {
            let expected = key.domain.description();
            return Err(format!("nominal `{section}.{}` is {value}, expected {expected}", key.name));
        }
        let _ = writeln!(text, "{} = {value:?}", key.name);
    }
    Ok(())
}

struct Reader<'a> {
    path: &'a Path,
    file: String,
    warnings: &'a mut Vec<String>,
}

impl Reader<'_> {
    fn refused(&self, key: &str, found: String, expected: &str) -> RecordingError {
        let (file, key, expected) = (self.path.to_path_buf(), key.to_owned(), expected.to_owned());
        RecordingError::BadKey { file, key, found, expected }
    }

    fn wrong(&self, section: &str, wrong: extras::Wrong) -> RecordingError {
        let key = [section, &wrong.key].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
        self.refused(&key.join("."), wrong.found, &wrong.expected)
    }

    fn unknown(&mut self, key: &str) {
        self.warnings.push(format!("{}: key `{key}` is not known and was not read", self.file));
    }

    /// The keys before the sections.
    fn head(&mut self, table: &Table) -> Result<(), RecordingError> {
        for (key, value) in table {
            let expected = match key.as_str() {
                "format_version" if value.as_integer() != Some(VERSION) => {
                    format!("{VERSION}, the version this program reads")
                }
                "model" if value.as_str() != Some(MODEL) => {
                    format!("\"{MODEL}\", the nominal model this program knows")
                }
                "duration_s" if !number(value).is_some_and(|value| Domain::NotNegative.holds(value)) => {
                    Domain::NotNegative.description().to_owned()
                }
                "format_version" | "model" | "duration_s" | "noise" | "range_sensor" | "robots" => continue,
                key if extras::DRIVE.contains(&key) => continue,
                _ => {
                    self.unknown(key);
                    continue;
                }
            };
            return Err(self.refused(key, found(Some(value)), &expected));
        }
        Ok(())
    }

    fn table<'t>(&self, parent: &'t Table, name: &str, section: &str) -> Result<&'t Table, RecordingError> {
        let value = parent.get(name);
        value
            .and_then(Value::as_table)
            .ok_or_else(|| self.refused(section, found(value), "a section of keys"))
    }

    /// Reads a section; keys that are not in `keys` go to `other`, which tells whether it knows them.
    fn section<T: Default>(
        &mut self,
        parent: &Table,
        name: &str,
        section: &str,
        keys: &[Key<T>],
        other: fn(&mut T, &str, &Value) -> Result<bool, Domain>,
    ) -> Result<T, RecordingError> {
        let table = self.table(parent, name, section)?;
        let mut values = T::default();
        let mut ideal = Vec::new();
        for key in keys {
            let entry = table.get(key.name);
            let value = match (entry, key.absent) {
                (Some(value), _) => number(value).filter(|&value| key.domain.holds(value)),
                (None, Absent::Ideal(value)) => {
                    ideal.push(format!("{} = {value}", key.name));
                    Some(value)
                }
                (None, Absent::Refused) => None,
            };
            *(key.field)(&mut values) = value.ok_or_else(|| {
                self.refused(&format!("{section}.{}", key.name), found(entry), key.domain.description())
            })?;
        }
        if !ideal.is_empty() {
            self.warnings.push(format!("{}: [{section}] is taken to say {}", self.file, ideal.join(", ")));
        }
        for (key, value) in table.iter().filter(|(name, _)| !keys.iter().any(|key| key.name == *name)) {
            let full = format!("{section}.{key}");
            let known = other(&mut values, key, value)
                .map_err(|domain| self.refused(&full, found(Some(value)), domain.description()))?;
            if !known {
                self.unknown(&full);
            }
        }
        Ok(values)
    }
}

/// A number, written as integer or decimal.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(value) => Some(*value),
        // Counts and rates, far below the 2^53 from which an integer would lose digits.
        Value::Integer(value) => Some(*value as f64),
        _ => None,
    }
}

fn found(value: Option<&Value>) -> String {
    match value {
        None => "nothing".to_owned(),
        Some(Value::Table(_)) => "a section".to_owned(),
        Some(value) => format!("`{value}`"),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests;

//! `recording.toml`: what the folder should hold, so that a folder copied in part is noticed.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use pleiad_estimation::RobotId;
use toml::{Table, Value};

use super::{CHANNELS, robot_folder, robot_of};
use crate::error::RecordingError;
use crate::table::load;

/// The file's name.
pub(super) const FILE: &str = "recording.toml";

/// The newest version of the folder that is read, and the one that is written. Version 1 is the format of
/// the sample recordings; version 2 adds `velocity.csv`, `increment.csv` and further kinds of sighting; version 3
/// `scan.csv`, `walls.csv` and `steer.csv`.
pub const FORMAT_VERSION: i64 = 3;

const UNITS: &str = "SI, radians";
const EPOCH: &str = "common to the robots and the ground truth";
const KEYS: [&str; 6] = ["format_version", "name", "units", "epoch", "robots", "channels"];

/// What a folder says of itself.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Manifest {
    /// The recording's name; `None` leaves it to the folder's.
    pub(super) name: Option<String>,
    /// The robots; `None` leaves it to the folders found.
    pub(super) robots: Option<Vec<RobotId>>,
    /// Rows by robot and channel.
    pub(super) rows: BTreeMap<RobotId, BTreeMap<String, usize>>,
}

/// Parses a TOML file; `None` if there is none.
pub(crate) fn load_toml(path: &Path) -> Result<Option<Table>, RecordingError> {
    let Some(bytes) = load(path)? else { return Ok(None) };
    let invalid = |message: String| RecordingError::Toml { file: path.to_path_buf(), message };
    let text = String::from_utf8(bytes).map_err(|error| invalid(error.to_string()))?;
    text.parse().map(Some).map_err(|error: toml::de::Error| invalid(error.to_string()))
}

impl Manifest {
    /// Reads `recording.toml` of `folder`; `None` if there is none.
    pub(super) fn read(folder: &Path, warnings: &mut Vec<String>) -> Result<Option<Self>, RecordingError> {
        let path = folder.join(FILE);
        let Some(table) = load_toml(&path)? else { return Ok(None) };
        let refused = |key: &str, found: String, expected: &str| RecordingError::BadKey {
            file: path.clone(),
            key: key.to_owned(),
            found,
            expected: expected.to_owned(),
        };
        let described =
            |value: Option<&Value>| value.map_or("nothing".to_owned(), |value| format!("`{value}`"));
        let version = table.get("format_version");
        let readable = |version: i64| (1..=FORMAT_VERSION).contains(&version);
        if !version.and_then(Value::as_integer).is_some_and(readable) {
            let expected = format!("a version from 1 to {FORMAT_VERSION}, the newest this program reads");
            return Err(refused("format_version", described(version), &expected));
        }
        let text = |key: &str| match table.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            other => Err(refused(key, described(other), "text in quotes")),
        };
        if text("units")?.is_some_and(|units| units != UNITS) {
            return Err(refused("units", described(table.get("units")), &format!("`{UNITS:?}`")));
        }
        text("epoch")?;
        let mut manifest = Self { name: text("name")?, ..Self::default() };
        if let Some(value) = table.get("robots") {
            let number = |value: &Value| value.as_integer().and_then(|n| u32::try_from(n).ok()).map(RobotId);
            let robots = value.as_array().and_then(|list| list.iter().map(number).collect());
            let expected = "a list of robot numbers such as [1, 2, 3]";
            manifest.robots =
                Some(robots.ok_or_else(|| refused("robots", described(Some(value)), expected))?);
        }
        if let Some(value) = table.get("channels") {
            let expected = "for each robot the rows of its channels, such as r1 = { gyro = 7426 }";
            manifest.rows =
                rows_of(value).ok_or_else(|| refused("channels", described(Some(value)), expected))?;
        }
        for key in table.keys().filter(|key| !KEYS.contains(&key.as_str())) {
            warnings.push(format!("{FILE}: key `{key}` is not known and was not read"));
        }
        Ok(Some(manifest))
    }

    /// The file's text.
    pub(super) fn text(&self) -> String {
        let mut text = format!("# One recording of a team of robots.\nformat_version = {FORMAT_VERSION}\n");
        if let Some(name) = &self.name {
            // Writing to a string cannot fail, here and below.
            let _ = writeln!(text, "name = {}", Value::from(name.as_str()));
        }
        let _ = writeln!(text, "units = \"{UNITS}\"\nepoch = \"{EPOCH}\"");
        if let Some(robots) = &self.robots {
            let robots: Vec<String> = robots.iter().map(ToString::to_string).collect();
            let _ = writeln!(text, "robots = [{}]", robots.join(", "));
        }
        text.push_str("\n# Rows of each channel.\n[channels]\n");
        for (robot, channels) in &self.rows {
            let rows: Vec<String> = channels.iter().map(|(name, rows)| format!("{name} = {rows}")).collect();
            let _ = writeln!(text, "{} = {{ {} }}", robot_folder(*robot), rows.join(", "));
        }
        text
    }
}

fn rows_of(value: &Value) -> Option<BTreeMap<RobotId, BTreeMap<String, usize>>> {
    let count = |(name, rows): (&String, &Value)| {
        CHANNELS.iter().find(|channel| channel.name == name)?;
        Some((name.clone(), usize::try_from(rows.as_integer()?).ok()?))
    };
    let robot = |(name, channels): (&String, &Value)| {
        Some((robot_of(name)?, channels.as_table()?.iter().map(count).collect::<Option<_>>()?))
    };
    value.as_table()?.iter().map(robot).collect()
}

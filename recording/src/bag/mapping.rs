//! `mapping.toml`: which topic or file is which channel of which robot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use pleiad_estimation::sample::Target;
use pleiad_estimation::{LandmarkId, RobotId};
use serde::Deserialize;

use crate::error::RecordingError;
use crate::folder::{CHANNELS, Channel, RELATIVE};
use crate::suggest::nearest;

/// How far a robot may tilt before its yaw is no heading in the plane any more, radians: 20 degrees.
const MAX_TILT_RAD: f64 = 0.35;

/// A mapping, checked.
#[derive(Debug)]
pub(super) struct Mapping {
    file: PathBuf,
    told: Told,
    topics: Vec<Topic>,
    tables: Vec<CsvTable>,
}

/// The file as it is written.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Told {
    name: Option<String>,
    origin: Option<Origin>,
    #[serde(default)]
    landmark: Vec<Landmark>,
    #[serde(default)]
    topic: Vec<ToldTopic>,
    #[serde(default)]
    csv: Vec<ToldTable>,
}

/// Where on the ellipsoid the map's origin is.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Origin {
    pub(super) latitude_deg: f64,
    pub(super) longitude_deg: f64,
    #[serde(default)]
    pub(super) altitude_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Landmark {
    id: u32,
    x_m: f64,
    y_m: f64,
}

/// Where a stamp is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum TimeSource {
    Header,
    Log,
}

/// What joints tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum JointValue {
    #[default]
    Position,
    Velocity,
}

/// What a relative pose is used as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum RelativeAs {
    #[default]
    Pose,
    Position,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToldTopic {
    topic: String,
    robot: u32,
    channel: String,
    time: Option<TimeSource>,
    #[serde(default)]
    offset_s: f64,
    scale: Option<Vec<f64>>,
    frame: Option<String>,
    child_frame: Option<String>,
    max_tilt_rad: Option<f64>,
    #[serde(default)]
    joints: Vec<String>,
    #[serde(default)]
    left: Vec<String>,
    #[serde(default)]
    right: Vec<String>,
    #[serde(default)]
    from: JointValue,
    target: Option<ToldTarget>,
    #[serde(default)]
    relative: RelativeAs,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
enum ToldTarget {
    Robot(u32),
    Landmark(u32),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToldTable {
    file: String,
    robot: u32,
    channel: String,
    columns: Vec<String>,
    #[serde(default)]
    time_unit: TimeUnit,
    #[serde(default)]
    offset_s: f64,
    scale: Option<Vec<f64>>,
}

/// Unit of a column of stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub(super) enum TimeUnit {
    #[default]
    #[serde(rename = "s")]
    Seconds,
    #[serde(rename = "ms")]
    Milliseconds,
    #[serde(rename = "us")]
    Microseconds,
    #[serde(rename = "ns")]
    Nanoseconds,
}

/// What numbers are multiplied with, and stamps are moved by.
#[derive(Clone, Debug)]
pub(super) struct Conversion {
    pub(super) offset_s: f64,
    pub(super) scale: Vec<f64>,
}

/// One topic, checked.
#[derive(Clone, Debug)]
pub(super) struct Topic {
    /// Its table, for messages.
    pub(super) place: String,
    /// Its name in the bag.
    pub(super) name: String,
    pub(super) robot: RobotId,
    pub(super) channel: Channel,
    pub(super) time: Option<TimeSource>,
    pub(super) conversion: Conversion,
    pub(super) frame: Option<String>,
    pub(super) child_frame: Option<String>,
    pub(super) max_tilt_rad: f64,
    pub(super) joints: Vec<String>,
    pub(super) left: Vec<String>,
    pub(super) right: Vec<String>,
    pub(super) from: JointValue,
    pub(super) target: Option<Target>,
    pub(super) relative: RelativeAs,
}

/// One csv file, checked.
#[derive(Clone, Debug)]
pub(super) struct CsvTable {
    pub(super) place: String,
    pub(super) file: String,
    pub(super) robot: RobotId,
    pub(super) channel: Channel,
    /// Names of the columns in the order of the channel's.
    pub(super) columns: Vec<String>,
    pub(super) time_unit: TimeUnit,
    pub(super) conversion: Conversion,
}

impl Mapping {
    /// Reads and checks a mapping.
    pub(super) fn read(file: &Path) -> Result<Self, RecordingError> {
        let text = std::fs::read_to_string(file).map_err(RecordingError::io("read", file))?;
        let told: Told = toml::from_str(&text)
            .map_err(|error| RecordingError::Toml { file: file.to_path_buf(), message: error.to_string() })?;
        let refused = |place: &str, problem: String| RecordingError::Mapping {
            mapping: file.to_path_buf(),
            place: place.to_owned(),
            problem,
        };
        if told.topic.is_empty() && told.csv.is_empty() {
            let problem = "found neither [[topic]] nor [[csv]]; expected one for each channel".to_owned();
            return Err(refused("mapping", problem));
        }
        if let Some(origin) = told.origin
            && !(origin.latitude_deg.abs() <= 90.0
                && origin.longitude_deg.abs() <= 360.0
                && origin.altitude_m.is_finite())
        {
            return Err(refused(
                "origin",
                "expected a latitude from -90 to 90 and a longitude in degrees".to_owned(),
            ));
        }
        let mut seen = BTreeSet::new();
        for Landmark { id, x_m, y_m } in &told.landmark {
            if !(x_m.is_finite() && y_m.is_finite() && seen.insert(*id)) {
                let problem = format!("landmark {id}: expected finite numbers, and every landmark once");
                return Err(refused("landmark", problem));
            }
        }
        let mut topics = Vec::new();
        for (index, topic) in told.topic.iter().enumerate() {
            let place = format!("topic[{}] ({})", index + 1, topic.topic);
            topics.push(checked_topic(topic, &place).map_err(|problem| refused(&place, problem))?);
        }
        let mut tables = Vec::new();
        for (index, table) in told.csv.iter().enumerate() {
            let place = format!("csv[{}] ({})", index + 1, table.file);
            tables.push(checked_table(table, &place).map_err(|problem| refused(&place, problem))?);
        }
        Ok(Self { file: file.to_path_buf(), told, topics, tables })
    }

    pub(super) fn file(&self) -> &Path {
        &self.file
    }

    pub(super) fn name(&self) -> Option<String> {
        self.told.name.clone()
    }

    pub(super) fn origin(&self) -> Option<Origin> {
        self.told.origin
    }

    pub(super) fn landmarks(&self) -> BTreeMap<LandmarkId, [f64; 2]> {
        self.told.landmark.iter().map(|own| (LandmarkId(own.id), [own.x_m, own.y_m])).collect()
    }

    pub(super) fn topics(&self) -> &[Topic] {
        &self.topics
    }

    pub(super) fn tables(&self) -> &[CsvTable] {
        &self.tables
    }

    /// An error at one of its tables.
    pub(super) fn refused(&self, place: &str, problem: String) -> RecordingError {
        RecordingError::Mapping { mapping: self.file.clone(), place: place.to_owned(), problem }
    }
}

fn channel_named(name: &str) -> Result<Channel, String> {
    CHANNELS.into_iter().find(|channel| channel.name == name).ok_or_else(|| {
        let names = CHANNELS.map(|channel| channel.name);
        let near = nearest(name, names.into_iter())
            .map(|near| format!("; did you mean `{near}`?"))
            .unwrap_or_default();
        format!("key `channel`: found `{name}`, expected one of {}{near}", names.join(", "))
    })
}

fn conversion(channel: Channel, offset_s: f64, scale: Option<&[f64]>) -> Result<Conversion, String> {
    let columns = &channel.columns[1..];
    if !offset_s.is_finite() || offset_s.abs() > 1e9 {
        return Err(format!("key `offset_s`: found {offset_s}, expected seconds within 1e9 of 0"));
    }
    let scale = match scale {
        None => vec![1.0; columns.len()],
        Some(&[all]) => vec![all; columns.len()],
        Some(each) if each.len() == columns.len() => each.to_vec(),
        Some(other) => {
            let count = other.len();
            return Err(format!(
                "key `scale`: found {count} numbers, expected one, or one for each of {}",
                columns.join(", ")
            ));
        }
    };
    match scale.iter().find(|factor| !factor.is_finite() || **factor == 0.0) {
        Some(factor) => Err(format!("key `scale`: found {factor}, expected finite numbers other than 0")),
        None => Ok(Conversion { offset_s, scale }),
    }
}

fn checked_topic(told: &ToldTopic, place: &str) -> Result<Topic, String> {
    let channel = channel_named(&told.channel)?;
    let max_tilt_rad = told.max_tilt_rad.unwrap_or(MAX_TILT_RAD);
    if !(0.0..=std::f64::consts::PI).contains(&max_tilt_rad) {
        return Err(format!("key `max_tilt_rad`: found {max_tilt_rad}, expected an angle from 0 to pi"));
    }
    if (channel == RELATIVE) != told.target.is_some() {
        return Err(
            "key `target`: expected for channel `relative` and for no other, as in { robot = 2 }".to_owned()
        );
    }
    if channel == RELATIVE && told.scale.is_some() {
        return Err(
            "key `scale`: poses that were seen are in metres and radians already; leave it out".to_owned()
        );
    }
    let scale = if channel == RELATIVE { None } else { told.scale.as_deref() };
    Ok(Topic {
        place: place.to_owned(),
        name: told.topic.clone(),
        robot: RobotId(told.robot),
        channel,
        time: told.time,
        conversion: conversion(channel, told.offset_s, scale)?,
        frame: told.frame.clone(),
        child_frame: told.child_frame.clone(),
        max_tilt_rad,
        joints: told.joints.clone(),
        left: told.left.clone(),
        right: told.right.clone(),
        from: told.from,
        target: told.target.map(|target| match target {
            ToldTarget::Robot(robot) => Target::Robot(RobotId(robot)),
            ToldTarget::Landmark(landmark) => Target::Landmark(LandmarkId(landmark)),
        }),
        relative: told.relative,
    })
}

fn checked_table(told: &ToldTable, place: &str) -> Result<CsvTable, String> {
    let channel = channel_named(&told.channel)?;
    if channel == RELATIVE {
        return Err("key `channel`: sightings name their targets; write them as r1/relative.csv".to_owned());
    }
    if told.columns.len() != channel.columns.len() {
        return Err(format!(
            "key `columns`: found {} names, expected those of the columns with {}",
            told.columns.len(),
            channel.columns.join(", ")
        ));
    }
    Ok(CsvTable {
        place: place.to_owned(),
        file: told.file.clone(),
        robot: RobotId(told.robot),
        channel,
        columns: told.columns.clone(),
        time_unit: told.time_unit,
        conversion: conversion(channel, told.offset_s, told.scale.as_deref())?,
    })
}

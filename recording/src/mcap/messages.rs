//! Messages of the recording's own topics: a stamp and the columns of the channel, as JSON.

use std::fmt::Write;

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use serde_json::{Map, Value};

use crate::folder::sightings::{self, Kind};
use crate::number::push_number;
use crate::types::Recording;

const NANOS_PER_SECOND: i64 = 1_000_000_000;
/// Columns of a sighting's numbers, as in `relative.csv`.
const NUMBERS: [&str; 5] = ["range", "bearing", "x", "y", "yaw"];

/// Seconds, rounded down, and nanoseconds since then.
pub(super) fn parts(time: Timestamp) -> (i64, i64) {
    (time.0.div_euclid(NANOS_PER_SECOND), time.0.rem_euclid(NANOS_PER_SECOND))
}

/// What MCAP sorts by: nanoseconds, never negative.
pub(super) fn log_time(time: Timestamp) -> u64 {
    u64::try_from(time.0).unwrap_or(0)
}

/// A row of numbers.
pub(super) fn numbers(columns: &[&str], time: Timestamp, numbers: &[f64]) -> Vec<u8> {
    let mut text = begin(time);
    for (name, value) in columns.iter().skip(1).zip(numbers) {
        push(&mut text, name, *value);
    }
    text.push('}');
    text.into_bytes()
}

/// A sighting.
pub(super) fn sighting(time: Timestamp, target: Target, relative: &Relative) -> Result<Vec<u8>, String> {
    let mut text = begin(time);
    let (kind, number) = match target {
        Target::Robot(robot) => ("robot", robot.0),
        Target::Landmark(landmark) => ("landmark", landmark.0),
    };
    let relative_kind = Kind::of(relative).name();
    // Writing to a string cannot fail, here and below.
    let _ = write!(text, r#","target_kind":"{kind}","target_id":{number},"relative_kind":"{relative_kind}""#);
    for (name, value) in NUMBERS.iter().zip(sightings::cells(relative)) {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return Err(format!("the number {value} is not finite"));
        }
        push(&mut text, name, value);
    }
    text.push('}');
    Ok(text.into_bytes())
}

/// Landmarks and walls.
pub(super) fn map(recording: &Recording) -> Result<Vec<u8>, String> {
    let numbers = recording.landmarks.values().flatten().chain(recording.walls.iter().flatten());
    if let Some(value) = numbers.into_iter().find(|value| !value.is_finite()) {
        return Err(format!("map: the number {value} is not finite"));
    }
    let landmark =
        |(id, [x, y]): (&LandmarkId, &[f64; 2])| format!(r#"{{"id":{},"x":{x:?},"y":{y:?}}}"#, id.0);
    let landmarks: Vec<String> = recording.landmarks.iter().map(landmark).collect();
    let wall =
        |[x0, y0, x1, y1]: &[f64; 4]| format!(r#"{{"x0":{x0:?},"y0":{y0:?},"x1":{x1:?},"y1":{y1:?}}}"#);
    let walls: Vec<String> = recording.walls.iter().map(wall).collect();
    Ok(format!(r#"{{"landmarks":[{}],"walls":[{}]}}"#, landmarks.join(","), walls.join(",")).into_bytes())
}

fn begin(time: Timestamp) -> String {
    let (sec, nsec) = parts(time);
    format!(r#"{{"t":{{"sec":{sec},"nsec":{nsec}}}"#)
}

fn push(text: &mut String, name: &str, value: f64) {
    let _ = write!(text, r#","{name}":"#);
    push_number(text, value);
}

/// A message as it was read.
pub(super) struct Message(Map<String, Value>);

impl Message {
    /// Parses a message.
    pub(super) fn parse(data: &[u8]) -> Result<Self, String> {
        match serde_json::from_slice(data) {
            Ok(Value::Object(fields)) => Ok(Self(fields)),
            Ok(_) => Err("a JSON object".to_owned()),
            Err(error) => Err(format!("a JSON object ({error})")),
        }
    }

    /// Its stamp.
    pub(super) fn time(&self) -> Result<Timestamp, String> {
        let part = |name: &str| self.0.get("t").and_then(|t| t.get(name)).and_then(Value::as_i64);
        let (Some(sec), Some(nsec)) = (part("sec"), part("nsec")) else {
            return Err("a stamp `t` with whole numbers `sec` and `nsec`".to_owned());
        };
        let fits = (0..NANOS_PER_SECOND).contains(&nsec);
        // Seconds are rounded down: the earliest instants only fit once the nanoseconds are added.
        let nanos = i128::from(sec) * i128::from(NANOS_PER_SECOND) + i128::from(nsec);
        match i64::try_from(nanos) {
            Ok(nanos) if fits => Ok(Timestamp(nanos)),
            _ => Err("a stamp within 292 years from the epoch, with `nsec` below 1e9".to_owned()),
        }
    }

    /// A number.
    pub(super) fn number(&self, name: &str) -> Result<f64, String> {
        let value = self.0.get(name).and_then(Value::as_f64).filter(|value| value.is_finite());
        value.ok_or_else(|| format!("a finite number `{name}`"))
    }

    /// The numbers of a channel.
    pub(super) fn numbers(&self, columns: &[&str]) -> Result<Vec<f64>, String> {
        columns.iter().skip(1).map(|name| self.number(name)).collect()
    }

    /// A sighting.
    pub(super) fn sighting(&self) -> Result<Sample, String> {
        let text = |name: &str| self.0.get(name).and_then(Value::as_str).unwrap_or_default();
        let number = self.0.get("target_id").and_then(Value::as_u64).and_then(|id| u32::try_from(id).ok());
        let number = number.ok_or("a whole number `target_id`")?;
        let target = match text("target_kind") {
            "robot" => Target::Robot(RobotId(number)),
            "landmark" => Target::Landmark(LandmarkId(number)),
            other => return Err(format!("`robot` or `landmark` as `target_kind`, not `{other}`")),
        };
        let kind = text("relative_kind");
        let kind = Kind::named(kind).ok_or_else(|| format!("a known `relative_kind`, not `{kind}`"))?;
        let range = || match self.number("range")? {
            range if range >= 0.0 => Ok(range),
            range => Err(format!("a range that is not negative, not {range}")),
        };
        let relative = match kind {
            Kind::RangeBearing => {
                Relative::RangeBearing { range_m: range()?, bearing_rad: self.number("bearing")? }
            }
            Kind::Range => Relative::Range { range_m: range()? },
            Kind::Bearing => Relative::Bearing { bearing_rad: self.number("bearing")? },
            Kind::Position => Relative::Position { x_m: self.number("x")?, y_m: self.number("y")? },
            Kind::Pose => {
                Relative::Pose(Pose2::new(self.number("x")?, self.number("y")?, self.number("yaw")?))
            }
        };
        Ok(Sample { time: self.time()?, reading: Reading::Sighting { target, relative } })
    }

    /// The objects of a list, each as a message.
    pub(super) fn list(&self, name: &str) -> Result<Vec<Self>, String> {
        let object = |value: &Value| value.as_object().cloned().map(Self);
        let list = self.0.get(name).and_then(Value::as_array);
        let list = list.and_then(|list| list.iter().map(object).collect::<Option<_>>());
        list.ok_or_else(|| format!("a list `{name}` of objects"))
    }

    /// A whole number.
    pub(super) fn identifier(&self, name: &str) -> Result<u32, String> {
        let number = self.0.get(name).and_then(Value::as_u64).and_then(|id| u32::try_from(id).ok());
        number.ok_or_else(|| format!("a whole number `{name}`"))
    }
}

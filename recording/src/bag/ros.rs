//! Reads the mapped topics of a bag.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pleiad_estimation::sample::{Reading, Sample, Target};
use pleiad_estimation::{Pose2, Timestamp};

use super::Gathered;
use super::convert::{KINDS, Kind, Outcome, Part, Refusal, is_meant, outcome};
use super::geodesy::TangentPlane;
use super::mapping::{JointValue, Mapping, Origin, TimeSource, Topic};
use crate::error::RecordingError;
use crate::folder::rows;
use crate::mcap::stream::{self, Channel, Item, scan};
use crate::report::SkippedRow;

/// Topics and frames that a message lists at most.
const LISTED: usize = 60;

const REMEDY: &str = "correct the mapping, or leave such messages out (--skip-bad-rows)";

/// The topics of `bags` with their types, for people.
pub(super) fn listed(bags: &[PathBuf]) -> Result<String, RecordingError> {
    let mut all = BTreeSet::new();
    for bag in bags {
        all.extend(stream::channels(bag)?.into_iter().map(|channel| (channel.topic, channel.schema)));
    }
    Ok(list(&all))
}

fn list(topics: &BTreeSet<(String, String)>) -> String {
    let mut text = "its topics:".to_owned();
    for (topic, schema) in topics.iter().take(LISTED) {
        let used = if kind_of(schema).is_some() { "" } else { ", not read" };
        // Writing to a string cannot fail, here and below.
        let _ = write!(text, "\n  {topic} ({}{used})", normal(schema));
    }
    if topics.len() > LISTED {
        let _ = write!(text, "\n  and {} more", topics.len() - LISTED);
    }
    text
}

/// The full name of a type, which some writers shorten as ROS 1 did.
fn normal(schema: &str) -> String {
    match schema.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => schema.to_owned(),
    }
}

fn kind_of(schema: &str) -> Option<&'static Kind> {
    static ALL: [Kind; 11] = KINDS;
    let name = normal(schema);
    ALL.iter().find(|kind| kind.name == name)
}

/// What waits for the whole bag to be read.
#[derive(Default)]
struct Waiting {
    poses: Vec<(Timestamp, Pose2)>,
    speeds: Vec<(Timestamp, [f64; 2])>,
    without_fix: usize,
    /// Frames that were seen and not meant.
    other_frames: BTreeSet<(String, String)>,
    taken: usize,
}

/// Reads what `mapping` asks of `bags`.
pub(super) fn read(
    bags: &[PathBuf],
    mapping: &Mapping,
    gathered: &mut Gathered<'_>,
) -> Result<(), RecordingError> {
    let mut reader = Reader {
        mapping,
        gathered,
        seen: BTreeSet::new(),
        waiting: BTreeMap::new(),
        plane: mapping.origin().map(|origin| (TangentPlane::at(origin), origin)),
    };
    for topic in mapping.topics() {
        reader.gathered.recording.robots.entry(topic.robot).or_default();
    }
    for bag in bags {
        scan(bag, |item| {
            match item {
                Item::Channel(channel) => reader.channel(channel)?,
                Item::Message { channel, number, log_time, data } => {
                    reader.message(bag, channel, number, log_time, data)?;
                }
                Item::Metadata { .. } | Item::Attachment { .. } => {}
            }
            Ok(ControlFlow::Continue(()))
        })?;
    }
    reader.finish()
}

struct Reader<'a, 'g> {
    mapping: &'a Mapping,
    gathered: &'a mut Gathered<'g>,
    seen: BTreeSet<(String, String)>,
    /// By the place of the topic in the mapping.
    waiting: BTreeMap<usize, Waiting>,
    plane: Option<(TangentPlane, Origin)>,
}

impl Reader<'_, '_> {
    /// Whether a channel is what the mapping takes it for.
    fn channel(&mut self, channel: &Channel) -> Result<(), RecordingError> {
        self.seen.insert((channel.topic.clone(), channel.schema.clone()));
        for topic in self.mapping.topics().iter().filter(|topic| topic.name == channel.topic) {
            suits(topic, channel).map_err(|problem| self.mapping.refused(&topic.place, problem))?;
        }
        Ok(())
    }

    fn message(
        &mut self,
        bag: &Path,
        channel: &Channel,
        number: usize,
        log_time: u64,
        data: &[u8],
    ) -> Result<(), RecordingError> {
        let Some(kind) = kind_of(&channel.schema) else { return Ok(()) };
        let mapping = self.mapping;
        let mapped = mapping.topics().iter().enumerate().filter(|(_, topic)| topic.name == channel.topic);
        for (place, topic) in mapped {
            let parts = (kind.decode)(data)
                .map_err(|error| (error.to_string(), format!("a message of {}", kind.name)));
            let result = parts.and_then(|parts| {
                parts.iter().try_for_each(|part| self.part(place, topic, kind, part, log_time))
            });
            let Err((found, expected)) = result else { continue };
            if self.gathered.options.skip_bad_rows {
                let file = self.gathered.file(topic.robot, topic.channel, &topic.name);
                file.rows += 1;
                file.skip(SkippedRow { line: number, found, expected });
                continue;
            }
            return Err(RecordingError::BadMessage {
                file: bag.to_path_buf(),
                topic: topic.name.clone(),
                number,
                found,
                expected,
                remedy: REMEDY,
            });
        }
        Ok(())
    }

    fn part(
        &mut self,
        place: usize,
        topic: &Topic,
        kind: &Kind,
        part: &Part,
        log_time: u64,
    ) -> Result<(), Refusal> {
        let waiting = self.waiting.entry(place).or_default();
        if !is_meant(topic, kind, part)? {
            if waiting.other_frames.len() < LISTED {
                let name = |frame: &Option<String>| frame.clone().unwrap_or_default();
                waiting.other_frames.insert((name(&part.frame), name(&part.child)));
            }
            return Ok(());
        }
        let time = stamp(topic, part, log_time)?;
        let robot = self.gathered.recording.robots.entry(topic.robot).or_default();
        let row = match outcome(topic, part, &mut self.plane)? {
            Outcome::Row(numbers) => numbers,
            Outcome::Pose(pose) => {
                waiting.poses.push((time, pose));
                waiting.taken += 1;
                return Ok(());
            }
            Outcome::Speeds(speeds) => {
                waiting.speeds.push((time, speeds));
                waiting.taken += 1;
                return Ok(());
            }
            Outcome::Seen(reading) => {
                if matches!(reading, Reading::Sighting { target: Target::Robot(seen), .. } if seen == topic.robot)
                {
                    let found = format!("a sighting of robot {} by itself", topic.robot);
                    return Err((found, "another `target`".to_owned()));
                }
                robot.push(Sample { time, reading });
                waiting.taken += 1;
                self.gathered.file(topic.robot, topic.channel, &topic.name).rows += 1;
                return Ok(());
            }
            Outcome::NoFix => {
                waiting.without_fix += 1;
                return Ok(());
            }
        };
        let scaled: Vec<f64> = row.iter().zip(&topic.conversion.scale).map(|(a, b)| a * b).collect();
        rows::insert(robot, topic.channel, time, &scaled)
            .map_err(|expected| (format!("{row:?}"), expected))?;
        waiting.taken += 1;
        self.gathered.file(topic.robot, topic.channel, &topic.name).rows += 1;
        Ok(())
    }

    fn finish(mut self) -> Result<(), RecordingError> {
        let known = |topic: &str| self.seen.iter().any(|(name, _)| name == topic);
        if let Some(topic) = self.mapping.topics().iter().find(|topic| !known(&topic.name)) {
            let problem = format!(
                "the bag has no topic `{}`; correct the key `topic`; {}",
                topic.name,
                list(&self.seen)
            );
            return Err(self.mapping.refused(&topic.place, problem));
        }
        let mapped = |topic: &str| self.mapping.topics().iter().any(|own| own.name == topic);
        let left: Vec<&str> =
            self.seen.iter().map(|(topic, _)| topic.as_str()).filter(|topic| !mapped(topic)).collect();
        if !left.is_empty() {
            let warning = format!("topics that the mapping leaves out: {}", left.join(", "));
            self.gathered.report.warnings.push(warning);
        }
        if let (None, Some((_, origin))) = (self.mapping.origin(), &self.plane) {
            self.gathered.report.warnings.push(format!(
                "the map has its origin at the first fix: latitude {:?}, longitude {:?}, altitude {:?} m; state it as \
                 [origin] to keep it",
                origin.latitude_deg, origin.longitude_deg, origin.altitude_m
            ));
        }
        for (place, waiting) in std::mem::take(&mut self.waiting) {
            if let Some(topic) = self.mapping.topics().get(place) {
                self.gathered.settle(topic, waiting)?;
            }
        }
        Ok(())
    }
}

/// Whether the channel of `topic` can be made of the messages of `channel`.
fn suits(topic: &Topic, channel: &Channel) -> Result<(), String> {
    let name = normal(&channel.schema);
    let Some(kind) = kind_of(&channel.schema) else {
        let known: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
        return Err(format!("found messages of {name}, expected one of {}", known.join(", ")));
    };
    if channel.encoding != "cdr" {
        let found = &channel.encoding;
        return Err(format!(
            "found messages written as `{found}`, expected `cdr`; convert the bag to ROS 2 (rosbags-convert)"
        ));
    }
    let wanted = topic.channel.name;
    if !kind.channels.contains(&wanted) {
        let able = kind.channels.join(", ");
        return Err(format!("key `channel`: found `{wanted}`, but {name} gives {able}"));
    }
    if topic.time == Some(TimeSource::Header) && !kind.stamped {
        return Err(format!("key `time`: found `header`, but {name} has none; write time = \"log\""));
    }
    if kind.many && (topic.frame.is_none() || topic.child_frame.is_none()) {
        return Err(format!(
            "{name} places many frames; name the two that are meant in `frame` and `child_frame`"
        ));
    }
    let named = |key: &str, names: &[String]| match names {
        [] => Err(format!(
            "key `{key}`: found nothing, expected the names of joints, as in [\"wheel_left_joint\"]"
        )),
        _ => Ok(()),
    };
    match wanted {
        "wheel_odometry" => named("left", &topic.left).and_then(|()| named("right", &topic.right)),
        "steer" => {
            if topic.from == JointValue::Velocity {
                return Err("key `from`: a steering angle is a position".to_owned());
            }
            named("joints", &topic.joints)
        }
        _ => Ok(()),
    }
}

fn stamp(topic: &Topic, part: &Part, log_time: u64) -> Result<Timestamp, Refusal> {
    let source =
        topic.time.unwrap_or(if part.stamp.is_some() { TimeSource::Header } else { TimeSource::Log });
    let nanos = match (source, part.stamp) {
        (TimeSource::Header, Some(stamp)) => stamp.nanos().ok_or_else(|| {
            (format!("a stamp with {} nanoseconds", stamp.nanosec), "less than a second of them".to_owned())
        })?,
        _ => i64::try_from(log_time).map_err(|_| {
            (format!("a log time of {log_time} ns"), "one within 292 years from 1970".to_owned())
        })?,
    };
    // Without an offset no digit is touched.
    let moved = Timestamp(nanos);
    Ok(if topic.conversion.offset_s == 0.0 { moved } else { moved.plus_seconds(topic.conversion.offset_s) })
}

impl Gathered<'_> {
    /// Makes rows of what had to wait for its neighbours, and tells what is odd about a topic.
    fn settle(&mut self, topic: &Topic, waiting: Waiting) -> Result<(), RecordingError> {
        let Waiting { poses, speeds, without_fix, other_frames, taken } = waiting;
        let count = poses.len() + speeds.len();
        if without_fix > 0 {
            let warning = format!("{}: {without_fix} messages without a fix left out", topic.name);
            self.report.warnings.push(warning);
        }
        if taken == 0 && !other_frames.is_empty() {
            let frames: Vec<String> =
                other_frames.iter().map(|(frame, child)| format!("{frame} -> {child}")).collect();
            let problem = format!(
                "found no transform from `{}` to `{}`; it has {}",
                topic.frame.as_deref().unwrap_or_default(),
                topic.child_frame.as_deref().unwrap_or_default(),
                frames.join(", ")
            );
            return Err(self.mapping.refused(&topic.place, problem));
        }
        if count == 0 {
            return Ok(());
        }
        let mut made = increments(poses, &topic.conversion.scale);
        made.extend(angles(speeds, &topic.conversion.scale));
        let dropped = count - made.len();
        if dropped > 0 {
            let warning = format!("{}: {dropped} messages with the stamp of another left out", topic.name);
            self.report.warnings.push(warning);
        }
        self.file(topic.robot, topic.channel, &topic.name).rows += made.len();
        let robot = self.recording.robots.entry(topic.robot).or_default();
        for (time, numbers) in made {
            rows::insert(robot, topic.channel, time, &numbers)
                .map_err(|problem| self.mapping.refused(&topic.place, format!("expected {problem}")))?;
        }
        Ok(())
    }
}

/// Sorts by stamp, stably, and keeps the first of every stamp.
fn sorted<T>(mut all: Vec<(Timestamp, T)>) -> Vec<(Timestamp, T)> {
    all.sort_by_key(|(time, _)| *time);
    all.dedup_by_key(|(time, _)| *time);
    all
}

/// Motion from each pose to the next, in the frame of the former; none at the first.
fn increments(poses: Vec<(Timestamp, Pose2)>, scale: &[f64]) -> Vec<(Timestamp, Vec<f64>)> {
    let poses = sorted(poses);
    let before = poses.first().into_iter().chain(&poses);
    let step = |((_, from), (time, to)): (&(Timestamp, Pose2), &(Timestamp, Pose2))| {
        let step = from.between(to);
        let numbers = [step.x_m(), step.y_m(), step.yaw_rad()];
        (*time, numbers.iter().zip(scale).map(|(number, factor)| number * factor).collect())
    };
    before.zip(&poses).map(step).collect()
}

/// Angles of wheels that turned at each speed until the next was told.
fn angles(speeds: Vec<(Timestamp, [f64; 2])>, scale: &[f64]) -> Vec<(Timestamp, Vec<f64>)> {
    let mut angles = [0.0; 2];
    let mut last: Option<(Timestamp, [f64; 2])> = None;
    let mut made = Vec::with_capacity(speeds.len());
    for (time, speed) in sorted(speeds) {
        if let Some((before, turned)) = last {
            let seconds = time.seconds_since(before);
            for (angle, (speed, factor)) in angles.iter_mut().zip(turned.iter().zip(scale)) {
                *angle += speed * factor * seconds;
            }
        }
        last = Some((time, speed));
        made.push((time, angles.to_vec()));
    }
    made
}

//! Writes a recording, and what was made of it, as an MCAP file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, Writer};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_ros::Message as _;
use pleiad_ros::messages::nav_msgs::Odometry;
use serde::Serialize;
use serde_json::Value;

use super::{
    FORMAT_KEY, MAP_TOPIC, METADATA, NAME_KEY, NOMINAL, ROBOTS_KEY, frame, messages, scene, schemas, topic,
    views,
};
use crate::error::RecordingError;
use crate::folder::{FORMAT_VERSION, RELATIVE, duration_s, rows};
use crate::nominal::{COMMENT, nominal_text};
use crate::types::Recording;

/// Least time between two views of one robot, seconds: viewers interpolate, and files stay small.
const SCENE_STEP_S: f64 = 0.5;
const TRUTH_STEP_S: f64 = 0.1;

/// Where a robot is believed to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// When.
    pub time: Timestamp,
    /// `map_from_robot`.
    pub pose: Pose2,
    /// Of position in the map and yaw.
    pub covariance: Symmetric3,
}

/// How grave a line of a log is, as `foxglove.Log` numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    /// Something that went as it should.
    Info = 2,
    /// Something that is worse than it should be.
    Warning = 3,
}

/// A line of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When.
    pub time: Timestamp,
    /// How grave.
    pub level: LogLevel,
    /// Who says so.
    pub name: String,
    /// What.
    pub message: String,
}

/// What goes into a file.
#[derive(Clone, Debug, Default)]
pub struct McapContents<'a> {
    /// The recording; `None` leaves only views.
    pub recording: Option<&'a Recording>,
    /// Estimates per robot, in the order of time.
    pub estimates: BTreeMap<RobotId, Vec<Estimate>>,
    /// What was said.
    pub logs: Vec<LogLine>,
    /// Files to lie within: texts by name.
    pub attachments: BTreeMap<String, String>,
}

/// Writes `contents` to `path`, whole or not at all; a file that is there is replaced.
///
/// The recording reads back the same: stamps to the nanosecond, numbers to the bit.
///
/// # Errors
/// A number is not finite; a robot has no odometry or odometry of several kinds; a channel is not sorted or holds
/// readings of another; the file system refuses.
pub fn write_mcap(path: &Path, contents: &McapContents<'_>) -> Result<(), RecordingError> {
    let unwritable = |reason: String| RecordingError::Unwritable { reason };
    let mut file = Output::new();
    if let Some(recording) = contents.recording {
        record(&mut file, recording).map_err(unwritable)?;
        view_world(&mut file, recording);
    }
    for (robot, estimates) in &contents.estimates {
        if let Some(bad) = estimates.iter().find(|estimate| !estimate.pose.is_finite()) {
            return Err(unwritable(format!(
                "robot {robot}: the estimate at {} is not finite",
                bad.time.seconds()
            )));
        }
        view_robot(&mut file, *robot, estimates, contents.recording);
    }
    if !contents.logs.is_empty() {
        let log = file.channel("/log", &schemas::log());
        for line in &contents.logs {
            file.push(log, line.time, Box::new(move || bytes(&views::log(line))));
        }
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".partial");
    let partial = path.with_file_name(name);
    file.write(&partial, contents)?;
    std::fs::rename(&partial, path).map_err(RecordingError::io("write", path))
}

type Render<'a> = Box<dyn Fn() -> Result<Vec<u8>, String> + 'a>;

/// Channels, and messages that are rendered when their turn comes.
struct Output<'a> {
    channels: Vec<ChannelSpec>,
    messages: Vec<(Timestamp, usize, Render<'a>)>,
}

struct ChannelSpec {
    topic: String,
    encoding: &'static str,
    schema: String,
    schema_encoding: &'static str,
    schema_text: String,
}

fn bytes(view: &impl Serialize) -> Result<Vec<u8>, String> {
    serde_json::to_vec(view).map_err(|error| error.to_string())
}

impl<'a> Output<'a> {
    fn new() -> Self {
        Self { channels: Vec::new(), messages: Vec::new() }
    }

    /// The number of the channel, which several robots may share.
    fn add(&mut self, channel: ChannelSpec) -> usize {
        let known = self.channels.iter().position(|known| known.topic == channel.topic);
        known.unwrap_or_else(|| {
            self.channels.push(channel);
            self.channels.len() - 1
        })
    }

    /// A channel of JSON whose schema is named by its title.
    fn channel(&mut self, topic: &str, schema: &Value) -> usize {
        self.add(ChannelSpec {
            topic: topic.to_owned(),
            encoding: "json",
            schema: schema["title"].as_str().unwrap_or_default().to_owned(),
            schema_encoding: schemas::ENCODING,
            schema_text: schema.to_string(),
        })
    }

    fn push(&mut self, channel: usize, time: Timestamp, render: Render<'a>) {
        self.messages.push((time, channel, render));
    }

    fn write(mut self, path: &Path, contents: &McapContents<'_>) -> Result<(), RecordingError> {
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(RecordingError::io("create", parent))?;
        }
        // Stably: within a channel, messages of one stamp stay in their order.
        self.messages.sort_by_key(|(time, channel, _)| (*time, *channel));
        let file = File::create(path).map_err(RecordingError::io("write", path))?;
        let refused = |error: mcap::McapError| RecordingError::Io {
            path: path.to_path_buf(),
            action: "write",
            source: std::io::Error::other(error),
        };
        let options = mcap::WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .library(concat!("pleiad ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(BufWriter::new(file)).map_err(refused)?;
        let mut ids = Vec::with_capacity(self.channels.len());
        if let Some(recording) = contents.recording {
            writer.write_metadata(&metadata(recording)).map_err(refused)?;
        }
        for spec in &self.channels {
            let schema = writer.add_schema(&spec.schema, spec.schema_encoding, spec.schema_text.as_bytes());
            let schema = schema.map_err(refused)?;
            let id = writer.add_channel(schema, &spec.topic, spec.encoding, &BTreeMap::new());
            ids.push(id.map_err(refused)?);
        }
        for (name, text) in attachments(contents)? {
            let data = text.as_bytes().into();
            let media_type = "application/toml".to_owned();
            let attachment = Attachment { log_time: 0, create_time: 0, name, media_type, data };
            writer.attach(&attachment).map_err(refused)?;
        }
        let mut sequences = vec![0; ids.len()];
        for (time, channel, render) in self.messages {
            let data = render().map_err(|reason| RecordingError::Unwritable { reason })?;
            let log_time = messages::log_time(time);
            let header = MessageHeader {
                channel_id: ids[channel],
                sequence: sequences[channel],
                log_time,
                publish_time: log_time,
            };
            sequences[channel] += 1;
            writer.write_to_known_channel(&header, &data).map_err(refused)?;
        }
        finish(writer).map_err(refused)
    }
}

/// Writes what comes last; an error that would only show when the file is closed shows here.
fn finish(mut writer: Writer<BufWriter<File>>) -> Result<(), mcap::McapError> {
    writer.finish()?;
    let mut buffered = writer.into_inner();
    std::io::Write::flush(&mut buffered)?;
    Ok(())
}

fn metadata(recording: &Recording) -> mcap::records::Metadata {
    let robots: Vec<String> = recording.robots.keys().map(ToString::to_string).collect();
    let values = [
        (FORMAT_KEY, FORMAT_VERSION.to_string()),
        (NAME_KEY, recording.name.clone()),
        (ROBOTS_KEY, robots.join(" ")),
    ];
    mcap::records::Metadata {
        name: METADATA.to_owned(),
        metadata: values.map(|(key, value)| (key.to_owned(), value)).into(),
    }
}

/// The files that lie within.
fn attachments(contents: &McapContents<'_>) -> Result<BTreeMap<String, String>, RecordingError> {
    let mut all = contents.attachments.clone();
    if let Some((recording, nominal)) = contents.recording.and_then(|own| Some((own, own.nominal.as_ref()?)))
    {
        let text = nominal_text(nominal, COMMENT, Some(duration_s(recording)))
            .map_err(|reason| RecordingError::Unwritable { reason })?;
        all.insert(NOMINAL.to_owned(), text);
    }
    Ok(all)
}

/// The recording itself: what is read back.
fn record<'a>(file: &mut Output<'a>, recording: &'a Recording) -> Result<(), String> {
    if recording.robots.is_empty() {
        return Err("it has no robot".to_owned());
    }
    let map = messages::map(recording)?;
    let first = first_stamp(recording);
    let channel = file.channel(MAP_TOPIC, &schemas::map());
    file.push(channel, first, Box::new(move || Ok(map.clone())));
    for (&robot, channels) in &recording.robots {
        let of = |reason: String| format!("robot {robot}, {reason}");
        for rows in rows::channels(channels).map_err(of)? {
            let rows = std::rc::Rc::new(rows);
            let channel = file.channel(&topic(robot, rows.channel.name), &schemas::channel(rows.channel));
            for (row, time) in rows.times.iter().enumerate() {
                // Whatever cannot be written is told before anything is.
                rows.numbers(row).map_err(of)?;
                let (rows, time) = (rows.clone(), *time);
                let render = move || Ok(messages::numbers(rows.channel.columns, time, &rows.numbers(row)?));
                file.push(channel, time, Box::new(render));
            }
        }
        let sightings = rows::sightings(&channels.sightings).map_err(of)?;
        if sightings.is_empty() {
            continue;
        }
        let channel = file.channel(&topic(robot, RELATIVE.name), &schemas::channel(RELATIVE));
        for (time, target, relative) in sightings {
            messages::sighting(time, target, &relative)
                .map_err(|what| of(rows::at(RELATIVE, time, &what)))?;
            file.push(channel, time, Box::new(move || messages::sighting(time, target, &relative)));
        }
    }
    Ok(())
}

fn first_stamp(recording: &Recording) -> Timestamp {
    let stamps = recording.robots.values().flat_map(|robot| &robot.odometry).map(|sample| sample.time);
    stamps.min().unwrap_or_default()
}

/// Landmarks, walls and true poses.
fn view_world<'a>(file: &mut Output<'a>, recording: &'a Recording) {
    let first = first_stamp(recording);
    let channel = file.channel("/scene/world", &schemas::scene_update());
    file.push(channel, first, Box::new(move || bytes(&scene::world(first, recording))));
    for (&robot, channels) in recording.robots.iter().filter(|(_, channels)| !channels.truth.is_empty()) {
        let channel = file.channel(&topic(robot, "truth_pose"), &schemas::pose_in_frame());
        let mut last: Option<Timestamp> = None;
        for truth in &channels.truth {
            if last.is_none_or(|last| truth.time.seconds_since(last) >= TRUTH_STEP_S) {
                let view = move || bytes(&views::pose_in_frame(truth.time, &truth.pose));
                file.push(channel, truth.time, Box::new(view));
                last = Some(truth.time);
            }
        }
    }
}

/// Pose, transform, odometry and scene of one robot.
fn view_robot<'a>(
    file: &mut Output<'a>,
    robot: RobotId,
    estimates: &'a [Estimate],
    recording: Option<&'a Recording>,
) {
    let description = Odometry::description();
    let odometry = file.add(ChannelSpec {
        topic: topic(robot, "estimate_odometry"),
        encoding: "cdr",
        schema: description.name.to_owned(),
        schema_encoding: "ros2msg",
        schema_text: description.text(),
    });
    let pose = file.channel(&topic(robot, "estimate"), &schemas::pose_in_frame());
    let transform = file.channel("/tf", &schemas::frame_transform());
    let update = file.channel(&format!("/scene/{}", frame(robot)), &schemas::scene_update());
    let channels = recording.and_then(|recording| recording.robots.get(&robot));
    let mut last: Option<Timestamp> = None;
    for (at, estimate) in estimates.iter().enumerate() {
        let Estimate { time, pose: of, .. } = *estimate;
        file.push(pose, time, Box::new(move || bytes(&views::pose_in_frame(time, &of))));
        let moved = move || bytes(&views::frame_transform(time, &frame(robot), &of));
        file.push(transform, time, Box::new(moved));
        if let Some(message) = views::odometry(estimate, &frame(robot)) {
            let render = move || pleiad_ros::to_cdr(&message).map_err(|error| error.to_string());
            file.push(odometry, time, Box::new(render));
        }
        if last.is_none_or(|last| time.seconds_since(last) >= SCENE_STEP_S) {
            let since = last.unwrap_or(time);
            let view = move || {
                let view = scene::robot(robot, estimates, at, since, channels);
                bytes(&view.ok_or("an estimate that is not there")?)
            };
            file.push(update, time, Box::new(view));
            last = Some(time);
        }
    }
}

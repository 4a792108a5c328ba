//! Reads back the recording in an MCAP file that Pleiad wrote.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use pleiad_estimation::sample::{Reading, Target};
use pleiad_estimation::{LandmarkId, RobotId};

use super::messages::Message;
use super::stream::{Channel, Item, scan};
use super::{FORMAT_KEY, MAP_TOPIC, METADATA, NAME_KEY, NOMINAL, ROBOTS_KEY};
use crate::error::RecordingError;
use crate::folder::{self, CHANNELS, FORMAT_VERSION, RELATIVE, rows};
use crate::ingest::ReadOptions;
use crate::nominal::nominal_of;
use crate::open::{Opened, warn_of_unmapped_targets};
use crate::report::{FileReport, Form, IngestReport, SkippedRow};
use crate::tidy::tidy_robot;
use crate::types::Recording;

/// What names the schemas of the recording's own topics.
pub(super) const SCHEMA_PREFIX: &str = "pleiad.";

const REMEDY: &str = "write the file again, or read with bad rows skipped (--skip-bad-rows)";

/// Whether Pleiad wrote a recording into the file: it says so before the first message.
pub(crate) fn is_own(path: &Path) -> Result<bool, RecordingError> {
    let mut own = false;
    scan(path, |item| {
        own |= match item {
            Item::Message { .. } => return Ok(ControlFlow::Break(())),
            Item::Metadata { name, .. } => name == METADATA,
            Item::Channel(channel) => channel.schema.starts_with(SCHEMA_PREFIX),
            Item::Attachment { .. } => false,
        };
        Ok(if own { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    })?;
    Ok(own)
}

/// Reads the recording in `path`.
pub(crate) fn read_own(path: &Path, options: ReadOptions) -> Result<Opened, RecordingError> {
    let mut reader = Reader {
        path,
        options,
        recording: Recording::default(),
        files: BTreeMap::new(),
        report: IngestReport::new(Form::Mcap),
        attachments: BTreeMap::new(),
        told: false,
    };
    scan(path, |item| reader.take(item).map(ControlFlow::Continue))?;
    reader.finish()
}

struct Reader<'a> {
    path: &'a Path,
    options: ReadOptions,
    recording: Recording,
    /// Reports by robot and channel.
    files: BTreeMap<(RobotId, &'static str), FileReport>,
    report: IngestReport,
    attachments: BTreeMap<String, String>,
    /// Whether the file said what it is.
    told: bool,
}

impl Reader<'_> {
    fn take(&mut self, item: Item<'_>) -> Result<(), RecordingError> {
        match item {
            Item::Metadata { name, values } if name == METADATA => self.metadata(&values),
            Item::Metadata { .. } | Item::Channel(_) => Ok(()),
            Item::Attachment { name, data } => {
                let Ok(text) = std::str::from_utf8(data) else {
                    self.report.warnings.push(format!("attachment {name}: not text; not read"));
                    return Ok(());
                };
                self.attachments.insert(name, text.to_owned());
                Ok(())
            }
            Item::Message { channel, number, data, .. } => {
                if !channel.schema.starts_with(SCHEMA_PREFIX) {
                    return Ok(());
                }
                self.message(channel, number, data)
            }
        }
    }

    fn metadata(&mut self, values: &BTreeMap<String, String>) -> Result<(), RecordingError> {
        let value = |key: &str| values.get(key).map(String::as_str).unwrap_or_default();
        let refused = |key: &str, expected: String| RecordingError::BadKey {
            file: self.path.to_path_buf(),
            key: format!("metadata {METADATA}.{key}"),
            found: format!("`{}`", value(key)),
            expected,
        };
        let version = value(FORMAT_KEY).parse::<i64>().ok();
        if !version.is_some_and(|version| (1..=FORMAT_VERSION).contains(&version)) {
            let expected = format!("a version from 1 to {FORMAT_VERSION}, the newest this program reads");
            return Err(refused(FORMAT_KEY, expected));
        }
        let number = |text: &str| text.parse().ok().map(RobotId);
        let robots: Option<Vec<RobotId>> =
            value(ROBOTS_KEY).split(' ').filter(|text| !text.is_empty()).map(number).collect();
        let robots = robots.ok_or_else(|| refused(ROBOTS_KEY, "numbers with blanks between".to_owned()))?;
        value(NAME_KEY).clone_into(&mut self.recording.name);
        for robot in robots {
            self.recording.robots.entry(robot).or_default();
        }
        self.told = true;
        Ok(())
    }

    fn message(&mut self, channel: &Channel, number: usize, data: &[u8]) -> Result<(), RecordingError> {
        let result = if channel.topic == MAP_TOPIC { self.map(data) } else { self.row(channel, data) };
        let Err(expected) = result else { return Ok(()) };
        let found = crate::table::shown(data);
        let file = self.place(channel).map(|(robot, channel)| self.files.entry((robot, channel.name)));
        if let Some(file) = file.filter(|_| self.options.skip_bad_rows) {
            let report = file.or_insert_with(|| FileReport::new(&channel.topic));
            report.rows += 1;
            report.skip(SkippedRow { line: number, found, expected });
            return Ok(());
        }
        Err(RecordingError::BadMessage {
            file: self.path.to_path_buf(),
            topic: channel.topic.clone(),
            number,
            found,
            expected,
            remedy: REMEDY,
        })
    }

    /// The robot and channel of a topic such as `/robot2/gyro`.
    fn place(&self, channel: &Channel) -> Option<(RobotId, folder::Channel)> {
        let (robot, name) = channel.topic.strip_prefix("/robot")?.split_once('/')?;
        let robot = robot.parse().ok().map(RobotId)?;
        let channel = CHANNELS.into_iter().find(|channel| channel.name == name)?;
        self.recording.robots.contains_key(&robot).then_some((robot, channel))
    }

    fn row(&mut self, channel: &Channel, data: &[u8]) -> Result<(), String> {
        let Some((robot, place)) = self.place(channel) else {
            return Err("a topic such as /robot1/gyro of a robot that the file lists".to_owned());
        };
        let message = Message::parse(data)?;
        let channels = self.recording.robots.entry(robot).or_default();
        if place == RELATIVE {
            let sample = message.sighting()?;
            if matches!(sample.reading, Reading::Sighting { target: Target::Robot(seen), .. } if seen == robot)
            {
                return Err(format!("another target than robot {robot} itself"));
            }
            channels.push(sample);
        } else {
            rows::insert(channels, place, message.time()?, &message.numbers(place.columns)?)?;
        }
        self.files.entry((robot, place.name)).or_insert_with(|| FileReport::new(&channel.topic)).rows += 1;
        Ok(())
    }

    fn map(&mut self, data: &[u8]) -> Result<(), String> {
        let message = Message::parse(data)?;
        for landmark in message.list("landmarks")? {
            let place = [landmark.number("x")?, landmark.number("y")?];
            let landmark = LandmarkId(landmark.identifier("id")?);
            if self.recording.landmarks.insert(landmark, place).is_some() {
                return Err(format!("landmark {landmark} only once"));
            }
        }
        for wall in message.list("walls")? {
            let ends = [wall.number("x0")?, wall.number("y0")?, wall.number("x1")?, wall.number("y1")?];
            self.recording.walls.push(ends);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Opened, RecordingError> {
        if !self.told {
            return Err(RecordingError::Mcap {
                file: self.path.to_path_buf(),
                message: format!("it has topics of a recording, but no metadata `{METADATA}` before them"),
            });
        }
        if let Some(text) = self.attachments.remove(NOMINAL) {
            let path = self.path.join(NOMINAL);
            let table = text.parse().map_err(|error: toml::de::Error| RecordingError::Toml {
                file: path.clone(),
                message: error.to_string(),
            })?;
            self.recording.nominal = Some(nominal_of(&path, &table, &mut self.report.warnings)?);
        }
        for (robot, channels) in &mut self.recording.robots {
            let kinds = rows::odometry_kinds(channels);
            if kinds.len() > 1 {
                let found = kinds.join(" and ");
                return Err(RecordingError::Ambiguous { folder: self.path.to_path_buf(), found });
            }
            let files = self.files.iter_mut().filter(|((of, _), _)| of == robot);
            tidy_robot(channels, files.map(|((_, name), report)| (*name, report)).collect());
            if channels.odometry.is_empty() {
                return Err(RecordingError::EmptyChannel {
                    file: self.path.to_path_buf(),
                    rows: 0,
                    skipped: 0,
                    needed_for: format!("robot {robot} cannot be localized without odometry"),
                });
            }
        }
        if self.recording.robots.is_empty() {
            let found = "it lists no robot".to_owned();
            return Err(RecordingError::NotARecording { path: self.path.to_path_buf(), found });
        }
        self.report.files.extend(self.files.into_values());
        warn_of_unmapped_targets(&self.recording, &mut self.report.warnings);
        Ok(Opened { recording: self.recording, report: self.report, attachments: self.attachments })
    }
}

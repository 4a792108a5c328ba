//! Files of others, through a mapping: ROS 2 bags (MCAP with CDR) and comma-separated values.
//!
//! A mapping is a TOML file that says which topic, or which file with which columns, is which channel of which robot.

mod convert;
mod csv;
mod geodesy;
mod mapping;
mod ros;
mod turn;

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_estimation::RobotId;

use crate::error::RecordingError;
use crate::folder::{Channel as Place, rows};
use crate::ingest::ReadOptions;
use crate::mcap;
use crate::open::{Opened, entries, recording_name, warn_of_unmapped_targets};
use crate::report::{FileReport, Form, IngestReport};
use crate::tidy::tidy_robot;
use crate::types::Recording;
use mapping::Mapping;

/// The mapping that lies beside the files it is for.
const BESIDE: &str = "mapping.toml";

/// Whether `folder` holds a bag, or a mapping of its files.
pub(crate) fn is_mapped(folder: &Path) -> Result<bool, RecordingError> {
    let files = entries(folder)?;
    Ok(files.iter().any(|(name, is_folder)| !is_folder && (is_bag(name) || name == BESIDE)))
}

fn is_bag(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|ending| ending == "mcap")
}

/// Reads an MCAP file, a folder of them (one bag, split), or csv files.
pub(crate) fn open(
    path: &Path,
    mapping: Option<&Path>,
    options: ReadOptions,
) -> Result<Opened, RecordingError> {
    let (folder, bags) = if path.is_dir() {
        let names = entries(path)?.into_iter().filter(|(name, is_folder)| !is_folder && is_bag(name));
        (path.to_path_buf(), names.map(|(name, _)| path.join(name)).collect())
    } else {
        // A bare name has the empty path as its parent, which no system lists.
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_path_buf();
        let bag = path.extension().is_some_and(|ending| ending == "mcap");
        (folder, if bag { vec![path.to_path_buf()] } else { Vec::new() })
    };
    if mapping.is_none()
        && let [file] = bags.as_slice()
        && mcap::is_own(file)?
    {
        return mcap::read_own(file, options);
    }
    let beside = folder.join(BESIDE);
    let told = match mapping {
        Some(file) => Mapping::read(file)?,
        None if beside.is_file() => Mapping::read(&beside)?,
        None => {
            let holds = ros::listed(&bags)?;
            return Err(RecordingError::NoMapping { file: path.to_path_buf(), beside, holds });
        }
    };
    let mut gathered = Gathered::new(path, &told, options);
    if !told.topics().is_empty() {
        if bags.is_empty() {
            return Err(no_bag(path, &folder)?);
        }
        ros::read(&bags, &told, &mut gathered)?;
    }
    csv::read(&folder, &told, &mut gathered)?;
    gathered.finish()
}

fn no_bag(path: &Path, folder: &Path) -> Result<RecordingError, RecordingError> {
    let names = entries(folder)?;
    let sqlite = names.iter().any(|(name, _)| Path::new(name).extension().is_some_and(|end| end == "db3"));
    let found = if sqlite {
        "its bag is of the SQLite form (.db3): convert it with `ros2 bag convert` to storage_id mcap"
    } else {
        "the mapping has topics, and it holds no .mcap file"
    };
    Ok(RecordingError::NotARecording { path: path.to_path_buf(), found: found.to_owned() })
}

/// What was read so far.
struct Gathered<'a> {
    path: &'a Path,
    mapping: &'a Mapping,
    options: ReadOptions,
    recording: Recording,
    report: IngestReport,
    /// Reports by robot and channel.
    files: BTreeMap<(RobotId, &'static str), FileReport>,
}

impl<'a> Gathered<'a> {
    fn new(path: &'a Path, mapping: &'a Mapping, options: ReadOptions) -> Self {
        let form = if mapping.topics().is_empty() { Form::Csv } else { Form::Bag };
        let whole = if path.is_dir() { recording_name(path) } else { stem(path) };
        let mut recording = Recording { name: mapping.name().unwrap_or(whole), ..Recording::default() };
        recording.landmarks = mapping.landmarks();
        let report = IngestReport::new(form);
        Self { path, mapping, options, recording, report, files: BTreeMap::new() }
    }

    /// The report on a channel of a robot, which comes from `source`.
    fn file(&mut self, robot: RobotId, channel: Place, source: &str) -> &mut FileReport {
        let file = self.files.entry((robot, channel.name)).or_insert_with(|| FileReport::new(source));
        if !file.file.split(" and ").any(|known| known == source) {
            file.file = format!("{} and {source}", file.file);
        }
        file
    }

    fn finish(mut self) -> Result<Opened, RecordingError> {
        for (&robot, channels) in &mut self.recording.robots {
            let kinds = rows::odometry_kinds(channels);
            if kinds.len() > 1 {
                let found = format!("{} of robot {robot}", kinds.join(" and "));
                return Err(RecordingError::Ambiguous { folder: self.mapping.file().to_path_buf(), found });
            }
            let files = self.files.iter_mut().filter(|((of, _), _)| *of == robot);
            tidy_robot(channels, files.map(|((_, name), report)| (*name, report)).collect());
            if channels.odometry.is_empty() {
                let count = |of: fn(&FileReport) -> usize| {
                    let odometry = ["wheel_odometry", "velocity", "increment"];
                    let own = |(at, name): &(RobotId, &str)| *at == robot && odometry.contains(name);
                    self.files.iter().filter(|(key, _)| own(key)).map(|(_, file)| of(file)).sum()
                };
                return Err(RecordingError::EmptyChannel {
                    file: self.path.to_path_buf(),
                    rows: count(|file| file.rows),
                    skipped: count(|file| file.skipped),
                    needed_for: format!(
                        "robot {robot} cannot be localized without odometry; map a topic to velocity, increment or \
                         wheel_odometry in {}",
                        self.mapping.file().display()
                    ),
                });
            }
        }
        self.report.files.extend(self.files.into_values());
        warn_of_unmapped_targets(&self.recording, &mut self.report.warnings);
        let attachments = BTreeMap::new();
        Ok(Opened { recording: self.recording, report: self.report, attachments })
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

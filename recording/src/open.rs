//! Tells the forms of a recording apart by what a folder holds.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_estimation::sample::{Reading, Target};

use crate::bag;
use crate::error::RecordingError;
use crate::folder;
use crate::ingest::ReadOptions;
use crate::mrclam;
use crate::report::{Form, IngestReport};
use crate::types::Recording;

/// A recording that was read.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The recording.
    pub recording: Recording,
    /// What was found besides.
    pub report: IngestReport,
    /// Texts that lie within an MCAP file, by name: noise, start and model of the robots.
    pub attachments: BTreeMap<String, String>,
}

/// Reads the recording in `path`, of whichever form it is; of foreign files, the mapping beside them says what is
/// what.
///
/// # Errors
/// See [`open_mapped`].
pub fn open(path: &Path, options: &ReadOptions) -> Result<(Recording, IngestReport), RecordingError> {
    open_mapped(path, None, options).map(|opened| (opened.recording, opened.report))
}

/// Reads the recording in `path`: a recording folder, an MRCLAM folder, an MCAP file that Pleiad wrote; or, through
/// `mapping` (`mapping.toml` beside the files if `None`), a ROS 2 bag or files of comma-separated values.
///
/// # Errors
/// `path` holds no recording, or several forms at once; files that are damaged, or that the mapping does not fit.
pub fn open_mapped(
    path: &Path,
    mapping: Option<&Path>,
    options: &ReadOptions,
) -> Result<Opened, RecordingError> {
    let refused = |found: &str| {
        Err(RecordingError::NotARecording { path: path.to_path_buf(), found: found.to_owned() })
    };
    if !path.exists() {
        return refused("there is no such folder or file");
    }
    if mapping.is_some() {
        return bag::open(path, mapping, *options);
    }
    if !path.is_dir() {
        return match path.extension().and_then(|ending| ending.to_str()) {
            Some("mcap" | "csv") => bag::open(path, None, *options),
            _ => refused("it is a file, and neither .mcap nor .csv"),
        };
    }
    let whole = |(recording, report)| Opened { recording, report, attachments: BTreeMap::new() };
    match forms_of(path)?.as_slice() {
        [Form::Folder] => folder::read_folder(path, options).map(whole),
        [Form::Mrclam] => mrclam::read_mrclam(path, options).map(whole),
        [] if bag::is_mapped(path)? => bag::open(path, None, *options),
        [] => refused("it holds no robot"),
        _ => refused("it holds files of both forms, and which is meant is not told by guessing"),
    }
}

/// The forms of which `folder` holds files.
pub(crate) fn forms_of(folder: &Path) -> Result<Vec<Form>, RecordingError> {
    let mut forms = Vec::new();
    if folder::is_recording_folder(folder)? {
        forms.push(Form::Folder);
    }
    if !mrclam::robots_of(folder)?.is_empty() {
        forms.push(Form::Mrclam);
    }
    Ok(forms)
}

/// Names in `folder`, sorted, each with whether it is a folder; names that are no text are left out.
pub(crate) fn entries(folder: &Path) -> Result<Vec<(String, bool)>, RecordingError> {
    let read = || -> std::io::Result<Vec<(String, bool)>> {
        let mut names = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            if let Ok(name) = entry.file_name().into_string() {
                names.push((name, entry.path().is_dir()));
            }
        }
        names.sort();
        Ok(names)
    };
    read().map_err(RecordingError::io("list", folder))
}

/// The folder's own name, also where the path does not spell it out.
pub(crate) fn recording_name(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    whole.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Warns of sightings whose target is neither in the map nor a robot of the recording.
pub(crate) fn warn_of_unmapped_targets(recording: &Recording, warnings: &mut Vec<String>) {
    let mut unmapped: BTreeMap<Target, usize> = BTreeMap::new();
    for sample in recording.robots.values().flat_map(|robot| &robot.sightings) {
        let Reading::Sighting { target, .. } = sample.reading else { continue };
        let known = match target {
            Target::Robot(robot) => recording.robots.contains_key(&robot),
            Target::Landmark(landmark) => recording.landmarks.contains_key(&landmark),
        };
        if !known {
            *unmapped.entry(target).or_default() += 1;
        }
    }
    for (target, count) in unmapped {
        warnings.push(match target {
            Target::Robot(robot) => {
                format!("{count} sightings of robot {robot}, of which there is no recording")
            }
            Target::Landmark(landmark) => {
                format!("{count} sightings of landmark {landmark}, which is not in the map")
            }
        });
    }
}

//! Opens what a command was given as a recording, with what lies beside it or within it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use pleiad_recording::{IngestReport, ReadOptions, Recording, open_mapped};

use super::beside::is_beside;
use super::recording_folder;

/// A recording that was opened.
pub struct Input {
    /// The recording.
    pub recording: Recording,
    /// What was found while reading.
    pub ingest: IngestReport,
    /// The folder with noise, start and model of the robots, if there are any.
    pub folder: PathBuf,
    /// Holds that folder where the files lay within an MCAP file.
    _unpacked: Option<tempfile::TempDir>,
}

/// Opens a recording folder, run folder, MRCLAM folder, MCAP file, bag or csv file.
pub fn open(path: &Path, mapping: Option<&Path>, skip_bad_rows: bool) -> anyhow::Result<Input> {
    let from = recording_folder(path);
    let opened = open_mapped(&from, mapping, &ReadOptions { skip_bad_rows })?;
    let mut files = opened.attachments;
    files.retain(|name, _| is_beside(name));
    let (folder, unpacked) = if files.is_empty() {
        // A bare name has the empty path as its parent, which no system lists.
        let parent = from.parent().filter(|parent| !parent.as_os_str().is_empty());
        let beside = if from.is_dir() { from.as_path() } else { parent.unwrap_or(Path::new(".")) };
        (beside.to_path_buf(), None)
    } else {
        let folder =
            tempfile::tempdir().context("cannot create a folder for the files within the MCAP file")?;
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        (folder.path().to_path_buf(), Some(folder))
    };
    Ok(Input { recording: opened.recording, ingest: opened.report, folder, _unpacked: unpacked })
}

/// Whether a command was given a recording rather than a scenario.
pub fn is_recording(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|ending| ending == "mcap" || ending == "csv")
}

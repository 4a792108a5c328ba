//! A folder of small files, and what reading it gives.

use std::fs;
use std::path::{Path, PathBuf};

use pleiad_recording::{IngestReport, ReadOptions, Recording, open};
use tempfile::TempDir;

/// A folder of small files; removed when dropped.
pub struct Folder {
    path: PathBuf,
    _parent: TempDir,
}

impl Folder {
    /// A folder called `fixture` with these files and texts.
    pub fn new(files: &[(&str, &str)]) -> Self {
        let parent = tempfile::tempdir().expect("a temporary folder");
        let folder = Self { path: parent.path().join("fixture"), _parent: parent };
        fs::create_dir(folder.path()).expect("created");
        for (file, text) in files {
            folder.write(file, text);
        }
        folder
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn write(&self, file: &str, text: &str) {
        let path = self.path.join(file);
        fs::create_dir_all(path.parent().expect("inside the folder")).expect("created");
        fs::write(path, text).expect("written");
    }

    pub fn append(&self, file: &str, text: &str) {
        self.write(file, &(fs::read_to_string(self.path.join(file)).expect("readable") + text));
    }

    pub fn remove(&self, file: &str) {
        fs::remove_file(self.path.join(file)).expect("removed");
    }
}

/// Reads a folder that must be readable.
pub fn read_with(folder: &Folder, options: ReadOptions) -> (Recording, IngestReport) {
    open(folder.path(), &options).unwrap_or_else(|error| panic!("{error}"))
}

/// What a folder that must not be readable is refused with.
pub fn refusal(folder: &Folder, options: ReadOptions) -> String {
    open(folder.path(), &options).expect_err("damaged").to_string()
}

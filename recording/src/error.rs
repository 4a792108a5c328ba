//! What can be wrong with a recording, told with the place, what was found and what to do.

use std::path::{Path, PathBuf};

/// Why a recording could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What was tried: `read`, `write`, ...
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The path holds neither form of recording, or both at once.
    #[error(
        "{} is not a recording: {found}; expected a recording folder (r1/, r2/, ... with their .csv channels), an \
         MRCLAM folder (Robot1_Odometry.dat, ...), an .mcap file that Pleiad wrote, or a ROS 2 bag (.mcap) or .csv \
         files with a mapping", path.display()
    )]
    NotARecording {
        /// The path asked for.
        path: PathBuf,
        /// What is there instead.
        found: String,
    },
    /// A row that cannot be read.
    #[error("{}:{line}: found `{found}`, expected {expected}; {remedy}", file.display())]
    BadRow {
        /// The file.
        file: PathBuf,
        /// Its line, counted from 1.
        line: usize,
        /// The line's text, shortened.
        found: String,
        /// What should be there.
        expected: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A file whose header, or lack of one, leaves its columns unknown.
    #[error("{}:{line}: found header `{found}`, expected {expected}; write the header line", file.display())]
    BadHeader {
        /// The file.
        file: PathBuf,
        /// The header's line, counted from 1.
        line: usize,
        /// Its text, shortened.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// Two rows of a map contradict or repeat each other. Never skipped: either could be the right one.
    #[error("{}:{line}: found `{found}`, but {conflict}; keep one of the two lines", file.display())]
    Repeated {
        /// The file.
        file: PathBuf,
        /// The later line, counted from 1.
        line: usize,
        /// Its text, shortened.
        found: String,
        /// What it clashes with.
        conflict: String,
    },
    /// A file without which the recording makes no sense.
    #[error("{} is missing: {needed_for}; {remedy}", path.display())]
    MissingFile {
        /// The absent file.
        path: PathBuf,
        /// What it is needed for.
        needed_for: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A required channel without a single usable row.
    #[error(
        "{} holds no usable row ({rows} found, {skipped} skipped as bad): {needed_for}; expected at least one",
        file.display()
    )]
    EmptyChannel {
        /// The file.
        file: PathBuf,
        /// Data rows found.
        rows: usize,
        /// Rows skipped as bad.
        skipped: usize,
        /// What it is needed for.
        needed_for: String,
    },
    /// Files that exclude each other.
    #[error("{} holds {found}, expected only one of them; remove the others", folder.display())]
    Ambiguous {
        /// The folder.
        folder: PathBuf,
        /// The files.
        found: String,
    },
    /// A file that is not TOML.
    #[error("{} is not valid TOML: {message}", file.display())]
    Toml {
        /// The file.
        file: PathBuf,
        /// The parser's message, with the place.
        message: String,
    },
    /// A key that is missing, or has a value of the wrong type or outside its range.
    #[error("{}: key `{key}`: found {found}, expected {expected}; correct the key", file.display())]
    BadKey {
        /// The file.
        file: PathBuf,
        /// The key with its section.
        key: String,
        /// What is there.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// A file that is no whole MCAP file.
    #[error(
        "{} cannot be read as MCAP: {message}; if it was cut short, `mcap recover` of the MCAP tools saves what is \
         whole", file.display()
    )]
    Mcap {
        /// The file.
        file: PathBuf,
        /// What the reader says.
        message: String,
    },
    /// A message that cannot be used.
    #[error("{}: topic {topic}, message {number}: found {found}, expected {expected}; {remedy}", file.display())]
    BadMessage {
        /// The file.
        file: PathBuf,
        /// The topic.
        topic: String,
        /// Which of the topic's messages, counted from 1.
        number: usize,
        /// What is in it.
        found: String,
        /// What should be.
        expected: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A bag or folder of which nobody said what is what in it.
    #[error(
        "{}: there is no mapping that says which of its topics are which channels; name one with --mapping, or write \
         {} (docs/interchange.md). {holds}", file.display(), beside.display()
    )]
    NoMapping {
        /// The bag.
        file: PathBuf,
        /// Where one is looked for.
        beside: PathBuf,
        /// The topics with their types.
        holds: String,
    },
    /// A mapping that names a topic that the bag does not have, or asks of it what it does not hold.
    #[error("{}: {place}: {problem}", mapping.display())]
    Mapping {
        /// The mapping.
        mapping: PathBuf,
        /// Its table, as in `topic[2] (/robot1/odom)`.
        place: String,
        /// What was found, what was expected, and what to do.
        problem: String,
    },
    /// The recording in memory has no faithful form on disk.
    #[error("the recording cannot be written: {reason}")]
    Unwritable {
        /// Robot, channel and what is wrong with it.
        reason: String,
    },
    /// The folder to write to holds a recording.
    #[error(
        "{} already holds a recording: expected an empty or new folder; choose another, or ask for it to be \
         replaced", path.display()
    )]
    AlreadyRecorded {
        /// The folder.
        path: PathBuf,
    },
}

impl RecordingError {
    /// Makes an I/O error of `path`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { path, action, source }
    }
}

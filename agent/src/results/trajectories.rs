//! The trajectories that an agent writes as it goes, so that they take no memory and outlive it.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use pleiad_estimation::Timestamp;

use super::{CLOSED, COLUMNS, ONLINE, ResultsError, SETTLED, parse, rows};
use crate::node::SettledEstimate;

/// The files of estimates of one agent.
#[derive(Debug)]
pub(crate) struct Trajectories {
    folder: PathBuf,
    online: Rows,
    /// Settled when the past was closed; the node has forgotten them.
    closed: Option<Rows>,
}

impl Trajectories {
    /// Goes on with the files in a folder, or begins them `anew`.
    ///
    /// # Errors
    /// [`ResultsError`].
    pub fn open(folder: &Path, anew: bool) -> Result<Self, ResultsError> {
        let io = |cause| ResultsError::Io { path: folder.to_owned(), cause };
        std::fs::create_dir_all(folder).map_err(io)?;
        let closed = folder.join(CLOSED);
        if anew && closed.exists() {
            std::fs::remove_file(&closed).map_err(io)?;
        }
        let online = Rows::open(&folder.join(ONLINE), anew)?;
        let closed = closed.exists().then(|| Rows::open(&closed, false)).transpose()?;
        Ok(Self { folder: folder.to_owned(), online, closed })
    }

    /// An estimate as it was published.
    ///
    /// # Errors
    /// [`ResultsError::Io`].
    pub fn online(&mut self, estimate: &SettledEstimate) -> Result<(), ResultsError> {
        self.online.append(std::slice::from_ref(estimate))
    }

    /// Estimates that will not change any more. Those that an earlier life of the agent has already written,
    /// and closed again after a loss of power, are left out.
    ///
    /// # Errors
    /// [`ResultsError`].
    pub fn closed(&mut self, estimates: &[SettledEstimate]) -> Result<(), ResultsError> {
        let rows = match &mut self.closed {
            Some(rows) => rows,
            none => none.insert(Rows::open(&self.folder.join(CLOSED), false)?),
        };
        let written = rows.last;
        let first = estimates.partition_point(|estimate| written.is_some_and(|last| estimate.time <= last));
        rows.append(&estimates[first..])
    }

    /// The whole settled trajectory: what was closed, and what is settled since. Beside the file first, then
    /// in its place, so that a reader never sees half of it.
    ///
    /// # Errors
    /// [`ResultsError::Io`].
    pub fn finish(&self, settled: &[SettledEstimate]) -> Result<(), ResultsError> {
        let path = self.folder.join(SETTLED);
        let io = |cause| ResultsError::Io { path: path.clone(), cause };
        let part = path.with_extension("part");
        let mut file = match &self.closed {
            Some(rows) => {
                std::fs::copy(&rows.path, &part).map_err(io)?;
                OpenOptions::new().append(true).open(&part).map_err(io)?
            }
            None => begun(&part)?,
        };
        file.write_all(rows(settled).as_bytes()).map_err(io)?;
        std::fs::rename(&part, &path).map_err(io)
    }
}

/// A file of estimates that grows.
#[derive(Debug)]
struct Rows {
    path: PathBuf,
    file: File,
    /// Time of the last estimate.
    last: Option<Timestamp>,
}

fn begun(path: &Path) -> Result<File, ResultsError> {
    let io = |cause| ResultsError::Io { path: path.to_owned(), cause };
    let mut file = File::create(path).map_err(io)?;
    writeln!(file, "{COLUMNS}").map_err(io)?;
    Ok(file)
}

impl Rows {
    /// Goes on after the last whole line.
    fn open(path: &Path, anew: bool) -> Result<Self, ResultsError> {
        let io = |cause| ResultsError::Io { path: path.to_owned(), cause };
        let text = match std::fs::read_to_string(path) {
            Ok(text) if !anew => text,
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => return Err(io(cause)),
            _ => String::new(),
        };
        // A line that was cut off when the process or the power went is written no further.
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        if whole.is_empty() {
            return Ok(Self { path: path.to_owned(), file: begun(path)?, last: None });
        }
        let bad = |line: usize, found: &str| ResultsError::Line {
            path: path.to_owned(),
            line,
            found: found.to_owned(),
        };
        let first = whole.lines().next().unwrap_or_default();
        if first != COLUMNS {
            return Err(bad(1, first));
        }
        let count = whole.lines().count();
        let last = match whole.lines().last().filter(|_| count > 1) {
            Some(line) => Some(parse(line).ok_or_else(|| bad(count, line))?.time),
            None => None,
        };
        let file = OpenOptions::new().append(true).open(path).map_err(io)?;
        file.set_len(whole.len() as u64).map_err(io)?;
        Ok(Self { path: path.to_owned(), file, last })
    }

    fn append(&mut self, estimates: &[SettledEstimate]) -> Result<(), ResultsError> {
        let Some(last) = estimates.last() else { return Ok(()) };
        let written = self.file.write_all(rows(estimates).as_bytes());
        written.map_err(|cause| ResultsError::Io { path: self.path.clone(), cause })?;
        self.last = Some(last.time);
        Ok(())
    }
}

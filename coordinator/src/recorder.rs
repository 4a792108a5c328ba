//! Records what a team publishes: every message of facts and statuses as it came, every estimate as a row,
//! and how much of each there was.
//!
//! What agents ask of one another (facts they miss) and what is asked of them (samples, control) is not
//! published and hence not here.

mod frames;
mod traffic;
mod writer;

use std::path::{Path, PathBuf};
use std::time::Duration;

use pleiad_bus::{Bus, BusError, Incoming};
use pleiad_protocol::TeamName;
use pleiad_protocol::keys::{self, Kind};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::Instant;

pub use frames::{Frame, Frames, read_frames};
pub use traffic::{Count, Traffic};
pub use writer::ESTIMATE_COLUMNS;
use writer::Writer;

/// File of the messages of facts.
pub const FACTS: &str = "facts.bin";
/// File of the statuses.
pub const STATUSES: &str = "statuses.bin";
/// File of the estimates.
pub const ESTIMATES: &str = "estimates.csv";
/// File of the counts, written at the end.
pub const TRAFFIC: &str = "traffic.json";

/// A recorder that is killed loses at most what came since.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecorderError {
    /// The file system refused.
    #[error("{path}: {cause}")]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The file is something else.
    #[error("{path} is not a recording of messages of this version")]
    NotARecording {
        /// Which file.
        path: PathBuf,
    },
    /// A length that no message has.
    #[error("{path} is damaged at byte {offset}: found a message of {found} bytes, expected at most {limit}")]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Where.
        offset: usize,
        /// The length found.
        found: usize,
        /// The longest message.
        limit: usize,
    },
    /// The recording task ended before its time.
    #[error("the recording into {folder} ended abnormally: {cause}")]
    Abandoned {
        /// Into which folder.
        folder: PathBuf,
        /// Why.
        cause: String,
    },
}

/// A running recording. It also ends, orderly but without its counts being known to anyone, when dropped.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    stop: oneshot::Sender<()>,
    task: JoinHandle<Result<Traffic, RecorderError>>,
}

struct Sources {
    facts: mpsc::Receiver<Incoming>,
    statuses: mpsc::Receiver<Incoming>,
    estimates: mpsc::Receiver<Incoming>,
}

impl Recorder {
    /// Starts recording into a new folder `recorder` inside `folder`, or `recorder-2` and so on where
    /// that exists: nothing is overwritten.
    ///
    /// # Errors
    /// If the folder cannot be made or the bus fails.
    pub async fn start<B: Bus>(bus: &B, team: &TeamName, folder: &Path) -> Result<Self, RecorderError> {
        let folder = fresh_folder(folder)?;
        let sources = Sources {
            facts: bus.subscribe(&keys::all(team, Kind::Fact)).await?,
            statuses: bus.subscribe(&keys::all(team, Kind::Status)).await?,
            estimates: bus.subscribe(&keys::all(team, Kind::Estimate)).await?,
        };
        let writer = Writer::create(&folder)?;
        tracing::info!(folder = %folder.display(), "recording");
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(record(writer, sources, stopped));
        Ok(Self { folder, stop, task })
    }

    /// Where the recording is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Takes what has arrived until now, writes the counts and ends.
    ///
    /// # Errors
    /// [`RecorderError`] if anything could not be written.
    pub async fn finish(self) -> Result<Traffic, RecorderError> {
        // A task that has failed does not listen any more.
        let _ = self.stop.send(());
        self.task
            .await
            .map_err(|cause| RecorderError::Abandoned { folder: self.folder, cause: cause.to_string() })?
    }
}

fn fresh_folder(folder: &Path) -> Result<PathBuf, RecorderError> {
    let io = |path: &Path, cause| RecorderError::Io { path: path.to_owned(), cause };
    std::fs::create_dir_all(folder).map_err(|cause| io(folder, cause))?;
    let mut path = folder.join("recorder");
    let mut number = 1;
    loop {
        match std::fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(cause) if cause.kind() == std::io::ErrorKind::AlreadyExists => {
                number += 1;
                path = folder.join(format!("recorder-{number}"));
            }
            Err(cause) => return Err(io(&path, cause)),
        }
    }
}

async fn record(
    mut writer: Writer,
    mut sources: Sources,
    mut stopped: oneshot::Receiver<()>,
) -> Result<Traffic, RecorderError> {
    let start = Instant::now();
    let mut flushes = tokio::time::interval(FLUSH_PERIOD);
    loop {
        let incoming = tokio::select! {
            _ = &mut stopped => break,
            _ = flushes.tick() => {
                writer.flush()?;
                continue;
            }
            Some(incoming) = sources.facts.recv() => incoming,
            Some(incoming) = sources.statuses.recv() => incoming,
            Some(incoming) = sources.estimates.recv() => incoming,
        };
        writer.take(start.elapsed(), &incoming)?;
    }
    for source in [&mut sources.facts, &mut sources.statuses, &mut sources.estimates] {
        while let Ok(incoming) = source.try_recv() {
            writer.take(start.elapsed(), &incoming)?;
        }
    }
    writer.finish()
}

#[cfg(test)]
mod tests;

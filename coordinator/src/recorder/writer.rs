//! Files of a recording.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use pleiad_bus::Incoming;
use pleiad_protocol::keys::{Key, Kind};
use pleiad_protocol::{Estimate, Message, RobotId, limits};

use super::{ESTIMATES, FACTS, RecorderError, STATUSES, TRAFFIC, Traffic, frames};

/// First line of the file of estimates. Positions and yaw in the map, standard deviations of their errors.
pub const ESTIMATE_COLUMNS: &str =
    "t_ns,robot,boot,x_m,y_m,yaw_rad,sigma_x_m,sigma_y_m,sigma_yaw_rad,facts_used";

/// A file of a recording, and its name for errors.
struct Output {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Output {
    fn create(path: PathBuf) -> Result<Self, RecorderError> {
        match File::create_new(&path) {
            Ok(file) => Ok(Self { path, file: BufWriter::new(file) }),
            Err(cause) => Err(RecorderError::Io { path, cause }),
        }
    }

    fn write(
        &mut self,
        write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), RecorderError> {
        write(&mut self.file).map_err(|cause| RecorderError::Io { path: self.path.clone(), cause })
    }
}

/// Writes a recording and counts what it writes.
pub(super) struct Writer {
    folder: PathBuf,
    facts: Output,
    statuses: Output,
    estimates: Output,
    traffic: Traffic,
}

impl Writer {
    /// Begins the files of a recording in an empty folder.
    pub(super) fn create(folder: &Path) -> Result<Self, RecorderError> {
        let mut writer = Self {
            folder: folder.to_owned(),
            facts: Output::create(folder.join(FACTS))?,
            statuses: Output::create(folder.join(STATUSES))?,
            estimates: Output::create(folder.join(ESTIMATES))?,
            traffic: Traffic::default(),
        };
        writer.facts.write(|file| file.write_all(frames::MAGIC))?;
        writer.statuses.write(|file| file.write_all(frames::MAGIC))?;
        writer.estimates.write(|file| writeln!(file, "{ESTIMATE_COLUMNS}"))?;
        Ok(writer)
    }

    /// Takes a message that came a time after the recording began. What is not valid is kept as it came
    /// where messages are kept, never made an estimate, and counted.
    pub(super) fn take(&mut self, elapsed: Duration, incoming: &Incoming) -> Result<(), RecorderError> {
        let Ok(Key { robot, kind, .. }) = incoming.key.parse::<Key>() else {
            self.traffic.refused += 1;
            return Ok(());
        };
        let message = &incoming.payload;
        self.traffic.add(robot, kind, message.len());
        if message.len() <= limits::MESSAGE_BYTES {
            match kind {
                Kind::Fact => self.facts.write(|file| frames::put(file, elapsed, robot, message))?,
                Kind::Status => self.statuses.write(|file| frames::put(file, elapsed, robot, message))?,
                _ => {}
            }
        }
        let own = match (kind, Message::decode(message)) {
            (Kind::Fact, Ok(Message::Entries(entries))) => {
                entries.iter().all(|entry| entry.id.robot == robot)
            }
            (Kind::Status, Ok(Message::Status(status))) => status.robot == robot,
            (Kind::Estimate, Ok(Message::Estimate(estimate))) => {
                if estimate.robot == robot {
                    self.estimates.write(|file| put_estimate(file, robot, &estimate))?;
                }
                estimate.robot == robot
            }
            _ => {
                self.traffic.refused += 1;
                return Ok(());
            }
        };
        self.traffic.misattributed += u64::from(!own);
        Ok(())
    }

    /// Hands everything to the system.
    pub(super) fn flush(&mut self) -> Result<(), RecorderError> {
        for output in [&mut self.facts, &mut self.statuses, &mut self.estimates] {
            output.write(Write::flush)?;
        }
        Ok(())
    }

    /// Writes the counts and ends.
    pub(super) fn finish(mut self) -> Result<Traffic, RecorderError> {
        self.flush()?;
        let mut counts = Output::create(self.folder.join(TRAFFIC))?;
        counts.write(|file| {
            writeln!(file, "{:#}", self.traffic.to_json())?;
            file.flush()
        })?;
        Ok(self.traffic)
    }
}

/// Numbers by their shortest exact digits.
fn put_estimate(file: &mut impl Write, robot: RobotId, estimate: &Estimate) -> io::Result<()> {
    let pose = &estimate.map_from_robot;
    let [sigma_x, sigma_y, sigma_yaw] = estimate.sigma;
    writeln!(
        file,
        "{},{robot},{},{:?},{:?},{:?},{sigma_x:?},{sigma_y:?},{sigma_yaw:?},{}",
        estimate.time.0,
        estimate.boot,
        pose.x_m(),
        pose.y_m(),
        pose.yaw_rad(),
        estimate.facts_used
    )
}

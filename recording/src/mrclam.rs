//! Reads folders of the UTIAS multi-robot cooperative localization and mapping data set
//! (Leung, Halpern, Barfoot & Liu, IJRR 30(8), 2011).

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};

use crate::error::RecordingError;
use crate::ingest::{Ingest, Presence, ReadOptions};
use crate::open::{entries, recording_name, warn_of_unmapped_targets};
use crate::report::{Form, IngestReport};
use crate::table::Table;
use crate::tidy::tidy;
use crate::types::{Command, Recording, RobotRecording, TruthSample};

const BARCODES: &str = "Barcodes.dat";
const LANDMARKS: &str = "Landmark_Groundtruth.dat";

/// The data set's robots are subjects 1 to 5; every later subject is a landmark.
const LAST_ROBOT_SUBJECT: u32 = 5;

const REMEDY: &str = "copy the file from the published data set";

/// The robots that `folder` has files of.
pub(crate) fn robots_of(folder: &Path) -> Result<BTreeSet<RobotId>, RecordingError> {
    let number = |name: &str| {
        let (number, rest) = name.strip_prefix("Robot")?.split_once('_')?;
        let known = matches!(rest, "Odometry.dat" | "Measurement.dat" | "Groundtruth.dat");
        if known { number.parse().ok().map(RobotId) } else { None }
    };
    Ok(entries(folder)?.iter().filter_map(|(name, _)| number(name)).collect())
}

/// Reads an MRCLAM folder. Stamps stay what they are, Unix seconds, exact to the nanosecond.
///
/// Its odometry is the commanded velocity, so it becomes both the robot's commands and its odometry.
///
/// # Errors
/// A damaged row (unless skipped), a subject or barcode listed twice, a robot without odometry.
pub fn read_mrclam(
    folder: &Path,
    options: &ReadOptions,
) -> Result<(Recording, IngestReport), RecordingError> {
    let robots = robots_of(folder)?;
    if robots.is_empty() {
        let found = "it holds no Robot<N>_Odometry.dat".to_owned();
        return Err(RecordingError::NotARecording { path: folder.to_path_buf(), found });
    }
    let mut ingest = Ingest::new(folder, Form::Mrclam, *options);
    let mut recording = Recording { name: recording_name(folder), ..Recording::default() };
    recording.landmarks = read_landmarks(&mut ingest)?;
    let subjects = read_barcodes(&mut ingest)?;
    recording.robots = ingest
        .of_robots(robots.iter().copied(), |ingest, robot| read_robot(ingest, robot, &robots, &subjects))?;
    warn_of_unmapped_targets(&recording, &mut ingest.report.warnings);
    Ok((recording, ingest.report))
}

fn read_landmarks(ingest: &mut Ingest<'_>) -> Result<BTreeMap<LandmarkId, [f64; 2]>, RecordingError> {
    let columns = ["subject", "x", "y", "x_std_dev", "y_std_dev"];
    let Some(table) = Table::open_columns(ingest.root, LANDMARKS, &columns)? else {
        ingest.warn(format!("{LANDMARKS}: missing; the recording has no map"));
        return Ok(BTreeMap::new());
    };
    ingest.map(
        &table,
        |row, _| Ok((LandmarkId(row.identifier(0, None)?), [row.number(1)?, row.number(2)?])),
        |landmark, line| format!("landmark {landmark} stands in line {line} already"),
    )
}

/// Subjects by barcode.
fn read_barcodes(ingest: &mut Ingest<'_>) -> Result<BTreeMap<u32, u32>, RecordingError> {
    let Some(table) = Table::open_columns(ingest.root, BARCODES, &["subject", "barcode"])? else {
        return Err(RecordingError::MissingFile {
            path: ingest.root.join(BARCODES),
            needed_for: "without it no measurement tells whom it saw".to_owned(),
            remedy: REMEDY,
        });
    };
    let by_subject = ingest.map(
        &table,
        |row, line| Ok((row.identifier(0, None)?, (row.identifier(1, None)?, line))),
        |subject, line| format!("subject {subject} stands in line {line} already"),
    )?;
    let mut by_barcode = BTreeMap::new();
    for (subject, (barcode, line)) in by_subject {
        if let Some(other) = by_barcode.insert(barcode, subject) {
            return Err(table.repeated(line, format!("barcode {barcode} is that of subject {other} already")));
        }
    }
    Ok(by_barcode)
}

fn read_robot(
    ingest: &mut Ingest<'_>,
    robot: RobotId,
    robots: &BTreeSet<RobotId>,
    subjects: &BTreeMap<u32, u32>,
) -> Result<RobotRecording, RecordingError> {
    let commands = read_odometry(ingest, robot)?;
    let velocity = |command: &Command| Sample {
        time: command.time,
        reading: Reading::Velocity {
            forward_m_s: command.forward_m_s,
            yaw_rate_rad_s: command.yaw_rate_rad_s,
        },
    };
    Ok(RobotRecording {
        odometry: commands.iter().map(velocity).collect(),
        commands,
        sightings: read_sightings(ingest, robot, robots, subjects)?,
        truth: read_truth(ingest, robot)?,
        ..RobotRecording::default()
    })
}

fn read_odometry(ingest: &mut Ingest<'_>, robot: RobotId) -> Result<Vec<Command>, RecordingError> {
    let file = format!("Robot{robot}_Odometry.dat");
    let needed_for = format!("robot {robot} cannot be localized without odometry");
    let columns = ["time", "forward_velocity", "angular_velocity"];
    let Some(table) = Table::open_columns(ingest.root, &file, &columns)? else {
        return Err(RecordingError::MissingFile { path: ingest.root.join(file), needed_for, remedy: REMEDY });
    };
    ingest.channel(&table, &Presence::Required(&needed_for), |row| {
        Ok(Command { time: row.time(0)?, forward_m_s: row.number(1)?, yaw_rate_rad_s: row.number(2)? })
    })
}

fn read_sightings(
    ingest: &mut Ingest<'_>,
    robot: RobotId,
    robots: &BTreeSet<RobotId>,
    subjects: &BTreeMap<u32, u32>,
) -> Result<Vec<Sample>, RecordingError> {
    let file = format!("Robot{robot}_Measurement.dat");
    let Some(table) = Table::open_columns(ingest.root, &file, &["time", "barcode", "range", "bearing"])?
    else {
        ingest.warn(format!("{file}: missing; robot {robot} sees nothing"));
        return Ok(Vec::new());
    };
    let mut unknown_barcodes: BTreeMap<u32, usize> = BTreeMap::new();
    let (mut rows, mut report) = ingest.rows(&table, |row, _| {
        let time: Timestamp = row.time(0)?;
        let barcode = row.identifier(1, None)?;
        let relative = Relative::RangeBearing { range_m: row.distance(2)?, bearing_rad: row.number(3)? };
        let Some(&subject) = subjects.get(&barcode) else {
            *unknown_barcodes.entry(barcode).or_default() += 1;
            return Ok(None);
        };
        let target = if subject <= LAST_ROBOT_SUBJECT || robots.contains(&RobotId(subject)) {
            Target::Robot(RobotId(subject))
        } else {
            Target::Landmark(LandmarkId(subject))
        };
        if target == Target::Robot(robot) {
            return Err(format!("another subject than robot {robot} itself, whose barcode is {barcode}"));
        }
        Ok(Some(Sample { time, reading: Reading::Sighting { target, relative } }))
    })?;
    report.unknown_barcodes = unknown_barcodes;
    tidy(&mut rows, &mut report);
    ingest.file_channel(&table, &Presence::Optional, &rows, report)?;
    Ok(rows)
}

fn read_truth(ingest: &mut Ingest<'_>, robot: RobotId) -> Result<Vec<TruthSample>, RecordingError> {
    let file = format!("Robot{robot}_Groundtruth.dat");
    let Some(table) = Table::open_columns(ingest.root, &file, &["time", "x", "y", "orientation"])? else {
        ingest.warn(format!("{file}: missing; robot {robot} cannot be judged"));
        return Ok(Vec::new());
    };
    ingest.channel(&table, &Presence::Optional, |row| {
        Ok(TruthSample {
            time: row.time(0)?,
            pose: Pose2::new(row.number(1)?, row.number(2)?, row.number(3)?),
        })
    })
}

//! Reads a recording folder.

use std::path::Path;

use pleiad_estimation::sample::{Reading, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId};

use super::manifest::Manifest;
use super::{
    CHANNELS, COMMAND, Channel, GPS, GYRO, HEADING, INCREMENT, LANDMARK_COLUMNS, LANDMARKS, NOMINAL,
    ODOMETRY, RELATIVE, SCAN, STEER, TRUTH, VELOCITY, WALL_COLUMNS, WALLS, WHEELS, robot_folder, robots_of,
    sightings,
};
use crate::error::RecordingError;
use crate::ingest::{Ingest, Presence, ReadOptions};
use crate::nominal::read_nominal;
use crate::open::{entries, recording_name, warn_of_unmapped_targets};
use crate::report::{Form, IngestReport};
use crate::table::{Row, Table};
use crate::types::{BeamSample, Command, Recording, RobotRecording, SteerSample, TruthSample};

/// Reads a recording folder.
///
/// `recording.toml`, `nominal.toml` and `landmarks.csv` may be absent, as may every channel but odometry.
///
/// # Errors
/// A damaged row (unless skipped), a header without its columns, a key of the wrong type, a landmark
/// listed twice, a robot without odometry or with two kinds of it, a robot or channel that `recording.toml`
/// lists and that is absent.
pub fn read_folder(
    folder: &Path,
    options: &ReadOptions,
) -> Result<(Recording, IngestReport), RecordingError> {
    let mut ingest = Ingest::new(folder, Form::Folder, *options);
    let manifest = Manifest::read(folder, &mut ingest.report.warnings)?.unwrap_or_default();
    let robots = listed_robots(&mut ingest, &manifest)?;
    let mut recording = Recording {
        name: manifest.name.clone().unwrap_or_else(|| recording_name(folder)),
        ..Recording::default()
    };
    recording.nominal = read_nominal(&folder.join(NOMINAL), &mut ingest.report.warnings)?;
    if let Some(table) = Table::open_csv(folder, LANDMARKS, &LANDMARK_COLUMNS, &[])? {
        recording.landmarks = ingest.map(
            &table,
            |row, _| Ok((LandmarkId(row.identifier(0, Some('L'))?), [row.number(1)?, row.number(2)?])),
            |landmark, line| format!("landmark {landmark} stands in line {line} already"),
        )?;
    } else {
        ingest.warn(format!("{LANDMARKS}: missing; the recording has no map"));
    }
    if let Some(table) = Table::open_csv(folder, WALLS, &WALL_COLUMNS, &[])? {
        let walls = ingest.map(
            &table,
            |row, line| Ok((line, [row.number(0)?, row.number(1)?, row.number(2)?, row.number(3)?])),
            |_, line| format!("the wall stands in line {line} already"),
        )?;
        recording.walls = walls.into_values().collect();
    }
    recording.robots = ingest.of_robots(robots.iter().copied(), |ingest, robot| {
        let read = read_robot(ingest, robot)?;
        compare_with_manifest(ingest, robot, &manifest)?;
        Ok(read)
    })?;
    if let Some(nominal) = &recording.nominal {
        for robot in robots.iter().filter(|robot| !nominal.robots.contains_key(robot)) {
            ingest.warn(format!("{NOMINAL}: has no section for robot {robot}"));
        }
    }
    warn_of_unmapped_targets(&recording, &mut ingest.report.warnings);
    Ok((recording, ingest.report))
}

/// The robots to read: those with a folder, which must include those the manifest lists.
fn listed_robots(ingest: &mut Ingest<'_>, manifest: &Manifest) -> Result<Vec<RobotId>, RecordingError> {
    let found = robots_of(ingest.root)?;
    if let Some(listed) = &manifest.robots {
        if let Some(robot) = listed.iter().find(|robot| !found.contains(robot)) {
            return Err(RecordingError::MissingFile {
                path: ingest.root.join(robot_folder(*robot)),
                needed_for: format!("recording.toml lists robot {robot}"),
                remedy: "copy the folder again, or take the robot out of recording.toml",
            });
        }
        for robot in found.iter().filter(|robot| !listed.contains(robot)) {
            ingest.warn(format!("{}: read, though recording.toml does not list it", robot_folder(*robot)));
        }
    }
    if found.is_empty() {
        let found = "it holds no robot's folder".to_owned();
        return Err(RecordingError::NotARecording { path: ingest.root.to_path_buf(), found });
    }
    Ok(found)
}

fn read_robot(ingest: &mut Ingest<'_>, robot: RobotId) -> Result<RobotRecording, RecordingError> {
    for (name, _) in entries(&ingest.root.join(robot_folder(robot)))? {
        let Some(stem) = name.strip_suffix(".csv") else { continue };
        if !CHANNELS.iter().any(|channel| channel.name == stem) {
            ingest
                .warn(format!("{}/{name}: not a channel this program knows; not read", robot_folder(robot)));
        }
    }
    let commands = read_channel(ingest, robot, COMMAND, &Presence::Optional, |row| {
        Ok(Command { time: row.time(0)?, forward_m_s: row.number(1)?, yaw_rate_rad_s: row.number(2)? })
    })?;
    let steer = read_channel(ingest, robot, STEER, &Presence::Optional, |row| {
        Ok(SteerSample { time: row.time(0)?, angle_rad: row.number(1)? })
    })?;
    let scans = read_channel(ingest, robot, SCAN, &Presence::Optional, |row| {
        let (bearing_rad, range_m) = (row.number(1)?, row.number(2)?);
        if range_m <= 0.0 {
            return Err("a range above 0; a beam that met nothing has no row".to_owned());
        }
        Ok(BeamSample { time: row.time(0)?, bearing_rad, range_m })
    })?;
    let truth = read_channel(ingest, robot, TRUTH, &Presence::Optional, |row| {
        Ok(TruthSample { time: row.time(0)?, pose: pose(row)? })
    })?;
    let samples = |ingest: &mut Ingest<'_>, channel, read: fn(&Row<'_>) -> Result<Reading, String>| {
        read_channel(ingest, robot, channel, &Presence::Optional, |row| sample(row, read))
    };
    Ok(RobotRecording {
        odometry: read_odometry(ingest, robot)?,
        gyro: samples(ingest, GYRO, |row| Ok(Reading::Gyro { yaw_rate_rad_s: row.number(1)? }))?,
        gps: samples(ingest, GPS, |row| Ok(Reading::Gps { x_m: row.number(1)?, y_m: row.number(2)? }))?,
        heading: samples(ingest, HEADING, |row| Ok(Reading::Heading { heading_rad: row.number(1)? }))?,
        sightings: read_sightings(ingest, robot)?,
        commands,
        steer,
        scans,
        truth,
    })
}

fn read_channel<T: crate::tidy::Stamped>(
    ingest: &mut Ingest<'_>,
    robot: RobotId,
    channel: Channel,
    presence: &Presence<'_>,
    parse: impl FnMut(&Row<'_>) -> Result<T, String>,
) -> Result<Vec<T>, RecordingError> {
    match Table::open_csv(ingest.root, &channel.file(robot), channel.columns, &[])? {
        Some(table) => ingest.channel(&table, presence, parse),
        None => Ok(Vec::new()),
    }
}

fn sample(row: &Row<'_>, read: fn(&Row<'_>) -> Result<Reading, String>) -> Result<Sample, String> {
    Ok(Sample { time: row.time(0)?, reading: read(row)? })
}

fn pose(row: &Row<'_>) -> Result<Pose2, String> {
    Ok(Pose2::new(row.number(1)?, row.number(2)?, row.number(3)?))
}

fn read_odometry(ingest: &mut Ingest<'_>, robot: RobotId) -> Result<Vec<Sample>, RecordingError> {
    let needed_for = format!("robot {robot} cannot be localized without odometry");
    let folder = ingest.root.join(robot_folder(robot));
    let present: Vec<Channel> =
        ODOMETRY.into_iter().filter(|channel| ingest.root.join(channel.file(robot)).is_file()).collect();
    let &[channel] = present.as_slice() else {
        let names: Vec<String> = present.iter().map(|channel| format!("{}.csv", channel.name)).collect();
        return Err(if names.is_empty() {
            RecordingError::MissingFile {
                path: folder.join("wheel_odometry.csv"),
                needed_for,
                remedy: "record it, or give velocity.csv or increment.csv in its place",
            }
        } else {
            RecordingError::Ambiguous { folder, found: names.join(" and ") }
        });
    };
    read_channel(ingest, robot, channel, &Presence::Required(&needed_for), |row| {
        let reading = if channel == WHEELS {
            Reading::Wheels { left_rad: row.number(1)?, right_rad: row.number(2)? }
        } else if channel == VELOCITY {
            Reading::Velocity { forward_m_s: row.number(1)?, yaw_rate_rad_s: row.number(2)? }
        } else {
            debug_assert_eq!(channel, INCREMENT);
            Reading::Increment(pose(row)?)
        };
        Ok(Sample { time: row.time(0)?, reading })
    })
}

fn read_sightings(ingest: &mut Ingest<'_>, robot: RobotId) -> Result<Vec<Sample>, RecordingError> {
    let file = RELATIVE.file(robot);
    let Some(table) = Table::open_csv(ingest.root, &file, RELATIVE.columns, &sightings::OPTIONAL)? else {
        return Ok(Vec::new());
    };
    let layout = sightings::layout_of(&table).map_err(|expected| table.bad_header(expected))?;
    ingest.channel(&table, &Presence::Optional, |row| {
        let target = sightings::target(row)?;
        if target == Target::Robot(robot) {
            return Err(format!("another target than robot {robot} itself"));
        }
        let relative = sightings::relative(row, &layout)?;
        Ok(Sample { time: row.time(0)?, reading: Reading::Sighting { target, relative } })
    })
}

/// A channel the manifest lists must be there; another number of rows is worth a warning.
fn compare_with_manifest(
    ingest: &mut Ingest<'_>,
    robot: RobotId,
    manifest: &Manifest,
) -> Result<(), RecordingError> {
    for (name, &listed) in manifest.rows.get(&robot).into_iter().flatten() {
        let file = format!("{}/{name}.csv", robot_folder(robot));
        match ingest.report.file(&file).map(|report| report.rows) {
            Some(rows) if rows == listed => {}
            Some(rows) => ingest.warn(format!("{file}: {rows} rows, but recording.toml lists {listed}")),
            None => {
                return Err(RecordingError::MissingFile {
                    path: ingest.root.join(file),
                    needed_for: format!("recording.toml lists it with {listed} rows"),
                    remedy: "copy the file again, or take it out of recording.toml",
                });
            }
        }
    }
    Ok(())
}

//! Writes a recording folder.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use pleiad_estimation::LandmarkId;
use pleiad_estimation::sample::{Sample, Target};

use super::manifest::{self, Manifest};
use super::rows::{self, Rows};
use super::{
    CHANNELS, Channel, LANDMARK_COLUMNS, LANDMARKS, NOMINAL, RELATIVE, WALL_COLUMNS, WALLS, robot_folder,
    robots_of, sightings,
};
use crate::error::RecordingError;
use crate::nominal::{COMMENT, nominal_text};
use crate::number::{push_number, push_time};
use crate::open::forms_of;
use crate::report::Form;
use crate::types::{Recording, RobotRecording};

/// What to do with a recording that is already there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overwrite {
    /// Leave it and fail.
    Refuse,
    /// Remove its files, and only files this program knows as a recording's, then write.
    Replace,
}

/// Writes `recording` as a folder, which is created along with its parents. Each file appears whole or
/// not at all; nothing is touched before the whole recording is known to be writable.
///
/// What is written reads back the same: stamps to the nanosecond, numbers to the bit.
///
/// # Errors
/// The folder holds a recording already; a number is not finite; a robot has no odometry or odometry of
/// several kinds; a channel is not sorted or holds readings of another; the file system refuses.
pub fn write_folder(
    recording: &Recording,
    folder: &Path,
    overwrite: Overwrite,
) -> Result<(), RecordingError> {
    let files = render(recording).map_err(|reason| RecordingError::Unwritable { reason })?;
    if folder.is_dir() {
        match (forms_of(folder)?.as_slice(), overwrite) {
            ([], _) => {}
            ([Form::Folder], Overwrite::Replace) => clear(folder)?,
            _ => return Err(RecordingError::AlreadyRecorded { path: folder.to_path_buf() }),
        }
    }
    for (file, text) in &files {
        write_whole(&folder.join(file), text)?;
    }
    Ok(())
}

/// Writes a file under a passing name and then renames it, so that no reader meets half a file.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), RecordingError> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(RecordingError::io("create", parent))?;
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".partial");
    let partial = path.with_file_name(name);
    std::fs::write(&partial, text).map_err(RecordingError::io("write", &partial))?;
    std::fs::rename(&partial, path).map_err(RecordingError::io("write", path))
}

/// Removes the files of the recording in `folder`, the manifest last: what an interrupted removal leaves
/// then misses files that are listed, and is refused.
fn clear(folder: &Path) -> Result<(), RecordingError> {
    let remove = |file: &str| {
        let path = folder.join(file);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(RecordingError::io("remove", &path)(error))
            }
            _ => Ok(()),
        }
    };
    for robot in robots_of(folder)? {
        for channel in CHANNELS {
            remove(&channel.file(robot))?;
        }
        let path = folder.join(robot_folder(robot));
        let empty = std::fs::read_dir(&path).map_err(RecordingError::io("list", &path))?.next().is_none();
        if empty {
            std::fs::remove_dir(&path).map_err(RecordingError::io("remove", &path))?;
        }
    }
    for file in [NOMINAL, LANDMARKS, WALLS, manifest::FILE] {
        remove(file)?;
    }
    Ok(())
}

/// All files with their texts, the manifest first: it lists the channels, so that a folder whose writing
/// was interrupted misses some and is refused.
fn render(recording: &Recording) -> Result<Vec<(String, String)>, String> {
    if recording.robots.is_empty() {
        return Err("it has no robot".to_owned());
    }
    let mut files = Vec::new();
    let mut manifest = Manifest {
        name: Some(recording.name.clone()),
        robots: Some(recording.robots.keys().copied().collect()),
        rows: BTreeMap::new(),
    };
    let mut landmarks = LANDMARK_COLUMNS.join(",") + "\n";
    for (landmark, position) in &recording.landmarks {
        push_landmark(&mut landmarks, *landmark);
        position
            .iter()
            .try_for_each(|&value| push_cell(&mut landmarks, value))
            .map_err(|what| format!("landmark {landmark}: {what}"))?;
        landmarks.push('\n');
    }
    files.push((LANDMARKS.to_owned(), landmarks));
    if !recording.walls.is_empty() {
        let mut walls = WALL_COLUMNS.join(",") + "\n";
        for wall in &recording.walls {
            let mut row = String::new();
            wall.iter()
                .try_for_each(|&value| push_cell(&mut row, value))
                .map_err(|what| format!("walls: {what}"))?;
            walls.push_str(row.trim_start_matches(','));
            walls.push('\n');
        }
        files.push((WALLS.to_owned(), walls));
    }
    if let Some(nominal) = &recording.nominal {
        files.push((NOMINAL.to_owned(), nominal_text(nominal, COMMENT, Some(duration_s(recording)))?));
    }
    for (&robot, channels) in &recording.robots {
        let mut rows = BTreeMap::new();
        for (channel, text, count) in
            render_robot(channels).map_err(|reason| format!("robot {robot}, {reason}"))?
        {
            rows.insert(channel.name.to_owned(), count);
            files.push((channel.file(robot), text));
        }
        manifest.rows.insert(robot, rows);
    }
    files.insert(0, (manifest::FILE.to_owned(), manifest.text()));
    Ok(files)
}

/// From the first odometry of any robot to the last.
pub(crate) fn duration_s(recording: &Recording) -> f64 {
    let stamps = || recording.robots.values().flat_map(|robot| &robot.odometry).map(|sample| sample.time);
    match (stamps().min(), stamps().max()) {
        (Some(first), Some(last)) => last.seconds_since(first),
        _ => 0.0,
    }
}

type Rendered = (Channel, String, usize);

/// The texts of the channels that have rows.
fn render_robot(robot: &RobotRecording) -> Result<Vec<Rendered>, String> {
    let mut rendered = rows::channels(robot)?.iter().map(table).collect::<Result<Vec<_>, _>>()?;
    rendered.push(relative(&robot.sightings)?);
    rendered.retain(|(_, _, rows)| *rows > 0);
    Ok(rendered)
}

/// Renders a channel whose rows are a stamp and numbers.
fn table(rows: &Rows<'_>) -> Result<Rendered, String> {
    let mut text = rows.channel.columns.join(",") + "\n";
    for (row, time) in rows.times.iter().enumerate() {
        push_time(&mut text, *time);
        for value in rows.numbers(row)? {
            text.push(',');
            push_number(&mut text, value);
        }
        text.push('\n');
    }
    Ok((rows.channel, text, rows.times.len()))
}

fn relative(samples: &[Sample]) -> Result<Rendered, String> {
    let seen = rows::sightings(samples)?;
    let first = seen.first().map(|(_, _, relative)| sightings::Kind::of(relative));
    let uniform = seen.iter().all(|(_, _, relative)| Some(sightings::Kind::of(relative)) == first);
    // A uniform file has just the columns of its kind; a mixed one has all, with empty cells.
    let columns: Vec<usize> = (0..5)
        .filter(|&column| {
            !uniform || seen.first().is_some_and(|seen| sightings::cells(&seen.2)[column].is_some())
        })
        .collect();
    let mut text = RELATIVE.columns.join(",");
    let kind_column = if uniform { None } else { Some(sightings::OPTIONAL[0]) };
    for name in kind_column.into_iter().chain(columns.iter().map(|column| sightings::OPTIONAL[column + 1])) {
        text.push(',');
        text.push_str(name);
    }
    text.push('\n');
    for (time, target, relative) in &seen {
        push_time(&mut text, *time);
        match target {
            Target::Robot(robot) => {
                text.push_str(",robot,");
                text.push_str(&robot_folder(*robot));
            }
            Target::Landmark(landmark) => {
                text.push_str(",landmark,");
                push_landmark(&mut text, *landmark);
            }
        }
        if !uniform {
            text.push(',');
            text.push_str(sightings::Kind::of(relative).name());
        }
        let cells = sightings::cells(relative);
        for &column in &columns {
            match cells[column] {
                Some(value) => {
                    push_cell(&mut text, value).map_err(|what| rows::at(RELATIVE, *time, &what))?;
                }
                None => text.push(','),
            }
        }
        text.push('\n');
    }
    Ok((RELATIVE, text, samples.len()))
}

/// Appends the name of a landmark as the map has it: `L07`.
fn push_landmark(text: &mut String, landmark: LandmarkId) {
    // Writing to a string cannot fail.
    let _ = write!(text, "L{:02}", landmark.0);
}

/// Appends a comma and a number.
fn push_cell(text: &mut String, value: f64) -> Result<(), String> {
    if !value.is_finite() {
        return Err(format!("the number {value} is not finite"));
    }
    text.push(',');
    push_number(text, value);
    Ok(())
}

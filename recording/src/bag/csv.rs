//! Reads the mapped columns of csv files.

use std::path::Path;

use pleiad_estimation::Timestamp;

use super::Gathered;
use super::mapping::{CsvTable, Mapping, TimeUnit};
use crate::error::RecordingError;
use crate::folder::rows;
use crate::number::parse_time;
use crate::report::SkippedRow;
use crate::table::{Row, Table, shown};
use crate::types::RobotRecording;

const REMEDY: &str = "repair or remove the line, or read with bad rows skipped (--skip-bad-rows)";

/// Reads what `mapping` asks of the csv files in `folder`.
pub(super) fn read(
    folder: &Path,
    mapping: &Mapping,
    gathered: &mut Gathered<'_>,
) -> Result<(), RecordingError> {
    for told in mapping.tables() {
        let columns: Vec<&str> = told.columns.iter().map(String::as_str).collect();
        let Some(table) = Table::open_csv(folder, &told.file, &columns, &[])? else {
            return Err(RecordingError::MissingFile {
                path: folder.join(&told.file),
                needed_for: format!("{} names it in {}", mapping.file().display(), told.place),
                remedy: "correct the key `file`, which is taken from the folder that is read",
            });
        };
        let mut cells = Vec::new();
        for (line, text) in table.lines() {
            let robot = gathered.recording.robots.entry(told.robot).or_default();
            let read = table.row(text, &mut cells).and_then(|row| take(&row, told, robot));
            let file = gathered.file(told.robot, told.channel, &told.file);
            file.rows += 1;
            match read {
                Ok(()) => {}
                Err(expected) if gathered.options.skip_bad_rows => {
                    let file = gathered.file(told.robot, told.channel, &told.file);
                    file.skip(SkippedRow { line, found: shown(text), expected });
                }
                Err(expected) => return Err(table.bad_row(line, expected, REMEDY)),
            }
        }
        if table.ends_abruptly() {
            let warning = format!("{}: the last line has no line end; the file may be cut short", told.file);
            gathered.report.warnings.push(warning);
        }
    }
    Ok(())
}

fn take(row: &Row<'_>, told: &CsvTable, robot: &mut RobotRecording) -> Result<(), String> {
    let time = stamp(row, told)?;
    let numbers = told.conversion.scale.iter().enumerate();
    let numbers = numbers.map(|(at, factor)| Ok(row.number(at + 1)? * factor));
    let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
    rows::insert(robot, told.channel, time, &numbers)
}

/// The stamp in the first column, exact to the nanosecond in every unit.
fn stamp(row: &Row<'_>, told: &CsvTable) -> Result<Timestamp, String> {
    let text = row.text(0);
    let digits = match told.time_unit {
        TimeUnit::Seconds => 0,
        TimeUnit::Milliseconds => 3,
        TimeUnit::Microseconds => 6,
        TimeUnit::Nanoseconds => 9,
    };
    // Units are told apart by where the decimal point belongs, so that no digit passes through a double.
    let time = parse_time(shifted(text, digits).as_bytes())
        .ok_or_else(|| format!("a time in column `{}`, not `{text}`", told.columns[0]))?;
    let offset_s = told.conversion.offset_s;
    Ok(if offset_s == 0.0 { time } else { time.plus_seconds(offset_s) })
}

/// `text` with its decimal point `digits` places to the left; what is no plain decimal stays what it is.
fn shifted(text: &str, digits: usize) -> String {
    let (sign, number) = match text.strip_prefix('-') {
        Some(number) => ("-", number),
        None => ("", text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let plain = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    if digits == 0 || whole.is_empty() || !plain(whole) || !plain(fraction) {
        return if digits == 0 { text.to_owned() } else { String::new() };
    }
    let padded = format!("{whole:0>width$}", width = digits + 1);
    let (seconds, rest) = padded.split_at(padded.len() - digits);
    format!("{sign}{seconds}.{rest}{fraction}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_move_the_point_and_keep_every_digit() {
        for (text, digits, seconds) in [
            ("1700000000123456789", 9, "1700000000.123456789"),
            ("5", 9, "0.000000005"),
            ("-1500.25", 3, "-1.50025"),
            ("+12", 6, "0.000012"),
            ("1.5e3", 0, "1.5e3"),
            ("1.5e3", 3, ""),
            ("", 3, ""),
            ("abc", 9, ""),
        ] {
            assert_eq!(shifted(text, digits), seconds, "{text}");
        }
    }
}

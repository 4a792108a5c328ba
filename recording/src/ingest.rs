//! Reading the files of a folder under one set of options into one report.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_estimation::RobotId;

use crate::error::RecordingError;
use crate::parallel;
use crate::report::{FileReport, Form, IngestReport, SkippedRow};
use crate::table::{Row, Table, shown};
use crate::tidy::{Stamped, tidy};

/// What a user can do about a bad row.
const REMEDY: &str = "repair or remove the line, or read with bad rows skipped (--skip-bad-rows)";

/// How damaged input is treated.
///
/// Whatever the options, in each channel
/// * rows out of order are sorted by stamp, stably, and counted;
/// * of rows with one stamp (for sightings: one stamp, target and kind of measurement) the first is kept;
///   identical ones are counted as duplicates, different ones as conflicts;
/// * pauses of more than five median periods are counted, the longest with its place;
/// * sightings of a barcode that no subject bears are dropped and counted by barcode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Whether rows that cannot be read (wrong number of cells, no number, NaN or infinity, an
    /// impossible value) are skipped and counted instead of ending the reading with an error.
    pub skip_bad_rows: bool,
}

/// A folder being read.
pub(crate) struct Ingest<'a> {
    /// The folder.
    pub(crate) root: &'a Path,
    /// What was found so far.
    pub(crate) report: IngestReport,
    options: ReadOptions,
}

/// Whether a channel may be without rows.
pub(crate) enum Presence<'a> {
    /// At least one row must remain; why.
    Required(&'a str),
    /// No rows are worth a warning.
    Optional,
}

impl<'a> Ingest<'a> {
    /// Begins to read `root`.
    pub(crate) fn new(root: &'a Path, form: Form, options: ReadOptions) -> Self {
        Self { root, report: IngestReport::new(form), options }
    }

    /// Reads what belongs to one robot each, on several processors; the report is in the order of the robots.
    pub(crate) fn of_robots<T: Send>(
        &mut self,
        robots: impl IntoIterator<Item = RobotId>,
        read: impl Fn(&mut Self, RobotId) -> Result<T, RecordingError> + Sync,
    ) -> Result<BTreeMap<RobotId, T>, RecordingError> {
        let (root, form, options) = (self.root, self.report.form, self.options);
        let robots: Vec<RobotId> = robots.into_iter().collect();
        let parts = parallel::map(&robots, |&robot| {
            let mut own = Self::new(root, form, options);
            let result = read(&mut own, robot);
            (robot, own.report, result)
        });
        let mut all = BTreeMap::new();
        for (robot, report, result) in parts {
            self.report.warnings.extend(report.warnings);
            self.report.files.extend(report.files);
            all.insert(robot, result?);
        }
        Ok(all)
    }

    /// Adds a warning.
    pub(crate) fn warn(&mut self, warning: String) {
        self.report.warnings.push(warning);
    }

    /// Parses every row of `table`. A row that `parse` turns into `None` is dropped; `parse` counts it.
    pub(crate) fn rows<T>(
        &mut self,
        table: &Table,
        mut parse: impl FnMut(&Row<'_>, usize) -> Result<Option<T>, String>,
    ) -> Result<(Vec<T>, FileReport), RecordingError> {
        let mut report = FileReport::new(&table.file);
        let mut parsed = Vec::with_capacity(table.expected_rows());
        let mut cells = Vec::new();
        for (line, text) in table.lines() {
            report.rows += 1;
            match table.row(text, &mut cells).and_then(|row| parse(&row, line)) {
                Ok(Some(row)) => parsed.push(row),
                Ok(None) => {}
                Err(expected) => {
                    if !self.options.skip_bad_rows {
                        return Err(table.bad_row(line, expected, REMEDY));
                    }
                    report.skip(SkippedRow { line, found: shown(text), expected });
                }
            }
        }
        report.kept = parsed.len();
        if table.ends_abruptly() {
            self.warn(format!("{}: the last line has no line end; the file may be cut short", table.file));
        }
        if !table.unknown_columns.is_empty() {
            self.warn(format!("{}: columns not read: {}", table.file, table.unknown_columns.join(", ")));
        }
        Ok((parsed, report))
    }

    /// Reads a channel: parses its rows, puts them in order, files the report.
    pub(crate) fn channel<T: Stamped>(
        &mut self,
        table: &Table,
        presence: &Presence<'_>,
        mut parse: impl FnMut(&Row<'_>) -> Result<T, String>,
    ) -> Result<Vec<T>, RecordingError> {
        let (mut rows, mut report) = self.rows(table, |row, _| parse(row).map(Some))?;
        tidy(&mut rows, &mut report);
        self.file_channel(table, presence, &rows, report)?;
        Ok(rows)
    }

    /// Files the report of a channel that was put in order, and judges whether it may be empty.
    pub(crate) fn file_channel<T>(
        &mut self,
        table: &Table,
        presence: &Presence<'_>,
        rows: &[T],
        report: FileReport,
    ) -> Result<(), RecordingError> {
        if rows.is_empty() {
            match presence {
                Presence::Required(needed_for) => {
                    return Err(RecordingError::EmptyChannel {
                        file: table.path.clone(),
                        rows: report.rows,
                        skipped: report.skipped,
                        needed_for: (*needed_for).to_owned(),
                    });
                }
                Presence::Optional => self.warn(format!("{}: no rows", table.file)),
            }
        }
        self.report.files.push(report);
        Ok(())
    }

    /// Reads a table of things with numbers, each of which may be listed once.
    pub(crate) fn map<K: Ord + Copy, V>(
        &mut self,
        table: &Table,
        mut parse: impl FnMut(&Row<'_>, usize) -> Result<(K, V), String>,
        repeated: impl Fn(K, usize) -> String,
    ) -> Result<BTreeMap<K, V>, RecordingError> {
        let mut lines = BTreeMap::new();
        let mut clash = None;
        let (rows, report) = self.rows(table, |row, line| {
            let (key, value) = parse(row, line)?;
            match lines.insert(key, line) {
                Some(earlier) if clash.is_none() => clash = Some((line, repeated(key, earlier))),
                _ => {}
            }
            Ok(Some((key, value)))
        })?;
        if let Some((line, conflict)) = clash {
            return Err(table.repeated(line, conflict));
        }
        self.report.files.push(report);
        Ok(rows.into_iter().collect())
    }
}

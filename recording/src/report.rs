//! What reading a recording found besides its data.

use std::collections::BTreeMap;
use std::fmt;

use pleiad_estimation::Timestamp;
use serde::{Serialize, Serializer};

use crate::number::time_text;

/// Skipped rows are listed up to this many per file; the rest are only counted.
const LISTED_ROWS: usize = 5;

/// The forms a recording is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// A folder `r1/`, `r2/`, ... of `.csv` channels.
    Folder,
    /// A folder of the UTIAS multi-robot data set.
    Mrclam,
    /// An MCAP file that Pleiad wrote.
    Mcap,
    /// A ROS 2 bag through a mapping.
    Bag,
    /// Files of comma-separated values through a mapping.
    Csv,
}

/// What was found while reading; nothing is dropped, reordered or assumed without standing here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IngestReport {
    /// Which form was read.
    pub form: Form,
    /// Whatever deserves a look but is no fault of a single row.
    pub warnings: Vec<String>,
    /// One entry per file of rows, in the order of reading.
    pub files: Vec<FileReport>,
}

/// What was found in one file.
///
/// Every data row is accounted for once:
/// `rows = kept + skipped + duplicates + conflicts + unknown barcodes`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileReport {
    /// The file, from the recording's folder; the topic of a bag.
    pub file: String,
    /// Data rows found; neither header, comments nor blank lines.
    pub rows: usize,
    /// Rows that became part of the recording.
    pub kept: usize,
    /// Rows skipped because they could not be read.
    pub skipped: usize,
    /// Rows dropped because an identical row with the same stamp came before.
    pub duplicates: usize,
    /// Rows dropped because a different row with the same stamp came before; the first is kept.
    pub conflicts: usize,
    /// Rows stamped before the row in front of them; they were sorted in, equal stamps in file order.
    pub out_of_order: usize,
    /// The first skipped rows.
    pub first_skipped: Vec<SkippedRow>,
    /// Rows dropped because no subject bears their barcode: how many, by barcode.
    pub unknown_barcodes: BTreeMap<u32, usize>,
    /// Pauses between stamps.
    pub gaps: Gaps,
}

/// A row that could not be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SkippedRow {
    /// Its line, counted from 1.
    pub line: usize,
    /// Its text, shortened.
    pub found: String,
    /// What should be there.
    pub expected: String,
}

/// Pauses of more than [`Gaps::FACTOR`] times the median period of the channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Gaps {
    /// How many.
    pub count: usize,
    /// The longest, seconds; 0 if there is none.
    pub largest_s: f64,
    /// The stamp the longest begins at, seconds from the epoch.
    #[serde(rename = "at_s", serialize_with = "seconds", skip_serializing_if = "Option::is_none")]
    pub at: Option<Timestamp>,
    /// The median period between distinct stamps, seconds; `None` below three stamps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median_period_s: Option<f64>,
}

#[allow(clippy::ref_option, reason = "serde's signature")]
fn seconds<S: Serializer>(time: &Option<Timestamp>, serializer: S) -> Result<S::Ok, S::Error> {
    time.map(Timestamp::seconds).serialize(serializer)
}

impl Gaps {
    /// A pause is a gap if it is longer than this many median periods.
    pub const FACTOR: f64 = 5.0;
}

impl FileReport {
    /// An empty report on `file`.
    pub(crate) fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Counts a skipped row.
    pub(crate) fn skip(&mut self, row: SkippedRow) {
        self.skipped += 1;
        if self.first_skipped.len() < LISTED_ROWS {
            self.first_skipped.push(row);
        }
    }
}

impl IngestReport {
    /// A report on nothing yet.
    pub(crate) fn new(form: Form) -> Self {
        Self { form, files: Vec::new(), warnings: Vec::new() }
    }

    /// The report on `file`, named from the recording's folder.
    pub fn file(&self, file: &str) -> Option<&FileReport> {
        self.files.iter().find(|report| report.file == file)
    }

    /// Rows of all files that could not be read.
    pub fn skipped(&self) -> usize {
        self.files.iter().map(|file| file.skipped).sum()
    }

    /// Whether nothing was dropped or reordered and there is no warning. Gaps alone do not count: a
    /// robot that sees nobody for a while is no fault of its recording.
    pub fn is_clean(&self) -> bool {
        let faultless = |file: &FileReport| file.rows == file.kept && file.out_of_order == 0;
        self.warnings.is_empty() && self.files.iter().all(faultless)
    }

    fn line(
        &self,
        f: &mut fmt::Formatter<'_>,
        what: &str,
        count: impl Fn(&FileReport) -> usize,
    ) -> fmt::Result {
        let worst = self.files.iter().rev().max_by_key(|file| count(file)).filter(|file| count(file) > 0);
        let Some(worst) = worst else { return Ok(()) };
        let total: usize = self.files.iter().map(&count).sum();
        let files = self.files.iter().filter(|file| count(file) > 0).count();
        write!(f, "\n  {total} {what}, in {files} file(s), most in {} ({})", worst.file, count(worst))
    }
}

impl fmt::Display for IngestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let form = match self.form {
            Form::Folder => "recording folder",
            Form::Mrclam => "MRCLAM folder",
            Form::Mcap => "MCAP file",
            Form::Bag => "ROS 2 bag",
            Form::Csv => "CSV files",
        };
        let rows: usize = self.files.iter().map(|file| file.rows).sum();
        let kept: usize = self.files.iter().map(|file| file.kept).sum();
        let parts = if matches!(self.form, Form::Mcap | Form::Bag) { "topics" } else { "files" };
        write!(f, "{form}: {} {parts}, {kept} of {rows} rows kept", self.files.len())?;
        self.line(f, "bad rows skipped", |file| file.skipped)?;
        for file in &self.files {
            if let Some(row) = file.first_skipped.first() {
                write!(f, "\n    {}:{}: `{}`, expected {}", file.file, row.line, row.found, row.expected)?;
            }
        }
        self.line(f, "identical rows with an equal stamp dropped", |file| file.duplicates)?;
        self.line(f, "different rows with an equal stamp dropped (the first kept)", |file| file.conflicts)?;
        self.line(f, "rows out of order, sorted", |file| file.out_of_order)?;
        self.line(f, "sightings of unknown barcodes dropped", |file| file.unknown_barcodes.values().sum())?;
        self.line(f, "gaps longer than 5 median periods", |file| file.gaps.count)?;
        let longest = self.files.iter().max_by(|a, b| a.gaps.largest_s.total_cmp(&b.gaps.largest_s));
        if let Some((file, at)) = longest.and_then(|file| Some((file, file.gaps.at?))) {
            write!(f, "; the longest {:.3} s, in {} from {}", file.gaps.largest_s, file.file, time_text(at))?;
        }
        self.warnings.iter().try_for_each(|warning| write!(f, "\n  warning: {warning}"))
    }
}

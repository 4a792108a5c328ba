//! A text file of rows: comma-separated with a header, or whitespace-separated with fixed columns.

use std::path::{Path, PathBuf};

use pleiad_estimation::Timestamp;

use crate::error::RecordingError;
use crate::number::{parse_f64, parse_time};

/// Longest piece of a line that a message shows.
const SHOWN_CHARACTERS: usize = 80;

/// How the cells of a row are told apart.
#[derive(Clone, Copy, PartialEq)]
enum Separator {
    Comma,
    Whitespace,
}

/// A file in memory whose columns are known.
pub(crate) struct Table {
    /// The file, from the recording's folder.
    pub(crate) file: String,
    /// The file, as the user would name it.
    pub(crate) path: PathBuf,
    /// Header columns that were not asked for.
    pub(crate) unknown_columns: Vec<String>,
    bytes: Vec<u8>,
    /// Where the rows begin, and how many lines lie before.
    body: usize,
    lines_before: usize,
    separator: Separator,
    /// Number of cells in every row.
    width: usize,
    /// The columns asked for, and where each is.
    wanted: Vec<String>,
    cells: Vec<Option<usize>>,
}

/// The bytes of `path`, or `None` if there is no such file.
pub(crate) fn load(path: &Path) -> Result<Option<Vec<u8>>, RecordingError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(RecordingError::io("read", path)(error)),
    }
}

/// A line for people: lossy, shortened.
pub(crate) fn shown(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.chars().take(SHOWN_CHARACTERS).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}

impl Table {
    /// Opens a `.csv` file by its header, which may order the columns freely; `None` if there is no file.
    pub(crate) fn open_csv(
        root: &Path,
        file: &str,
        required: &[&str],
        optional: &[&str],
    ) -> Result<Option<Self>, RecordingError> {
        let path = root.join(file);
        let Some(bytes) = load(&path)? else { return Ok(None) };
        let mut lines = Lines::new(&bytes, 0, 0);
        let header = lines.by_ref().find(|(_, text)| is_data(text));
        let (line, text) = header.unwrap_or((lines.number.max(1), b""));
        let names: Vec<&str> = text.split(|&byte| byte == b',').map(str_or_empty).collect();
        let wanted: Vec<String> = required.iter().chain(optional).map(ToString::to_string).collect();
        let refused = |expected: String| RecordingError::BadHeader {
            file: path.clone(),
            line,
            found: shown(text),
            expected,
        };
        for name in required {
            if !names.contains(name) {
                return Err(refused(format!("the columns {}; `{name}` is missing", required.join(","))));
            }
        }
        for name in &wanted {
            if names.iter().filter(|column| **column == name.as_str()).count() > 1 {
                return Err(refused(format!("column `{name}` only once")));
            }
        }
        let cells =
            wanted.iter().map(|name| names.iter().position(|column| *column == name.as_str())).collect();
        let unknown_columns = names
            .iter()
            .filter(|name| !wanted.iter().any(|own| own == *name))
            .map(ToString::to_string)
            .collect();
        Ok(Some(Self {
            file: file.to_owned(),
            unknown_columns,
            body: lines.offset,
            lines_before: lines.number,
            separator: Separator::Comma,
            width: names.len(),
            wanted,
            cells,
            path,
            bytes,
        }))
    }

    /// Opens a whitespace-separated file with the columns `names`; `None` if there is no file.
    pub(crate) fn open_columns(
        root: &Path,
        file: &str,
        names: &[&str],
    ) -> Result<Option<Self>, RecordingError> {
        let path = root.join(file);
        let Some(bytes) = load(&path)? else { return Ok(None) };
        Ok(Some(Self {
            file: file.to_owned(),
            path,
            unknown_columns: Vec::new(),
            bytes,
            body: 0,
            lines_before: 0,
            separator: Separator::Whitespace,
            width: names.len(),
            wanted: names.iter().map(ToString::to_string).collect(),
            cells: (0..names.len()).map(Some).collect(),
        }))
    }

    /// Whether the file has the wanted column `index`.
    pub(crate) fn has(&self, index: usize) -> bool {
        self.cells.get(index).is_some_and(Option::is_some)
    }

    /// The error of a header that has its required columns and still makes no sense.
    pub(crate) fn bad_header(&self, expected: String) -> RecordingError {
        let line = self.lines_before;
        RecordingError::BadHeader { file: self.path.clone(), line, found: self.shown_line(line), expected }
    }

    /// The error of a row that is not what was `expected`.
    pub(crate) fn bad_row(&self, line: usize, expected: String, remedy: &'static str) -> RecordingError {
        let (file, found) = (self.path.clone(), self.shown_line(line));
        RecordingError::BadRow { file, line, found, expected, remedy }
    }

    /// The error of a line that clashes with an earlier one.
    pub(crate) fn repeated(&self, line: usize, conflict: String) -> RecordingError {
        RecordingError::Repeated { file: self.path.clone(), line, found: self.shown_line(line), conflict }
    }

    /// The text of a line, for people.
    fn shown_line(&self, number: usize) -> String {
        let line = Lines::new(&self.bytes, 0, 0).find(|line| line.0 == number);
        line.map(|(_, text)| shown(text)).unwrap_or_default()
    }

    /// Whether the last line lacks its line end, as it does in a file that was cut short.
    pub(crate) fn ends_abruptly(&self) -> bool {
        self.bytes.last().is_some_and(|&byte| byte != b'\n')
    }

    /// A generous guess of the number of rows, to allocate once.
    pub(crate) fn expected_rows(&self) -> usize {
        self.bytes.len() / 32
    }

    /// The rows with their line numbers from 1; comments (`#`) and blank lines are left out.
    pub(crate) fn lines(&self) -> impl Iterator<Item = (usize, &[u8])> {
        Lines::new(&self.bytes, self.body, self.lines_before).filter(|(_, text)| is_data(text))
    }

    /// Splits a line into `cells`, reusing their memory, and checks their number.
    pub(crate) fn row<'r, 't: 'r>(
        &'t self,
        text: &'t [u8],
        cells: &'r mut Vec<&'t [u8]>,
    ) -> Result<Row<'r>, String> {
        cells.clear();
        match self.separator {
            Separator::Comma => cells.extend(text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii)),
            Separator::Whitespace => {
                cells.extend(text.split(u8::is_ascii_whitespace).filter(|cell| !cell.is_empty()));
            }
        }
        if cells.len() == self.width {
            Ok(Row { table: self, cells })
        } else {
            let names = self.wanted.join(", ");
            Err(format!("{} cells ({names}), not {}", self.width, cells.len()))
        }
    }
}

/// One row; columns are named by their place in the list that was asked for.
pub(crate) struct Row<'t> {
    table: &'t Table,
    cells: &'t [&'t [u8]],
}

impl<'t> Row<'t> {
    /// The cell of a column; empty if the file lacks the column.
    fn cell(&self, column: usize) -> &'t [u8] {
        let index = self.table.cells.get(column).copied().flatten();
        index.and_then(|index| self.cells.get(index)).copied().unwrap_or_default()
    }

    fn expected(&self, column: usize, what: &str) -> String {
        let name = self.table.wanted.get(column).map(String::as_str).unwrap_or_default();
        format!("{what} in column `{name}`, not `{}`", shown(self.cell(column)))
    }

    /// A finite number.
    pub(crate) fn number(&self, column: usize) -> Result<f64, String> {
        let value = parse_f64(self.cell(column)).filter(|value| value.is_finite());
        value.ok_or_else(|| self.expected(column, "a finite number"))
    }

    /// A finite number that is not negative.
    pub(crate) fn distance(&self, column: usize) -> Result<f64, String> {
        let value = self.number(column)?;
        if value >= 0.0 { Ok(value) } else { Err(self.expected(column, "a distance that is not negative")) }
    }

    /// An instant in seconds.
    pub(crate) fn time(&self, column: usize) -> Result<Timestamp, String> {
        parse_time(self.cell(column)).ok_or_else(|| self.expected(column, "a time in seconds"))
    }

    /// A number of a robot, landmark, subject or barcode, with or without the letter that may precede it.
    pub(crate) fn identifier(&self, column: usize, letter: Option<char>) -> Result<u32, String> {
        let text = str_or_empty(self.cell(column));
        let number = letter.and_then(|letter| text.strip_prefix(letter)).unwrap_or(text);
        let digits = number.bytes().all(|byte| byte.is_ascii_digit());
        let parsed = if digits { number.parse().ok() } else { None };
        parsed.ok_or_else(|| match letter {
            Some(letter) => self.expected(column, &format!("a number such as `{letter}2` or `2`")),
            None => self.expected(column, "a whole number"),
        })
    }

    /// The text of a cell.
    pub(crate) fn text(&self, column: usize) -> &'t str {
        str_or_empty(self.cell(column))
    }

    /// Whether a cell is filled.
    pub(crate) fn is_filled(&self, column: usize) -> bool {
        !self.cell(column).is_empty()
    }
}

/// The text of a cell; what is not UTF-8 equals nothing that is expected, just as an empty cell.
fn str_or_empty(cell: &[u8]) -> &str {
    std::str::from_utf8(cell.trim_ascii()).unwrap_or_default()
}

fn is_data(text: &[u8]) -> bool {
    text.first().is_some_and(|&byte| byte != b'#')
}

/// Lines with their numbers, trimmed; a byte order mark is passed over.
struct Lines<'t> {
    bytes: &'t [u8],
    offset: usize,
    number: usize,
}

impl<'t> Lines<'t> {
    fn new(bytes: &'t [u8], offset: usize, number: usize) -> Self {
        let mark = if offset == 0 && bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, offset: offset + mark, number }
    }
}

impl<'t> Iterator for Lines<'t> {
    type Item = (usize, &'t [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.bytes.get(self.offset..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        self.offset += end + 1;
        self.number += 1;
        Some((self.number, rest[..end].trim_ascii()))
    }
}

//! The end of an agent's log, for error messages.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Written into a log whenever its agent is started, so that an earlier life is not quoted.
const MARK: &str = "---- agent started ----";
/// How much of a log is quoted.
const LINES: usize = 10;
/// How far from its end that is looked for, bytes.
const REACH: u64 = 8192;

/// Opens a log for another life of its agent, after what is there.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    writeln!(file, "{MARK}")?;
    Ok(file)
}

/// The last lines since the agent was started last; none if the log cannot be read.
pub(crate) fn tail(path: &Path) -> Vec<String> {
    let Ok((bytes, whole)) = end_of(path) else { return Vec::new() };
    let text = String::from_utf8_lossy(&bytes);
    let mut lines: Vec<_> = text.lines().collect();
    if !whole && !lines.is_empty() {
        // Its beginning is missing.
        lines.remove(0);
    }
    if let Some(mark) = lines.iter().rposition(|line| *line == MARK) {
        lines.drain(..=mark);
    }
    lines[lines.len().saturating_sub(LINES)..].iter().map(|line| (*line).to_owned()).collect()
}

fn end_of(path: &Path) -> io::Result<(Vec<u8>, bool)> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let from = length.saturating_sub(REACH);
    file.seek(SeekFrom::Start(from))?;
    let mut bytes = Vec::new();
    file.take(REACH).read_to_end(&mut bytes)?;
    Ok((bytes, from == 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_life_is_quoted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("logs").join("1.log");
        writeln!(open(&path).unwrap(), "first life").unwrap();
        assert_eq!(tail(&path), ["first life"]);
        let mut second = open(&path).unwrap();
        assert_eq!(tail(&path), Vec::<String>::new());
        write!(second, "second life\nno newline at the end").unwrap();
        assert_eq!(tail(&path), ["second life", "no newline at the end"]);
        assert!(std::fs::read_to_string(&path).unwrap().contains("first life"), "nothing is deleted");
    }

    #[test]
    fn long_logs_give_their_last_lines_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("1.log");
        let mut file = open(&path).unwrap();
        for line in 0..5000 {
            writeln!(file, "line {line}").unwrap();
        }
        let expected: Vec<_> = (4990..5000).map(|line| format!("line {line}")).collect();
        assert_eq!(tail(&path), expected);
        writeln!(file, "{}", "x".repeat(9000)).unwrap();
        assert_eq!(tail(&path), Vec::<String>::new(), "a line longer than the reach has no beginning");
    }

    #[test]
    fn a_missing_log_has_no_lines() {
        assert_eq!(tail(Path::new("nowhere.log")), Vec::<String>::new());
    }
}

//! Torn, damaged and foreign files.

use super::*;
use pleiad_estimation::Timestamp;
use pleiad_estimation::sample::{Reading, Sample};

fn record(seconds: f64) -> Record {
    let reading = Reading::Gps { x_m: seconds, y_m: -seconds };
    Record::Sample(Sample { time: Timestamp::from_seconds(seconds), reading })
}

fn written(frames: &[Vec<Record>]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep/journal.bin");
    let (mut journal, found) = Journal::open(&path).unwrap();
    assert!(found.records.is_empty() && found.torn_bytes == 0);
    for frame in frames {
        journal.append(frame).unwrap();
    }
    journal.sync().unwrap();
    (folder, path)
}

#[test]
fn what_was_appended_is_found_in_order_across_restarts() {
    let (_folder, path) = written(&[vec![record(1.0), record(2.0)], vec![record(3.0)]]);
    let (mut journal, found) = Journal::open(&path).unwrap();
    assert_eq!(found.records, [record(1.0), record(2.0), record(3.0)]);
    journal.append(&[record(4.0)]).unwrap();
    assert_eq!(Journal::read(&path).unwrap().len(), 4);
}

#[test]
fn a_torn_last_frame_is_dropped_whole_at_every_length() {
    let (_folder, path) = written(&[vec![record(1.0)], vec![record(2.0), record(3.0)]]);
    let whole = std::fs::read(&path).unwrap();
    let first = Journal::open(&path).unwrap().1.records.len();
    assert_eq!(first, 3);
    let second_frame = (whole.len() - MAGIC.len()) / 3 + MAGIC.len();
    for cut in second_frame + 8..whole.len() {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let (mut journal, found) = Journal::open(&path).unwrap();
        assert!(found.records == [record(1.0)] || found.records.is_empty(), "cut at {cut}");
        assert!(found.torn_bytes > 0);
        journal.append(&[record(9.0)]).unwrap();
        assert_eq!(Journal::read(&path).unwrap().last(), Some(&record(9.0)), "cut at {cut}");
    }
}

#[test]
fn a_damaged_frame_in_the_middle_is_an_error_with_its_place() {
    let (_folder, path) = written(&[vec![record(1.0)], vec![record(2.0)]]);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[MAGIC.len() + HEADER_BYTES + 6] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let error = Journal::open(&path).unwrap_err();
    assert!(matches!(error, JournalError::Damaged { offset: 8, .. }), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "a damaged journal is left as it is");
}

#[test]
fn a_length_no_frame_can_have_is_damage_and_not_a_torn_end() {
    let (_folder, path) = written(&[vec![record(1.0)], vec![record(2.0)]]);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[MAGIC.len() + 3] = 0x7f;
    std::fs::write(&path, &bytes).unwrap();
    assert!(matches!(Journal::open(&path).unwrap_err(), JournalError::Damaged { offset: 8, .. }));
}

#[test]
fn another_file_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notes.txt");
    std::fs::write(&path, "not a journal at all").unwrap();
    assert!(matches!(Journal::open(&path).unwrap_err(), JournalError::NotAJournal { .. }));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "not a journal at all");
}

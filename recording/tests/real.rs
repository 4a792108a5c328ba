//! Reads the published recordings. Runs with `--features recordings` and the environment variable
//! `PLEIAD_RECORDINGS` naming the folder that holds `mrclam/` and `physics-engine/`.
//!
//! Expected values come from the descriptions beside the recordings and from counts made with other
//! programs (`awk`, a separate script).

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::{LandmarkId, RobotId, Timestamp};
use pleiad_recording::{Form, IngestReport, Overwrite, ReadOptions, Recording, open, write_folder};

fn recordings() -> PathBuf {
    let path = std::env::var_os("PLEIAD_RECORDINGS").expect(
        "set PLEIAD_RECORDINGS to the folder that holds mrclam/MRCLAM_Dataset6 (published by its authors at \
         asrl.utias.utoronto.ca/datasets/mrclam) and physics-engine/",
    );
    PathBuf::from(path)
}

fn mrclam(dataset: u32) -> (PathBuf, Recording, IngestReport) {
    let folder = recordings().join(format!("mrclam/MRCLAM_Dataset{dataset}"));
    let (recording, report) =
        open(&folder, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    (folder, recording, report)
}

/// Lines that are neither blank nor comments, less a header.
fn data_lines(path: &Path, header_lines: usize) -> usize {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).count() - header_lines
}

#[test]
fn mrclam_row_counts_are_those_of_counting_lines() {
    for dataset in [2, 6] {
        let (folder, _, report) = mrclam(dataset);
        assert_eq!(report.form, Form::Mrclam);
        assert_eq!(report.files.len(), 17, "{report}");
        for file in &report.files {
            assert_eq!(file.rows, data_lines(&folder.join(&file.file), 0), "{}", file.file);
            let unknown: usize = file.unknown_barcodes.values().sum();
            let accounted = file.kept + file.skipped + file.duplicates + file.conflicts + unknown;
            assert_eq!(file.rows, accounted, "{}", file.file);
        }
    }
}

#[test]
fn mrclam_holds_five_robots_and_fifteen_landmarks() {
    for dataset in [2, 6] {
        let (_, recording, report) = mrclam(dataset);
        assert_eq!(recording.name, format!("MRCLAM_Dataset{dataset}"));
        assert_eq!(
            recording.robots.keys().copied().collect::<Vec<_>>(),
            (1..=5).map(RobotId).collect::<Vec<_>>()
        );
        let landmarks: Vec<_> = recording.landmarks.keys().copied().collect();
        assert_eq!(landmarks, (6..=20).map(LandmarkId).collect::<Vec<_>>());
        assert_eq!(report.skipped(), 0);
        assert!(report.warnings.is_empty(), "{report}");
    }
}

#[test]
fn unknown_barcodes_of_mrclam_are_counted() {
    for (dataset, expected) in [(2, [(34, 1), (43, 2), (52, 8)]), (6, [(34, 2), (43, 1), (50, 3)])] {
        let mut counted: BTreeMap<u32, usize> = BTreeMap::new();
        for file in mrclam(dataset).2.files {
            for (barcode, count) in file.unknown_barcodes {
                *counted.entry(barcode).or_default() += count;
            }
        }
        assert_eq!(counted, expected.into());
    }
}

#[test]
fn repeated_odometry_stamps_of_dataset_6_are_duplicates_or_conflicts() {
    let (_, _, report) = mrclam(6);
    for (robot, duplicates, conflicts) in [(1, 0, 0), (2, 1, 0), (3, 7, 1), (4, 7, 3), (5, 3, 1)] {
        let file = report.file(&format!("Robot{robot}_Odometry.dat")).expect("read");
        assert_eq!(
            (file.duplicates, file.conflicts, file.out_of_order),
            (duplicates, conflicts, 0),
            "{robot}"
        );
    }
}

#[test]
fn gaps_of_dataset_6_are_those_its_description_names() {
    let (_, recording, report) = mrclam(6);
    // The longest pauses in truth: 2.03 s for robot 4, 0.334 s for the others.
    for (robot, longest_s) in [(1, 0.334), (2, 0.334), (3, 0.334), (4, 2.03), (5, 0.334)] {
        let gaps = &report.file(&format!("Robot{robot}_Groundtruth.dat")).expect("read").gaps;
        assert!((gaps.largest_s - longest_s).abs() < 1e-9, "robot {robot}: {gaps:?}");
        assert!((gaps.median_period_s.expect("many rows") - 0.016).abs() < 1e-9);
    }
    let robot_4 = &recording.robots[&RobotId(4)];
    let gap = report.file("Robot4_Groundtruth.dat").expect("read").gaps.at.expect("a gap");
    assert_eq!(gap, Timestamp(1_248_444_871_044_000_000));
    assert_eq!(robot_4.truth_at(gap.plus_seconds(1.0), 1.0), None);
    assert!(robot_4.truth_at(gap.plus_seconds(1.0), 2.5).is_some());
    // Odometry pauses up to about a second.
    for robot in 1..=5 {
        let longest_s = report.file(&format!("Robot{robot}_Odometry.dat")).expect("read").gaps.largest_s;
        assert!((1.0..1.04).contains(&longest_s), "robot {robot}: {longest_s}");
    }
}

#[test]
fn truth_of_robot_1_of_dataset_6_ends_after_772_seconds() {
    let (_, recording, _) = mrclam(6);
    let truth = &recording.robots[&RobotId(1)].truth;
    let (first, last) = (truth[0], truth[truth.len() - 1]);
    assert_eq!(first.time, Timestamp(1_248_444_175_103_000_000));
    assert!((last.time.seconds_since(first.time) - 772.0).abs() < 0.5);
    assert_eq!(
        (first.pose.x_m(), first.pose.y_m(), first.pose.yaw_rad()),
        (1.412_772_9, -3.891_077_6, 2.2696)
    );
    let (start, end) = recording.common_time().expect("a common time");
    assert_eq!(end, last.time, "no other channel ends earlier");
    assert!(start > first.time);
}

#[test]
fn the_first_sighting_of_robot_1_of_dataset_6_is_robot_2_at_3_787_m() {
    // Barcode 14 is subject 2, barcode 90 subject 15.
    let (_, recording, _) = mrclam(6);
    let robot = &recording.robots[&RobotId(1)];
    let seen = |index: usize| match robot.sightings[index].reading {
        Reading::Sighting { target, relative: Relative::RangeBearing { range_m, bearing_rad } } => {
            (robot.sightings[index].time, target, range_m, bearing_rad)
        }
        other => panic!("{other:?}"),
    };
    let time = Timestamp(1_248_444_189_599_000_000);
    assert_eq!(seen(0), (time, Target::Robot(RobotId(2)), 3.787, -0.257));
    assert_eq!(seen(1), (time, Target::Landmark(LandmarkId(15)), 6.758, -0.005));
    assert_eq!(robot.odometry.len(), robot.commands.len());
}

#[test]
fn every_recording_of_the_physics_engine_reads_cleanly_and_in_full() {
    let root = recordings().join("physics-engine");
    let mut folders: Vec<PathBuf> = fs::read_dir(&root)
        .expect("physics-engine/")
        .map(|entry| entry.expect("readable").path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    assert_eq!(folders.len(), 9);
    for folder in folders {
        let (recording, report) =
            open(&folder, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(report.is_clean(), "{}: {report}", folder.display());
        assert_eq!(report.form, Form::Folder);
        for file in &report.files {
            assert_eq!(file.kept, data_lines(&folder.join(&file.file), 1), "{}", file.file);
        }
        assert_eq!(recording.landmarks.len(), 12);
        assert!((3..=4).contains(&recording.robots.len()));
        let nominal = recording.nominal.as_ref().expect("nominal.toml");
        assert_eq!(nominal.robots.keys().collect::<Vec<_>>(), recording.robots.keys().collect::<Vec<_>>());
        for (id, robot) in &recording.robots {
            let rates = &nominal.robots[id].rates_hz;
            assert_eq!(rates["gps_rate_hz"] > 0.0, !robot.gps.is_empty(), "{}: {id}", folder.display());
            assert_eq!(rates["heading_rate_hz"] > 0.0, !robot.heading.is_empty());
            assert!(matches!(robot.odometry[0].reading, Reading::Wheels { .. }));
        }
    }
}

#[test]
fn dataset_6_survives_being_written_as_a_recording_folder() {
    let (_, recording, _) = mrclam(6);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("dataset6");
    write_folder(&recording, &path, Overwrite::Refuse).unwrap_or_else(|error| panic!("{error}"));
    let (read, report) = open(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(report.is_clean(), "{report}");
    assert_eq!(read, recording);
}

//! MRCLAM folders: clean ones, and ones with planted damage.

use crate::common::{Folder, read_with, refusal};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, RobotId, Timestamp};
use pleiad_recording::{Form, ReadOptions, open, read_mrclam};

const SKIP: ReadOptions = ReadOptions { skip_bad_rows: true };

/// Two robots (subjects 1, 2; barcodes 5, 14) and one landmark (subject 6, barcode 63), in the data set's
/// own spelling.
fn clean() -> Folder {
    let odometry = "# Odometry\n# Time [s]    forward velocity [m/s]    angular velocity[rad/s] \n\
        1248444187.156 \t  0.086 \t -0.398 \n1248444187.186 \t  0.000 \t  0.100 \n";
    let measurement = "# Measurement\n1248444189.599 \t  14 \t  3.787 \t -0.257 \n\
        1248444189.599 \t  63 \t  6.758 \t -0.005 \n";
    let truth = "# Groundtruth\n1248444175.103 \t 1.41277290 \t -3.89107760 \t 2.26960000 \n";
    Folder::new(&[
        ("Barcodes.dat", "# Subject #    Barcode #\n  1 \t   5 \n  2 \t  14 \n  6 \t  63 \n"),
        (
            "Landmark_Groundtruth.dat",
            "# map\n  6 \t 0.58831396 \t -4.28264845 \t 0.00004570 \t 0.00027395 \n",
        ),
        ("Robot1_Odometry.dat", odometry),
        ("Robot1_Measurement.dat", measurement),
        ("Robot1_Groundtruth.dat", truth),
        ("Robot2_Odometry.dat", odometry),
        ("Robot2_Measurement.dat", &measurement.replace("  14 ", "   5 ")),
        ("Robot2_Groundtruth.dat", truth),
    ])
}

#[test]
fn a_clean_folder_becomes_its_recording_with_nothing_counted() {
    let folder = clean();
    let (recording, report) = read_with(&folder, ReadOptions::default());
    assert_eq!(report.form, Form::Mrclam);
    assert!(report.is_clean(), "{report}");
    assert_eq!(recording.landmarks, [(LandmarkId(6), [0.588_313_96, -4.282_648_45])].into());
    assert_eq!(recording.robots.len(), 2);
    let robot = &recording.robots[&RobotId(1)];
    let time = Timestamp(1_248_444_187_156_000_000);
    let velocity = Reading::Velocity { forward_m_s: 0.086, yaw_rate_rad_s: -0.398 };
    assert_eq!(robot.odometry[0], Sample { time, reading: velocity });
    assert_eq!((robot.commands[0].time, robot.commands[0].forward_m_s), (time, 0.086));
    let relative = Relative::RangeBearing { range_m: 3.787, bearing_rad: -0.257 };
    let reading = Reading::Sighting { target: Target::Robot(RobotId(2)), relative };
    assert_eq!(robot.sightings[0], Sample { time: Timestamp(1_248_444_189_599_000_000), reading });
    assert!(matches!(
        robot.sightings[1].reading,
        Reading::Sighting { target: Target::Landmark(LandmarkId(6)), .. }
    ));
    let truth = robot.truth[0].pose;
    assert_eq!((truth.x_m(), truth.y_m(), truth.yaw_rad()), (1.412_772_9, -3.891_077_6, 2.2696));
}

#[test]
fn a_damaged_row_is_an_error_with_file_line_text_expectation_and_remedy() {
    for (row, expected) in [
        ("1248444188.000 0.086", "3 cells (time, forward_velocity, angular_velocity), not 2"),
        ("1248444188.000 0.086 0.1 7", "3 cells (time, forward_velocity, angular_velocity), not 4"),
        ("1248444188.000 0.086 nan", "a finite number in column `angular_velocity`, not `nan`"),
        ("1248444188.000 inf 0.1", "a finite number in column `forward_velocity`, not `inf`"),
        ("12:48 0.086 0.1", "a time in seconds in column `time`, not `12:48`"),
        ("1248444188.000 0,086 0.1", "a finite number in column `forward_velocity`, not `0,086`"),
    ] {
        let folder = clean();
        folder.append("Robot2_Odometry.dat", &format!("{row}\n"));
        let error = refusal(&folder, ReadOptions::default());
        for part in ["Robot2_Odometry.dat:5: found `", row, expected, "repair or remove the line"] {
            assert!(error.contains(part), "{error}\nlacks {part}");
        }
    }
}

#[test]
fn bad_rows_are_skipped_counted_and_listed_when_asked() {
    let folder = clean();
    folder.append("Robot2_Odometry.dat", "1248444188.000 0.086\n1248444188.010 0.0 0.0\n\u{0}\u{0}\n");
    let (recording, report) = read_with(&folder, SKIP);
    let file = report.file("Robot2_Odometry.dat").expect("read");
    assert_eq!((file.rows, file.kept, file.skipped), (5, 3, 2));
    assert_eq!(file.first_skipped.iter().map(|row| row.line).collect::<Vec<_>>(), [5, 7]);
    assert_eq!(recording.robots[&RobotId(2)].odometry.len(), 3);
    assert_eq!(recording.robots[&RobotId(1)], read_with(&clean(), SKIP).0.robots[&RobotId(1)]);
    let text = report.to_string();
    assert!(
        text.contains("2 bad rows skipped") && text.contains("Robot2_Odometry.dat:5: `1248444188.000 0.086`")
    );
}

#[test]
fn only_the_first_skipped_rows_are_listed_but_all_are_counted() {
    let folder = clean();
    folder.append("Robot1_Groundtruth.dat", &"bad\n".repeat(40));
    let report = read_with(&folder, SKIP).1;
    let file = report.file("Robot1_Groundtruth.dat").expect("read");
    assert_eq!((file.skipped, file.first_skipped.len(), report.skipped()), (40, 5, 40));
}

#[test]
fn unknown_barcodes_are_dropped_and_counted_by_barcode() {
    let folder = clean();
    folder.append(
        "Robot1_Measurement.dat",
        "1248444190 34 1.0 0.0\n1248444191 34 1.0 0.0\n1248444192 50 1.0 0.0\n",
    );
    let (recording, report) = read_with(&folder, ReadOptions::default());
    assert_eq!(
        report.file("Robot1_Measurement.dat").expect("read").unknown_barcodes,
        [(34, 2), (50, 1)].into()
    );
    assert_eq!(recording.robots[&RobotId(1)].sightings.len(), 2);
}

#[test]
fn impossible_sightings_are_bad_rows() {
    for (row, expected) in [
        ("1248444190 5 1.0 0.0", "another subject than robot 1 itself, whose barcode is 5"),
        ("1248444190 63 -1.0 0.0", "a distance that is not negative in column `range`, not `-1.0`"),
        ("1248444190 6.3 1.0 0.0", "a whole number in column `barcode`, not `6.3`"),
    ] {
        let folder = clean();
        folder.append("Robot1_Measurement.dat", &format!("{row}\n"));
        let error = refusal(&folder, ReadOptions::default());
        assert!(error.contains("Robot1_Measurement.dat:4") && error.contains(expected), "{error}");
    }
}

#[test]
fn a_backward_stamp_is_sorted_in_and_counted() {
    let folder = clean();
    folder.append("Robot1_Odometry.dat", "1248444187.170 0.5 0.0\n1248444187.200 0.0 0.0\n");
    let (recording, report) = read_with(&folder, ReadOptions::default());
    let odometry = &recording.robots[&RobotId(1)].odometry;
    let millis: Vec<i64> =
        odometry.iter().map(|sample| sample.time.0 / 1_000_000 - 1_248_444_187_000).collect();
    assert_eq!(millis, [156, 170, 186, 200]);
    assert_eq!(report.file("Robot1_Odometry.dat").expect("read").out_of_order, 1);
    assert!(!report.is_clean());
}

#[test]
fn a_subject_or_barcode_listed_twice_is_refused_even_when_skipping() {
    for (row, expected) in [
        ("6 81\n", "Barcodes.dat:5: found `6 81`, but subject 6 stands in line 4 already"),
        ("7 63\n", "Barcodes.dat:5: found `7 63`, but barcode 63 is that of subject 6 already"),
    ] {
        let folder = clean();
        folder.append("Barcodes.dat", row);
        let error = refusal(&folder, SKIP);
        assert!(error.contains(expected), "{error}");
    }
    let folder = clean();
    folder.append("Landmark_Groundtruth.dat", "6 1.0 2.0 0.1 0.1\n");
    assert!(refusal(&folder, SKIP).contains("landmark 6 stands in line 2 already"));
}

#[test]
fn missing_or_empty_odometry_is_refused() {
    let folder = clean();
    folder.remove("Robot2_Odometry.dat");
    let error = refusal(&folder, ReadOptions::default());
    assert!(error.contains("Robot2_Odometry.dat is missing: robot 2 cannot be localized"), "{error}");
    folder.write("Robot2_Odometry.dat", "# Time v w\n");
    let error = refusal(&folder, ReadOptions::default());
    assert!(error.contains("Robot2_Odometry.dat holds no usable row (0 found, 0 skipped as bad)"), "{error}");
    folder.write("Robot2_Odometry.dat", "# Time v w\nx y z\n");
    assert!(refusal(&folder, SKIP).contains("(1 found, 1 skipped as bad)"));
}

#[test]
fn missing_barcodes_are_refused_and_other_missing_files_are_warnings() {
    let folder = clean();
    for file in ["Robot1_Groundtruth.dat", "Robot2_Measurement.dat", "Landmark_Groundtruth.dat"] {
        folder.remove(file);
    }
    let (recording, report) = read_with(&folder, ReadOptions::default());
    assert!(recording.robots[&RobotId(1)].truth.is_empty() && recording.landmarks.is_empty());
    for warning in [
        "Robot1_Groundtruth.dat: missing",
        "Robot2_Measurement.dat: missing",
        "Landmark_Groundtruth.dat: missing",
        "1 sightings of landmark 6, which is not in the map",
    ] {
        assert!(report.warnings.iter().any(|found| found.contains(warning)), "{report}");
    }
    folder.remove("Barcodes.dat");
    assert!(refusal(&folder, ReadOptions::default()).contains("Barcodes.dat is missing"));
}

#[test]
fn the_form_is_told_by_content_and_never_by_name() {
    let folder = clean();
    let renamed = folder.path().with_file_name("r1 recording.toml");
    std::fs::rename(folder.path(), &renamed).expect("renamed");
    let report = open(&renamed, &ReadOptions::default()).expect("still an MRCLAM folder").1;
    assert_eq!(report.form, Form::Mrclam);
    let empty = Folder::new(&[("notes.txt", "Robot1_Odometry.dat\n")]);
    assert!(refusal(&empty, ReadOptions::default()).contains("it holds no robot"));
    assert!(read_mrclam(empty.path(), &ReadOptions::default()).is_err());
    let both = clean();
    both.write("r1/velocity.csv", "t,v,w\n0,0,0\n");
    assert!(refusal(&both, ReadOptions::default()).contains("both forms"));
    let file = clean();
    let error = open(&file.path().join("Barcodes.dat"), &ReadOptions::default()).expect_err("a file");
    assert!(error.to_string().contains("it is a file"), "{error}");
    let error = open(&file.path().join("nowhere"), &ReadOptions::default()).expect_err("nothing");
    assert!(error.to_string().contains("there is no such folder"), "{error}");
}

#[test]
fn the_report_serializes_with_its_counts() {
    let folder = clean();
    folder.append("Robot1_Measurement.dat", "1248444190 34 1.0 0.0\n");
    let report = read_with(&folder, ReadOptions::default()).1;
    let text = toml::to_string(&report).expect("serializable");
    let table: toml::Table = text.parse().expect("TOML");
    assert_eq!(table["form"].as_str(), Some("mrclam"));
    let files = table["files"].as_array().expect("files");
    let file =
        files.iter().find(|file| file["file"].as_str() == Some("Robot1_Measurement.dat")).expect("read");
    assert_eq!((file["rows"].as_integer(), file["kept"].as_integer()), (Some(3), Some(2)));
    assert_eq!(file["unknown_barcodes"]["34"].as_integer(), Some(1));
}

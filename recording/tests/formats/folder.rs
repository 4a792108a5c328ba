//! Recording folders: clean ones, and ones with planted damage.

use crate::common::{Folder, read_with, refusal};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{Form, ReadOptions};

const STRICT: ReadOptions = ReadOptions { skip_bad_rows: false };
const SKIP: ReadOptions = ReadOptions { skip_bad_rows: true };

/// Two robots in the spelling of the sample recordings.
fn clean() -> Folder {
    let folder = Folder::new(&[
        ("landmarks.csv", "id,x,y\nL01,-6.000,-0.299\nL07,2.5,1.841\n"),
        ("r1/command.csv", "t,v_cmd,w_cmd\n0.9960,0.2715,0.0000\n1.0360,0.2715,0.1000\n"),
        ("r1/gps.csv", "t,x,y\n1.1116,2.7487,2.0548\n"),
        ("r1/heading.csv", "t,heading\n0.9876,-1.93356\n"),
    ]);
    for robot in ["r1", "r2"] {
        let other = if robot == "r1" { "r2" } else { "r1" };
        folder.write(
            &format!("{robot}/wheel_odometry.csv"),
            "t,left_angle_rad,right_angle_rad\n0.9836,2.22734,2.22120\n1.0036,2.28870,2.27643\n",
        );
        folder.write(&format!("{robot}/gyro.csv"), "t,yaw_rate\n0.9960,-0.00745\n");
        folder.write(
            &format!("{robot}/relative.csv"),
            &format!(
                "t,target_kind,target_id,range,bearing\n1.0135,landmark,L07,3.7394,-0.53626\n\
                 1.0135,robot,{other},1.8650,0.42879\n"
            ),
        );
        folder.write(&format!("{robot}/truth.csv"), "t,x,y,heading\n0.0066,2.8715,2.2248,-1.9209\n");
    }
    folder
}

fn sample(nanos: i64, reading: Reading) -> Sample {
    Sample { time: Timestamp(nanos), reading }
}

#[test]
fn a_clean_folder_becomes_its_recording_with_nothing_counted() {
    let (recording, report) = read_with(&clean(), STRICT);
    assert_eq!(report.form, Form::Folder);
    assert!(report.is_clean(), "{report}");
    assert_eq!(recording.name, "fixture");
    assert_eq!(recording.landmarks, [(LandmarkId(1), [-6.0, -0.299]), (LandmarkId(7), [2.5, 1.841])].into());
    assert_eq!(recording.nominal, None);
    let robot = &recording.robots[&RobotId(1)];
    assert_eq!((robot.commands.len(), robot.commands[1].yaw_rate_rad_s), (2, 0.1));
    let wheels = Reading::Wheels { left_rad: 2.22734, right_rad: 2.2212 };
    assert_eq!(robot.odometry[0], sample(983_600_000, wheels));
    assert_eq!(robot.gyro, [sample(996_000_000, Reading::Gyro { yaw_rate_rad_s: -0.00745 })]);
    assert_eq!(robot.gps, [sample(1_111_600_000, Reading::Gps { x_m: 2.7487, y_m: 2.0548 })]);
    assert_eq!(robot.heading, [sample(987_600_000, Reading::Heading { heading_rad: -1.93356 })]);
    let relative = Relative::RangeBearing { range_m: 1.865, bearing_rad: 0.42879 };
    let seen = Reading::Sighting { target: Target::Robot(RobotId(2)), relative };
    assert_eq!(robot.sightings[1], sample(1_013_500_000, seen));
    assert_eq!(robot.truth[0].pose, Pose2::new(2.8715, 2.2248, -1.9209));
    assert!(recording.robots[&RobotId(2)].gps.is_empty());
}

#[test]
fn columns_are_found_by_their_header_line_ends_and_spaces_do_not_matter() {
    let folder = clean();
    folder.write("r1/gps.csv", "\u{feff}# by hand\r\ny, x ,t\r\n2.0548, 2.7487,1.1116\r\n\r\n");
    let (recording, report) = read_with(&folder, STRICT);
    assert!(report.is_clean(), "{report}");
    assert_eq!(recording, read_with(&clean(), STRICT).0);
}

#[test]
fn every_kind_of_sighting_is_read_as_its_header_says() {
    let seen = |header: &str, cells: &str| {
        let folder = clean();
        folder.write("r1/relative.csv", &format!("t,target_kind,target_id,{header}\n1,robot,2,{cells}\n"));
        match read_with(&folder, STRICT).0.robots[&RobotId(1)].sightings[0].reading {
            Reading::Sighting { target: Target::Robot(RobotId(2)), relative } => relative,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(seen("range", "1.5"), Relative::Range { range_m: 1.5 });
    assert_eq!(seen("bearing", "-1.5"), Relative::Bearing { bearing_rad: -1.5 });
    assert_eq!(seen("x,y", "1.5,2.5"), Relative::Position { x_m: 1.5, y_m: 2.5 });
    assert_eq!(seen("yaw,y,x", "0.5,2.5,1.5"), Relative::Pose(Pose2::new(1.5, 2.5, 0.5)));
    let mixed = "relative_kind,range,bearing,x,y,yaw";
    assert_eq!(seen(mixed, "range,1.5,,,,"), Relative::Range { range_m: 1.5 });
    assert_eq!(seen(mixed, "position,,,1.5,2.5,"), Relative::Position { x_m: 1.5, y_m: 2.5 });
}

#[test]
fn an_empty_cell_never_turns_one_kind_of_sighting_into_another() {
    for (header, cells, expected) in [
        ("range,bearing", "1.5,", "a finite number in column `bearing`, not ``"),
        ("x,y,yaw", "1.5,2.5,", "a finite number in column `yaw`, not ``"),
        ("relative_kind,range,bearing", "range,1.5,0.5", "only the cells of a sighting of kind `range`"),
        ("relative_kind,range,bearing", "range_bearing,1.5,", "a finite number in column `bearing`"),
        ("relative_kind,range,bearing", "sonar,1.5,", "one of range_bearing, range, bearing, position, pose"),
    ] {
        let folder = clean();
        folder.write("r1/relative.csv", &format!("t,target_kind,target_id,{header}\n1,robot,2,{cells}\n"));
        let error = refusal(&folder, STRICT);
        assert!(error.contains("relative.csv:2") && error.contains(expected), "{error}");
    }
    let folder = clean();
    folder.write("r1/relative.csv", "t,target_kind,target_id,range,yaw\n1,robot,2,1,0\n");
    assert!(refusal(&folder, STRICT).contains("relative.csv:1: found header"));
}

#[test]
fn targets_are_named_with_or_without_their_letter() {
    let folder = clean();
    let rows = "t,target_kind,target_id,range,bearing\n1,landmark,L7,1,0\n2,landmark,07,1,0\n3,robot,r2,1,0\n4,robot,2,1,0\n";
    folder.write("r1/relative.csv", rows);
    let (recording, report) = read_with(&folder, STRICT);
    assert!(report.is_clean(), "{report}");
    let targets: Vec<Target> = recording.robots[&RobotId(1)]
        .sightings
        .iter()
        .map(|sample| match sample.reading {
            Reading::Sighting { target, .. } => target,
            other => panic!("{other:?}"),
        })
        .collect();
    let (landmark, robot) = (Target::Landmark(LandmarkId(7)), Target::Robot(RobotId(2)));
    assert_eq!(targets, [landmark, landmark, robot, robot]);
}

#[test]
fn a_damaged_row_is_an_error_with_file_line_text_and_expectation() {
    for (file, row, expected) in [
        ("r1/gyro.csv", "1.0160", "2 cells (t, yaw_rate), not 1"),
        ("r1/gyro.csv", "1.0160,0.1,0.2", "2 cells (t, yaw_rate), not 3"),
        ("r1/gyro.csv", "1.0160,NaN", "a finite number in column `yaw_rate`, not `NaN`"),
        ("r1/truth.csv", "1.0160,1,2,", "a finite number in column `heading`, not ``"),
        ("r2/relative.csv", "2,robot,r2,1,0", "another target than robot 2 itself"),
        ("r2/relative.csv", "2,tree,r2,1,0", "`robot` or `landmark` in column `target_kind`, not `tree`"),
        ("r2/relative.csv", "2,landmark,door,1,0", "in column `target_id`, not `door`"),
        ("r2/relative.csv", "2,landmark,L07,-1,0", "a distance that is not negative"),
        ("landmarks.csv", "L03,1", "3 cells (id, x, y), not 2"),
    ] {
        let folder = clean();
        folder.append(file, &format!("{row}\n"));
        let error = refusal(&folder, STRICT);
        assert!(error.contains(file) && error.contains(&format!("found `{row}`")), "{error}");
        assert!(error.contains(expected), "{error}");
        let (recording, report) = read_with(&folder, SKIP);
        assert_eq!(report.skipped(), 1, "{row}");
        assert_eq!(recording, read_with(&clean(), STRICT).0, "{row}");
    }
}

#[test]
fn a_header_without_its_columns_is_refused() {
    for (text, expected) in [
        (
            "t,rate\n1,2\n",
            "gyro.csv:1: found header `t,rate`, expected the columns t,yaw_rate; `yaw_rate` is missing",
        ),
        ("1.0,2.0\n", "`t` is missing"),
        ("", "gyro.csv:1: found header ``"),
        ("t,yaw_rate,t\n", "column `t` only once"),
    ] {
        let folder = clean();
        folder.write("r1/gyro.csv", text);
        let error = refusal(&folder, STRICT);
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn what_is_not_read_or_may_be_incomplete_is_a_warning() {
    let folder = clean();
    folder.write("r1/lidar.csv", "t,scan\n");
    folder.write("r1/gps.csv", "t,x,y,quality\n1.1116,2.7487,2.0548,4\n");
    folder.write("r2/gyro.csv", "t,yaw_rate\n0.9960,-0.0074");
    folder.write("r2/heading.csv", "t,heading\n");
    folder.append("r1/relative.csv", "2,landmark,L09,1,0\n2,robot,r8,1,0\n3,robot,r8,1,0\n");
    let report = read_with(&folder, STRICT).1;
    for warning in [
        "r1/lidar.csv: not a channel",
        "r1/gps.csv: columns not read: quality",
        "r2/gyro.csv: the last line has no line end",
        "r2/heading.csv: no rows",
        "1 sightings of landmark 9, which is not in the map",
        "2 sightings of robot 8, of which there is no recording",
    ] {
        assert!(report.warnings.iter().any(|found| found.contains(warning)), "{warning}\n{report}");
    }
    assert_eq!(report.warnings.len(), 6, "{report}");
}

#[test]
fn a_robot_needs_odometry_of_exactly_one_kind() {
    let folder = clean();
    folder.write("r2/velocity.csv", "t,v,w\n1,0.5,0.1\n");
    let error = refusal(&folder, STRICT);
    assert!(error.contains("wheel_odometry.csv and velocity.csv, expected only one"), "{error}");
    folder.remove("r2/wheel_odometry.csv");
    let velocity = Reading::Velocity { forward_m_s: 0.5, yaw_rate_rad_s: 0.1 };
    assert_eq!(read_with(&folder, STRICT).0.robots[&RobotId(2)].odometry, [sample(1_000_000_000, velocity)]);
    folder.remove("r2/velocity.csv");
    let error = refusal(&folder, STRICT);
    assert!(error.contains("wheel_odometry.csv is missing: robot 2 cannot be localized"), "{error}");
    folder.write("r2/increment.csv", "t,dx,dy,dyaw\n1,0.5,0.1,0.2\n");
    let increment = Reading::Increment(Pose2::new(0.5, 0.1, 0.2));
    assert_eq!(read_with(&folder, STRICT).0.robots[&RobotId(2)].odometry, [sample(1_000_000_000, increment)]);
    folder.write("r2/increment.csv", "t,dx,dy,dyaw\n");
    assert!(refusal(&folder, STRICT).contains("increment.csv holds no usable row"));
}

#[test]
fn a_landmark_listed_twice_is_refused_even_when_skipping() {
    let folder = clean();
    folder.append("landmarks.csv", "1,0,0\n");
    let error = refusal(&folder, SKIP);
    assert!(
        error.contains("landmarks.csv:4: found `1,0,0`, but landmark 1 stands in line 2 already"),
        "{error}"
    );
}

#[test]
fn a_folder_copied_in_part_is_noticed_by_its_manifest() {
    let manifest = |robots: &str, rows: &str| {
        let folder = clean();
        let text = format!(
            "format_version = 2\nname = \"yard\"\nrobots = {robots}\n[channels]\nr1 = {{ {rows} }}\n"
        );
        folder.write("recording.toml", &text);
        folder
    };
    let (recording, report) = read_with(&manifest("[1, 2]", "gyro = 1, gps = 1"), STRICT);
    assert!(report.is_clean(), "{report}");
    assert_eq!(recording.name, "yard");
    assert!(
        refusal(&manifest("[1, 2, 3]", ""), STRICT).contains("r3 is missing: recording.toml lists robot 3")
    );
    let error = refusal(&manifest("[1, 2]", "velocity = 9"), STRICT);
    assert!(error.contains("velocity.csv is missing: recording.toml lists it with 9 rows"), "{error}");
    let report = read_with(&manifest("[1]", "gyro = 100"), STRICT).1;
    assert_eq!(report.warnings.len(), 2, "{report}");
    assert!(report.warnings[0].contains("r2: read, though recording.toml does not list it"));
    assert!(report.warnings[1].contains("r1/gyro.csv: 1 rows, but recording.toml lists 100"));
}

#[test]
fn a_manifest_that_is_not_understood_is_an_error_naming_the_key() {
    for (text, expected) in [
        ("", "key `format_version`: found nothing"),
        ("format_version = 99", "key `format_version`: found `99`, expected a version from 1 to 3"),
        ("format_version = 1\nunits = \"feet\"", "key `units`: found `\"feet\"`, expected `\"SI, radians\"`"),
        ("format_version = 1\nname = 7", "key `name`: found `7`"),
        ("format_version = 1\nrobots = [\"r1\"]", "key `robots`"),
        ("format_version = 1\nchannels = { r1 = { sonar = 1 } }", "key `channels`"),
        ("format_version = ", "is not valid TOML"),
    ] {
        let folder = clean();
        folder.write("recording.toml", text);
        let error = refusal(&folder, STRICT);
        assert!(error.contains("recording.toml") && error.contains(expected), "{error}");
    }
    let folder = clean();
    folder.write("recording.toml", "format_version = 1\nweather = \"fog\"\n");
    assert_eq!(
        read_with(&folder, STRICT).1.warnings,
        ["recording.toml: key `weather` is not known and was not read"]
    );
}

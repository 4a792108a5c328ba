//! Foreign csv files become recordings through a mapping.

use std::fs;
use std::path::Path;

use pleiad_estimation::sample::Reading;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_recording::{Form, IngestReport, ReadOptions, Recording, open};

/// A folder of csv files with a mapping.
fn tables(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in files {
        fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

const CSV: &str = r#"
[[csv]]
file = "wheels.csv"
robot = 3
channel = "velocity"
columns = ["stamp_ms", "speed_kmh", "turn_deg_s"]
time_unit = "ms"
scale = [0.5, 0.25]
"#;

fn read_tables(folder: &Path) -> Result<(Recording, IngestReport), String> {
    open(folder, &ReadOptions::default()).map_err(|error| error.to_string())
}

#[test]
fn columns_of_any_csv_become_channels() {
    let folder = tables(&[
        ("mapping.toml", CSV),
        (
            "wheels.csv",
            "turn_deg_s,stamp_ms,temperature,speed_kmh\n4,1700000000123.456789,20,3\n8,1700000001000,20,5\n",
        ),
    ]);
    let (recording, report) = read_tables(folder.path()).expect("read");
    assert_eq!(report.form, Form::Csv);
    let odometry = &recording.robots[&RobotId(3)].odometry;
    assert_eq!(odometry[0].time, Timestamp(1_700_000_000_123_456_789));
    assert_eq!(odometry[0].reading, Reading::Velocity { forward_m_s: 1.5, yaw_rate_rad_s: 1.0 });
    assert_eq!(odometry[1].reading, Reading::Velocity { forward_m_s: 2.5, yaw_rate_rad_s: 2.0 });
    // The file itself can be named as well.
    assert_eq!(read_tables(&folder.path().join("wheels.csv")).expect("read").0.robots, recording.robots);
}

#[test]
fn a_csv_that_does_not_fit_is_refused_with_its_place() {
    let refused = |mapping: &str, table: &str| {
        read_tables(tables(&[("mapping.toml", mapping), ("wheels.csv", table)]).path()).expect_err("refused")
    };
    let header = "stamp_ms,speed_kmh,turn_deg_s\n";
    let error = refused(CSV, &format!("{header}1,2,3\n1,2,x\n"));
    assert!(
        error.contains("wheels.csv:3: found `1,2,x`, expected a finite number in column `turn_deg_s`"),
        "{error}"
    );
    let error = refused(CSV, &format!("{header}1e3,2,3\n"));
    assert!(error.contains("expected a time in column `stamp_ms`, not `1e3`"), "{error}");
    let error = refused(CSV, "stamp_ms,speed\n");
    assert!(error.contains("`speed_kmh` is missing"), "{error}");
    let error = refused(&CSV.replace("wheels.csv", "wheel.csv"), header);
    assert!(error.contains("wheel.csv is missing") && error.contains("csv[1] (wheel.csv)"), "{error}");
    let error = refused(&CSV.replace(", \"turn_deg_s\"", ""), header);
    assert!(error.contains("found 2 names, expected those of the columns with t, v, w"), "{error}");
    let error = refused(&CSV.replace("velocity", "relative"), header);
    assert!(error.contains("write them as r1/relative.csv"), "{error}");
}

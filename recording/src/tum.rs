//! Trajectories in TUM format: lines `t x y z qx qy qz qw`, as `evo` and most evaluation tools read them.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::{Pose2, Timestamp};

use crate::error::RecordingError;
use crate::folder::write_whole;
use crate::number::{push_number, push_time, time_text};
use crate::table::{Row, Table};

const COLUMNS: [&str; 8] = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"];

/// How far the norm of a quaternion may be from 1: what six decimals leave open, with room.
const NORM_TOLERANCE: f64 = 1e-3;

/// Writes a trajectory: stamps with nine decimals, numbers by their shortest exact digits, so that equal
/// poses give equal files.
///
/// # Errors
/// A pose is not finite; the file system refuses.
pub fn write(path: &Path, trajectory: &[(Timestamp, Pose2)]) -> Result<(), RecordingError> {
    let mut text = String::with_capacity(trajectory.len() * 100);
    for (time, pose) in trajectory {
        if !pose.is_finite() {
            let reason = format!("the pose at {} s is not finite", time_text(*time));
            return Err(RecordingError::Unwritable { reason });
        }
        // Sine and cosine come from the pose, whose functions give the same bits on every machine.
        let half_turn = Pose2::new(0.0, 0.0, 0.5 * pose.yaw_rad()).rotate(Vector2::new(1.0, 0.0));
        push_time(&mut text, *time);
        for value in [pose.x_m(), pose.y_m(), 0.0, 0.0, 0.0, half_turn.y, half_turn.x] {
            text.push(' ');
            push_number(&mut text, value);
        }
        text.push('\n');
    }
    write_whole(path, &text)
}

/// Reads a trajectory; of a spatial pose the horizontal position and the yaw are kept.
///
/// # Errors
/// The file is missing; a line is no pose, its quaternion has no unit norm, or its stamp does not come
/// after the one before.
pub fn read(path: &Path) -> Result<Vec<(Timestamp, Pose2)>, RecordingError> {
    let (root, file) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
    let Some(table) = Table::open_columns(root, &file.to_string_lossy(), &COLUMNS)? else {
        return Err(RecordingError::MissingFile {
            path: path.to_path_buf(),
            needed_for: "a trajectory was to be read from it".to_owned(),
            remedy: "check the path",
        });
    };
    let mut trajectory: Vec<(Timestamp, Pose2)> = Vec::with_capacity(table.expected_rows());
    let mut cells = Vec::new();
    for (line, text) in table.lines() {
        let read =
            table.row(text, &mut cells).and_then(|row| pose(&row)).and_then(|(time, pose)| match trajectory
                .last()
            {
                Some((before, _)) if *before >= time => Err(format!("a stamp after {}", time_text(*before))),
                _ => Ok((time, pose)),
            });
        trajectory.push(read.map_err(|expected| table.bad_row(line, expected, "repair or remove the line"))?);
    }
    Ok(trajectory)
}

fn pose(row: &Row<'_>) -> Result<(Timestamp, Pose2), String> {
    let time = row.time(0)?;
    let (x_m, y_m) = (row.number(1)?, row.number(2)?);
    row.number(3)?;
    let (qx, qy, qz, qw) = (row.number(4)?, row.number(5)?, row.number(6)?, row.number(7)?);
    let norm = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
    if (norm - 1.0).abs() > NORM_TOLERANCE {
        return Err(format!("a quaternion of norm 1 in the last four columns, not of norm {norm}"));
    }
    Ok((time, Pose2::new(x_m, y_m, yaw(qx, qy, qz, qw))))
}

/// The yaw of a rotation; for a level one twice the half angle, which loses no digits.
pub(crate) fn yaw(qx: f64, qy: f64, qz: f64, qw: f64) -> f64 {
    if qx == 0.0 && qy == 0.0 {
        // The same rotation has two quaternions; the one with a half angle within a quarter turn.
        let half = if qw < 0.0 { (-qz).atan2(-qw) } else { qz.atan2(qw) };
        return 2.0 * half.clamp(-FRAC_PI_2, FRAC_PI_2);
    }
    (2.0 * (qw * qz + qx * qy)).atan2(qw * qw + qx * qx - qy * qy - qz * qz)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_quarter_turn_is_written_with_equal_quaternion_parts() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("new/r1.tum");
        let quarter = Pose2::new(1.5, -2.0, PI / 2.0);
        write(&path, &[(Timestamp(1_248_444_175_103_000_001), quarter)]).expect("writable");
        let text = std::fs::read_to_string(&path).expect("written");
        let cells: Vec<&str> = text.trim_end().split(' ').collect();
        assert_eq!(cells[..6], ["1248444175.103000001", "1.5", "-2.0", "0.0", "0.0", "0.0"]);
        for cell in &cells[6..] {
            assert!((cell.parse::<f64>().expect("a number") - 0.5_f64.sqrt()).abs() < 1e-15);
        }
    }

    #[test]
    fn a_trajectory_reads_back_with_exact_positions_and_stamps() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("r1.tum");
        let trajectory: Vec<(Timestamp, Pose2)> = (0..200_u32)
            .map(|i| {
                (
                    Timestamp(i64::from(i) * 7 - 3),
                    Pose2::new(0.1 * f64::from(i), 1.0 / 3.0, 0.05 * f64::from(i)),
                )
            })
            .collect();
        write(&path, &trajectory).expect("writable");
        let read = read(&path).expect("readable");
        assert_eq!(read.len(), trajectory.len());
        for ((time, pose), (written_time, written)) in read.iter().zip(&trajectory) {
            assert_eq!((time, pose.x_m(), pose.y_m()), (written_time, written.x_m(), written.y_m()));
            // Sine, arc tangent and their rounding: a few units in the last place of pi.
            assert!((pose.yaw_rad() - written.yaw_rad()).abs() < 2e-15);
        }
    }

    #[test]
    fn the_yaw_of_a_tilted_pose_is_kept_and_either_sign_of_the_quaternion_reads_the_same() {
        // Yaw 60 degrees after pitch 10 degrees: q = q_yaw q_pitch.
        let (yaw_rad, pitch_rad) = (PI / 3.0, PI / 18.0);
        let ((sz, cz), (sy, cy)) = ((0.5 * yaw_rad).sin_cos(), (0.5 * pitch_rad).sin_cos());
        let (qx, qy, qz, qw) = (-sz * sy, cz * sy, sz * cy, cz * cy);
        assert!((yaw(qx, qy, qz, qw) - yaw_rad).abs() < 1e-15);
        assert!((yaw(-qx, -qy, -qz, -qw) - yaw_rad).abs() < 1e-15);
        assert!((yaw(0.0, 0.0, -sz, -cz) - yaw_rad).abs() < 1e-15);
    }

    #[test]
    fn a_line_that_is_no_pose_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("r1.tum");
        let refused = |text: &str| {
            std::fs::write(&path, text).expect("writable");
            read(&path).expect_err("damaged").to_string()
        };
        let good = "# t x y z qx qy qz qw\n0.0 1 2 0 0 0 0 1\n";
        assert!(refused(&format!("{good}0.1 1 2 0 0 0 1\n")).contains("r1.tum:3: found `0.1 1 2 0 0 0 1`"));
        assert!(refused(&format!("{good}0.1 1 2 0 0 0 0 0.5\n")).contains("norm 0.5"));
        assert!(refused(&format!("{good}0.0 1 2 0 0 0 0 1\n")).contains("a stamp after"));
        assert!(refused(&format!("{good}0.1 1 nan 0 0 0 0 1\n")).contains("a finite number in column `y`"));
    }
}

//! Expected values by hand or in closed form.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::Timestamp;

fn pairs(poses: &[(Pose2, Pose2)]) -> Vec<PosePair> {
    poses
        .iter()
        .enumerate()
        .map(|(index, (estimate, truth))| PosePair {
            time: Timestamp::from_seconds(index as f64),
            estimate: *estimate,
            truth: *truth,
        })
        .collect()
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-12, "{a} instead of {b}");
}

#[test]
fn statistics_of_four_errors_by_hand() {
    // Mean 2, squares 1 + 4 + 0 + 25 = 30, variance 30/4 - 4 = 3.5, median (1 + 2) / 2.
    let statistics = ErrorStatistics::of(&[1.0, 2.0, 0.0, 5.0]).unwrap();
    close(statistics.mean, 2.0);
    close(statistics.median, 1.5);
    close(statistics.std, 3.5_f64.sqrt());
    close(statistics.rmse, 7.5_f64.sqrt());
    close(statistics.sse, 30.0);
    assert_eq!((statistics.count, statistics.min, statistics.max), (4, 0.0, 5.0));
    assert!(ErrorStatistics::of(&[]).is_none());
}

#[test]
fn without_alignment_a_shifted_estimate_is_off_by_the_shift() {
    let poses = [(0.0, 0.0), (1.0, 0.5), (2.0, -1.0)]
        .map(|(x, y)| (Pose2::new(x + 3.0, y - 4.0, 0.0), Pose2::new(x, y, 0.0)));
    let error = absolute_trajectory_error(&pairs(&poses), Alignment::None).unwrap();
    close(error.rmse, 5.0);
    close(error.max, 5.0);
}

#[test]
fn a_rigidly_moved_estimate_has_no_error_after_alignment() {
    let by = Pose2::new(-7.0, 2.0, 2.5);
    let truth = [(0.0, 0.0), (4.0, 1.0), (3.0, 5.0), (-2.0, 2.0)].map(|(x, y)| Pose2::new(x, y, 0.1 * x));
    let moved = pairs(&truth.map(|pose| (by.compose(&pose), pose)));
    assert!(absolute_trajectory_error(&moved, Alignment::None).unwrap().rmse > 1.0);
    assert!(absolute_trajectory_error(&moved, Alignment::Se2).unwrap().rmse < 1e-12);
    assert!(alignment_se2(&moved).unwrap().compose(&by).log().norm() < 1e-12);
}

#[test]
fn alignment_of_a_stretched_square_leaves_the_stretch() {
    // Corners at (+-1, +-1) estimated at (+-(1+d), +-1), then turned by a quarter and moved: the best fit
    // undoes turn and motion, and leaves d at each corner.
    let by = Pose2::new(5.0, -3.0, FRAC_PI_2);
    let poses = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
        .map(|(x, y)| (by.compose(&Pose2::new(1.25 * x, y, 0.0)), Pose2::new(x, y, 0.0)));
    let error = absolute_trajectory_error(&pairs(&poses), Alignment::Se2).unwrap();
    close(error.rmse, 0.25);
    close(error.std, 0.0);
}

#[test]
fn relative_error_of_a_constant_drift_is_the_drift_per_step() {
    // Truth goes 1 m a frame; the estimate 1.1 m a frame and turns 0.02 rad after each step.
    let step = Pose2::new(1.1, 0.0, 0.02);
    let mut estimate = Pose2::new(3.0, 1.0, 0.7);
    let mut poses = Vec::new();
    for frame in 0..6 {
        poses.push((estimate, Pose2::new(f64::from(frame), 0.0, 0.0)));
        estimate = estimate.compose(&step);
    }
    let poses = pairs(&poses);
    let one = relative_pose_error(&poses, 1, false).unwrap();
    assert_eq!(one.translation_m.count, 5);
    close(one.translation_m.rmse, 0.1);
    close(one.rotation_rad.mean, 0.02);
    // Over two frames: (1.1 + 1.1 cos 0.02 - 2, 1.1 sin 0.02).
    let (x, y) = (1.1 + 1.1 * 0.02_f64.cos() - 2.0, 1.1 * 0.02_f64.sin());
    let two = relative_pose_error(&poses, 2, false).unwrap();
    assert_eq!(two.translation_m.count, 2);
    close(two.translation_m.rmse, x.hypot(y));
    close(two.rotation_rad.max, 0.04);
    assert_eq!(relative_pose_error(&poses, 2, true).unwrap().translation_m.count, 4);
    assert!(relative_pose_error(&poses, 6, true).is_none());
    assert!(relative_pose_error(&poses, 0, true).is_none());
}

#[test]
fn relative_error_does_not_see_a_rigid_motion_of_the_whole() {
    let by = Pose2::new(-7.0, 2.0, 2.5);
    let truth = [(0.0, 0.0), (4.0, 1.0), (3.0, 5.0), (-2.0, 2.0)].map(|(x, y)| Pose2::new(x, y, 0.1 * x));
    let error = relative_pose_error(&pairs(&truth.map(|pose| (by.compose(&pose), pose))), 1, false).unwrap();
    assert!(error.translation_m.max < 1e-12 && error.rotation_rad.max < 1e-12);
}

#[test]
fn heading_errors_are_wrapped() {
    let poses =
        [(PI - 0.1, 0.1 - PI), (0.2, 0.0)].map(|(a, b)| (Pose2::new(0.0, 0.0, a), Pose2::new(0.0, 0.0, b)));
    close(heading_rmse_rad(&pairs(&poses)).unwrap(), 0.2);
}

//! A robot that is carried off.

use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_sim_peers::Scenario;

use crate::run;

fn text(kidnap: &str) -> String {
    format!(
        "name = \"kidnap\"\nduration_s = 40.0\nteam_size = 1\n[defaults]\n{kidnap}\n\
         [defaults.motion]\npolicy = \"circle\"\n"
    )
}

#[test]
fn a_robot_that_is_carried_off_goes_on_from_there_and_its_odometry_does_not_notice() {
    let left_alone = run(&text(""), 3);
    let carried = run(&text("kidnap = [{ time_s = 20.0, x_m = 5.0, y_m = -4.0, heading_rad = 2.5 }]"), 3);
    let (own, other) = (&left_alone.recording.robots[&RobotId(1)], &carried.recording.robots[&RobotId(1)]);
    assert_eq!(own.odometry, other.odometry);
    assert_eq!(own.commands, other.commands);
    let (before, after) = (&left_alone.tracks[&RobotId(1)], &carried.tracks[&RobotId(1)]);
    let at = |seconds: f64| Timestamp::from_seconds(seconds);
    assert_eq!(before.pose_at(at(19.9)), after.pose_at(at(19.9)));
    // It comes about at the first tick from 20 s on; a circle is driven alike from wherever it begins.
    let tick = own.odometry.iter().map(|sample| sample.time).find(|time| *time >= at(20.0)).unwrap();
    let moved = before.pose_at(tick).between(&before.pose_at(at(39.0)));
    let expected = Pose2::new(5.0, -4.0, 2.5).compose(&moved);
    assert!(expected.between(&after.pose_at(at(39.0))).log().norm() < 1e-9);
}

#[test]
fn a_kidnapping_out_of_the_arena_or_out_of_order_is_refused_with_its_line() {
    let error = |kidnap: &str| Scenario::from_toml(&text(kidnap), "bad.toml").unwrap_err().to_string();
    let outside = error("kidnap = [{ time_s = 20.0, x_m = 50.0, y_m = 0.0, heading_rad = 0.0 }]");
    assert!(outside.contains("kidnap.x_m") && outside.contains("50") && outside.contains("-10"), "{outside}");
    let late = "{ time_s = 20.0, x_m = 1.0, y_m = 0.0, heading_rad = 0.0 }";
    let twice = error(&format!("kidnap = [{late}, {late}]"));
    assert!(twice.contains("kidnap.time_s") && twice.contains("after 20"), "{twice}");
}

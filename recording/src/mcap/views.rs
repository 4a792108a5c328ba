//! Poses, transforms and logs as viewers want them.

use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_ros::messages::builtin_interfaces::Time;
use pleiad_ros::messages::geometry_msgs::{Point, Pose, PoseWithCovariance, Quaternion, TwistWithCovariance};
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::std_msgs::Header;
use serde::Serialize;

use super::messages::parts;
use super::write::{Estimate, LogLine};

/// The frame that everything is in.
pub(super) const MAP: &str = "map";

/// `time` and `duration`.
#[derive(Serialize)]
pub(super) struct Instant {
    sec: i64,
    nsec: i64,
}

/// `foxglove.Vector3` and `foxglove.Point3`.
#[derive(Serialize)]
pub(super) struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

/// `foxglove.Quaternion`.
#[derive(Serialize)]
struct Rotation {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// `foxglove.Pose`.
#[derive(Serialize)]
pub(super) struct PoseView {
    position: Vector,
    orientation: Rotation,
}

/// `foxglove.PoseInFrame`.
#[derive(Serialize)]
pub(super) struct PoseInFrame {
    timestamp: Instant,
    frame_id: &'static str,
    pose: PoseView,
}

/// `foxglove.FrameTransform`.
#[derive(Serialize)]
pub(super) struct FrameTransform<'a> {
    timestamp: Instant,
    parent_frame_id: &'static str,
    child_frame_id: &'a str,
    translation: Vector,
    rotation: Rotation,
}

/// `foxglove.Log`.
#[derive(Serialize)]
pub(super) struct Log<'a> {
    timestamp: Instant,
    level: u8,
    message: &'a str,
    name: &'a str,
    file: &'static str,
    line: u32,
}

pub(super) fn instant(time: Timestamp) -> Instant {
    let (sec, nsec) = parts(time);
    Instant { sec, nsec }
}

/// A point of the plane.
pub(super) fn level([x, y]: [f64; 2]) -> Vector {
    Vector { x, y, z: 0.0 }
}

/// The quaternion of a turn about the vertical: its last two numbers.
fn half_turn(pose: &Pose2) -> Vector2 {
    Pose2::new(0.0, 0.0, 0.5 * pose.yaw_rad()).rotate(Vector2::new(1.0, 0.0))
}

fn rotation(pose: &Pose2) -> Rotation {
    let half = half_turn(pose);
    Rotation { x: 0.0, y: 0.0, z: half.y, w: half.x }
}

pub(super) fn pose(pose: &Pose2) -> PoseView {
    PoseView { position: level([pose.x_m(), pose.y_m()]), orientation: rotation(pose) }
}

pub(super) fn pose_in_frame(time: Timestamp, of: &Pose2) -> PoseInFrame {
    PoseInFrame { timestamp: instant(time), frame_id: MAP, pose: pose(of) }
}

pub(super) fn frame_transform<'a>(time: Timestamp, child: &'a str, of: &Pose2) -> FrameTransform<'a> {
    FrameTransform {
        timestamp: instant(time),
        parent_frame_id: MAP,
        child_frame_id: child,
        translation: level([of.x_m(), of.y_m()]),
        rotation: rotation(of),
    }
}

pub(super) fn log(line: &LogLine) -> Log<'_> {
    Log {
        timestamp: instant(line.time),
        level: line.level as u8,
        message: &line.message,
        name: &line.name,
        file: "",
        line: 0,
    }
}

/// Says of a covariance of ROS that nobody knows it.
const UNKNOWN: f64 = -1.0;

/// An estimate as ROS wants it; `None` for instants that a stamp of ROS cannot tell. The velocity is not estimated.
pub(super) fn odometry(estimate: &Estimate, child: &str) -> Option<Odometry> {
    let half = half_turn(&estimate.pose);
    let pose = Pose {
        position: Point { x: estimate.pose.x_m(), y: estimate.pose.y_m(), z: 0.0 },
        orientation: Quaternion { x: 0.0, y: 0.0, z: half.y, w: half.x },
    };
    let mut twist = TwistWithCovariance::default();
    twist.covariance[0] = UNKNOWN;
    Some(Odometry {
        header: Header { stamp: Time::from_nanos(estimate.time.0)?, frame_id: MAP.to_owned() },
        child_frame_id: child.to_owned(),
        pose: PoseWithCovariance { pose, covariance: spatial_covariance(&estimate.covariance) },
        twist,
    })
}

/// A covariance over (x, y, yaw) among (x, y, z, roll, pitch, yaw), by rows; what does not move is certain.
fn spatial_covariance(covariance: &Symmetric3) -> [f64; 36] {
    const PLACE: [usize; 3] = [0, 1, 5];
    let [xx, yx, yy, tx, ty, tt] = covariance.0;
    let planar = [[xx, yx, tx], [yx, yy, ty], [tx, ty, tt]];
    let mut all = [0.0; 36];
    for (row, values) in planar.iter().enumerate() {
        for (column, value) in values.iter().enumerate() {
            all[6 * PLACE[row] + PLACE[column]] = *value;
        }
    }
    all
}

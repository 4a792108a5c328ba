//! `geometry_msgs`. Metres, radians, seconds; x forward, y left, z up; covariances by rows over (x, y, z, rotations
//! about x, y and z).

use super::message;
use super::std_msgs::Header;

message! {
    /// A point.
    #[derive(Copy)]
    Point = "geometry_msgs/msg/Point" {
        /// Metres.
        x: f64,
        /// Metres.
        y: f64,
        /// Metres.
        z: f64,
    }
}

message! {
    /// A vector without a place.
    #[derive(Copy)]
    Vector3 = "geometry_msgs/msg/Vector3" {
        /// In the unit of whoever holds it.
        x: f64,
        /// Likewise.
        y: f64,
        /// Likewise.
        z: f64,
    }
}

message! {
    /// A rotation; no rotation unless said otherwise.
    #[derive(Copy)]
    Quaternion = "geometry_msgs/msg/Quaternion" {
        /// First part of the axis, times the sine of half the angle.
        x: f64 = 0.0 as "0",
        /// Second part.
        y: f64 = 0.0 as "0",
        /// Third part.
        z: f64 = 0.0 as "0",
        /// Cosine of half the angle.
        w: f64 = 1.0 as "1",
    }
}

message! {
    /// A position and a rotation.
    #[derive(Copy)]
    Pose = "geometry_msgs/msg/Pose" {
        /// Where.
        position: Point,
        /// Turned how.
        orientation: Quaternion,
    }
}

message! {
    /// A pose in a frame at an instant.
    PoseStamped = "geometry_msgs/msg/PoseStamped" {
        /// When, and in which frame.
        header: Header,
        /// The pose.
        pose: Pose,
    }
}

message! {
    /// A pose and how uncertain it is.
    #[derive(Copy)]
    PoseWithCovariance = "geometry_msgs/msg/PoseWithCovariance" {
        /// The pose.
        pose: Pose,
        /// Six by six, by rows.
        covariance: [f64; 36],
    }
}

message! {
    /// An uncertain pose in a frame at an instant.
    PoseWithCovarianceStamped = "geometry_msgs/msg/PoseWithCovarianceStamped" {
        /// When, and in which frame.
        header: Header,
        /// The pose.
        pose: PoseWithCovariance,
    }
}

message! {
    /// A velocity.
    #[derive(Copy)]
    Twist = "geometry_msgs/msg/Twist" {
        /// Metres per second.
        linear: Vector3,
        /// Radians per second.
        angular: Vector3,
    }
}

message! {
    /// A velocity in a frame at an instant.
    TwistStamped = "geometry_msgs/msg/TwistStamped" {
        /// When, and in which frame.
        header: Header,
        /// The velocity.
        twist: Twist,
    }
}

message! {
    /// A velocity and how uncertain it is.
    #[derive(Copy)]
    TwistWithCovariance = "geometry_msgs/msg/TwistWithCovariance" {
        /// The velocity.
        twist: Twist,
        /// Six by six, by rows.
        covariance: [f64; 36],
    }
}

message! {
    /// An uncertain velocity in a frame at an instant.
    TwistWithCovarianceStamped = "geometry_msgs/msg/TwistWithCovarianceStamped" {
        /// When, and in which frame.
        header: Header,
        /// The velocity.
        twist: TwistWithCovariance,
    }
}

message! {
    /// Where one frame is in another.
    #[derive(Copy)]
    Transform = "geometry_msgs/msg/Transform" {
        /// Metres.
        translation: Vector3,
        /// Turned how.
        rotation: Quaternion,
    }
}

message! {
    /// Where the frame `child_frame_id` is in the frame of the header, at an instant.
    TransformStamped = "geometry_msgs/msg/TransformStamped" {
        /// When, and in which frame.
        header: Header,
        /// The frame that is placed.
        child_frame_id: String,
        /// Where it is.
        transform: Transform,
    }
}

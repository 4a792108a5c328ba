//! `sensor_msgs`.

use super::geometry_msgs::{Quaternion, Vector3};
use super::message;
use super::std_msgs::Header;

message! {
    /// An inertial measurement unit. A covariance whose first number is -1 says that its quantity was not measured.
    Imu = "sensor_msgs/msg/Imu" {
        /// When, and in which frame.
        header: Header,
        /// Turned how.
        orientation: Quaternion,
        /// Three by three, by rows, about x, y and z.
        orientation_covariance: [f64; 9],
        /// Radians per second.
        angular_velocity: Vector3,
        /// Three by three, by rows.
        angular_velocity_covariance: [f64; 9],
        /// Metres per second squared.
        linear_acceleration: Vector3,
        /// Three by three, by rows.
        linear_acceleration_covariance: [f64; 9],
    }
}

message! {
    /// How a satellite receiver came to its fix.
    #[derive(Copy)]
    NavSatStatus = "sensor_msgs/msg/NavSatStatus" {
        [
            STATUS_UNKNOWN: i8 = -2;
            STATUS_NO_FIX: i8 = -1;
            STATUS_FIX: i8 = 0;
            STATUS_SBAS_FIX: i8 = 1;
            STATUS_GBAS_FIX: i8 = 2;
            SERVICE_UNKNOWN: u16 = 0;
            SERVICE_GPS: u16 = 1;
            SERVICE_GLONASS: u16 = 2;
            SERVICE_COMPASS: u16 = 4;
            SERVICE_GALILEO: u16 = 8;
        ]
        /// One of the constants `STATUS_...`; below `STATUS_FIX` there is no fix.
        status: i8,
        /// A sum of constants `SERVICE_...`.
        service: u16,
    }
}

message! {
    /// A fix of a satellite receiver on the WGS 84 ellipsoid.
    NavSatFix = "sensor_msgs/msg/NavSatFix" {
        [
            COVARIANCE_TYPE_UNKNOWN: u8 = 0;
            COVARIANCE_TYPE_APPROXIMATED: u8 = 1;
            COVARIANCE_TYPE_DIAGONAL_KNOWN: u8 = 2;
            COVARIANCE_TYPE_KNOWN: u8 = 3;
        ]
        /// When, and the antenna's frame.
        header: Header,
        /// Whether there is a fix.
        status: NavSatStatus,
        /// Degrees, north positive.
        latitude: f64,
        /// Degrees, east positive.
        longitude: f64,
        /// Metres above the ellipsoid; NaN if unknown.
        altitude: f64,
        /// Square metres over east, north and up, by rows.
        position_covariance: [f64; 9],
        /// One of the constants `COVARIANCE_TYPE_...`.
        position_covariance_type: u8,
    }
}

message! {
    /// States of joints, by name. What is not measured is left empty.
    JointState = "sensor_msgs/msg/JointState" {
        /// When.
        header: Header,
        /// Names of the joints.
        name: Vec<String>,
        /// Radians or metres, in the order of the names.
        position: Vec<f64>,
        /// Radians or metres per second.
        velocity: Vec<f64>,
        /// Newton metres or newton.
        effort: Vec<f64>,
    }
}

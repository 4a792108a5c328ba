//! The ROS 2 messages that Pleiad exchanges, as bytes and as names: structs, CDR in both directions, message
//! definitions as MCAP stores them, type hashes (RIHS01), and the names and attachments of `rmw_zenoh`.
//!
//! No files, no transport: bytes and text in, bytes and text out.
//!
//! ```
//! use pleiad_ros::{Message, from_cdr, to_cdr};
//! use pleiad_ros::messages::nav_msgs::Odometry;
//!
//! let mut odometry = Odometry::default();
//! odometry.header.frame_id = "odom".into();
//! odometry.twist.twist.linear.x = 0.5;
//! let bytes = to_cdr(&odometry)?;
//! assert_eq!(bytes[..4], [0, 1, 0, 0]);
//! assert_eq!(from_cdr::<Odometry>(&bytes)?, odometry);
//! assert!(Odometry::description().hash().starts_with("RIHS01_3cc97dc7"));
//! # Ok::<(), pleiad_ros::CdrError>(())
//! ```

mod cdr;
mod description;
mod error;
pub mod messages;
pub mod rmw;
mod values;

pub use cdr::{Reader, Writer, from_cdr, to_cdr};
pub use description::{Constant, Description, Field, Kind, Primitive};
pub use error::{CdrError, Problem};
pub use values::{Message, Value};

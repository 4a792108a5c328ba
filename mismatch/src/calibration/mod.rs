//! Methods that calibrate odometry, as they were published. Each is a function of recordings: nothing is simulated
//! and nothing is read or written here.

pub mod map;
mod reckoned;
pub mod umbmark;

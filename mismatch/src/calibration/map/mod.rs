//! Map-based maximum-likelihood calibration (`hoseinnezhad2003`): odometry errors per metre driven, from range scans
//! against a map.
//!
//! Over a path of length `l` the robot truly moves by `D_trans = d_trans + a_trans l` along its odometry and turns by
//! `D_rot = d_rot + a_rot l` besides noise. After every stretch the occupancy grid seen by the sensor is matched with
//! what the map has at the pose that `(a_trans, a_rot)` predict; the best pair moves the estimate by
//! `a <- gamma a + (1 - gamma) a*`.

mod calibrate;
mod error;
mod grid;
mod matched;
mod scan;

pub use calibrate::{Drift, MapCalibration, MapOptions, Stretch, calibrate};
pub use error::MapError;
pub use grid::{Grid, cells_on, match_score};
pub use scan::{LocalCell, local_grid};

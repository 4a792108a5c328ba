//! The figures of localization: maps, sigmas, errors, innovations, comparisons.

mod bars;
pub(crate) mod diagnose;
mod error;
mod map;
mod nis;
mod sigma;

pub use bars::bar_figure;
pub use error::{error_figures, share_within_three_sigma};
pub use map::{Extent, map_figure};
pub use nis::{nis_figure, share_within_bounds};
pub use sigma::{sigma_figure, sigma_patterns};

use pleiad_estimation::RobotId;

/// The name of a robot in legends and headings.
pub(crate) fn robot_name(robot: RobotId) -> String {
    format!("robot {robot}")
}

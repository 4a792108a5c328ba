//! Whether an estimate is as good as it says (NIS, NEES) and how good it is (ATE, RPE, heading).

mod chi_square;
mod nees;
mod nis;
mod trajectory;
mod trajectory_error;
mod whiteness;

pub use chi_square::{chi_square_cdf, chi_square_interval, chi_square_quantile};
pub use nees::{AneesAtTime, NeesSummary, nees};
pub use nis::NisSummary;
pub use trajectory::{PosePair, Truth, associate};
pub use trajectory_error::{
    Alignment, ErrorStatistics, RelativeError, absolute_trajectory_error, alignment_se2, heading_rmse_rad,
    relative_pose_error,
};
pub use whiteness::Whiteness;

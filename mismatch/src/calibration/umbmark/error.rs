//! Why a recording cannot be calibrated on.

use super::run::Turning;

/// A recording that is no run of the procedure, or runs that do not suffice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UmbmarkError {
    /// A recording that is none of the runs.
    #[error("{recording}: {found}; {expected}")]
    NoRun {
        /// The recording and what of it is looked at.
        recording: String,
        /// What was found, with the value.
        found: String,
        /// What was expected, and what to do.
        expected: String,
    },
    /// Squares of one direction alone.
    #[error(
        "all {runs} squares were driven {turning}: in one direction a wrong track hides unequal wheel diameters (a \
         track set wrong by what the wheels bend the sides brings this robot home with both errors still there; the \
         other direction shows them). Drive as many squares {other} from the same start and give both"
    )]
    OneDirection {
        /// How many there are.
        runs: usize,
        /// In which direction.
        turning: Turning,
        /// The one that is missing.
        other: Turning,
    },
    /// No square at all.
    #[error(
        "there is no square among the {runs} recordings: drive squares in both directions, five times each, and give \
         one recording for each"
    )]
    NoSquare {
        /// How many recordings there are.
        runs: usize,
    },
    /// Squares of different sizes.
    #[error(
        "{recording}: its sides are {side_m:.3} m long, those of {other} {other_m:.3} m; squares of one calibration have \
         the same sides: give those of one size"
    )]
    Sides {
        /// A recording.
        recording: String,
        /// Its sides, metres.
        side_m: f64,
        /// Another one.
        other: String,
        /// Its sides, metres.
        other_m: f64,
    },
    /// A result that is no differential drive.
    #[error(
        "the return errors ask for corners short by {alpha_deg:.1} degrees and sides bent by {beta_deg:.1} degrees; the \
         formulas hold for a few degrees: check wheel_radius and track_width in nominal.toml, and which way forward is"
    )]
    TooLarge {
        /// `alpha`, degrees.
        alpha_deg: f64,
        /// `beta`, degrees.
        beta_deg: f64,
    },
}

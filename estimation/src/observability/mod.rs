//! What a set of measurements can tell and what it cannot: rank of the observability matrix, the
//! unobservable directions in words, and which robots' uncertainty is bounded.
//!
//! In the invariant error `Phi = I`, so the observability matrix of a run is the stack of its
//! measurement Jacobians; in the linear textbook case it is `[H; H Phi; H Phi^2; ...]`.

mod analysis;
mod entries;
mod words;

pub use analysis::{Coordinates, DEFAULT_TOLERANCE, MeasurementRow, Observability, RobotBounds, stack};
pub use entries::{of_entries, rows_from};

#[cfg(test)]
mod tests;

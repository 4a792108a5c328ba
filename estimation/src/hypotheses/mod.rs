//! Localization by several hypotheses: a known map whose landmarks look alike, and recognition that errs
//! (Roumeliotis & Bekey 2000, "Bayesian estimation and Kalman filtering: a unified framework for mobile robot
//! localization").
//!
//! Dead reckoning runs once, as the nominal trajectory `N(t)` and its noise sum; every hypothesis is a robot's block
//! of the joint filter on that trajectory, `X_i(t) = G_i N(t)` with covariance `P_i`, and a weight. At a sighting each
//! of N hypotheses is tried with each of M landmarks; the pairs have the weights
//!
//! ```text
//! w_ij  ~  w_i  p(said | kind of j)  N(z; h(X_i, l_j), S_ij)
//! ```
//!
//! Pairs of little weight are dropped, close ones merged, and of the rest the heaviest kept, so that their number is
//! bounded. Beside the hypotheses stands a *reserve*: the probability that the robot is anywhere in the map with any
//! heading. All weight is there at a uniform start; a robot that may be carried off gives some of it back with time.
//! A sighting turns the reserve into poses all around each landmark, with the weight of a uniform density, which is
//! next to nothing as long as any hypothesis explains what is seen.
//!
//! Sightings of one scan are taken as independent: that no landmark is seen twice in a scan, and that others were
//! *not* seen, is not used.

mod birth;
mod map;
mod mixture;
mod reduction;

pub use map::{KindOfLandmark, KindedMap, MappedLandmark};
pub use mixture::{Belief, HypothesisError, Localizer, Settings, Sighting, Standing};

#[cfg(test)]
mod tests;

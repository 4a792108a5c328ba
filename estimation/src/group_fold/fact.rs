//! Facts: all that the fold knows, complete and immutable.

use super::{Measured, NominalState, Space, Symmetric};
use crate::geometry::LieGroup;
use crate::{BootIndex, LandmarkId, RobotId};

/// Covariance of a measurement of 1 to `D` degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise<const D: usize> {
    /// Degrees of freedom.
    pub dimension: usize,
    /// The covariance; what is beyond the dimension is not used.
    pub covariance: Symmetric<D>,
}

impl<const D: usize> Noise<D> {
    /// Independent components from their standard deviations (1 to `D` of them; more are ignored).
    pub fn from_sigmas(sigmas: &[f64]) -> Self {
        let mut all = [0.0; D];
        for (slot, sigma) in all.iter_mut().zip(sigmas) {
            *slot = *sigma;
        }
        Self { dimension: sigmas.len().min(D), covariance: Symmetric::from_sigmas(all) }
    }
}

/// What carries a robot's block over from one boot to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Continuation<G, const D: usize> {
    /// The boot carried on from.
    pub previous: BootIndex,
    /// Its last nominal state.
    pub last: NominalState<G, D>,
    /// Variance of the unseen motion in the gap, body frame.
    pub gap: Symmetric<D>,
}

/// What was observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity<G: Space<D>, const D: usize> {
    /// Another robot.
    Robot {
        /// Who was seen.
        robot: RobotId,
        /// Where, in the observer's body frame.
        relative: G::Relative,
    },
    /// A landmark at a known place.
    Landmark {
        /// Which.
        landmark: LandmarkId,
        /// Its place in the map, metres.
        position_m: G::Point,
        /// Where, in the observer's body frame.
        relative: G::Relative,
    },
    /// The observer itself, against the map.
    Absolute(G::Absolute),
}

/// A complete fact. Who says it, in which boot and when is in its key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fact<G: Space<D>, const D: usize> {
    /// A robot's boot begins.
    Boot {
        /// `N` at its start; the noise sum is zero there.
        nominal: G,
        /// The journal was intact, and the previous boot is carried on.
        continuation: Option<Continuation<G, D>>,
    },
    /// A robot observed something.
    Observation {
        /// What.
        quantity: Quantity<G, D>,
        /// How well.
        noise: Noise<D>,
        /// The observer's nominal state.
        observer: NominalState<G, D>,
        /// The state of the robot that was seen, and the boot it belongs to.
        other: Option<(BootIndex, NominalState<G, D>)>,
    },
}

/// What is wrong with a fact that is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unsound {
    /// A number is NaN or infinite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// A covariance is not positive semidefinite.
    #[error("{0} is not positive semidefinite")]
    Indefinite(&'static str),
    /// The noise has another dimension than the measurement.
    #[error("the noise has dimension {noise}, the measurement {measurement}")]
    Dimension {
        /// Of the noise.
        noise: usize,
        /// Of what was measured.
        measurement: usize,
    },
}

impl<G: Space<D>, const D: usize> Quantity<G, D> {
    /// Degrees of freedom of what was measured.
    pub fn dimension(&self) -> usize {
        match self {
            Self::Robot { relative, .. } | Self::Landmark { relative, .. } => relative.dimension(),
            Self::Absolute(absolute) => absolute.dimension(),
        }
    }

    /// What was measured, of what kind, and about whom or where: all that tells it from another quantity.
    fn words(&self) -> Vec<u64> {
        let (mut words, numbers) = match self {
            Self::Robot { robot, relative } => {
                (vec![0, u64::from(robot.0), relative.kind()], relative.numbers().collect())
            }
            Self::Landmark { landmark, position_m, relative } => {
                let numbers: Vec<f64> = G::coordinates(position_m).chain(relative.numbers()).collect();
                (vec![1, u64::from(landmark.0), relative.kind()], numbers)
            }
            Self::Absolute(absolute) => (vec![2, absolute.kind()], absolute.numbers().collect()),
        };
        words.extend(numbers.into_iter().map(f64::to_bits));
        words
    }

    fn is_finite(&self) -> bool {
        match self {
            Self::Robot { relative, .. } => relative.numbers().all(f64::is_finite),
            Self::Landmark { position_m, relative, .. } => {
                G::coordinates(position_m).chain(relative.numbers()).all(f64::is_finite)
            }
            Self::Absolute(absolute) => absolute.numbers().all(f64::is_finite),
        }
    }
}

impl<G: Space<D>, const D: usize> Fact<G, D> {
    /// Whether it may be folded at all.
    ///
    /// # Errors
    /// [`Unsound`], naming what is wrong.
    pub fn check(&self) -> Result<(), Unsound> {
        match self {
            Self::Boot { nominal, continuation } => {
                finite("the nominal pose", nominal.is_finite())?;
                if let Some(Continuation { last, gap, .. }) = continuation {
                    state("the last state of the previous boot", last)?;
                    semidefinite("the noise of the gap", gap)?;
                }
            }
            Self::Observation { quantity, noise, observer, other } => {
                finite("the measurement", quantity.is_finite())?;
                semidefinite("the noise of the measurement", &noise.covariance)?;
                let measurement = quantity.dimension();
                if noise.dimension != measurement {
                    return Err(Unsound::Dimension { noise: noise.dimension, measurement });
                }
                state("the observer's state", observer)?;
                if let Some((_, seen)) = other {
                    state("the state of the robot that was seen", seen)?;
                }
            }
        }
        Ok(())
    }

    /// All its bits: two facts are the same if, and only if, their words are. (By `==` they may be the same and differ in
    /// the sign of a zero.)
    pub fn words(&self) -> Vec<u64> {
        match self {
            Self::Boot { nominal, continuation } => {
                let mut words = vec![0];
                words.extend(nominal.words());
                if let Some(Continuation { previous, last, gap }) = continuation {
                    words.push(u64::from(previous.0));
                    words.extend(state_words(last).chain(gap.packed().map(f64::to_bits)));
                }
                words
            }
            Self::Observation { quantity, noise, observer, other } => {
                let mut words = vec![1, noise.dimension as u64];
                words.extend(quantity.words());
                words.extend(noise.covariance.packed().map(f64::to_bits).chain(state_words(observer)));
                if let Some((boot, state)) = other {
                    words.push(u64::from(boot.0));
                    words.extend(state_words(state));
                }
                words
            }
        }
    }
}

fn state_words<G: LieGroup<D>, const D: usize>(state: &NominalState<G, D>) -> impl Iterator<Item = u64> {
    state.nominal.words().chain(state.noise_sum.packed().map(f64::to_bits))
}

fn finite(what: &'static str, is_finite: bool) -> Result<(), Unsound> {
    if is_finite { Ok(()) } else { Err(Unsound::NotFinite(what)) }
}

fn semidefinite<const D: usize>(what: &'static str, covariance: &Symmetric<D>) -> Result<(), Unsound> {
    finite(what, covariance.is_finite())?;
    if covariance.is_positive_semidefinite() { Ok(()) } else { Err(Unsound::Indefinite(what)) }
}

fn state<G: LieGroup<D>, const D: usize>(
    what: &'static str,
    state: &NominalState<G, D>,
) -> Result<(), Unsound> {
    finite(what, state.nominal.is_finite())?;
    semidefinite(what, &state.noise_sum)
}

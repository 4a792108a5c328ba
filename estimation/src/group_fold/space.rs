//! What the fold needs to know of a group besides its algebra: what is measured in it.

use std::fmt::Debug;

use crate::geometry::{LieGroup, Square, Tangent};

/// A measurement linearized at an estimate. Rows and entries beyond `dimension` are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearization<const D: usize> {
    /// Degrees of freedom of the measurement, at most those of the group.
    pub dimension: usize,
    /// Measured minus predicted.
    pub innovation: Tangent<D>,
    /// Derivative of the prediction with respect to the error `xi` of the robot that was seen; of the observer's own for
    /// absolute kinds. The observer of a relative kind has minus this, exactly.
    pub jacobian: Square<D>,
}

/// Why a measurement has no linearization.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unusable {
    /// The target is predicted so close that the kind of measurement has no derivative.
    TooClose {
        /// Predicted distance, m.
        distance_m: f64,
    },
    /// A full pose was measured of a point, which has no orientation.
    PointHasNoOrientation,
    /// A direction was measured opposite to the predicted one: no shortest way leads there.
    Opposite,
}

/// A measured value.
pub trait Measured: Copy + Debug + PartialEq {
    /// Its degrees of freedom: the size of its noise.
    fn dimension(&self) -> usize;

    /// Which kind of measurement it is: different for any two kinds.
    fn kind(&self) -> u64;

    /// Its numbers, always in the same order.
    fn numbers(&self) -> impl Iterator<Item = f64>;
}

/// A group whose elements are poses of robots that observe each other.
pub trait Space<const D: usize>: LieGroup<D> {
    /// A place, metres.
    type Point: Copy + Debug + PartialEq;
    /// What a robot measures of another one, or of a landmark.
    type Relative: Measured;
    /// What a robot measures of itself against the map.
    type Absolute: Measured;

    /// One robot seen by another. A motion common to both is in the null space at any linearization point, because the
    /// observer's derivative is minus the one returned.
    ///
    /// # Errors
    /// [`Unusable`] if there is no derivative.
    fn of_robot(
        relative: &Self::Relative,
        observer: &Self,
        target: &Self,
    ) -> Result<Linearization<D>, Unusable>;

    /// A point of the map seen by a robot, whose derivative is minus the one returned.
    ///
    /// # Errors
    /// [`Unusable`] if there is no derivative.
    fn of_point(
        relative: &Self::Relative,
        observer: &Self,
        point: &Self::Point,
    ) -> Result<Linearization<D>, Unusable>;

    /// The robot itself against the map.
    fn of_map(absolute: &Self::Absolute, robot: &Self) -> Linearization<D>;

    /// The pose that a measurement gives by itself: what places a robot in the map.
    fn prior(absolute: &Self::Absolute) -> Option<Self>;

    /// The coordinates of a place.
    fn coordinates(point: &Self::Point) -> impl Iterator<Item = f64>;
}

impl<const D: usize> Linearization<D> {
    /// From an innovation and a row of the derivative for each degree of freedom of the measurement.
    pub fn from_rows(rows: &[(f64, Tangent<D>)]) -> Self {
        let mut linearization =
            Self { dimension: rows.len().min(D), innovation: Tangent::zeros(), jacobian: Square::zeros() };
        for (k, (innovation, row)) in rows.iter().take(D).enumerate() {
            linearization.innovation[k] = *innovation;
            for axis in 0..D {
                linearization.jacobian[(k, axis)] = row[axis];
            }
        }
        linearization
    }
}

//! Measurement models in space, in right-invariant coordinates (`docs/notation.md`, SE(3)).
//!
//! Relative kinds have `H_a = -H_b` exactly, so only `H_b` is formed: an error common to both robots is in the null space
//! at any linearization point.

use super::direction::between_directions;
use crate::geometry::{Pose3, Tangent6, Vector3};
use crate::group_fold::{Linearization, Measured, Space, Unusable};

/// A place in the map, metres.
pub type Point3 = Vector3;

/// Below this distance direction and distance have no usable derivative, metres.
const LEAST_DISTANCE_M: f64 = 1e-3;

/// A unit vector. Of a measured one the noise is stated along [`tangent_basis`](super::tangent_basis), radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction(Vector3);

/// The vector has no direction: zero, or not finite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("({0}, {1}, {2}) has no direction")]
pub struct NotADirection(pub f64, pub f64, pub f64);

impl Direction {
    /// The direction of a vector of any length but zero.
    ///
    /// # Errors
    /// [`NotADirection`] of a vector that is zero or not finite.
    pub fn new(v: Vector3) -> Result<Self, NotADirection> {
        // Scaled first, so that the squares neither overflow nor vanish.
        let largest = v.x.abs().max(v.y.abs()).max(v.z.abs());
        if !(largest > 0.0 && largest.is_finite() && v.x.is_finite() && v.y.is_finite() && v.z.is_finite()) {
            return Err(NotADirection(v.x, v.y, v.z));
        }
        let s = Vector3::new(v.x / largest, v.y / largest, v.z / largest);
        let length = (s.x * s.x + s.y * s.y + s.z * s.z).sqrt();
        Ok(Self(Vector3::new(s.x / length, s.y / length, s.z / length)))
    }

    /// The unit vector.
    pub fn vector(&self) -> Vector3 {
        self.0
    }
}

/// What a robot measures of another robot, or of a landmark, in its body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relative3 {
    /// Pose; noise in the frame of the robot seen, `z = Z exp(n)`: 6 degrees of freedom.
    Pose(Pose3),
    /// Position, metres: 3.
    Position(Vector3),
    /// Distance, metres: 1.
    Range(f64),
    /// Direction: 2, radians in the tangent plane of the measured direction.
    Bearing(Direction),
    /// Distance and direction: 3, in this order.
    RangeBearing(f64, Direction),
}

/// What a robot measures of itself against the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Absolute3 {
    /// Pose, with noise in the body frame, `z = X exp(n)`: 6 degrees of freedom. The first one places the robot.
    Pose(Pose3),
    /// Position, metres, with noise in the map frame: 3.
    Position(Vector3),
}

impl Measured for Relative3 {
    fn dimension(&self) -> usize {
        match self {
            Self::Pose(_) => 6,
            Self::Position(_) | Self::RangeBearing(..) => 3,
            Self::Bearing(_) => 2,
            Self::Range(_) => 1,
        }
    }

    fn kind(&self) -> u64 {
        match self {
            Self::Pose(_) => 0,
            Self::Position(_) => 1,
            Self::Range(_) => 2,
            Self::Bearing(_) => 3,
            Self::RangeBearing(..) => 4,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let numbers = match self {
            Self::Pose(pose) => pose.components().to_vec(),
            Self::Position(v) | Self::Bearing(Direction(v)) => vec![v.x, v.y, v.z],
            Self::Range(range_m) => vec![*range_m],
            Self::RangeBearing(range_m, Direction(v)) => vec![*range_m, v.x, v.y, v.z],
        };
        numbers.into_iter()
    }
}

impl Measured for Absolute3 {
    fn dimension(&self) -> usize {
        match self {
            Self::Pose(_) => 6,
            Self::Position(_) => 3,
        }
    }

    fn kind(&self) -> u64 {
        match self {
            Self::Pose(_) => 0,
            Self::Position(_) => 1,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let numbers = match self {
            Self::Pose(pose) => pose.components().to_vec(),
            Self::Position(v) => vec![v.x, v.y, v.z],
        };
        numbers.into_iter()
    }
}

impl Space<6> for Pose3 {
    type Point = Point3;
    type Relative = Relative3;
    type Absolute = Absolute3;

    fn of_robot(relative: &Relative3, observer: &Self, target: &Self) -> Result<Linearization<6>, Unusable> {
        if let Relative3::Pose(measured) = relative {
            // r = log(Zhat^-1 z) with noise in the frame of z: H_b = Ad(X_b^-1).
            return Ok(Linearization {
                dimension: 6,
                innovation: observer.between(target).between(measured).log(),
                jacobian: target.inverse().adjoint(),
            });
        }
        Self::of_point(relative, observer, &target.position())
    }

    fn of_point(relative: &Relative3, observer: &Self, point: &Point3) -> Result<Linearization<6>, Unusable> {
        let apart = Vector3::new(
            point.x - observer.position().x,
            point.y - observer.position().y,
            point.z - observer.position().z,
        );
        let seen = observer.rotate_back(&apart);
        let distance = length(&seen);
        let unit = Vector3::new(seen.x / distance, seen.y / distance, seen.z / distance);
        let d_seen = d_seen_d_target(observer, point);
        let range = |range_m: f64| (range_m - distance, combined(&unit, &d_seen));
        if distance < LEAST_DISTANCE_M && !matches!(relative, Relative3::Position(_)) {
            return Err(Unusable::TooClose { distance_m: distance });
        }
        let bearing = |measured: &Direction| {
            let (predicted, by_unit) = between_directions(&measured.0, &unit).ok_or(Unusable::Opposite)?;
            // d unit / d seen = (I - u u^T) / |seen|: the part along the line of sight is taken off.
            Ok::<_, Unusable>([0, 1].map(|axis| {
                let row = &by_unit[axis];
                let along = row.x * unit.x + row.y * unit.y + row.z * unit.z;
                let across = Vector3::new(
                    (row.x - along * unit.x) / distance,
                    (row.y - along * unit.y) / distance,
                    (row.z - along * unit.z) / distance,
                );
                (-predicted[axis], combined(&across, &d_seen))
            }))
        };
        Ok(Linearization::from_rows(&match relative {
            Relative3::Pose(_) => return Err(Unusable::PointHasNoOrientation),
            Relative3::Position(z) => [0, 1, 2].map(|axis| (z[axis] - seen[axis], d_seen[axis])).to_vec(),
            Relative3::Range(range_m) => vec![range(*range_m)],
            Relative3::Bearing(direction) => bearing(direction)?.to_vec(),
            Relative3::RangeBearing(range_m, direction) => {
                let [a, b] = bearing(direction)?;
                vec![range(*range_m), a, b]
            }
        }))
    }

    fn of_map(absolute: &Absolute3, robot: &Self) -> Linearization<6> {
        match absolute {
            Absolute3::Pose(measured) => Linearization {
                dimension: 6,
                innovation: robot.between(measured).log(),
                jacobian: robot.inverse().adjoint(),
            },
            Absolute3::Position(z) => {
                // p moves by rho + phi x p: H = [I, -[p]].
                let p = robot.position();
                let moved = d_seen_d_target(&Self::identity(), &p);
                Linearization::from_rows(&[0, 1, 2].map(|axis| (z[axis] - p[axis], moved[axis])))
            }
        }
    }

    fn prior(absolute: &Absolute3) -> Option<Self> {
        match absolute {
            Absolute3::Pose(pose) => Some(*pose),
            Absolute3::Position(_) => None,
        }
    }

    fn coordinates(point: &Point3) -> impl Iterator<Item = f64> {
        [point.x, point.y, point.z].into_iter()
    }
}

/// Rows of `R_a^T [I, -[q]]`: how the point `q`, seen from `observer`, moves with the map under it.
fn d_seen_d_target(observer: &Pose3, q: &Vector3) -> [Tangent6; 3] {
    // Columns of -[q] are q moved by a small rotation about each axis: e x q.
    let columns = [
        Vector3::x(),
        Vector3::y(),
        Vector3::z(),
        Vector3::new(0.0, -q.z, q.y),
        Vector3::new(q.z, 0.0, -q.x),
        Vector3::new(-q.y, q.x, 0.0),
    ]
    .map(|column| observer.rotate_back(&column));
    [0, 1, 2].map(|axis| Tangent6::from(columns.map(|column| column[axis])))
}

/// `v^T` times three rows.
fn combined(v: &Vector3, rows: &[Tangent6; 3]) -> Tangent6 {
    let entry = |k: usize| v.x * rows[0][k] + v.y * rows[1][k] + v.z * rows[2][k];
    Tangent6::from(std::array::from_fn::<f64, 6, _>(entry))
}

fn length(v: &Vector3) -> f64 {
    (v.x * v.x + v.y * v.y + v.z * v.z).sqrt()
}

#[cfg(test)]
mod tests;

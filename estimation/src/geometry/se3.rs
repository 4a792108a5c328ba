//! The group SE(3) of rigid motions in space; formulas after Sola, Deray & Atchuthan 2018 (`sola2018micro`) and
//! Barfoot 2017 (`barfoot2017`), equation numbers of the former.
//!
//! Transcendental functions come from the pure-Rust `libm`, and products are written out in a fixed order, so that every
//! processor computes the same bits. A rotation is a unit quaternion: it is normalized with one square root, and both
//! ends of the range of angles, 0 and pi, are well-conditioned.

use super::Pose2;
use super::se2::{Matrix3, Vector3};

/// A tangent vector `(x, y, z, rx, ry, rz)`: metres, radians.
pub type Tangent6 = nalgebra::SVector<f64, 6>;

/// Below this angle `sin(angle/2)/angle` is taken from its series, whose first neglected term is there under 1e-19.
const SMALL_ANGLE_RAD: f64 = 1e-4;
/// Below these angles, quotients whose numerator cancels are taken from their series; remainders below 1e-16.
const SERIES_TO_RAD: f64 = 0.5;
const LOG_SERIES_TO_RAD: f64 = 0.3;

/// `[v]`, the matrix of the cross product: `[v] w = v x w`.
pub fn skew(v: &Vector3) -> Matrix3 {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// A pose in space, read as `map_from_robot`: position in metres and a unit quaternion.
///
/// Of the two quaternions of a rotation the one with `w > 0` is kept (of those with `w = 0`, the one whose first component
/// that is not zero is positive).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose3 {
    position: Vector3,
    w: f64,
    // The vector part of the quaternion.
    v: Vector3,
}

impl Default for Pose3 {
    fn default() -> Self {
        Self::identity()
    }
}

impl Pose3 {
    /// From a position in metres and a quaternion `[w, x, y, z]` of any length but zero, which is normalized.
    pub fn new(position: Vector3, [w, x, y, z]: [f64; 4]) -> Self {
        Self::normalized(position, w, Vector3::new(x, y, z))
    }

    /// From a position in metres and a rotation vector (axis times angle) in radians.
    pub fn from_rotation_vector(position: Vector3, rotation: Vector3) -> Self {
        let (w, v) = quaternion_exp(&rotation);
        Self::normalized(position, w, v)
    }

    /// From [`Pose3::components`], bit for bit; `None` if these are not such: not finite, not of length 1 to 1e-12, or of
    /// the wrong sign.
    pub fn from_components(components: [f64; 7]) -> Option<Self> {
        let [px, py, pz, w, x, y, z] = components;
        let pose = Self { position: Vector3::new(px, py, pz), w, v: Vector3::new(x, y, z) };
        let square = w * w + x * x + y * y + z * z;
        (pose.is_finite() && (square - 1.0).abs() < 1e-12 && !is_negative(w, &pose.v)).then_some(pose)
    }

    /// Position `x, y, z` in metres and the quaternion `w, x, y, z`.
    pub fn components(&self) -> [f64; 7] {
        let (p, v) = (&self.position, &self.v);
        [p.x, p.y, p.z, self.w, v.x, v.y, v.z]
    }

    /// The pose of a planar robot: in the plane `z = 0`, turned about the z axis.
    pub fn from_planar(pose: &Pose2) -> Self {
        let position = Vector3::new(pose.x_m(), pose.y_m(), 0.0);
        Self::from_rotation_vector(position, Vector3::new(0.0, 0.0, pose.yaw_rad()))
    }

    /// The neutral element.
    pub const fn identity() -> Self {
        Self { position: Vector3::new(0.0, 0.0, 0.0), w: 1.0, v: Vector3::new(0.0, 0.0, 0.0) }
    }

    /// One rounding per component and the sign chosen: the same product gives the same bits, and the length does not
    /// drift however many poses are composed.
    fn normalized(position: Vector3, w: f64, v: Vector3) -> Self {
        let length = (w * w + v.x * v.x + v.y * v.y + v.z * v.z).sqrt();
        let length = if is_negative(w, &v) { -length } else { length };
        Self { position, w: w / length, v: Vector3::new(v.x / length, v.y / length, v.z / length) }
    }

    /// Position, metres.
    pub fn position(&self) -> Vector3 {
        self.position
    }

    /// The unit quaternion `[w, x, y, z]`.
    pub fn quaternion(&self) -> [f64; 4] {
        [self.w, self.v.x, self.v.y, self.v.z]
    }

    /// The rotation vector: axis times angle, the angle in `[0, pi]`.
    pub fn rotation_vector(&self) -> Vector3 {
        let sine = norm(&self.v);
        if sine < SMALL_ANGLE_RAD {
            // w > 0.99: angle = 2 asin(sine), of which angle/sine = 2 + sine^2/3 + O(sine^4).
            return scaled(&self.v, 2.0 + sine * sine / 3.0);
        }
        scaled(&self.v, 2.0 * libm::atan2(sine, self.w) / sine)
    }

    /// The rotation matrix.
    pub fn rotation(&self) -> Matrix3 {
        let (w, x, y, z) = (self.w, self.v.x, self.v.y, self.v.z);
        Matrix3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        )
    }

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.components().iter().all(|component| component.is_finite())
    }

    /// The group product: `a_from_b.compose(b_from_c)` is `a_from_c`.
    pub fn compose(&self, other: &Self) -> Self {
        let (a, b) = (&self.v, &other.v);
        let w = self.w * other.w - dot(a, b);
        let cross = cross(a, b);
        let v = Vector3::new(
            self.w * b.x + other.w * a.x + cross.x,
            self.w * b.y + other.w * a.y + cross.y,
            self.w * b.z + other.w * a.z + cross.z,
        );
        Self::normalized(self.act(&other.position), w, v)
    }

    /// The inverse: `map_from_robot` becomes `robot_from_map`.
    pub fn inverse(&self) -> Self {
        let back = scaled(&self.v, -1.0);
        // The sign of w is kept and the length too; only with w = 0 may the sign have to change.
        Self::normalized(rotated(self.w, &back, &scaled(&self.position, -1.0)), self.w, back)
    }

    /// `self^-1 * other`: the other pose seen from this one.
    pub fn between(&self, other: &Self) -> Self {
        let turned = Self { position: Vector3::zeros(), w: self.w, v: scaled(&self.v, -1.0) };
        let mut seen = turned.compose(other);
        seen.position = self.rotate_back(&difference(&other.position, &self.position));
        seen
    }

    /// The point `p` of the robot frame in the map frame.
    pub fn act(&self, p: &Vector3) -> Vector3 {
        sum(&self.rotate(p), &self.position)
    }

    /// `R v`.
    pub fn rotate(&self, v: &Vector3) -> Vector3 {
        rotated(self.w, &self.v, v)
    }

    /// `R^T v`.
    pub fn rotate_back(&self, v: &Vector3) -> Vector3 {
        rotated(self.w, &scaled(&self.v, -1.0), v)
    }

    /// The exponential map (eqs. 172, 174).
    pub fn exp(tangent: &Tangent6) -> Self {
        let (rho, phi) = parts(tangent);
        let angle = norm(&phi);
        let (w, v) = quaternion_exp(&phi);
        // V rho = rho + (1 - cos)/angle^2 phi x rho + (angle - sin)/angle^3 phi x (phi x rho)
        let once = cross(&phi, &rho);
        let twice = cross(&phi, &once);
        let (b, c) = (one_minus_cos_over_square(angle), angle_minus_sin_over_cube(angle));
        let position = sum(&sum(&rho, &scaled(&once, b)), &scaled(&twice, c));
        Self::normalized(position, w, v)
    }

    /// The logarithm (eq. 173), with an angle in `[0, pi]`.
    pub fn log(&self) -> Tangent6 {
        let phi = self.rotation_vector();
        // V^-1 p = p - phi x p / 2 + (1 - (angle/2) cot(angle/2))/angle^2 phi x (phi x p)
        let once = cross(&phi, &self.position);
        let twice = cross(&phi, &once);
        let d = self.log_coefficient(norm(&phi));
        let rho = sum(&sum(&self.position, &scaled(&once, -0.5)), &scaled(&twice, d));
        tangent(&rho, &phi)
    }

    /// `(1 - (angle/2) cot(angle/2))/angle^2`; the cotangent is a quotient of the quaternion, which is exact at pi.
    fn log_coefficient(&self, angle: f64) -> f64 {
        let s = angle * angle;
        if angle < LOG_SERIES_TO_RAD {
            let series = s * (1.0 / 47_900_160.0 + s * (691.0 / 1_307_674_368_000.0));
            1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30_240.0 + s * (1.0 / 1_209_600.0 + series)))
        } else {
            (1.0 - 0.5 * angle * self.w / norm(&self.v)) / s
        }
    }

    /// The adjoint `[R, [p] R; 0, R]` (eq. 175): `X exp(w) X^-1 = exp(Ad_X w)`.
    pub fn adjoint(&self) -> nalgebra::Matrix6<f64> {
        let rotation = self.rotation();
        let mut adjoint = nalgebra::Matrix6::zeros();
        for column in 0..3 {
            let turned = Vector3::new(rotation[(0, column)], rotation[(1, column)], rotation[(2, column)]);
            let lever = cross(&self.position, &turned);
            for row in 0..3 {
                adjoint[(row, column)] = turned[row];
                adjoint[(3 + row, 3 + column)] = turned[row];
                adjoint[(row, 3 + column)] = lever[row];
            }
        }
        adjoint
    }

    /// `[I, -[p]; 0, I]`: takes the right-invariant error `xi` to the errors of position (map frame, metres) and of
    /// orientation (a small rotation of the map, radians). What is published as sigma or covariance passes through it.
    pub fn additive_from_invariant(&self) -> nalgebra::Matrix6<f64> {
        let mut matrix = nalgebra::Matrix6::identity();
        let lever = skew(&self.position);
        for row in 0..3 {
            for column in 0..3 {
                matrix[(row, 3 + column)] = -lever[(row, column)];
            }
        }
        matrix
    }
}

/// Whether a quaternion is the one of the two that is not kept.
fn is_negative(w: f64, v: &Vector3) -> bool {
    let first = [w, v.x, v.y, v.z].into_iter().find(|component| *component != 0.0);
    first.is_some_and(|component| component < 0.0)
}

/// The unit quaternion of a rotation vector, up to rounding and sign.
fn quaternion_exp(phi: &Vector3) -> (f64, Vector3) {
    let angle = norm(phi);
    let half = 0.5 * angle;
    let factor = if angle < SMALL_ANGLE_RAD { 0.5 - angle * angle / 48.0 } else { libm::sin(half) / angle };
    (libm::cos(half), scaled(phi, factor))
}

/// `R(q) p` of a unit quaternion: `p + 2 w (v x p) + 2 v x (v x p)`.
fn rotated(w: f64, v: &Vector3, p: &Vector3) -> Vector3 {
    let once = scaled(&cross(v, p), 2.0);
    let twice = cross(v, &once);
    sum(&sum(p, &scaled(&once, w)), &twice)
}

/// `(1 - cos(angle))/angle^2`, as `2 sin^2(angle/2)/angle^2`, which does not cancel.
fn one_minus_cos_over_square(angle: f64) -> f64 {
    if angle < SMALL_ANGLE_RAD {
        0.5 - angle * angle / 24.0
    } else {
        let half = libm::sin(0.5 * angle) / angle;
        2.0 * half * half
    }
}

/// `(angle - sin(angle))/angle^3`.
fn angle_minus_sin_over_cube(angle: f64) -> f64 {
    if angle < SERIES_TO_RAD {
        let s = angle * angle;
        let tail = 1.0 - s / 110.0 * (1.0 - s / 156.0 * (1.0 - s / 210.0));
        (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * tail))) / 6.0
    } else {
        (angle - libm::sin(angle)) / (angle * angle * angle)
    }
}

fn parts(tangent: &Tangent6) -> (Vector3, Vector3) {
    let t = tangent;
    (Vector3::new(t[0], t[1], t[2]), Vector3::new(t[3], t[4], t[5]))
}

fn tangent(rho: &Vector3, phi: &Vector3) -> Tangent6 {
    Tangent6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

fn dot(a: &Vector3, b: &Vector3) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

fn norm(v: &Vector3) -> f64 {
    dot(v, v).sqrt()
}

fn cross(a: &Vector3, b: &Vector3) -> Vector3 {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

fn scaled(v: &Vector3, factor: f64) -> Vector3 {
    Vector3::new(v.x * factor, v.y * factor, v.z * factor)
}

fn sum(a: &Vector3, b: &Vector3) -> Vector3 {
    Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

fn difference(a: &Vector3, b: &Vector3) -> Vector3 {
    Vector3::new(a.x - b.x, a.y - b.y, a.z - b.z)
}

#[cfg(test)]
mod tests;

//! The group SE(2) of planar rigid motions; formulas after Sola, Deray & Atchuthan 2018 (`sola2018micro`),
//! section and equation numbers as there.
//!
//! Transcendental functions come from the pure-Rust `libm`, and products are written out in a fixed
//! order, so that every processor computes the same bits.

use std::f64::consts::{PI, TAU};

/// A 3x3 block in tangent order `(x, y, yaw)`.
pub type Matrix3 = nalgebra::Matrix3<f64>;
/// A tangent vector `(x, y, yaw)`: metres, metres, radians.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A planar vector in metres.
pub type Vector2 = nalgebra::Vector2<f64>;

/// Below this angle the quotients are taken from their series, whose first neglected term is there
/// under 1e-17.
const SMALL_ANGLE_RAD: f64 = 1e-4;

/// An angle wrapped to `(-pi, pi]`.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad - TAU * ((angle_rad + PI) / TAU).floor();
    if wrapped <= -PI {
        wrapped + TAU
    } else if wrapped > PI {
        wrapped - TAU
    } else {
        wrapped
    }
}

/// `J v` with `J = [0 -1; 1 0]`: the vector turned by a quarter turn.
pub fn skew_times(v: Vector2) -> Vector2 {
    Vector2::new(-v.y, v.x)
}

/// A planar pose, read as `map_from_robot`: position in metres, yaw in radians in `(-pi, pi]`.
#[derive(Clone, Copy, Debug)]
pub struct Pose2 {
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    // Kept beside the angle because every product needs them and they cost far more than the product.
    cos: f64,
    sin: f64,
}

impl PartialEq for Pose2 {
    fn eq(&self, other: &Self) -> bool {
        self.x_m == other.x_m && self.y_m == other.y_m && self.yaw_rad == other.yaw_rad
    }
}

impl Default for Pose2 {
    fn default() -> Self {
        Self::identity()
    }
}

impl Pose2 {
    /// A pose from position in metres and yaw in radians; the yaw is wrapped.
    pub fn new(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        let yaw_rad = wrap_angle(yaw_rad);
        let (sin, cos) = libm::sincos(yaw_rad);
        Self { x_m, y_m, yaw_rad, cos, sin }
    }

    /// The neutral element.
    pub const fn identity() -> Self {
        Self { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0, cos: 1.0, sin: 0.0 }
    }

    /// Position along x, metres.
    pub fn x_m(&self) -> f64 {
        self.x_m
    }

    /// Position along y, metres.
    pub fn y_m(&self) -> f64 {
        self.y_m
    }

    /// Yaw in `(-pi, pi]`, radians, counter-clockwise positive.
    pub fn yaw_rad(&self) -> f64 {
        self.yaw_rad
    }

    /// Position, metres.
    pub fn position(&self) -> Vector2 {
        Vector2::new(self.x_m, self.y_m)
    }

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.yaw_rad.is_finite()
    }

    /// The group product: `a_from_b.compose(b_from_c)` is `a_from_c`.
    pub fn compose(&self, other: &Self) -> Self {
        let p = self.act(other.position());
        Self::new(p.x, p.y, self.yaw_rad + other.yaw_rad)
    }

    /// The inverse: `map_from_robot` becomes `robot_from_map`.
    pub fn inverse(&self) -> Self {
        let p = self.rotate_back(Vector2::new(-self.x_m, -self.y_m));
        Self::new(p.x, p.y, -self.yaw_rad)
    }

    /// `self^-1 * other`: the other pose seen from this one.
    pub fn between(&self, other: &Self) -> Self {
        let p = self.rotate_back(other.position() - self.position());
        Self::new(p.x, p.y, other.yaw_rad - self.yaw_rad)
    }

    /// The point `p` of the robot frame in the map frame.
    pub fn act(&self, p: Vector2) -> Vector2 {
        let r = self.rotate(p);
        Vector2::new(r.x + self.x_m, r.y + self.y_m)
    }

    /// `R v`.
    pub fn rotate(&self, v: Vector2) -> Vector2 {
        Vector2::new(self.cos * v.x - self.sin * v.y, self.sin * v.x + self.cos * v.y)
    }

    /// `R^T v`.
    pub fn rotate_back(&self, v: Vector2) -> Vector2 {
        Vector2::new(self.cos * v.x + self.sin * v.y, self.cos * v.y - self.sin * v.x)
    }

    /// The exponential map (eqs. 156, 158).
    pub fn exp(tangent: Vector3) -> Self {
        let theta = tangent.z;
        let (a, b) = sinc_and_cosc(theta);
        Self::new(a * tangent.x - b * tangent.y, b * tangent.x + a * tangent.y, theta)
    }

    /// The logarithm (eq. 157), with yaw in `(-pi, pi]`.
    pub fn log(&self) -> Vector3 {
        let theta = self.yaw_rad;
        let (a, b) = sinc_and_cosc(theta);
        let norm = a * a + b * b;
        Vector3::new((a * self.x_m + b * self.y_m) / norm, (a * self.y_m - b * self.x_m) / norm, theta)
    }

    /// The adjoint (eq. 159): `X exp(w) X^-1 = exp(Ad_X w)`.
    pub fn adjoint(&self) -> Matrix3 {
        Matrix3::new(self.cos, -self.sin, self.y_m, self.sin, self.cos, -self.x_m, 0.0, 0.0, 1.0)
    }

    /// `[I, J p; 0, 1]`: takes the right-invariant error `xi` to the additive error
    /// `(position, yaw)` in the map frame. What is published as sigma or covariance of a position
    /// passes through this matrix.
    pub fn additive_from_invariant(&self) -> Matrix3 {
        Matrix3::new(1.0, 0.0, -self.y_m, 0.0, 1.0, self.x_m, 0.0, 0.0, 1.0)
    }

    /// `[I, -J p; 0, 1]`, the inverse of [`Pose2::additive_from_invariant`].
    pub fn invariant_from_additive(&self) -> Matrix3 {
        Matrix3::new(1.0, 0.0, self.y_m, 0.0, 1.0, -self.x_m, 0.0, 0.0, 1.0)
    }

    /// The left Jacobian (eq. 164): `exp(v + dv) = exp(J_l dv) exp(v)` to first order.
    pub fn left_jacobian(tangent: Vector3) -> Matrix3 {
        Self::jacobian(tangent, 1.0)
    }

    /// The right Jacobian (eq. 163): `exp(v + dv) = exp(v) exp(J_r dv)` to first order.
    pub fn right_jacobian(tangent: Vector3) -> Matrix3 {
        Self::jacobian(tangent, -1.0)
    }

    /// `J_r(v) = J_l(-v)`; `side` is +1 for left, -1 for right.
    fn jacobian(tangent: Vector3, side: f64) -> Matrix3 {
        let (x, y, theta) = (tangent.x, tangent.y, tangent.z);
        let (a, b) = sinc_and_cosc(theta);
        let b = b * side;
        let (c, d) = (theta_minus_sin_over_square(theta), cosc_over_angle(theta));
        let d = d * side;
        Matrix3::new(a, -b, c * x + d * y, b, a, c * y - d * x, 0.0, 0.0, 1.0)
    }
}

/// `sin(theta)/theta` and `(1 - cos(theta))/theta`, the latter as `2 sin^2(theta/2)/theta`, which does
/// not cancel.
fn sinc_and_cosc(theta: f64) -> (f64, f64) {
    if theta.abs() < SMALL_ANGLE_RAD {
        let square = theta * theta;
        (1.0 - square / 6.0, theta * (0.5 - square / 24.0))
    } else {
        let half = libm::sin(0.5 * theta);
        (libm::sin(theta) / theta, 2.0 * half * half / theta)
    }
}

/// `(1 - cos(theta))/theta^2`.
fn cosc_over_angle(theta: f64) -> f64 {
    if theta.abs() < SMALL_ANGLE_RAD {
        0.5 - theta * theta / 24.0
    } else {
        let half = libm::sin(0.5 * theta) / theta;
        2.0 * half * half
    }
}

/// `(theta - sin(theta))/theta^2`. The difference cancels far above [`SMALL_ANGLE_RAD`], so the series
/// (to the term in `theta^11`, relative remainder below 1e-16) reaches to 0.2 rad.
fn theta_minus_sin_over_square(theta: f64) -> f64 {
    if theta.abs() < 0.2 {
        let s = theta * theta;
        theta / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0))))
    } else {
        (theta - libm::sin(theta)) / (theta * theta)
    }
}

#[cfg(test)]
mod tests;

//! What the signal chain computes with: plain numbers, or numbers that carry their derivatives.

use std::f64::consts::TAU;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number, possibly with derivatives ([`Dual`](crate::Dual)).
///
/// Comparison is by value. Where a function has a kink, the derivative is that of the branch the value
/// lies in; on the kink itself it is the one stated with the method.
pub trait Scalar:
    Copy
    + Debug
    + PartialOrd
    + PartialOrd<f64>
    + PartialEq
    + PartialEq<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// A number that depends on nothing.
    fn constant(value: f64) -> Self;

    /// The value without its derivatives.
    fn value(self) -> f64;

    /// Whether it depends on nothing.
    fn is_constant(self) -> bool;

    /// A function of one argument by its value and its derivative at that argument.
    ///
    /// Every elementary function goes through here; a derivative of zero never multiplies into `NaN`.
    fn chain(self, value: f64, derivative: f64) -> Self;

    /// The angle of the vector `(x, self)`, radians in `[-pi, pi]`.
    fn atan2(self, x: Self) -> Self;

    /// Zero.
    #[inline]
    fn zero() -> Self {
        Self::constant(0.0)
    }

    /// One.
    #[inline]
    fn one() -> Self {
        Self::constant(1.0)
    }

    /// Sine of an angle in radians.
    #[inline]
    fn sin(self) -> Self {
        let (sin, cos) = libm::sincos(self.value());
        self.chain(sin, cos)
    }

    /// Cosine of an angle in radians.
    #[inline]
    fn cos(self) -> Self {
        let (sin, cos) = libm::sincos(self.value());
        self.chain(cos, -sin)
    }

    /// Sine and cosine of an angle in radians, for the price of one.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = libm::sincos(self.value());
        (self.chain(sin, cos), self.chain(cos, -sin))
    }

    /// Tangent of an angle in radians.
    #[inline]
    fn tan(self) -> Self {
        let tan = libm::tan(self.value());
        self.chain(tan, 1.0 + tan * tan)
    }

    /// The angle whose tangent this is, radians.
    #[inline]
    fn atan(self) -> Self {
        let value = self.value();
        self.chain(libm::atan(value), 1.0 / (1.0 + value * value))
    }

    /// The exponential.
    #[inline]
    fn exp(self) -> Self {
        let exp = libm::exp(self.value());
        self.chain(exp, exp)
    }

    /// The natural logarithm.
    #[inline]
    fn ln(self) -> Self {
        self.chain(libm::log(self.value()), 1.0 / self.value())
    }

    /// The square root. Its derivative at zero is infinite.
    #[inline]
    fn sqrt(self) -> Self {
        let root = libm::sqrt(self.value());
        self.chain(root, 0.5 / root)
    }

    /// An integer power.
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        let value = self.value();
        let lower = integer_power(value, exponent - 1);
        let derivative = if exponent == 0 { 0.0 } else { f64::from(exponent) * lower };
        self.chain(integer_power(value, exponent), derivative)
    }

    /// The square.
    #[inline]
    fn square(self) -> Self {
        self * self
    }

    /// The absolute value; at zero the derivative from above.
    #[inline]
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }

    /// `-1`, `0` or `1`; its derivative is zero.
    #[inline]
    fn sign(self) -> Self {
        let value = self.value();
        Self::constant(if value > 0.0 {
            1.0
        } else if value < 0.0 {
            -1.0
        } else {
            0.0
        })
    }

    /// The lesser; of two equal values, `self`.
    #[inline]
    fn min(self, other: Self) -> Self {
        if other.value() < self.value() { other } else { self }
    }

    /// The greater; of two equal values, `self`.
    #[inline]
    fn max(self, other: Self) -> Self {
        if other.value() > self.value() { other } else { self }
    }

    /// The nearest value in `[low, high]`; on a bound, `self`.
    #[inline]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }

    /// The length of the vector `(self, other)`; its derivative at the origin is zero.
    #[inline]
    fn hypot(self, other: Self) -> Self {
        let square = self * self + other * other;
        if square.value() == 0.0 { Self::zero() } else { square.sqrt() }
    }

    /// An angle wrapped to `(-pi, pi]`.
    #[inline]
    fn wrapped(self) -> Self {
        let turns = libm::ceil(self.value() / TAU - 0.5);
        self - turns * TAU
    }
}

fn integer_power(base: f64, exponent: i32) -> f64 {
    let mut power = 1.0;
    for _ in 0..exponent.unsigned_abs() {
        power *= base;
    }
    if exponent < 0 { 1.0 / power } else { power }
}

impl Scalar for f64 {
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline]
    fn value(self) -> f64 {
        self
    }

    #[inline]
    fn is_constant(self) -> bool {
        true
    }

    #[inline]
    fn chain(self, value: f64, _derivative: f64) -> Self {
        value
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
}

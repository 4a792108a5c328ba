//! Forward-mode differentiation: a value and its derivatives with respect to `P` parameters.

use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::scalar::Scalar;

/// A value with its derivatives with respect to `P` chosen parameters.
///
/// Exact to rounding: the rules of differentiation are applied to every operation, there is no step size.
#[derive(Clone, Copy, Debug)]
pub struct Dual<const P: usize> {
    value: f64,
    derivatives: [f64; P],
}

impl<const P: usize> Dual<P> {
    /// The parameter number `index` itself: its derivative with respect to itself is one.
    ///
    /// An `index` of `P` or more gives a constant: the number depends on none of the parameters.
    #[inline]
    pub fn variable(value: f64, index: usize) -> Self {
        let mut derivatives = [0.0; P];
        if let Some(own) = derivatives.get_mut(index) {
            *own = 1.0;
        }
        Self { value, derivatives }
    }

    /// The derivatives, in the order of the parameters.
    #[inline]
    pub fn derivatives(&self) -> &[f64; P] {
        &self.derivatives
    }

    #[inline]
    fn combined(value: f64, first: &Self, by_first: f64, second: &Self, by_second: f64) -> Self {
        let mut derivatives = [0.0; P];
        if by_first.is_finite() && by_second.is_finite() {
            for ((out, a), b) in derivatives.iter_mut().zip(first.derivatives).zip(second.derivatives) {
                *out = a * by_first + b * by_second;
            }
        } else {
            for ((out, a), b) in derivatives.iter_mut().zip(first.derivatives).zip(second.derivatives) {
                *out = scaled(a, by_first) + scaled(b, by_second);
            }
        }
        Self { value, derivatives }
    }
}

/// What depends on nothing stays so, also where the partial derivative is infinite: a limit that is
/// switched off is an infinite constant.
fn scaled(derivative: f64, by: f64) -> f64 {
    if derivative == 0.0 { 0.0 } else { derivative * by }
}

impl<const P: usize> Scalar for Dual<P> {
    #[inline]
    fn constant(value: f64) -> Self {
        Self { value, derivatives: [0.0; P] }
    }

    #[inline]
    fn value(self) -> f64 {
        self.value
    }

    #[inline]
    fn is_constant(self) -> bool {
        self.derivatives.iter().all(|own| *own == 0.0)
    }

    #[inline]
    fn chain(self, value: f64, derivative: f64) -> Self {
        let derivatives = if derivative.is_finite() {
            self.derivatives.map(|own| own * derivative)
        } else {
            self.derivatives.map(|own| scaled(own, derivative))
        };
        Self { value, derivatives }
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        let square = self.value * self.value + x.value * x.value;
        let angle = libm::atan2(self.value, x.value);
        Self::combined(angle, &self, x.value / square, &x, -self.value / square)
    }
}

impl<const P: usize> Neg for Dual<P> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, derivatives: self.derivatives.map(|own| -own) }
    }
}

impl<const P: usize> Add for Dual<P> {
    type Output = Self;
    #[inline]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl<const P: usize> Sub for Dual<P> {
    type Output = Self;
    #[inline]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}

impl<const P: usize> AddAssign for Dual<P> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.value += other.value;
        for (own, other) in self.derivatives.iter_mut().zip(other.derivatives) {
            *own += other;
        }
    }
}

impl<const P: usize> SubAssign for Dual<P> {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        self.value -= other.value;
        for (own, other) in self.derivatives.iter_mut().zip(other.derivatives) {
            *own -= other;
        }
    }
}

/// A constant added changes no derivative.
impl<const P: usize> Add<f64> for Dual<P> {
    type Output = Self;
    #[inline]
    fn add(mut self, other: f64) -> Self {
        self.value += other;
        self
    }
}

impl<const P: usize> Sub<f64> for Dual<P> {
    type Output = Self;
    #[inline]
    fn sub(mut self, other: f64) -> Self {
        self.value -= other;
        self
    }
}

impl<const P: usize> Mul for Dual<P> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::combined(self.value * other.value, &self, other.value, &other, self.value)
    }
}

impl<const P: usize> Div for Dual<P> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        Self::combined(quotient, &self, 1.0 / other.value, &other, -quotient / other.value)
    }
}

macro_rules! with_number {
    ($($trait:ident $method:ident $by:expr;)*) => {$(
        impl<const P: usize> $trait<f64> for Dual<P> {
            type Output = Self;
            #[inline]
            fn $method(self, other: f64) -> Self {
                let by: fn(f64) -> f64 = $by;
                self.chain(self.value.$method(other), by(other))
            }
        }
    )*};
}
with_number! {
    Mul mul |other| other;
    Div div |other| 1.0 / other;
}

macro_rules! in_place {
    ($($trait:ident $method:ident $operator:tt;)*) => {$(
        impl<const P: usize> $trait for Dual<P> {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    )*};
}
in_place! {
    MulAssign mul_assign *;
    DivAssign div_assign /;
}

impl<const P: usize> PartialEq for Dual<P> {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const P: usize> PartialOrd for Dual<P> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const P: usize> PartialEq<f64> for Dual<P> {
    #[inline]
    fn eq(&self, other: &f64) -> bool {
        self.value == *other
    }
}

impl<const P: usize> PartialOrd<f64> for Dual<P> {
    #[inline]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values that are exact by construction")]
mod tests {
    use super::*;

    /// Central difference of a function that is generic over the scalar, at the step that balances
    /// truncation (h^2) and rounding (1e-16 / h): an accuracy of about 1e-9.
    fn check(name: &str, at: f64, plain: fn(f64) -> f64, dual: fn(Dual<1>) -> Dual<1>) {
        let h = 1e-5;
        let central = (plain(at + h) - plain(at - h)) / (2.0 * h);
        let found = dual(Dual::variable(at, 0));
        let derivative = found.derivatives()[0];
        assert!(
            (derivative - central).abs() < 1e-8 * (1.0 + central.abs()),
            "{name}: {derivative} {central}"
        );
        assert!((found.value() - plain(at)).abs() < 1e-15, "{name}: value");
    }

    /// One function, checked as both instances of the generic.
    macro_rules! check_all {
        ($at:expr; $($body:expr),* $(,)?) => {$({
            fn f<S: Scalar>(x: S) -> S {
                let body: fn(S) -> S = $body;
                body(x)
            }
            check(stringify!($body), $at, f::<f64>, f::<Dual<1>>);
        })*};
    }

    #[test]
    fn elementary_functions_match_central_differences() {
        for at in [-1.3, -0.2, 0.4, 2.1] {
            check_all! { at;
                |x| x.sin(), |x| x.cos(), |x| x.tan(), |x| x.atan(), |x| x.exp(), |x| x.powi(3), |x| x.powi(-2),
                |x| x.powi(0), |x| x.square(), |x| Scalar::abs(x), |x| x.sign(), |x| x.wrapped(),
                |x| (x.square() + 0.5).sqrt(), |x| (x.square() + 0.5).ln(), |x| x.hypot(S::constant(0.7)),
                |x| x.atan2(S::constant(-0.7)), |x| S::constant(0.7).atan2(x),
                |x| (x * 2.0 - 1.0) / (x.square() + 3.0), |x| S::one() / x - x / 3.0 + 2.0, |x| -x * x.sin(),
                |x| Scalar::min(x, x * x), |x| Scalar::max(x, x * x),
                |x| Scalar::clamp(x * 2.0, S::constant(-1.0), S::constant(1.0)),
                |x| { let mut y = x; y += x * x; y -= x.sin(); y *= x; y /= S::constant(3.0); y },
            }
        }
    }

    #[test]
    fn derivatives_with_respect_to_several_parameters_stay_apart() {
        let (x, y) = (Dual::<2>::variable(3.0, 0), Dual::<2>::variable(5.0, 1));
        assert_eq!((x * y).derivatives(), &[5.0, 3.0]);
        assert_eq!((x / y).derivatives(), &[0.2, -0.12]);
        assert_eq!(Dual::<2>::variable(1.0, 2).derivatives(), &[0.0, 0.0]);
    }

    #[test]
    fn at_a_kink_the_stated_branch_is_taken() {
        let x = Dual::<1>::variable(0.0, 0);
        assert_eq!(Scalar::abs(x).derivatives(), &[1.0]);
        let zero = Dual::constant(0.0);
        assert_eq!(Scalar::max(x, zero).derivatives(), &[1.0]);
        assert_eq!(Scalar::min(x, zero).derivatives(), &[1.0]);
        assert_eq!(Scalar::max(zero, x).derivatives(), &[0.0]);
        assert_eq!(Scalar::clamp(x, zero, Dual::constant(1.0)).derivatives(), &[1.0]);
        assert_eq!(zero.hypot(zero).derivatives(), &[0.0]);
    }

    #[test]
    fn an_infinite_limit_leaves_derivatives_finite() {
        let limit = Dual::<1>::constant(f64::INFINITY);
        let x = Dual::<1>::variable(2.0, 0);
        assert_eq!(Scalar::clamp(x, -limit, limit).derivatives(), &[1.0]);
        assert_eq!((x / limit).derivatives(), &[0.0]);
    }

    #[test]
    fn angles_wrap_to_the_half_open_interval() {
        use std::f64::consts::PI;
        assert_eq!(PI.wrapped(), PI);
        assert_eq!((-PI).wrapped(), PI);
        assert!((7.0_f64.wrapped() - (7.0 - 2.0 * PI)).abs() < 1e-15);
        assert_eq!(Dual::<1>::variable(7.0, 0).wrapped().derivatives(), &[1.0]);
    }
}

//! Planar poses over a [`Scalar`]: what `estimation::geometry::Pose2` is, with derivatives.

use crate::scalar::Scalar;

/// Up to this angle the quotients of the exponential map come from their series; the first neglected term is below
/// 1e-18, that of their derivatives below 1e-16.
const SERIES_UP_TO_RAD: f64 = 0.5;
/// So many terms.
const TERMS: usize = 8;
/// Of `sin(a)/a` and of `(1 - cos(a))/a^2` in powers of `a^2`.
const SIN: [f64; TERMS] = coefficients(1);
const COS: [f64; TERMS] = coefficients(2);

/// `(-1)^n / (2n + first)!`; `first` is 1 or 2, its own factorial.
const fn coefficients(first: u16) -> [f64; TERMS] {
    let mut all = [0.0; TERMS];
    let (mut n, mut factor, mut next) = (0, 1.0 / first as f64, first + 1);
    while n < TERMS {
        all[n] = factor;
        factor /= -(next as f64 * (next + 1) as f64);
        next += 2;
        n += 1;
    }
    all
}

/// A power series and its derivative.
#[inline]
fn series(coefficients: &[f64; TERMS], at: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for coefficient in coefficients.iter().rev() {
        slope = slope * at + value;
        value = value * at + coefficient;
    }
    (value, slope)
}

/// A pose or a rigid motion of SE(2): metres, metres, radians. The yaw is not wrapped, so that it can be
/// differentiated and differenced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<S> {
    /// Along x, metres.
    pub x_m: S,
    /// Along y, metres.
    pub y_m: S,
    /// Counter-clockwise from x, radians.
    pub yaw_rad: S,
}

impl<S: Scalar> Pose<S> {
    /// A pose from position and yaw.
    pub fn new(x_m: S, y_m: S, yaw_rad: S) -> Self {
        Self { x_m, y_m, yaw_rad }
    }

    /// A pose that depends on no parameter.
    pub fn constant(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Self::new(S::constant(x_m), S::constant(y_m), S::constant(yaw_rad))
    }

    /// The neutral element.
    pub fn identity() -> Self {
        Self::constant(0.0, 0.0, 0.0)
    }

    /// The position, metres.
    pub fn position(&self) -> [S; 2] {
        [self.x_m, self.y_m]
    }

    /// `R v`: a vector of this frame in the outer frame.
    pub fn rotate(&self, [x, y]: [S; 2]) -> [S; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [cos * x - sin * y, sin * x + cos * y]
    }

    /// `R' v`: a vector of the outer frame in this frame.
    pub fn rotate_back(&self, [x, y]: [S; 2]) -> [S; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [cos * x + sin * y, cos * y - sin * x]
    }

    /// The group product: `a_from_b.compose(b_from_c)` is `a_from_c`.
    pub fn compose(&self, other: &Self) -> Self {
        let [x, y] = self.rotate(other.position());
        Self::new(self.x_m + x, self.y_m + y, self.yaw_rad + other.yaw_rad)
    }

    /// `self^-1 other`: the other pose seen from this one.
    pub fn between(&self, other: &Self) -> Self {
        let [x, y] = self.rotate_back([other.x_m - self.x_m, other.y_m - self.y_m]);
        Self::new(x, y, other.yaw_rad - self.yaw_rad)
    }

    /// A point of the outer frame seen from this pose.
    pub fn point_seen(&self, [x, y]: [S; 2]) -> [S; 2] {
        self.rotate_back([x - self.x_m, y - self.y_m])
    }

    /// The exponential map: the motion along a constant body velocity whose integral is
    /// `(forward, left, yaw)` (`sola2018micro`, eqs. 156 and 158).
    pub fn exp(forward_m: S, left_m: S, yaw_rad: S) -> Self {
        let angle = yaw_rad.value();
        let (a, b) = if angle.abs() < SERIES_UP_TO_RAD {
            let square = angle * angle;
            let (a, a_slope) = series(&SIN, square);
            let (b, b_slope) = series(&COS, square);
            (yaw_rad.chain(a, 2.0 * angle * a_slope), yaw_rad.chain(angle * b, b + 2.0 * square * b_slope))
        } else {
            let (sin, cos) = (yaw_rad * 0.5).sin_cos();
            (sin * cos * 2.0 / yaw_rad, sin * sin * 2.0 / yaw_rad)
        };
        Self::new(a * forward_m - b * left_m, b * forward_m + a * left_m, yaw_rad)
    }

    /// The group product, in plain numbers where neither depends on anything: most of what carries a reference pose.
    pub(crate) fn compose_plainly(&self, other: &Self) -> Self {
        if self.is_constant() && other.is_constant() {
            return self.value().compose(&other.value()).lift();
        }
        self.compose(other)
    }

    /// `self^-1`: the outer frame seen from this one; in plain numbers where it depends on nothing.
    pub(crate) fn inverse(&self) -> Self {
        if self.is_constant() {
            return self.value().between(&Pose::identity()).lift();
        }
        self.between(&Self::identity())
    }

    fn is_constant(&self) -> bool {
        [self.x_m, self.y_m, self.yaw_rad].into_iter().all(S::is_constant)
    }

    /// The values without their derivatives.
    pub fn value(&self) -> Pose<f64> {
        Pose::new(self.x_m.value(), self.y_m.value(), self.yaw_rad.value())
    }
}

impl Pose<f64> {
    /// The same pose as another scalar, depending on nothing.
    pub fn lift<S: Scalar>(&self) -> Pose<S> {
        Pose::constant(self.x_m, self.y_m, self.yaw_rad)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values that are exact by construction")]
mod tests {
    use super::*;
    use crate::Dual;

    #[test]
    fn a_quarter_circle_ends_where_geometry_says() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let end = Pose::exp(quarter * 2.0, 0.0, quarter);
        assert!((end.x_m - 2.0).abs() < 1e-15 && (end.y_m - 2.0).abs() < 1e-15);
    }

    #[test]
    fn a_pose_seen_from_itself_is_the_identity() {
        let pose = Pose::new(1.0, -2.0, 0.7);
        assert_eq!(pose.between(&pose), Pose::identity());
        let back = pose.compose(&pose.between(&Pose::identity()));
        assert!(back.x_m.abs() < 1e-15 && back.y_m.abs() < 1e-15 && back.yaw_rad.abs() < 1e-15);
    }

    #[test]
    fn the_exponential_is_smooth_across_the_switch_to_its_series() {
        let at = |angle| Pose::exp(Dual::<1>::constant(1.0), Dual::constant(0.5), Dual::variable(angle, 0));
        let (below, above) = (at(SERIES_UP_TO_RAD - 1e-15), at(SERIES_UP_TO_RAD));
        for (lower, upper) in [(below.x_m, above.x_m), (below.y_m, above.y_m)] {
            assert!((lower.value() - upper.value()).abs() < 1e-14);
            assert!((lower.derivatives()[0] - upper.derivatives()[0]).abs() < 1e-14);
        }
        let nothing = at(0.0);
        assert_eq!((nothing.x_m.value(), nothing.y_m.value()), (1.0, 0.5));
        // x = sin(a)/a - (1 - cos(a))/a / 2, y = (1 - cos(a))/a + sin(a)/a / 2.
        assert_eq!((nothing.x_m.derivatives()[0], nothing.y_m.derivatives()[0]), (-0.25, 0.5));
    }
}

//! Unit vectors: a basis of the tangent plane, and the difference of two in it.

use crate::geometry::Vector3;

/// Two unit vectors that make a right-handed frame with a unit vector, without a branch but the sign of its z
/// (`duff2017`, listing 3). The same direction gives the same basis everywhere.
pub fn tangent_basis(n: &Vector3) -> [Vector3; 2] {
    let sign = 1.0f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [
        Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vector3::new(b, sign + n.y * n.y * a, -n.y),
    ]
}

/// The unit vector `u` seen from the unit vector `origin` in coordinates of the tangent plane there: two angles in radians
/// along [`tangent_basis`], whose length is the angle between the vectors (the logarithm of the sphere), and the rows of
/// their derivative by `u`. `None` if the two are opposite to 1e-6 rad, where no shortest way leads from one to the other.
pub fn between_directions(origin: &Vector3, u: &Vector3) -> Option<([f64; 2], [Vector3; 2])> {
    let basis = tangent_basis(origin);
    let [s, t] = [dot(&basis[0], u), dot(&basis[1], u)];
    let cosine = dot(origin, u);
    let square = s * s + t * t;
    let sine = square.sqrt();
    if sine < 1e-6 && cosine < 0.0 {
        return None;
    }
    let angle = libm::atan2(sine, cosine);
    // h = f (s, t) with f = angle / sine; d angle = cosine d sine - sine d cosine on the unit sphere, so that
    // d h = f d(s, t) + (s, t) (g (s ds + t dt) - d cosine) with g = (sine cosine - angle) / sine^3.
    let near = sine < 0.05 && cosine > 0.0;
    let f = if near { arcsine_quotient(square) } else { angle / sine };
    let g = if near { curvature(square) } else { (sine * cosine - angle) / (square * sine) };
    let rows = [0, 1].map(|axis| {
        let along = [s, t][axis];
        let combined =
            |k: usize| f * basis[axis][k] + along * (g * (s * basis[0][k] + t * basis[1][k]) - origin[k]);
        Vector3::new(combined(0), combined(1), combined(2))
    });
    Some(([f * s, f * t], rows))
}

/// `asin(x)/x` by `x^2`, to the term in `x^10`: the next is under 2e-17 for `x < 0.05`.
fn arcsine_quotient(square: f64) -> f64 {
    let q = square;
    1.0 + q * (1.0 / 6.0 + q * (3.0 / 40.0 + q * (5.0 / 112.0 + q * (35.0 / 1152.0 + q * (63.0 / 2816.0)))))
}

/// `(x sqrt(1 - x^2) - asin(x))/x^3` by `x^2`: the integral of `-2 x^2/sqrt(1 - x^2)`, term by term.
fn curvature(square: f64) -> f64 {
    let q = square;
    -2.0 * (1.0 / 3.0 + q * (1.0 / 10.0 + q * (3.0 / 56.0 + q * (5.0 / 144.0 + q * (35.0 / 1408.0)))))
}

fn dot(a: &Vector3, b: &Vector3) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(origin: Vector3, u: Vector3) {
        let [b1, b2] = tangent_basis(&origin);
        assert!((b1.cross(&b2) - origin).norm() < 2e-15 && (b1.norm() - 1.0).abs() < 2e-15);
        let (h, rows) = between_directions(&origin, &u).unwrap();
        // The way back: origin turned by the angle towards the tangent, in closed form.
        let along = b1 * h[0] + b2 * h[1];
        let angle = along.norm();
        let quotient = if angle < 1e-9 { 1.0 } else { libm::sin(angle) / angle };
        assert!((origin * libm::cos(angle) + along * quotient - u).norm() < 1e-14);
        // Derivative along the sphere, against central differences.
        let step = 1e-5;
        for tangent in tangent_basis(&u) {
            let [plus, minus] = [step, -step].map(|by| (u + tangent * by).normalize());
            let [plus, minus] = [plus, minus].map(|u| between_directions(&origin, &u).unwrap().0);
            for axis in 0..2 {
                let found = (plus[axis] - minus[axis]) / (2.0 * step);
                // The chart is stretched towards the opposite side.
                let behind = origin.dot(&u) < 0.0;
                let scale = if behind { 1.0 / libm::pow(origin.cross(&u).norm(), 3.0) } else { 1.0 };
                assert!((rows[axis].dot(&tangent) - found).abs() < 1e-9 * scale, "{origin} {u}");
            }
        }
    }

    #[test]
    fn every_octant_axis_and_small_angle_has_its_chart() {
        for origin in
            [Vector3::x(), -Vector3::y(), Vector3::z(), -Vector3::z(), Vector3::new(1.0, -2.0, 2.0) / 3.0]
        {
            for angle in [0.0, 1e-9, 1e-4, 0.049, 0.051, 0.5, 1.57, 2.5, 3.1] {
                let [b1, b2] = tangent_basis(&origin);
                let side = b1 * 0.6 - b2 * 0.8;
                check(origin, (origin * libm::cos(angle) + side * libm::sin(angle)).normalize());
            }
        }
    }

    #[test]
    fn opposite_directions_are_refused() {
        let n = Vector3::new(2.0, -1.0, 2.0) / 3.0;
        assert_eq!(between_directions(&n, &-n), None);
    }

    proptest! {
        #[test]
        fn charts_hold_at_random(a in -1.0..1.0f64, b in -1.0..1.0f64, c in -1.0..1.0f64,
                                 d in -1.0..1.0f64, e in -1.0..1.0f64, f in -1.0..1.0f64) {
            let (origin, u) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
            prop_assume!(origin.norm() > 0.1 && u.norm() > 0.1);
            let (origin, u) = (origin.normalize(), u.normalize());
            prop_assume!(origin.dot(&u) > -0.999);
            check(origin, u);
        }
    }
}

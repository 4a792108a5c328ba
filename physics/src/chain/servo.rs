//! The first-order velocity servo, integrated exactly.

use crate::scalar::Scalar;

/// Speed at the end of a step and the distance covered in it.
#[derive(Clone, Copy, Debug)]
pub struct ServoStep<S> {
    /// The unit of the set-point.
    pub speed: S,
    /// Its time integral.
    pub distance: S,
}

/// Follows a constant set-point for `step_s` by `tau dv/dt = u - v` with `|dv/dt| <= limit`: a ramp as long
/// as the limit binds, then an exponential. Both are integrated in closed form, so that the length of a
/// step does not matter. An infinite `limit` never binds; without lag the set-point is reached at once.
pub fn follow<S: Scalar>(speed: S, set_point: S, time_constant_s: S, limit: S, step_s: S) -> ServoStep<S> {
    let mut speed = speed;
    let mut distance = S::zero();
    let mut rest_s = step_s;
    let error = set_point - speed;
    if limit.value().is_finite() {
        let bound = limit * time_constant_s;
        if error.abs() > bound {
            let ramp_s = ((error.abs() - bound) / limit).min(step_s);
            let slope = limit * error.sign();
            distance += speed * ramp_s + slope * ramp_s * ramp_s * 0.5;
            speed += slope * ramp_s;
            rest_s -= ramp_s;
        }
    }
    let error = set_point - speed;
    let decay = if time_constant_s.value() > 0.0 { (-rest_s / time_constant_s).exp() } else { S::zero() };
    if rest_s.value() > 0.0 {
        // At a time constant of zero this keeps the slope of the distance in it: -error.
        distance += set_point * rest_s - error * time_constant_s * (S::one() - decay);
        speed = set_point - error * decay;
    }
    ServoStep { speed, distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dual;

    const NEVER: f64 = f64::INFINITY;

    #[test]
    fn a_step_response_is_the_textbook_exponential() {
        let end = follow(0.0, 2.0, 0.1, NEVER, 0.3);
        assert!((end.speed - 2.0 * (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
        assert!((end.distance - (0.6 - 0.2 * (1.0 - (-3.0_f64).exp()))).abs() < 1e-15);
    }

    #[test]
    fn one_long_step_equals_many_short_ones() {
        for limit in [NEVER, 4.0] {
            let whole = follow(0.3, -1.0, 0.1, limit, 0.5);
            let (mut speed, mut distance) = (0.3, 0.0);
            for _ in 0..500 {
                let step = follow(speed, -1.0, 0.1, limit, 0.001);
                (speed, distance) = (step.speed, distance + step.distance);
            }
            assert!((whole.speed - speed).abs() < 1e-12 && (whole.distance - distance).abs() < 1e-12);
        }
    }

    #[test]
    fn an_acceleration_limit_without_lag_is_a_ramp() {
        let ramp = follow(0.0, 1.0, 0.0, 2.0, 0.25);
        assert!((ramp.speed - 0.5).abs() < 1e-15 && (ramp.distance - 0.0625).abs() < 1e-15);
        let beyond = follow(0.0, 1.0, 0.0, 2.0, 1.0);
        assert!((beyond.speed - 1.0).abs() < 1e-15 && (beyond.distance - 0.75).abs() < 1e-15);
    }

    #[test]
    fn the_slope_in_the_time_constant_is_there_also_at_zero() {
        let at = |tau| follow(0.5, 2.0, tau, NEVER, 0.3).distance;
        let exact = follow(
            Dual::<1>::constant(0.5),
            Dual::constant(2.0),
            Dual::variable(0.0, 0),
            Dual::constant(NEVER),
            Dual::constant(0.3),
        );
        assert!((exact.distance.derivatives()[0] + 1.5).abs() < 1e-15);
        assert!(((at(1e-6) - at(0.0)) / 1e-6 + 1.5).abs() < 1e-9);
    }
}

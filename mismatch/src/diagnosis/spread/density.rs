//! Log-densities.

use crate::diagnosis::noise;

/// Half the logarithm of two pi.
const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_7;
/// Below this, the reciprocal of the degrees of freedom makes Student's t a Gaussian.
const GAUSSIAN: f64 = 1e-9;

/// Of a Gaussian error of `z` sigmas.
pub(super) fn gaussian(z: f64, sigma: f64) -> f64 {
    -0.5 * z * z - libm::log(sigma) - HALF_LOG_TAU
}

/// The same, its slope bounded beyond [`noise::CLIP`] sigmas.
pub(super) fn bounded(z: f64, sigma: f64) -> f64 {
    -0.5 * noise::rho(z) - libm::log(sigma) - HALF_LOG_TAU
}

/// Student's t of one over `reciprocal` degrees of freedom.
#[derive(Clone, Copy, Debug)]
pub(super) struct Student {
    reciprocal: f64,
    constant: f64,
}

impl Student {
    pub(super) fn new(reciprocal: f64) -> Self {
        let constant = if reciprocal < 0.02 {
            // Of lgamma((n+1)/2) - lgamma(n/2) - log(n/2)/2 for large n.
            -0.25 * reciprocal + reciprocal.powi(3) / 24.0
        } else {
            let freedom = 1.0 / reciprocal;
            libm::lgamma(0.5 * (freedom + 1.0)) - libm::lgamma(0.5 * freedom) - 0.5 * libm::log(0.5 * freedom)
        };
        Self { reciprocal, constant }
    }

    /// Of an error of `z` scales.
    pub(super) fn log_density(self, z: f64, scale: f64) -> f64 {
        if self.reciprocal < GAUSSIAN {
            return gaussian(z, scale);
        }
        let tail = 0.5 * (1.0 / self.reciprocal + 1.0) * libm::log1p(self.reciprocal * z * z);
        self.constant - tail - libm::log(scale) - HALF_LOG_TAU
    }
}

impl Student {
    /// The log-density of an error of `z` scales over that of none; beyond [`noise::CLIP`] as there.
    pub(super) fn relative(self, z: f64) -> f64 {
        let z = z.clamp(-noise::CLIP, noise::CLIP);
        self.log_density(z, 1.0) - self.log_density(0.0, 1.0)
    }

    /// By how much the log-density of an error of `z` scales grows with the logarithm of the scale.
    pub(super) fn slope(self, z: f64) -> f64 {
        let square = z * z;
        (1.0 + self.reciprocal) * square / (1.0 + self.reciprocal * square) - 1.0
    }

    /// By how much the log-density of an error of `z` scales falls with `z`.
    pub(super) fn pull(self, z: f64) -> f64 {
        (1.0 + self.reciprocal) * z / (1.0 + self.reciprocal * z * z)
    }

    /// Of two errors of so many scales each, by the product of the scales: with half the logarithms.
    pub(super) fn log_density_of_two(self, errors: [f64; 2], scales: f64) -> f64 {
        self.log_density_by(errors, libm::log(scales))
    }

    /// The same, by the logarithm of the product of the scales.
    pub(super) fn log_density_by(self, [a, b]: [f64; 2], log_scales: f64) -> f64 {
        let constant = 2.0 * (self.constant - HALF_LOG_TAU) - log_scales;
        if self.reciprocal < GAUSSIAN {
            return constant - 0.5 * (a * a + b * b);
        }
        let [a, b] = [self.reciprocal * a * a, self.reciprocal * b * b];
        constant - 0.5 * (1.0 / self.reciprocal + 1.0) * libm::log1p(a + b + a * b)
    }
}

/// The logarithm of the sum of two numbers given by theirs.
pub(super) fn log_sum(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    if high == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
}

/// The same of many.
pub(super) fn log_sum_of(all: impl Iterator<Item = f64> + Clone) -> f64 {
    let high = all.clone().fold(f64::NEG_INFINITY, f64::max);
    if all.clone().nth(1).is_none() || high == f64::NEG_INFINITY {
        return high;
    }
    high + libm::log(all.map(|own| libm::exp(own - high)).sum())
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{Continuous, StudentsT};

    use super::*;

    #[test]
    fn student_is_that_of_a_library_and_ends_at_the_gaussian() {
        for freedom in [1.0, 3.0, 49.0, 51.0, 1000.0] {
            let own = Student::new(1.0 / freedom);
            let library = StudentsT::new(0.0, 0.3, freedom).unwrap();
            for error in [0.0, 0.2, -1.7, 40.0] {
                let found = own.log_density(error / 0.3, 0.3);
                assert!((found - library.ln_pdf(error)).abs() < 1e-8, "{freedom} {error} {found}");
            }
        }
        let near = Student::new(1e-8).log_density(2.0, 0.5) - gaussian(2.0, 0.5);
        let limit = Student::new(0.0).log_density(2.0, 0.5) - gaussian(2.0, 0.5);
        assert!(near.abs() < 1e-6 && limit.abs() < 1e-15);
    }

    #[test]
    fn two_errors_at_once_have_the_sum_of_both() {
        for reciprocal in [0.0, 1e-8, 0.01, 0.4] {
            let student = Student::new(reciprocal);
            let apart = student.log_density(1.5, 0.3) + student.log_density(-40.0, 0.02);
            let at_once = student.log_density_of_two([1.5, -40.0], 0.3 * 0.02);
            assert!((apart - at_once).abs() < 1e-9 * apart.abs(), "{reciprocal}: {apart} {at_once}");
        }
    }

    #[test]
    fn sums_of_logarithms_do_not_overflow() {
        assert!((log_sum(-1000.0, -1000.0) - (-1000.0 + 2.0_f64.ln())).abs() < 1e-12);
        assert!((log_sum(3.0, f64::NEG_INFINITY) - 3.0).abs() < 1e-15);
        let nothing = log_sum(f64::NEG_INFINITY, f64::NEG_INFINITY);
        assert!(nothing.is_infinite() && nothing < 0.0);
    }
}

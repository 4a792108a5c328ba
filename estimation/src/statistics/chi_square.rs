//! The chi-square distribution.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability that a chi-square variable of `dof` degrees of freedom is at most `value`; NaN if `dof`
/// is not positive.
pub fn chi_square_cdf(dof: f64, value: f64) -> f64 {
    ChiSquared::new(dof).map_or(f64::NAN, |distribution| distribution.cdf(value.max(0.0)))
}

/// The value that a chi-square variable of `dof` degrees of freedom stays under with `probability`;
/// NaN if `dof` is not positive or `probability` not within `[0, 1]`.
pub fn chi_square_quantile(dof: f64, probability: f64) -> f64 {
    if !(0.0..=1.0).contains(&probability) {
        return f64::NAN;
    }
    ChiSquared::new(dof).map_or(f64::NAN, |distribution| distribution.inverse_cdf(probability))
}

/// The central interval that holds all but `alpha` of the probability, `alpha / 2` on each side.
pub fn chi_square_interval(dof: f64, alpha: f64) -> (f64, f64) {
    (chi_square_quantile(dof, alpha / 2.0), chi_square_quantile(dof, 1.0 - alpha / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_printed_tables() {
        // Abramowitz & Stegun, table 26.8, and the gates of the filter (upper 0.1 %).
        for (dof, probability, expected) in [
            (1.0, 0.95, 3.841_46),
            (2.0, 0.95, 5.991_46),
            (3.0, 0.95, 7.814_73),
            (1.0, 0.999, 10.828),
            (2.0, 0.999, 13.816),
            (3.0, 0.999, 16.266),
            (10.0, 0.025, 3.246_97),
            (100.0, 0.975, 129.561),
        ] {
            let value = chi_square_quantile(dof, probability);
            assert!((value - expected).abs() < 5e-4, "{dof} {probability}: {value}");
        }
    }

    #[test]
    fn two_degrees_of_freedom_have_the_closed_form() {
        for value in [0.0, 0.1, 1.0, 7.0, 40.0_f64] {
            let expected = 1.0 - (-value / 2.0).exp();
            assert!((chi_square_cdf(2.0, value) - expected).abs() < 1e-12);
        }
        assert!(chi_square_cdf(0.0, 1.0).is_nan());
        assert!(chi_square_quantile(2.0, 1.5).is_nan());
    }
}

//! Quantiles of the chi-square distribution, as tabulated.

/// The 95 % quantile for two degrees of freedom, `-2 ln 0.05`: the squared Mahalanobis radius of a
/// position's 95 % ellipse.
pub const CONFIDENCE_95_TWO_DIMENSIONS: f64 = 5.991;

/// The 2.5 % and 97.5 % quantiles for 1 to 6 degrees of freedom (NIST/SEMATECH e-Handbook of
/// Statistical Methods, section 1.3.6.7.4).
const TWO_SIDED_95: [(f64, f64); 6] =
    [(0.001, 5.024), (0.051, 7.378), (0.216, 9.348), (0.484, 11.143), (0.831, 12.833), (1.237, 14.449)];

/// The interval that holds a consistent filter's NIS in 95 of 100 cases (2.5 % on either side), for 1 to
/// 6 degrees of freedom; `None` for others.
pub fn two_sided_95(degrees_of_freedom: usize) -> Option<(f64, f64)> {
    TWO_SIDED_95.get(degrees_of_freedom.checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_degrees_of_freedom_match_the_closed_form() {
        // F(x) = 1 - exp(-x/2).
        let (low, high) = two_sided_95(2).unwrap();
        assert!((low + 2.0 * 0.975_f64.ln()).abs() < 5e-4);
        assert!((high + 2.0 * 0.025_f64.ln()).abs() < 5e-4);
        assert!((CONFIDENCE_95_TWO_DIMENSIONS + 2.0 * 0.05_f64.ln()).abs() < 5e-4);
    }

    #[test]
    fn four_degrees_of_freedom_match_the_closed_form() {
        // F(x) = 1 - exp(-x/2) (1 + x/2).
        let below = |x: f64| 1.0 - (-x / 2.0).exp() * (1.0 + x / 2.0);
        let (low, high) = two_sided_95(4).unwrap();
        assert!((below(low) - 0.025).abs() < 1e-4);
        assert!((below(high) - 0.975).abs() < 1e-4);
    }

    #[test]
    fn dimensions_outside_the_table_are_refused() {
        assert!(two_sided_95(0).is_none());
        assert!(two_sided_95(7).is_none());
    }
}

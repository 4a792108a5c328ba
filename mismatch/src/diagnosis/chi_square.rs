//! Tail probabilities.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability that chi-square with so many degrees of freedom exceeds `value`.
pub(crate) fn upper_tail(value: f64, degrees_of_freedom: usize) -> f64 {
    match ChiSquared::new(degrees_of_freedom.max(1) as f64) {
        Ok(distribution) if value.is_finite() => distribution.sf(value.max(0.0)),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::upper_tail;

    #[test]
    fn tails_are_those_of_tables() {
        // Two degrees of freedom: exp(-x/2).
        assert!((upper_tail(20.0, 2) - (-10.0_f64).exp()).abs() < 1e-15);
        assert!((upper_tail(3.841_459, 1) - 0.05).abs() < 1e-7);
        assert!(upper_tail(400.0, 2) > 0.0);
    }
}

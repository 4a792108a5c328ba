//! Normalized innovations of one run.

use super::chi_square::{chi_square_cdf, chi_square_interval, chi_square_quantile};

/// Normalized innovations squared of one run against the chi-square distribution.
///
/// Innovations of a consistent filter are white, so their sum along a run is chi-square distributed with
/// the sum of their dimensions. A gate that has taken away the upper 0.1 % lowers the sum by about 1 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisSummary {
    /// Number of innovations.
    pub count: usize,
    /// Sum of their dimensions.
    pub degrees_of_freedom: usize,
    /// Sum of NIS per degree of freedom: 1 for a consistent filter.
    pub mean_per_degree: f64,
    /// Where `mean_per_degree` lies with 95 % probability.
    pub interval_95: (f64, f64),
    /// Probability of a sum this small or smaller: tiny if the filter trusts itself too little.
    pub lower_tail: f64,
    /// Probability of a sum this large or larger: tiny if the filter trusts itself too much.
    pub upper_tail: f64,
    /// Share of innovations at or below the 95 % quantile of their own dimension.
    pub share_within_95: f64,
}

impl NisSummary {
    /// From pairs of NIS and dimension; `None` if there are none (of dimension 1 or more).
    pub fn from_values(values: impl IntoIterator<Item = (f64, usize)>) -> Option<Self> {
        let mut count = 0_usize;
        let mut degrees_of_freedom = 0_usize;
        let mut sum = 0.0;
        let mut within = 0_usize;
        for (nis, dimension) in values {
            if dimension == 0 {
                continue;
            }
            count += 1;
            degrees_of_freedom += dimension;
            sum += nis;
            within += usize::from(nis <= chi_square_quantile(dimension as f64, 0.95));
        }
        if count == 0 {
            return None;
        }
        let dof = degrees_of_freedom as f64;
        let (low, high) = chi_square_interval(dof, 0.05);
        let lower_tail = chi_square_cdf(dof, sum);
        Some(Self {
            count,
            degrees_of_freedom,
            mean_per_degree: sum / dof,
            interval_95: (low / dof, high / dof),
            lower_tail,
            upper_tail: 1.0 - lower_tail,
            share_within_95: within as f64 / count as f64,
        })
    }

    /// Whether neither tail is smaller than `alpha / 2`.
    pub fn is_consistent(&self, alpha: f64) -> bool {
        self.lower_tail.min(self.upper_tail) >= alpha / 2.0
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn white(scale: f64) -> Vec<(f64, usize)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        (0..900)
            .map(|i| {
                let dimension = i % 3 + 1;
                ((0..dimension).map(|_| (scale * draw()).powi(2)).sum(), dimension)
            })
            .collect()
    }

    #[test]
    fn white_innovations_pass_and_both_kinds_of_misjudgement_are_found() {
        let good = NisSummary::from_values(white(1.0)).unwrap();
        assert!(good.is_consistent(0.01), "{good:?}");
        assert_eq!((good.count, good.degrees_of_freedom), (900, 1800));
        // Binomial sigma of the share is 0.0073.
        assert!((good.share_within_95 - 0.95).abs() < 0.03);

        let overconfident = NisSummary::from_values(white(1.15)).unwrap();
        assert!(!overconfident.is_consistent(0.01) && overconfident.upper_tail < overconfident.lower_tail);
        let timid = NisSummary::from_values(white(0.85)).unwrap();
        assert!(!timid.is_consistent(0.01) && timid.lower_tail < timid.upper_tail);
    }

    #[test]
    fn two_innovations_by_hand() {
        let summary = NisSummary::from_values([(1.0, 1), (7.0, 1)]).unwrap();
        assert!((summary.mean_per_degree - 4.0).abs() < 1e-12);
        // Chi-square with 2 degrees: P(X > 8) = exp(-4).
        assert!((summary.upper_tail - (-4.0_f64).exp()).abs() < 1e-12);
        assert!((summary.share_within_95 - 0.5).abs() < 1e-12);
        assert!(NisSummary::from_values([]).is_none());
    }
}

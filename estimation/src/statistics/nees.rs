//! Normalized estimation errors across runs.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::chi_square::chi_square_interval;

/// `e^T P^-1 e`; `None` if `P` is not positive definite or the shapes do not fit.
pub fn nees(error: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
    if error.is_empty() || covariance.shape() != (error.len(), error.len()) {
        return None;
    }
    let cholesky = Cholesky::new(covariance.clone())?;
    Some(error.dot(&cholesky.solve(error)))
}

/// Average NEES per dimension across runs at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AneesAtTime {
    /// Average NEES per dimension over the runs where it is defined; `None` if it is in none.
    pub anees: Option<f64>,
    /// Runs where it is defined.
    pub runs: usize,
    /// Runs where it is not: the covariance is not positive definite.
    pub undefined: usize,
    /// Where it lies with the corrected probability, were the filter consistent.
    pub interval: (f64, f64),
}

impl AneesAtTime {
    /// Whether it is defined in every run and lies in the interval.
    pub fn is_consistent(&self) -> bool {
        self.undefined == 0
            && self.anees.is_some_and(|anees| (self.interval.0..=self.interval.1).contains(&anees))
    }
}

/// NEES across independent runs at times fixed beforehand.
///
/// Errors along one run are correlated, so sums over time have no known distribution; across runs
/// `runs x dimension x ANEES` is chi-square distributed at each time. The interval is corrected for the
/// number of times (Bonferroni).
#[derive(Clone, Debug, PartialEq)]
pub struct NeesSummary {
    /// One for each time.
    pub times: Vec<AneesAtTime>,
    /// Mean of the defined ANEES over the times; without a known distribution.
    pub overall: Option<f64>,
}

impl NeesSummary {
    /// From the errors and covariances of each run at the same times; `alpha` is the probability that a
    /// consistent filter fails anywhere. `None` if the runs do not all have as many times, the
    /// dimension changes between runs, or there is nothing.
    pub fn from_runs(runs: &[Vec<(DVector<f64>, DMatrix<f64>)>], alpha: f64) -> Option<Self> {
        let count = runs.first()?.len();
        if count == 0 || runs.iter().any(|run| run.len() != count) {
            return None;
        }
        let mut times = Vec::with_capacity(count);
        for index in 0..count {
            let dimension = runs[0][index].0.len();
            if runs.iter().any(|run| run[index].0.len() != dimension) {
                return None;
            }
            let defined: Vec<f64> =
                runs.iter().filter_map(|run| nees(&run[index].0, &run[index].1)).collect();
            let dof = (defined.len() * dimension) as f64;
            let (low, high) = chi_square_interval(dof, alpha / count as f64);
            times.push(AneesAtTime {
                anees: (!defined.is_empty()).then(|| defined.iter().sum::<f64>() / dof),
                runs: defined.len(),
                undefined: runs.len() - defined.len(),
                interval: (low / dof, high / dof),
            });
        }
        let anees: Vec<f64> = times.iter().filter_map(|time| time.anees).collect();
        let overall = (!anees.is_empty()).then(|| anees.iter().sum::<f64>() / anees.len() as f64);
        Some(Self { times, overall })
    }

    /// Whether the filter is consistent at every time.
    pub fn is_consistent(&self) -> bool {
        self.times.iter().all(AneesAtTime::is_consistent)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Errors drawn from a known covariance, reported with `reported` times that covariance.
    fn runs(reported: f64) -> Vec<Vec<(DVector<f64>, DMatrix<f64>)>> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let factor = DMatrix::from_row_slice(3, 3, &[0.3, 0.0, 0.0, 0.1, 0.2, 0.0, -0.05, 0.02, 0.04]);
        let covariance = &factor * factor.transpose();
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        (0..60)
            .map(|_| {
                (0..8)
                    .map(|_| (&factor * DVector::from_fn(3, |_, _| draw()), &covariance * reported))
                    .collect()
            })
            .collect()
    }

    #[test]
    fn true_covariances_pass_and_misstated_ones_fail() {
        let truth = NeesSummary::from_runs(&runs(1.0), 0.01).unwrap();
        assert!(truth.is_consistent(), "{truth:?}");
        assert!((truth.overall.unwrap() - 1.0).abs() < 0.1);
        assert!(!NeesSummary::from_runs(&runs(0.5), 0.01).unwrap().is_consistent());
        assert!(!NeesSummary::from_runs(&runs(2.0), 0.01).unwrap().is_consistent());
    }

    #[test]
    fn one_run_by_hand_and_an_indefinite_covariance_is_undefined() {
        let error = DVector::from_vec(vec![1.0, 2.0]);
        let covariance = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        // [1 2] [2 -1; -1 2]/3 [1 2]^T = (2 - 4 + 8) / 3 = 2.
        assert!((nees(&error, &covariance).unwrap() - 2.0).abs() < 1e-12);
        let indefinite = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        assert_eq!(nees(&error, &indefinite), None);
        let summary =
            NeesSummary::from_runs(&[vec![(error.clone(), covariance)], vec![(error, indefinite)]], 0.05)
                .unwrap();
        assert_eq!((summary.times[0].runs, summary.times[0].undefined), (1, 1));
        assert!((summary.times[0].anees.unwrap() - 1.0).abs() < 1e-12);
        assert!(!summary.is_consistent());
    }

    #[test]
    fn the_interval_widens_with_the_number_of_times() {
        let width = |times: usize| {
            let run = vec![(DVector::from_element(2, 0.5), DMatrix::identity(2, 2)); times];
            let summary = NeesSummary::from_runs(&vec![run; 20], 0.05).unwrap();
            summary.times[0].interval.1 - summary.times[0].interval.0
        };
        assert!(width(10) > width(1));
        // 20 runs of dimension 2: chi-square of 40 degrees, 2.5 % and 97.5 % points 24.433 and 59.342.
        assert!((width(1) - (59.342 - 24.433) / 40.0).abs() < 1e-4);
    }
}

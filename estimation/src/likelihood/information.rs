//! How well the levels are determined: the observed information, and whether the maximum is one in every direction.

use nalgebra::DMatrix;

use super::Evaluate;

/// A 95 % interval is so many standard errors to either side.
const QUANTILE: f64 = 1.959_964;
/// By so much the log-likelihood falls at the end of a 95 % interval: half the 95 % quantile of chi-square with one degree of
/// freedom.
const FALL: f64 = 1.920_729;
/// To either side a parameter is tried so far away (a factor of 55) to see whether the data keep it from there.
const FAR: f64 = 4.0;

/// What is known of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Standard error from the observed information; `None` if the parameter is not determined.
    pub standard_error: Option<f64>,
    /// The same where the model is not quite right: `H^-1 B H^-1` with the outer product of the scores for `B` (Huber 1967,
    /// White 1982).
    pub robust_error: Option<f64>,
    /// By how much the log-likelihood falls at the lower and upper end of the 95 % interval, the other parameters moved along as
    /// the information says: 1.92 for a parabola.
    pub falls: [f64; 2],
    /// Whether the data keep it from being far smaller, and far larger.
    pub bounded: [bool; 2],
}

impl Range {
    /// Whether the data determine the parameter: an interior maximum with a fall to both sides.
    pub fn is_determined(&self) -> bool {
        self.bounded == [true; 2]
            && self.standard_error.is_some()
            // A quarter of what a parabola would fall.
            && self.falls.iter().all(|fall| *fall > 0.25 * FALL)
    }

    /// Whether the log-likelihood falls at the ends of the interval by no more than four times what a parabola would. Where it
    /// falls further it is rough: readings that are taken or left as a whole, with all that follows from it. Such an interval is too narrow.
    pub fn is_smooth(&self) -> bool {
        self.falls.iter().all(|fall| *fall < 4.0 * FALL)
    }

    /// The 95 % interval about `x`.
    pub fn interval(&self, x: f64) -> Option<[f64; 2]> {
        self.standard_error.map(|error| [x - QUANTILE * error, x + QUANTILE * error])
    }
}

/// What the data know of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Information {
    /// By parameter.
    pub ranges: Vec<Range>,
    /// Whether the negative Hessian was positive definite; if not, standard errors are from the scores alone.
    pub definite: bool,
}

/// The observed information at a maximum `x` of `value`, from second differences.
pub fn information(evaluate: &Evaluate, x: &[f64], value: f64) -> Information {
    let size = x.len();
    let moved = |changes: &[(usize, f64)]| {
        let mut point = x.to_vec();
        for (j, by) in changes {
            point[*j] += by;
        }
        point
    };
    let totals = |points: &[Vec<f64>]| -> Vec<f64> {
        evaluate(points).iter().map(|densities| densities.iter().sum()).collect()
    };
    let far: Vec<Vec<f64>> = (0..size).flat_map(|j| [moved(&[(j, -FAR)]), moved(&[(j, FAR)])]).collect();
    let bounded: Vec<[bool; 2]> = totals(&far)
        .chunks_exact(2)
        .map(|sides| [0, 1].map(|side: usize| value - sides[side] >= FALL || sides[side].is_nan()))
        .collect();
    let outer = outer_product(evaluate, x);
    // Steps over which the log-likelihood falls by about a half, so that rounding and roughness do not matter.
    let steps: Vec<f64> =
        (0..size).map(|j| (1.0 / outer[(j, j)].max(1e-9).sqrt()).clamp(0.02, 0.5)).collect();
    let kept: Vec<usize> = (0..size).filter(|j| bounded[*j] == [true; 2]).collect();
    let hessian = hessian(&totals, &moved, &kept, &steps, value);
    let restricted = DMatrix::from_fn(kept.len(), kept.len(), |a, b| outer[(kept[a], kept[b])]);
    let factor = (-&hessian).cholesky();
    let definite = factor.is_some();
    let covariance = factor.or_else(|| restricted.clone().cholesky()).map(|factor| factor.inverse());
    let robust = covariance.as_ref().map(|covariance| covariance * &restricted * covariance);
    let mut ranges: Vec<Range> = bounded
        .into_iter()
        .map(|bounded| Range { standard_error: None, robust_error: None, falls: [0.0; 2], bounded })
        .collect();
    let (Some(covariance), Some(robust)) = (covariance, robust) else {
        return Information { ranges, definite };
    };
    let mut ends = Vec::with_capacity(2 * kept.len());
    for a in 0..kept.len() {
        let error = covariance[(a, a)].sqrt();
        for side in [-1.0, 1.0] {
            // The others where they are likeliest given this one, for a Gaussian.
            let along = |b: usize| side * QUANTILE * covariance[(b, a)] / error;
            ends.push(moved(&kept.iter().enumerate().map(|(b, j)| (*j, along(b))).collect::<Vec<_>>()));
        }
    }
    let ends = totals(&ends);
    for (a, j) in kept.iter().enumerate() {
        ranges[*j].standard_error = Some(covariance[(a, a)].sqrt());
        ranges[*j].robust_error = Some(robust[(a, a)].max(0.0).sqrt());
        ranges[*j].falls = [value - ends[2 * a], value - ends[2 * a + 1]];
    }
    Information { ranges, definite }
}

fn outer_product(evaluate: &Evaluate, x: &[f64]) -> DMatrix<f64> {
    const STEP: f64 = 0.02;
    let size = x.len();
    let points: Vec<Vec<f64>> = (0..size)
        .flat_map(|j| {
            [STEP, -STEP].map(|by| {
                let mut point = x.to_vec();
                point[j] += by;
                point
            })
        })
        .collect();
    let scores: Vec<Vec<f64>> = evaluate(&points)
        .chunks_exact(2)
        .map(|sides| sides[0].iter().zip(&sides[1]).map(|(a, b)| (a - b) / (2.0 * STEP)).collect())
        .collect();
    DMatrix::from_fn(size, size, |i, j| {
        scores[i].iter().zip(&scores[j]).map(|(a, b): (&f64, &f64)| a * b).sum()
    })
}

/// Second differences of the log-likelihood over the kept parameters.
fn hessian(
    totals: &impl Fn(&[Vec<f64>]) -> Vec<f64>,
    moved: &impl Fn(&[(usize, f64)]) -> Vec<f64>,
    kept: &[usize],
    steps: &[f64],
    value: f64,
) -> DMatrix<f64> {
    let sides: Vec<Vec<f64>> =
        kept.iter().flat_map(|j| [moved(&[(*j, steps[*j])]), moved(&[(*j, -steps[*j])])]).collect();
    let sides = totals(&sides);
    let pairs: Vec<(usize, usize)> = (0..kept.len()).flat_map(|a| (0..a).map(move |b| (a, b))).collect();
    let corners: Vec<Vec<f64>> = pairs
        .iter()
        .flat_map(|(a, b)| {
            let (i, j) = (kept[*a], kept[*b]);
            [1.0, -1.0].map(|side| moved(&[(i, side * steps[i]), (j, side * steps[j])]))
        })
        .collect();
    let corners = totals(&corners);
    let mut hessian = DMatrix::zeros(kept.len(), kept.len());
    for (a, j) in kept.iter().enumerate() {
        hessian[(a, a)] = (sides[2 * a] + sides[2 * a + 1] - 2.0 * value) / (steps[*j] * steps[*j]);
    }
    for (pair, (a, b)) in pairs.iter().enumerate() {
        let both = corners[2 * pair] + corners[2 * pair + 1] + 2.0 * value;
        let apart = sides[2 * a] + sides[2 * a + 1] + sides[2 * b] + sides[2 * b + 1];
        let mixed = (both - apart) / (2.0 * steps[kept[*a]] * steps[kept[*b]]);
        hessian[(*a, *b)] = mixed;
        hessian[(*b, *a)] = mixed;
    }
    hessian
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_deviation_is_that_of_the_textbook_and_what_is_in_no_datum_is_not_determined() {
        // n normal variables: the log of the root mean square has standard error 1 / sqrt(2 n).
        let count = 400;
        let evaluate = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let one = |x: &Vec<f64>| {
                // Squares with mean 1 and the spread of chi-square, so that scores are like those of normal variables.
                let of =
                    |k: usize| if k.is_multiple_of(2) { 1.0 + 2.0_f64.sqrt() } else { 1.0 - 2.0_f64.sqrt() };
                (0..count).map(|k| -x[0] - 0.5 * of(k) * (-2.0 * x[0]).exp()).collect()
            };
            points.iter().map(one).collect()
        };
        let value: f64 = evaluate(&[vec![0.0, 0.3]])[0].iter().sum();
        let found = information(&evaluate, &[0.0, 0.3], value);
        let expected = 1.0 / (2.0 * count as f64).sqrt();
        let [known, unknown] = [found.ranges[0], found.ranges[1]];
        assert!(found.definite && known.is_determined());
        // Differences over 0.035 leave an error of that squared.
        assert!((known.standard_error.unwrap() / expected - 1.0).abs() < 5e-3, "{known:?}");
        assert!((known.robust_error.unwrap() / expected - 1.0).abs() < 5e-3, "{known:?}");
        assert!(known.falls.iter().all(|fall| (fall / FALL - 1.0).abs() < 0.1), "{known:?}");
        assert!(!unknown.is_determined() && unknown.bounded == [false; 2]);
        assert!(known.is_smooth());
    }

    #[test]
    fn a_maximum_on_a_ledge_is_said_to_be_rough() {
        // Two data whose scores are opposite, with a standard error of 0.05 together; and a cliff of 30 at 0.08.
        let parabola = |x: f64| [0.5_f64, -0.5].map(|side| -100.0 * x * x + 20.0 * 2.0_f64.sqrt() * side * x);
        let clean = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
            points.iter().map(|x| parabola(x[0]).to_vec()).collect()
        };
        let evaluate = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let ledge = |x: f64| if x.abs() > 0.08 { -15.0 } else { 0.0 };
            points.iter().map(|x| parabola(x[0]).map(|datum| datum + ledge(x[0])).to_vec()).collect()
        };
        assert!(information(&clean, &[0.0], 0.0).ranges[0].is_smooth());
        assert!(!information(&evaluate, &[0.0], 0.0).ranges[0].is_smooth());
    }
}

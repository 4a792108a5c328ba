//! The largest value of a log-likelihood that is a sum over observations.
//!
//! Quasi-Newton (BFGS; Nocedal and Wright 2006, section 6.1) on central differences, begun with the outer product of the
//! observations' scores for curvature (Berndt, Hall, Hall and Hausman 1974), within a box.

use nalgebra::{DMatrix, DVector};

/// Log-densities of all observations at each of several points: a vector per point. The observations are the same, in the same
/// order, at every point.
pub type Evaluate<'a> = dyn Fn(&[Vec<f64>]) -> Vec<Vec<f64>> + 'a;

/// Half the distance of a central difference.
const STEP: f64 = 0.02;
/// Longest step of a parameter.
const LONGEST: f64 = 1.0;
const MOST_ROUNDS: usize = 60;

/// Where a search ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Maximum {
    /// The point.
    pub x: Vec<f64>,
    /// The log-likelihood there.
    pub value: f64,
    /// Whether no step promised more than the tolerance, rather than the rounds having run out.
    pub converged: bool,
    /// How often the observations were folded.
    pub evaluations: usize,
}

/// Climbs from `start` within `[lower, upper]` until a step promises less than `tolerance`.
///
/// It finds a maximum, not the greatest of several: begin from several points.
pub fn maximize(
    evaluate: &Evaluate,
    start: &[f64],
    (lower, upper): (&[f64], &[f64]),
    tolerance: f64,
) -> Maximum {
    let size = start.len();
    let within = |x: &DVector<f64>| DVector::from_fn(size, |j, _| x[j].clamp(lower[j], upper[j]));
    let mut x = within(&DVector::from_column_slice(start));
    let mut evaluations = 1;
    let mut value = total(&evaluate(&[x.as_slice().to_vec()])[0]);
    let mut inverse: Option<DMatrix<f64>> = None;
    let mut last: Option<(DVector<f64>, DVector<f64>)> = None;
    for _ in 0..MOST_ROUNDS {
        let (gradient, outer) = slope(evaluate, &x);
        evaluations += 2 * size;
        // What is at its bound and would go beyond stays.
        let held: Vec<bool> = (0..size)
            .map(|j| (x[j] <= lower[j] && gradient[j] <= 0.0) || (x[j] >= upper[j] && gradient[j] >= 0.0))
            .collect();
        let mut curvature = match (&inverse, &last) {
            (Some(inverse), Some((before, slope_before))) => {
                updated(inverse, &(&x - before), &(slope_before - &gradient))
            }
            _ => inverse_of(&outer),
        };
        let free = |j: usize| if held[j] { 0.0 } else { 1.0 };
        let mut step = masked(&curvature, &gradient, &free);
        if step.dot(&gradient) <= 0.0 {
            curvature = inverse_of(&outer);
            step = masked(&curvature, &gradient, &free);
        }
        let longest = step.amax();
        if longest > LONGEST {
            step *= LONGEST / longest;
        }
        let promised = step.dot(&gradient);
        if promised < tolerance {
            if inverse.is_some() {
                // The curvature learned on the way may only have gone small: the scores have the last word.
                (inverse, last) = (None, None);
                continue;
            }
            let x = x.as_slice().to_vec();
            return Maximum { x, value, converged: true, evaluations };
        }
        let mut gained = None;
        for shares in [[1.0, 0.4], [0.15, 0.05], [0.015, 0.005]] {
            let points: Vec<Vec<f64>> =
                shares.iter().map(|share| within(&(&x + &step * *share)).as_slice().to_vec()).collect();
            evaluations += points.len();
            let values: Vec<f64> = evaluate(&points).iter().map(|densities| total(densities)).collect();
            let best = usize::from(values[1] > values[0]);
            if values[best] > value {
                gained = Some((points[best].clone(), values[best]));
                break;
            }
        }
        let Some((point, higher)) = gained else {
            if inverse.is_some() {
                // The curvature learned on the way has gone wrong: once more from the scores.
                (inverse, last) = (None, None);
                continue;
            }
            let x = x.as_slice().to_vec();
            return Maximum { x, value, converged: promised < 100.0 * tolerance, evaluations };
        };
        last = Some((x, gradient));
        inverse = Some(curvature);
        x = DVector::from_vec(point);
        value = higher;
    }
    Maximum { x: x.as_slice().to_vec(), value, converged: false, evaluations }
}

fn total(densities: &[f64]) -> f64 {
    let sum: f64 = densities.iter().sum();
    if sum.is_finite() { sum } else { f64::NEG_INFINITY }
}

/// Gradient by central differences, and the outer product of the observations' scores.
fn slope(evaluate: &Evaluate, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let size = x.len();
    let mut points = Vec::with_capacity(2 * size);
    for j in 0..size {
        for side in [STEP, -STEP] {
            let mut point = x.as_slice().to_vec();
            point[j] += side;
            points.push(point);
        }
    }
    let values = evaluate(&points);
    let scores: Vec<Vec<f64>> = values
        .chunks_exact(2)
        .map(|sides| sides[0].iter().zip(&sides[1]).map(|(a, b)| (a - b) / (2.0 * STEP)).collect())
        .collect();
    let gradient = DVector::from_iterator(size, scores.iter().map(|of| of.iter().sum()));
    let outer = DMatrix::from_fn(size, size, |i, j| {
        scores[i].iter().zip(&scores[j]).map(|(a, b): (&f64, &f64)| a * b).sum()
    });
    (gradient, outer)
}

/// The inverse of a positive semidefinite matrix, made definite where it is not.
fn inverse_of(outer: &DMatrix<f64>) -> DMatrix<f64> {
    let size = outer.nrows();
    let mut ridge = 1e-3;
    loop {
        let made = outer + DMatrix::from_diagonal_element(size, size, ridge);
        if let Some(factor) = made.cholesky() {
            return factor.inverse();
        }
        if ridge > 1e6 {
            return DMatrix::identity(size, size);
        }
        ridge *= 10.0;
    }
}

/// `H g` over what is free; the inverse restricted to the free rows is close enough for a direction.
fn masked(inverse: &DMatrix<f64>, gradient: &DVector<f64>, free: &impl Fn(usize) -> f64) -> DVector<f64> {
    let size = gradient.len();
    let open = DVector::from_fn(size, |j, _| gradient[j] * free(j));
    let step = inverse * open;
    DVector::from_fn(size, |j, _| step[j] * free(j))
}

/// The BFGS update of the inverse of the negative Hessian; left as it is where the curvature is not that of a maximum.
fn updated(inverse: &DMatrix<f64>, moved: &DVector<f64>, fallen: &DVector<f64>) -> DMatrix<f64> {
    let along = moved.dot(fallen);
    if along <= 1e-10 * moved.norm() * fallen.norm() {
        return inverse.clone();
    }
    let size = moved.len();
    let left = DMatrix::identity(size, size) - moved * fallen.transpose() / along;
    &left * inverse * left.transpose() + moved * moved.transpose() / along
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Observations of normal variables with standard deviations `exp(x_j)`, whose squares have the means given and
    /// are spread about them.
    fn normal(points: &[Vec<f64>], squares: &[f64], count: usize) -> Vec<Vec<f64>> {
        let spread: Vec<f64> = (0..count).map(|k| -(1.0 - (k as f64 + 0.5) / count as f64).ln()).collect();
        let mean = spread.iter().sum::<f64>() / count as f64;
        let one = |point: &Vec<f64>| {
            let of = |j: usize, share: f64| -point[j] - 0.5 * squares[j] * share * (-2.0 * point[j]).exp();
            let all = spread.iter().flat_map(|share| (0..squares.len()).map(move |j| (j, share / mean)));
            all.map(|(j, share)| of(j, share)).collect()
        };
        points.iter().map(one).collect()
    }

    #[test]
    fn the_deviations_of_normal_variables_are_their_root_mean_squares() {
        let squares = [4.0, 0.01, 1e-4];
        let evaluate = |points: &[Vec<f64>]| normal(points, &squares, 50);
        let bounds = (vec![-20.0; 3], vec![20.0; 3]);
        let found = maximize(&evaluate, &[0.0, 0.0, 0.0], (&bounds.0, &bounds.1), 1e-3);
        assert!(found.converged, "{found:?}");
        for (x, square) in found.x.iter().zip(squares) {
            // A step that promises 1e-3 where the curvature is 100 is one of 0.003; differences over 0.04 add a tenth of that.
            assert!((x - 0.5 * f64::ln(square)).abs() < 4e-3, "{found:?}");
        }
    }

    #[test]
    fn what_wants_beyond_its_bound_ends_there() {
        let squares = [4.0, 1e-8];
        let evaluate = |points: &[Vec<f64>]| normal(points, &squares, 50);
        let found = maximize(&evaluate, &[1.0, 1.0], (&[-3.0, -3.0], &[3.0, 3.0]), 1e-6);
        assert!((found.x[0] - 2.0_f64.ln()).abs() < 1e-3 && (found.x[1] + 3.0).abs() < 1e-12, "{found:?}");
    }
}

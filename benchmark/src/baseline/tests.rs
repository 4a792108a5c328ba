use pleiad_mismatch::{Design, DesignColumn};
use pleiad_physics::Effect;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::{Folds, joint, lasso, thresholded};

const ROWS: usize = 3000;
/// Position and size, in standard deviations of the noise, of what is planted.
const PLANTED: [(usize, f64); 3] = [(4, 0.8), (11, -0.5), (17, 0.3)];

/// Independent normal columns, noise of one, and a few of the columns in what is to be explained.
fn design(planted: &[(usize, f64)], seed: u64) -> Design {
    let mut stream = ChaCha12Rng::seed_from_u64(seed);
    let mut draws = || -> Vec<f64> { (0..ROWS).map(|_| StandardNormal.sample(&mut stream)).collect() };
    let columns: Vec<Vec<f64>> = (0..20).map(|_| draws()).collect();
    let mut errors = draws();
    for &(position, size) in planted {
        for (error, value) in errors.iter_mut().zip(&columns[position]) {
            *error += size * value;
        }
    }
    let column = |(index, values): (usize, Vec<f64>)| DesignColumn {
        effect: Effect::ALL[index],
        robot: None,
        parameter: String::new(),
        parts: vec![(0, values)],
    };
    Design {
        errors,
        shares: (0..ROWS).map(|row| row as f64 / ROWS as f64).collect(),
        columns: columns.into_iter().enumerate().map(column).collect(),
    }
}

fn selected(coefficients: &[f64]) -> Vec<usize> {
    (0..coefficients.len()).filter(|&index| coefficients[index] != 0.0).collect()
}

#[test]
fn sparse_regression_finds_what_is_planted_and_its_size() {
    let own = design(&PLANTED, 1);
    let coefficients = thresholded(&Folds::of(&own));
    assert_eq!(selected(&coefficients), PLANTED.map(|(position, _)| position));
    for (position, size) in PLANTED {
        // A column of unit length has elements of one over the root of the rows; four standard errors are 4.
        let expected = size * (ROWS as f64).sqrt();
        assert!((coefficients[position] - expected).abs() < 4.0 + 0.06 * expected.abs(), "{position}");
    }
}

#[test]
fn the_lasso_keeps_what_is_planted_and_its_order() {
    let own = design(&PLANTED, 2);
    let coefficients = lasso(&Folds::of(&own));
    for (position, size) in PLANTED {
        assert!(coefficients[position] * size > 0.0, "{position}: {}", coefficients[position]);
    }
    let strongest = (0..20).max_by(|&a, &b| coefficients[a].abs().total_cmp(&coefficients[b].abs()));
    assert_eq!(strongest, Some(4));
}

#[test]
fn a_lasso_of_orthogonal_columns_is_the_soft_threshold() {
    // Two unit vectors: the minimum of 1/2 (a - y)^2 + p |a| is y - p.
    let own = Design {
        errors: vec![3.0, 0.5, 0.0, 0.0, 0.0],
        shares: vec![0.0; 5],
        columns: vec![
            DesignColumn {
                effect: Effect::Crab,
                robot: None,
                parameter: String::new(),
                parts: vec![(0, vec![1.0])],
            },
            DesignColumn {
                effect: Effect::Push,
                robot: None,
                parameter: String::new(),
                parts: vec![(1, vec![1.0])],
            },
        ],
    };
    let folds = Folds::of(&own);
    let found = super::lasso::descended(&folds.whole, 1.0);
    assert!((found[0] - 2.0).abs() < 1e-12 && found[1] == 0.0, "{found}");
}

#[test]
fn a_joint_fit_names_what_is_planted_and_nothing_of_noise() {
    assert_eq!(selected(&joint(&Folds::of(&design(&PLANTED, 3)))), PLANTED.map(|(position, _)| position));
    assert_eq!(selected(&joint(&Folds::of(&design(&[], 4)))), Vec::<usize>::new());
}

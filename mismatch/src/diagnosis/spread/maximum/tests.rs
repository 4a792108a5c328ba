use super::*;

/// Errors of mean `m` and logarithm of sigma `l`, and a third parameter that pulls below its bound.
struct Normal {
    errors: Vec<f64>,
    blocks: Vec<usize>,
}

impl Density for Normal {
    fn rows(&self) -> usize {
        self.errors.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        for (error, value) in self.errors.iter().zip(into) {
            let z = (error - parameters[0]) * libm::exp(-parameters[1]);
            *value = -0.5 * z * z - parameters[1] - parameters[2];
        }
    }
}

const BOUNDS: [Bounds; 3] = [
    Bounds { low: -100.0, high: 100.0, scale: 1.0 },
    Bounds { low: -20.0, high: 20.0, scale: 0.1 },
    Bounds { low: 0.0, high: 1.0, scale: 0.1 },
];

/// Symmetric about 3, so that mean and spread are closed forms.
fn normal(per_block: usize) -> Normal {
    let errors: Vec<f64> = (0..400).map(|index| 3.0 + 0.01 * (f64::from(index) - 199.5)).collect();
    let blocks = (0..400).map(|index| index / per_block).collect();
    Normal { errors, blocks }
}

#[test]
fn mean_and_spread_are_found_from_afar_and_a_bound_holds() {
    let normal = normal(1);
    let variance = 1e-4 * (400.0_f64 * 400.0 - 1.0) / 12.0;
    for start in [[0.0, 3.0, 0.5], [-5.0, -1.0, 0.0], [3.0, -6.0, 0.0]] {
        let found = maximize(&normal, &BOUNDS, &start, &[0, 1, 2], &|_| true);
        assert!((found.parameters[0] - 3.0).abs() < 1e-3, "{found:?}");
        assert!((found.parameters[1] - 0.5 * variance.ln()).abs() < 1e-3, "{found:?}");
        assert!(found.parameters[2].abs() < 1e-12);
        let expected = -400.0 * (0.5 + 0.5 * variance.ln());
        assert!((found.log_likelihood - expected).abs() < 1e-3);
    }
    let half = maximize(&normal, &BOUNDS, &[0.0; 3], &[0, 1], &|row| row < 200);
    assert!((half.parameters[0] - 2.0).abs() < 1e-2, "rows that are not kept say nothing");
}

#[test]
fn what_no_row_depends_on_is_not_known_and_the_rest_is() {
    struct Idle(Normal);
    impl Density for Idle {
        fn rows(&self) -> usize {
            self.0.rows()
        }

        fn blocks(&self) -> &[usize] {
            self.0.blocks()
        }

        fn fill(&self, parameters: &[f64], into: &mut [f64]) {
            self.0.fill(&[parameters[0], parameters[1], 0.0], into);
        }
    }
    let bounds = [BOUNDS[0], BOUNDS[1], BOUNDS[1]];
    let idle = Idle(normal(1));
    let found = maximize(&idle, &bounds, &[0.0; 3], &[0, 1, 2], &|_| true);
    let known = uncertainty(&idle, &bounds, &found, &[0, 1, 2]).unwrap();
    assert!(known.between(0, 0).is_some() && known.between(2, 2).is_none());
}

#[test]
fn a_curvature_that_bends_the_wrong_way_is_raised_there_alone() {
    let scores = [vec![3.0, -4.0], vec![1.0, 0.0]];
    let wrong = DMatrix::from_row_slice(2, 2, &[20.0, 0.0, 0.0, -0.5]);
    let right = positive(wrong, &scores).unwrap();
    assert!((right[(0, 0)] - 20.0).abs() < 1e-12 && (right[(1, 1)] - FLATTEST).abs() < 1e-12, "{right}");
}

#[test]
fn errors_are_those_of_means_and_grow_where_blocks_hang_together() {
    let [alone, together] = [1, 50].map(|per_block| {
        let normal = normal(per_block);
        let found = maximize(&normal, &BOUNDS, &[0.0; 3], &[0, 1], &|_| true);
        let known = uncertainty(&normal, &BOUNDS, &found, &[0, 1]).unwrap();
        (known.between(0, 0).unwrap(), known.inflation(&[0]))
    });
    let variance = 1e-4 * (400.0_f64 * 400.0 - 1.0) / 12.0;
    assert!((alone.0 / (variance / 400.0) - 1.0).abs() < 1e-3, "{alone:?}");
    // Blocks of 50 neighbours are nearly all of one sign: 50 times the variance, less what varies within.
    assert!((together.1 - 50.0).abs() < 1.0 && alone.1 < 1.001, "{together:?}");
    assert!((together.0 / alone.0 - 50.0).abs() < 1.0);
}

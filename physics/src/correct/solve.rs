//! Two equations in two unknowns that are nearly solved already.

use super::{MOST_ROUNDS, STILL};

/// What may be left of an equation that counts as solved: far below any sensor's noise.
const CLOSE: f64 = 1e-9;

/// Finds where `missing` (measured minus predicted) is zero, from a first guess whose prediction is nearly
/// itself: Broyden's method from the identity, which finds the slopes as it goes (`broyden1965`). An
/// equation that is solved throughout leaves its unknown alone. Where there is no solution, or none is found,
/// it is not a number.
pub(super) fn solve(guess: [f64; 2], missing: impl Fn([f64; 2]) -> [f64; 2]) -> [f64; 2] {
    let mut point = guess;
    // d prediction / d point.
    let mut slope = [[1.0, 0.0], [0.0, 1.0]];
    let mut rest = missing(point);
    for _ in 0..MOST_ROUNDS {
        let [[a, b], [c, d]] = slope;
        let determinant = a * d - b * c;
        let step = [(d * rest[0] - b * rest[1]) / determinant, (a * rest[1] - c * rest[0]) / determinant];
        point = [point[0] + step[0], point[1] + step[1]];
        let length = step[0].abs().max(step[1].abs());
        let scale = point[0].abs().max(point[1].abs()).max(1.0);
        if length.is_nan() || length <= STILL * scale {
            break;
        }
        let left = missing(point);
        let square = step[0] * step[0] + step[1] * step[1];
        for row in 0..2 {
            let surprise = rest[row] - left[row] - (slope[row][0] * step[0] + slope[row][1] * step[1]);
            for column in 0..2 {
                slope[row][column] += surprise * step[column] / square;
            }
        }
        rest = left;
    }
    let scale = guess[0].abs().max(guess[1].abs()).max(1.0);
    let solved = missing(point).iter().all(|left| left.abs() <= CLOSE * scale);
    if solved { point } else { [f64::NAN; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_whose_fixed_point_diverges_is_solved() {
        // b + c b^3 at 2.8: its slope is 2.2 there, so that a plain fixed point would run away.
        let read = 2.8 + 0.05 * 2.8_f64.powi(3);
        let [found, other] = solve([read, 7.0], |[b, _]| [read - b - 0.05 * b.powi(3), 0.0]);
        assert!((found - 2.8).abs() < 1e-12, "{found}");
        assert_eq!(other.to_bits(), 7.0_f64.to_bits());
    }

    #[test]
    fn coupled_equations_are_solved() {
        // x + y/2 = 2, y - x/3 = 1: x = 9/7, y = 10/7.
        let [x, y] = solve([2.0, 1.0], |[x, y]| [2.0 - x - 0.5 * y, 1.0 - y + x / 3.0]);
        assert!((x - 9.0 / 7.0).abs() < 1e-12 && (y - 10.0 / 7.0).abs() < 1e-12, "{x} {y}");
    }

    #[test]
    fn without_a_solution_it_is_not_a_number() {
        assert!(solve([1.0, 0.0], |_| [1.0, 0.0])[0].is_nan());
        // |x| + 0.5 is never 0.4.
        assert!(solve([0.4, 0.0], |[x, _]| [0.4 - x.abs() - 0.5, 0.0])[0].is_nan());
    }
}

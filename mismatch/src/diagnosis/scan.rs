//! Where on the map an effect would explain most: every rectangle of a grid, from sums over its cells.
//!
//! A place where a robot was for seconds is lost in the squares of a coarse grid, because most of what is in them says
//! that nothing acts. The gain of an effect inside a rectangle is the squared sum of its scores over the sum of its
//! information; both are differences of four corners of their cumulative sums, so that all rectangles can be tried.

use pleiad_physics::Region;

use crate::channel::Channel;
use crate::diagnosis::candidate::Candidate;
use crate::diagnosis::fit::State;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::Unit;
use crate::diagnosis::white::White;

/// The most cells on a side.
const CELLS: usize = 40;
/// Cells are no smaller than this, metres.
const LEAST_CELL_M: f64 = 0.1;
/// A rectangle is at most so many cells wide: greater ones are among the coarse squares.
const WIDEST: usize = 16;
/// The fewest elements of residuals in a rectangle.
const FEWEST: f64 = 4.0;
/// Bounds are found to this, metres.
const SHARP_M: f64 = 0.02;
/// So many rectangles that do not overlap are told.
const TOLD: usize = 2;

/// The grid over all that was driven.
struct Grid {
    low: [f64; 2],
    cell_m: f64,
    cells: [usize; 2],
}

impl Grid {
    fn new(units: &[&Unit<'_>]) -> Option<Self> {
        let places = || {
            let rows = units.iter().flat_map(|unit| &unit.rows);
            rows.filter_map(|row| row.regime.pose.map(|pose| pose.position()))
        };
        let bound = |axis: usize, worst: f64, pick: fn(f64, f64) -> f64| {
            places().map(|place| place[axis]).fold(worst, pick)
        };
        let low = [0, 1].map(|axis| bound(axis, f64::INFINITY, f64::min));
        let high = [0, 1].map(|axis| bound(axis, f64::NEG_INFINITY, f64::max));
        let side_m = (high[0] - low[0]).max(high[1] - low[1]);
        if !side_m.is_finite() {
            return None;
        }
        let cell_m = (side_m / CELLS as f64).max(LEAST_CELL_M);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most CELLS")]
        let cells = [0, 1].map(|axis| ((high[axis] - low[axis]) / cell_m) as usize + 1);
        Some(Self { low, cell_m, cells })
    }

    fn cell(&self, place: [f64; 2]) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the grid")]
        let [column, row] = [0, 1].map(|axis| ((place[axis] - self.low[axis]) / self.cell_m) as usize);
        row.min(self.cells[1] - 1) * self.cells[0] + column.min(self.cells[0] - 1)
    }

    /// Sums over all cells below and to the left of every corner.
    fn cumulated(&self, of_cell: &[f64]) -> Vec<f64> {
        let [columns, rows] = self.cells;
        let mut sums = vec![0.0; (columns + 1) * (rows + 1)];
        for row in 0..rows {
            let mut line = 0.0;
            for column in 0..columns {
                line += of_cell[row * columns + column];
                sums[(row + 1) * (columns + 1) + column + 1] = sums[row * (columns + 1) + column + 1] + line;
            }
        }
        sums
    }

    fn bounds(&self, [x0, x1, y0, y1]: [usize; 4]) -> [f64; 4] {
        let at = |axis: usize, cell: usize| self.low[axis] + cell as f64 * self.cell_m;
        [at(0, x0), at(0, x1), at(1, y0), at(1, y1)]
    }
}

/// How many rectangles of a grid can be told apart by where the robots were: what a probability is multiplied by.
pub(crate) fn rectangles(units: &[&Unit<'_>]) -> f64 {
    let Some(grid) = Grid::new(units) else { return 1.0 };
    let mut visited = vec![false; grid.cells[0] * grid.cells[1]];
    for place in units.iter().flat_map(|unit| &unit.rows).filter_map(|row| row.regime.pose) {
        visited[grid.cell(place.position())] = true;
    }
    let count = visited.into_iter().filter(|visited| *visited).count() as f64;
    (0.5 * count * (count + 1.0)).max(1.0)
}

/// The rectangles in which a candidate that acts everywhere would gain most beside the states of its units.
pub(crate) fn best_rectangles(
    everywhere: &Candidate,
    units: &[&Unit<'_>],
    states: &[State],
) -> Vec<[f64; 4]> {
    let columns = everywhere.columns(units);
    let acting: Vec<&Unit<'_>> = columns.iter().map(|(unit, _)| units[*unit]).collect();
    let Some(grid) = Grid::new(&acting) else { return Vec::new() };
    let cells = grid.cells[0] * grid.cells[1];
    let along = everywhere.along.len().max(1);
    let mut points: Vec<Point> = Vec::new();
    for (unit, columns) in &columns {
        let (unit, white) = (units[*unit], White::new(units[*unit], &states[*unit], &[]));
        for (position, column) in columns.iter().enumerate() {
            for (stretch, part) in unit.stretches.iter().zip(white.of(column)) {
                let Some(part) = part else { continue };
                for (index, value) in stretch.range().zip(part) {
                    let Some(pose) = unit.rows[index].regime.pose.filter(|_| value != 0.0) else { continue };
                    let (score, information) = (value * white.errors[index], value * value);
                    points.push(Point { place: pose.position(), along: position, score, information });
                }
            }
        }
    }
    let mut counts = vec![0.0; cells];
    let mut sums = vec![[vec![0.0; cells], vec![0.0; cells]]; along];
    for point in &points {
        let cell = grid.cell(point.place);
        counts[cell] += 1.0;
        sums[point.along][0][cell] += point.score;
        sums[point.along][1][cell] += point.information;
    }
    let counts = grid.cumulated(&counts);
    let sums: Vec<[Vec<f64>; 2]> =
        sums.iter().map(|own| [grid.cumulated(&own[0]), grid.cumulated(&own[1])]).collect();
    let mut told: Vec<[usize; 4]> = Vec::new();
    while told.len() < TOLD
        && let Some(next) = best(&grid, &counts, &sums, &told)
    {
        told.push(next);
    }
    // Where a robot is in the middle of a window says little of where in it a border lies.
    let by_windows = touches(everywhere.term.effect, Channel::Body);
    let bounds = told.into_iter().map(|own| grid.bounds(own));
    if by_windows {
        return bounds.collect();
    }
    bounds.map(|own| sharpened(own, &points, along, grid.cell_m)).collect()
}

/// What an element of residuals says of a parameter, and where the robot was.
struct Point {
    place: [f64; 2],
    along: usize,
    score: f64,
    information: f64,
}

/// Twice the log-likelihood gained inside a rectangle; 0 of too few elements.
fn gain(bounds: [f64; 4], points: &[Point], along: usize) -> f64 {
    let region = Region::from_bounds(bounds);
    let mut sums = vec![[0.0; 2]; along];
    let mut count = 0.0;
    for point in points.iter().filter(|point| region.contains(point.place)) {
        count += 1.0;
        sums[point.along][0] += point.score;
        sums[point.along][1] += point.information;
    }
    if count < FEWEST {
        return 0.0;
    }
    sums.iter().filter(|own| own[1] > 0.0).map(|[score, information]| score * score / information).sum()
}

/// The rectangle with each bound moved by halving steps to where it gains most: what lies in its cells and not in the
/// place speaks against all of it.
fn sharpened(mut bounds: [f64; 4], points: &[Point], along: usize, cell_m: f64) -> [f64; 4] {
    let mut most = gain(bounds, points, along);
    let mut step_m = cell_m;
    while step_m >= SHARP_M {
        let mut moved = false;
        for bound in 0..4 {
            for change in [-step_m, step_m] {
                let mut next = bounds;
                next[bound] += change;
                let own = gain(next, points, along);
                if own > most * (1.0 + 1e-9) {
                    (bounds, most, moved) = (next, own, true);
                }
            }
        }
        if !moved {
            step_m *= 0.5;
        }
    }
    bounds
}

/// The best rectangle that overlaps none of others: first and last columns and rows, the last not in it.
fn best(grid: &Grid, counts: &[f64], sums: &[[Vec<f64>; 2]], others: &[[usize; 4]]) -> Option<[usize; 4]> {
    let [columns, rows] = grid.cells;
    let line = columns + 1;
    let mut most: (f64, Option<[usize; 4]>) = (0.0, None);
    for y0 in 0..rows {
        for y1 in y0 + 1..=rows.min(y0 + WIDEST) {
            for x0 in 0..columns {
                let left = (counts[y1 * line + x0], counts[y0 * line + x0]);
                for x1 in x0 + 1..=columns.min(x0 + WIDEST) {
                    let inside = counts[y1 * line + x1] - counts[y0 * line + x1] - left.0 + left.1;
                    if inside < FEWEST {
                        continue;
                    }
                    let of = |sums: &[f64]| {
                        sums[y1 * line + x1] - sums[y0 * line + x1] - sums[y1 * line + x0]
                            + sums[y0 * line + x0]
                    };
                    let gain = |[score, information]: &[Vec<f64>; 2]| {
                        let information = of(information);
                        if information > 0.0 { of(score).powi(2) / information } else { 0.0 }
                    };
                    let gain: f64 = sums.iter().map(gain).sum();
                    let apart =
                        |[a0, a1, b0, b1]: &[usize; 4]| x1 <= *a0 || x0 >= *a1 || y1 <= *b0 || y0 >= *b1;
                    if gain > most.0 && others.iter().all(apart) {
                        most = (gain, Some([x0, x1, y0, y1]));
                    }
                }
            }
        }
    }
    most.1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every rectangle by its own sum, which cumulative sums must not differ from.
    #[test]
    fn the_best_rectangle_is_that_of_all_sums_taken_one_by_one() {
        let grid = Grid { low: [0.0; 2], cell_m: 1.0, cells: [6, 5] };
        let mut draw = 1_u32;
        let mut next = || {
            draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(draw >> 8) / f64::from(1_u32 << 24) - 0.5
        };
        let scores: Vec<f64> = (0..30).map(|_| next()).collect();
        let information: Vec<f64> = (0..30).map(|_| 1.0 + next()).collect();
        let mut slow = (0.0, [0; 4]);
        for y0 in 0..5 {
            for y1 in y0 + 1..=5 {
                for x0 in 0..6 {
                    for x1 in x0 + 1..=6 {
                        let own = |all: &[f64]| -> f64 {
                            (y0..y1).flat_map(|y| (x0..x1).map(move |x| y * 6 + x)).map(|at| all[at]).sum()
                        };
                        let gain = own(&scores).powi(2) / own(&information);
                        if (x1 - x0) * (y1 - y0) >= 4 && gain > slow.0 {
                            slow = (gain, [x0, x1, y0, y1]);
                        }
                    }
                }
            }
        }
        let sums = [[grid.cumulated(&scores), grid.cumulated(&information)]];
        let counts = grid.cumulated(&[1.0; 30]);
        let found = best(&grid, &counts, &sums, &[]).expect("a rectangle");
        assert_eq!(found, slow.1);
        let second = best(&grid, &counts, &sums, &[found]).expect("another");
        assert!(
            second[1] <= found[0] || second[0] >= found[1] || second[3] <= found[2] || second[2] >= found[3]
        );
    }
}

//! Occupancy grids: cells with the probability that something is in them.

/// Of a cell of which nothing is known.
pub(super) const UNKNOWN: f64 = 0.5;
/// The global grid is finer than the local one by this: what is cut from it at a pose is then interpolated over parts of
/// a cell alone.
const FINER: f64 = 4.0;
/// Walls that are near to some cell of a block are sought once for the block; its side in cells.
const BLOCK: usize = 16;

/// How occupied a cell is whose centre is so far from a surface: 1 on it, 0 from a cell away on, on either side alike.
pub(super) fn occupancy(distance_m: f64, cell_m: f64) -> f64 {
    (1.0 - distance_m / cell_m).max(0.0)
}

/// A grid over a rectangle of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Lower left corner, metres.
    origin_m: [f64; 2],
    /// Side of a cell of what is compared, metres; this grid's own are a quarter of it.
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// From the centres to the nearest wall, metres, row by row from below.
    distances_m: Vec<f64>,
}

impl Grid {
    /// The map's own grid: a cell is as occupied as a wall is near to its centre, from on the wall to a cell away, and free
    /// beyond. Outside the walls' extent and a margin around it nothing is known. `None` if there is no wall.
    pub fn of_walls(walls: &[[f64; 4]], cell_m: f64, margin_m: f64) -> Option<Self> {
        let (low, high) = extent(walls)?;
        let origin_m = low.map(|end| end - margin_m);
        let side_m = cell_m / FINER;
        // The cast saturates; the size was checked by who calls.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let [columns, rows] =
            [0, 1].map(|axis| ((high[axis] + margin_m - origin_m[axis]) / side_m).ceil() as usize);
        let mut distances_m = vec![f64::INFINITY; columns * rows];
        let centre = |column: f64, row: f64| [origin_m[0] + column * side_m, origin_m[1] + row * side_m];
        for first_row in (0..rows).step_by(BLOCK) {
            for first_column in (0..columns).step_by(BLOCK) {
                let half = 0.5 * BLOCK as f64;
                let middle = centre(first_column as f64 + half, first_row as f64 + half);
                let far: Vec<f64> = walls.iter().map(|wall| distance_m(middle, wall)).collect();
                // No cell of the block is farther from its middle than half the diagonal.
                let least = far.iter().copied().fold(f64::INFINITY, f64::min);
                let most = least + 2.0 * half * side_m * std::f64::consts::SQRT_2;
                let near: Vec<&[f64; 4]> =
                    walls.iter().zip(&far).filter(|(_, far)| **far <= most).map(|(wall, _)| wall).collect();
                for row in first_row..(first_row + BLOCK).min(rows) {
                    for column in first_column..(first_column + BLOCK).min(columns) {
                        let at = centre(column as f64 + 0.5, row as f64 + 0.5);
                        distances_m[row * columns + column] =
                            near.iter().map(|wall| distance_m(at, wall)).fold(f64::INFINITY, f64::min);
                    }
                }
            }
        }
        Some(Self { origin_m, cell_m, columns, rows, distances_m })
    }

    /// Probability of a cell of the local grid with its centre at a point; unknown outside.
    pub fn at(&self, point_m: [f64; 2]) -> f64 {
        self.distance_m(point_m).map_or(UNKNOWN, |distance_m| occupancy(distance_m, self.cell_m))
    }

    /// From a point to the nearest wall, interpolated between the centres of the four cells around it; `None` outside.
    pub fn distance_m(&self, [x_m, y_m]: [f64; 2]) -> Option<f64> {
        let side_m = self.cell_m / FINER;
        let column = (x_m - self.origin_m[0]) / side_m - 0.5;
        let row = (y_m - self.origin_m[1]) / side_m - 0.5;
        // Also false for what is not a number.
        if !(column >= 0.0 && row >= 0.0) {
            return None;
        }
        // A cast of what is far outside saturates and stays outside.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (left, below) = (column as usize, row as usize);
        if left.saturating_add(1) >= self.columns || below.saturating_add(1) >= self.rows {
            return None;
        }
        let (share_x, share_y) = (column - left as f64, row - below as f64);
        let index = below * self.columns + left;
        let lower = self.distances_m.get(index..index + 2)?;
        let upper = self.distances_m.get(index + self.columns..index + self.columns + 2)?;
        let lower = lower[0] + share_x * (lower[1] - lower[0]);
        let upper = upper[0] + share_x * (upper[1] - upper[0]);
        Some(lower + share_y * (upper - lower))
    }

    /// Whether every point within `reach_m` of this one is in the grid and free.
    pub(super) fn is_free_around(&self, point_m: [f64; 2], reach_m: f64) -> bool {
        let side_m = self.cell_m / FINER;
        let sides_m = [self.columns, self.rows].map(|count| count as f64 * side_m);
        let inside = (0..2).all(|axis| {
            let from_low_m = point_m[axis] - self.origin_m[axis];
            from_low_m.min(sides_m[axis] - from_low_m) > reach_m + side_m
        });
        // Interpolation errs by less than a cell of this grid.
        inside && self.distance_m(point_m).is_some_and(|far_m| far_m > reach_m + self.cell_m + side_m)
    }
}

/// From a point to a segment, metres.
pub(super) fn distance_m([x, y]: [f64; 2], &[x0, y0, x1, y1]: &[f64; 4]) -> f64 {
    let (along_x, along_y) = (x1 - x0, y1 - y0);
    let squared = along_x * along_x + along_y * along_y;
    let share = if squared > 0.0 { ((x - x0) * along_x + (y - y0) * along_y) / squared } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    (x - x0 - share * along_x).hypot(y - y0 - share * along_y)
}

/// Lower left and upper right corner of the walls.
pub(super) fn extent(walls: &[[f64; 4]]) -> Option<([f64; 2], [f64; 2])> {
    let of = |axis: usize| walls.iter().flat_map(move |wall| [wall[axis], wall[axis + 2]]);
    let low = [0, 1].map(|axis| of(axis).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|axis| of(axis).fold(f64::NEG_INFINITY, f64::max));
    (!walls.is_empty()).then_some((low, high))
}

/// The cells that a segment goes through, in order, each with the length in it, metres (`amanatides1987`).
pub fn cells_on(from: [f64; 2], to: [f64; 2], origin_m: [f64; 2], cell_m: f64) -> Vec<([i64; 2], f64)> {
    let start = [0, 1].map(|axis| (from[axis] - origin_m[axis]) / cell_m);
    let along = [0, 1].map(|axis| (to[axis] - from[axis]) / cell_m);
    let length_m = cell_m * along[0].hypot(along[1]);
    // Casts of coordinates within a map.
    #[allow(clippy::cast_possible_truncation)]
    let mut cell = start.map(|at| at.floor() as i64);
    // At which share of the segment the next border is crossed, and how far apart borders are.
    let step = along.map(|way| if way > 0.0 { 1 } else { -1 });
    let apart = along.map(|way| if way == 0.0 { f64::INFINITY } else { 1.0 / way.abs() });
    let mut next = [0, 1].map(|axis| {
        let border = cell[axis] as f64 + if step[axis] > 0 { 1.0 } else { 0.0 };
        if along[axis] == 0.0 { f64::INFINITY } else { (border - start[axis]) / along[axis] }
    });
    let mut cells = Vec::new();
    let mut done = 0.0;
    loop {
        let axis = usize::from(next[1] < next[0]);
        let until = next[axis].min(1.0);
        cells.push((cell, (until - done).max(0.0) * length_m));
        if next[axis] >= 1.0 || !next[axis].is_finite() {
            return cells;
        }
        done = until;
        cell[axis] += step[axis];
        next[axis] += apart[axis];
    }
}

/// The sums of a match over pairs of cells of `G` and `G'`, `|A| = sum |a_ij|`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Match {
    /// `|G - G'|`
    apart: f64,
    /// `|G - 1/2| + |G' - 1/2|`
    known: f64,
    /// `|G| + |G'|`
    pub(super) seen: f64,
}

impl Match {
    pub(super) fn add(&mut self, [ours, map]: [f64; 2]) {
        self.apart += (ours - map).abs();
        self.known += (ours - UNKNOWN).abs() + (map - UNKNOWN).abs();
        self.seen += ours + map;
    }

    /// `f`, from 0 to 1. `None` if nothing is known of any cell, or if too little is seen.
    pub(super) fn score(&self, mu_min: f64) -> Option<f64> {
        (self.known > 0.0 && self.seen >= mu_min).then(|| 1.0 - self.apart / self.known)
    }
}

/// `f = 1 - |G - G'| / (|G - 1/2| + |G' - 1/2|)` with `|A| = sum |a_ij|`, over pairs of cells of `G` and `G'`: from 0 to 1.
/// `None` if nothing is known of any cell, or if `|G| + |G'|` is below `mu_min`: then there is too little to match.
pub fn match_score(pairs: impl Iterator<Item = [f64; 2]>, mu_min: f64) -> Option<f64> {
    let mut sums = Match::default();
    pairs.for_each(|pair| sums.add(pair));
    sums.score(mu_min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_grids_match_by_one_and_opposite_ones_by_zero() {
        let score = |pairs: &[[f64; 2]]| match_score(pairs.iter().copied(), 0.0);
        assert_eq!(score(&[[0.95, 0.95], [0.05, 0.05]]), Some(1.0));
        assert_eq!(score(&[[1.0, 0.0], [0.0, 1.0]]), Some(0.0));
        // One knows and the other does not: |G - 1/2| is all there is, and all of it is apart.
        assert!(score(&[[0.9, 0.5]]).unwrap().abs() < 1e-15);
        assert_eq!(score(&[[0.5, 0.5]]), None);
        assert_eq!(match_score([[0.95, 0.95]].into_iter(), 2.0), None);
    }

    #[test]
    fn the_match_lies_between_zero_and_one_for_any_grids() {
        // A linear congruence stands in for chance.
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..2000 {
            let pairs: Vec<[f64; 2]> = (0..7).map(|_| [draw(), draw()]).collect();
            let score = match_score(pairs.into_iter(), 0.0).unwrap();
            assert!((-1e-12..=1.0 + 1e-12).contains(&score), "{score}");
        }
    }

    #[test]
    fn a_ray_goes_through_the_cells_that_geometry_has_it_in() {
        let cells = |from, to| cells_on(from, to, [0.0, 0.0], 1.0);
        let flat = cells([0.5, 0.5], [3.25, 0.5]);
        let expected = [([0, 0], 0.5), ([1, 0], 1.0), ([2, 0], 1.0), ([3, 0], 0.25)];
        assert_eq!(flat.len(), expected.len());
        for ((cell, length), (wanted, wanted_m)) in flat.into_iter().zip(expected) {
            assert!(cell == wanted && (length - wanted_m).abs() < 1e-12, "{cell:?} {length}");
        }
        // Down and to the left, slope 1/2, from the middle of a cell.
        let steep: Vec<[i64; 2]> = cells([2.5, 1.5], [0.5, 0.5]).into_iter().map(|(cell, _)| cell).collect();
        assert!(steep.starts_with(&[[2, 1], [1, 1]]) && steep.ends_with(&[[0, 0]]), "{steep:?}");
        // Whatever the direction, the lengths add up and neighbours share a side.
        for step in 0..64 {
            let angle = 0.098 * f64::from(step) + 0.013;
            let to = [0.3 + 7.7 * angle.cos(), -0.2 + 7.7 * angle.sin()];
            let ray = cells_on([0.3, -0.2], to, [-1.0, -1.0], 0.25);
            let sum: f64 = ray.iter().map(|(_, length)| length).sum();
            assert!((sum - 7.7).abs() < 1e-9, "{angle}: {sum}");
            for pair in ray.windows(2) {
                let moved: i64 = (0..2).map(|axis| (pair[1].0[axis] - pair[0].0[axis]).abs()).sum();
                assert_eq!(moved, 1, "{angle}");
            }
        }
    }

    #[test]
    fn walls_are_occupied_and_the_room_is_free() {
        let room = [[0.0, 0.0, 2.0, 0.0], [2.0, 0.0, 2.0, 1.0], [2.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];
        let grid = Grid::of_walls(&room, 0.1, 0.2).unwrap();
        assert!(
            grid.at([1.0, 0.5]) == 0.0
                && grid.at([-5.0, 0.0]) == UNKNOWN
                && grid.at([f64::NAN; 2]) == UNKNOWN
        );
        // A cell half a cell from the wall is half occupied, on both sides.
        for y in [-0.05, 0.05] {
            assert!((grid.at([1.0, y]) - 0.5).abs() < 1e-9);
        }
        assert!(grid.at([1.0, 0.1]) < 1e-9 && grid.at([1.0, 0.0]) > 0.85);
        // Blocks know of every wall that is the nearest of one of their cells.
        for step in 0..400 {
            let at = [-0.15 + 0.0055 * f64::from(step), 1.1 - 0.003 * f64::from(step)];
            let exact = room.iter().map(|wall| distance_m(at, wall)).fold(f64::INFINITY, f64::min);
            assert!((grid.distance_m(at).unwrap() - exact).abs() < 0.025, "{at:?}");
        }
        assert!(grid.is_free_around([1.0, 0.5], 0.3) && !grid.is_free_around([1.0, 0.5], 0.45));
        assert!((distance_m([1.0, 2.0], &[0.0, 0.0, 3.0, 0.0]) - 2.0).abs() < 1e-15);
        assert!((distance_m([6.0, 4.0], &[0.0, 0.0, 3.0, 0.0]) - 5.0).abs() < 1e-15);
        assert!(Grid::of_walls(&[], 0.1, 0.2).is_none());
    }
}

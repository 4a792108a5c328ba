//! Occupancy grids: cells with the probability that something is in them.

/// Of a cell of which nothing is known.
pub(super) const UNKNOWN: f64 = 0.5;
/// Of a cell that a beam met something in, and of one that it went through: an inverse sensor model of two values.
pub(super) const OCCUPIED: f64 = 0.95;
pub(super) const FREE: f64 = 0.05;

/// A grid over a rectangle of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Lower left corner, metres.
    origin_m: [f64; 2],
    /// Side of a cell, metres.
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// Probabilities, row by row from below.
    cells: Vec<f64>,
}

impl Grid {
    /// The map's own grid: a cell is as occupied as a wall is near to its centre, from on the wall to a cell away, and free
    /// beyond. Outside the walls' extent and a margin around it nothing is known. `None` if there is no wall.
    pub fn of_walls(walls: &[[f64; 4]], cell_m: f64, margin_m: f64) -> Option<Self> {
        let (low, high) = extent(walls)?;
        let origin_m = low.map(|end| end - margin_m);
        // The cast saturates; the size was checked by who calls.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let [columns, rows] =
            [0, 1].map(|axis| ((high[axis] + margin_m - origin_m[axis]) / cell_m).ceil() as usize);
        let centre = |index: usize| {
            let (column, row) = (index % columns, index / columns);
            [origin_m[0] + (column as f64 + 0.5) * cell_m, origin_m[1] + (row as f64 + 0.5) * cell_m]
        };
        let occupied = |index: usize| {
            let nearest_m =
                walls.iter().map(|wall| distance_m(centre(index), wall)).fold(f64::INFINITY, f64::min);
            FREE + (OCCUPIED - FREE) * (1.0 - nearest_m / cell_m).max(0.0)
        };
        Some(Self { origin_m, cell_m, columns, rows, cells: (0..columns * rows).map(occupied).collect() })
    }

    /// Probability at a point, interpolated between the centres of the four cells around it; unknown outside.
    pub fn at(&self, [x_m, y_m]: [f64; 2]) -> f64 {
        let column = (x_m - self.origin_m[0]) / self.cell_m - 0.5;
        let row = (y_m - self.origin_m[1]) / self.cell_m - 0.5;
        let (left, below) = (column.floor(), row.floor());
        let (share_x, share_y) = (column - left, row - below);
        // A cast of what is far outside saturates and stays outside.
        #[allow(clippy::cast_possible_truncation)]
        let (left, below) = (left as i64, below as i64);
        let value =
            |column: i64, row: i64| self.index([column, row]).map_or(UNKNOWN, |index| self.cells[index]);
        let lower = (1.0 - share_x) * value(left, below) + share_x * value(left + 1, below);
        let upper = (1.0 - share_x) * value(left, below + 1) + share_x * value(left + 1, below + 1);
        (1.0 - share_y) * lower + share_y * upper
    }

    /// The cell in a column and row, if it is in the grid.
    fn index(&self, [column, row]: [i64; 2]) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    /// Probability of the cell in a column and row, if it is in the grid.
    pub fn cell(&self, cell: [i64; 2]) -> Option<f64> {
        self.index(cell).map(|index| self.cells[index])
    }
}

/// From a point to a segment, metres.
fn distance_m([x, y]: [f64; 2], &[x0, y0, x1, y1]: &[f64; 4]) -> f64 {
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

/// `f = 1 - |G - G'| / (|G - 1/2| + |G' - 1/2|)` with `|A| = sum |a_ij|`, over pairs of cells of `G` and `G'`: from 0 to 1.
/// `None` if nothing is known of any cell, or if `|G| + |G'|` is below `mu_min`: then there is too little to match.
pub fn match_score(pairs: impl Iterator<Item = [f64; 2]>, mu_min: f64) -> Option<f64> {
    let (mut apart, mut known, mut seen) = (0.0, 0.0, 0.0);
    for [ours, map] in pairs {
        apart += (ours - map).abs();
        known += (ours - UNKNOWN).abs() + (map - UNKNOWN).abs();
        seen += ours + map;
    }
    (known > 0.0 && seen >= mu_min).then(|| 1.0 - apart / known)
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
        assert!(grid.at([1.0, 0.5]) < 0.1 && grid.at([-5.0, 0.0]) == UNKNOWN);
        // The lower wall is the border of two rows, half a cell from the centres of both; the next row is free.
        for row in [1, 2] {
            assert!((grid.cell([10, row]).unwrap() - 0.5 * (OCCUPIED + FREE)).abs() < 1e-9);
        }
        assert!((grid.cell([10, 3]).unwrap() - FREE).abs() < 1e-9);
        assert!((distance_m([1.0, 2.0], &[0.0, 0.0, 3.0, 0.0]) - 2.0).abs() < 1e-15);
        assert!((distance_m([6.0, 4.0], &[0.0, 0.0, 3.0, 0.0]) - 5.0).abs() < 1e-15);
        assert!(Grid::of_walls(&[], 0.1, 0.2).is_none());
    }
}

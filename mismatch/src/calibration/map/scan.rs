//! What the sensor sees around the robot, as a grid.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_physics::Pose;
use pleiad_recording::BeamSample;

use super::grid::{cells_on, distance_m, occupancy};

/// Beams farther apart than this do not see one surface.
const NEIGHBOURS_RAD: f64 = 0.5;

/// A cell of the local grid of which a beam says something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalCell {
    /// Its centre in the frame of the robot, metres.
    pub centre_m: [f64; 2],
    /// Probability that it is occupied.
    pub occupied: f64,
}

/// The local grid: what recent scans say of the cells around the robot, in its frame, on average over the scans that say
/// something of a cell; the others are left out, as unknown.
///
/// A cell near to a place that a beam met is as occupied as the surface there is near to its centre, as in the map's grid,
/// **before the surface and behind it alike**. A cell that was occupied where a beam ends and free just before would know
/// nothing behind: then a pose too near to a wall costs more than one as much too far, and all that is matched shrinks
/// toward the middle of the room. How a surface goes on the neighbours of a beam tell; where they do not lie on a line with
/// it, as at corners and edges, nothing is said. And nothing is said of cells that a beam goes through near to the chord
/// between the ends of neighbours, where a wall that is seen at a flat angle goes on.
pub fn local_grid(scans: &[(Pose<f64>, &[BeamSample])], cell_m: f64) -> Vec<LocalCell> {
    let mut all: BTreeMap<[i64; 2], (f64, u32)> = BTreeMap::new();
    for (pose, beams) in scans {
        for (cell, occupied) in one_scan(pose, beams, cell_m) {
            let (sum, count) = all.entry(cell).or_insert((0.0, 0));
            *sum += occupied;
            *count += 1;
        }
    }
    let cell = |(cell, (sum, count)): ([i64; 2], (f64, u32))| LocalCell {
        centre_m: centre(cell, cell_m),
        occupied: sum / f64::from(count),
    };
    all.into_iter().map(cell).collect()
}

fn centre([column, row]: [i64; 2], cell_m: f64) -> [f64; 2] {
    [(column as f64 + 0.5) * cell_m, (row as f64 + 0.5) * cell_m]
}

/// What one scan says of cells.
fn one_scan(pose: &Pose<f64>, beams: &[BeamSample], cell_m: f64) -> BTreeMap<[i64; 2], f64> {
    let from = [pose.x_m, pose.y_m];
    let met: Vec<[f64; 2]> = beams
        .iter()
        .map(|beam| {
            let (sine, cosine) = (pose.yaw_rad + beam.bearing_rad).sin_cos();
            [from[0] + beam.range_m * cosine, from[1] + beam.range_m * sine]
        })
        .collect();
    let mut free: BTreeSet<[i64; 2]> = BTreeSet::new();
    let mut near: BTreeMap<[i64; 2], (f64, u32)> = BTreeMap::new();
    for (number, to) in met.iter().enumerate() {
        let beside = [number + met.len() - 1, number + 1].map(|other| other % met.len());
        // The ends of a fan are no neighbours.
        let turned_rad = |other: usize| (beams[other].bearing_rad - beams[number].bearing_rad).cos().acos();
        let next = beside.map(|other| (turned_rad(other) < NEIGHBOURS_RAD).then_some(met[other]));
        for (cell, _) in cells_on(from, *to, [0.0, 0.0], cell_m) {
            let at = centre(cell, cell_m);
            let apart = |end: &Option<[f64; 2]>| {
                let end = end.unwrap_or(*to);
                distance_m(at, &[to[0], to[1], end[0], end[1]]) >= cell_m
            };
            if next.iter().all(apart) {
                free.insert(cell);
            }
        }
        let [Some(before), Some(after)] = next else { continue };
        let along = [after[0] - before[0], after[1] - before[1]];
        let length_m = along[0].hypot(along[1]);
        let off = |point: [f64; 2]| {
            ((point[0] - before[0]) * along[1] - (point[1] - before[1]) * along[0]).abs() / length_m
        };
        if length_m <= 0.0 || off(*to) > 0.5 * cell_m {
            continue;
        }
        // Casts of coordinates within a map.
        #[allow(clippy::cast_possible_truncation)]
        let middle = to.map(|at| (at / cell_m).floor() as i64);
        for column in middle[0] - 1..=middle[0] + 1 {
            for row in middle[1] - 1..=middle[1] + 1 {
                let at = centre([column, row], cell_m);
                let [x, y] = [at[0] - to[0], at[1] - to[1]];
                if x.hypot(y) < cell_m {
                    let (sum, count) = near.entry([column, row]).or_insert((0.0, 0));
                    *sum += occupancy((x * along[1] - y * along[0]).abs() / length_m, cell_m);
                    *count += 1;
                }
            }
        }
    }
    let mut said: BTreeMap<[i64; 2], f64> = free.into_iter().map(|cell| (cell, 0.0)).collect();
    said.extend(near.into_iter().map(|(cell, (sum, count))| (cell, sum / f64::from(count))));
    said
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::Timestamp;

    use super::*;

    /// A wall across the way, met by three beams, `wall_m` ahead.
    fn ahead(wall_m: f64) -> Vec<LocalCell> {
        let beam = |bearing_rad: f64| BeamSample {
            time: Timestamp(0),
            bearing_rad,
            range_m: (wall_m - 0.05) / bearing_rad.cos(),
        };
        local_grid(&[(Pose::new(0.05, 0.05, 0.0), &[beam(-0.2), beam(0.0), beam(0.2)])], 0.1)
    }

    fn of(grid: &[LocalCell], column: i64) -> Option<f64> {
        let [x, y] = centre([column, 0], 0.1);
        let near = |cell: &&LocalCell| (cell.centre_m[0] - x).hypot(cell.centre_m[1] - y) < 1e-9;
        grid.iter().find(near).map(|cell| cell.occupied)
    }

    #[test]
    fn a_beam_frees_its_way_and_a_surface_is_as_sure_behind_as_before() {
        // The wall lies on the centre of a cell, and then on the border of two.
        let grid = ahead(1.05);
        assert!((0..9).all(|column| of(&grid, column) == Some(0.0)), "{grid:?}");
        assert!((of(&grid, 10).unwrap() - 1.0).abs() < 1e-9);
        let grid = ahead(1.1);
        let [front, behind] = [10, 11].map(|column| of(&grid, column).unwrap());
        assert!((front - 0.5).abs() < 1e-9 && (behind - 0.5).abs() < 1e-9, "{front} {behind}");
    }

    #[test]
    fn an_edge_says_nothing_of_how_its_surface_goes_on() {
        let beam = |bearing_rad: f64, range_m: f64| BeamSample { time: Timestamp(0), bearing_rad, range_m };
        let beams = [beam(-0.2, 2.0), beam(0.0, 1.0), beam(0.2, 2.0)];
        let grid = local_grid(&[(Pose::new(0.05, 0.05, 0.0), &beams)], 0.1);
        assert!(grid.iter().all(|cell| cell.occupied == 0.0), "{grid:?}");
    }

    #[test]
    fn nothing_is_said_of_cells_between_the_places_that_neighbours_met() {
        // A wall 1 m to the left, seen at flat angles: the second beam passes over the wall just before it ends.
        let beam = |bearing_rad: f64| BeamSample {
            time: Timestamp(0),
            bearing_rad,
            range_m: 1.0 / bearing_rad.sin(),
        };
        let beams = [beam(0.25), beam(0.2)];
        let grid = local_grid(&[(Pose::new(0.0, 0.0, 0.0), &beams)], 0.1);
        let free_on_wall = |cell: &&LocalCell| cell.occupied == 0.0 && (cell.centre_m[1] - 1.0).abs() < 0.09;
        // Only before the first beam's end, of which nobody knows how the wall goes on.
        assert!(grid.iter().filter(free_on_wall).all(|cell| cell.centre_m[0] < beams[0].range_m), "{grid:?}");
        let alone = local_grid(&[(Pose::new(0.0, 0.0, 0.0), &beams[1..])], 0.1);
        assert!(alone.iter().filter(free_on_wall).any(|cell| cell.centre_m[0] > beams[0].range_m + 0.2));
    }
}

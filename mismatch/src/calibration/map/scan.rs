//! What the sensor sees around the robot, as a grid.

use std::collections::BTreeMap;

use pleiad_physics::Pose;
use pleiad_recording::BeamSample;

use super::grid::{FREE, OCCUPIED, UNKNOWN, cells_on};

/// A cell of the local grid of which a beam says something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalCell {
    /// Its centre in the frame of the robot, metres.
    pub centre_m: [f64; 2],
    /// Probability that it is occupied.
    pub occupied: f64,
}

/// The local grid: cells that beams of recent scans go through or end in, in the frame of the robot. Every beam multiplies
/// the odds of its cells; cells that no beam says anything of are left out, as unknown.
pub fn local_grid(scans: &[(Pose<f64>, &[BeamSample])], cell_m: f64) -> Vec<LocalCell> {
    let odds = |probability: f64| (probability / (1.0 - probability)).ln();
    let mut log_odds: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    for (pose, beams) in scans {
        // Per scan a cell is said one thing of: met, if any beam ended in it.
        let mut said: BTreeMap<[i64; 2], bool> = BTreeMap::new();
        for beam in *beams {
            let direction = pose.yaw_rad + beam.bearing_rad;
            let to = [pose.x_m + beam.range_m * direction.cos(), pose.y_m + beam.range_m * direction.sin()];
            let cells = cells_on([pose.x_m, pose.y_m], to, [0.0, 0.0], cell_m);
            for (number, (cell, _)) in cells.iter().enumerate() {
                let met = number + 1 == cells.len();
                let entry = said.entry(*cell).or_insert(met);
                *entry |= met;
            }
        }
        for (cell, met) in said {
            *log_odds.entry(cell).or_insert(odds(UNKNOWN)) += odds(if met { OCCUPIED } else { FREE });
        }
    }
    // Two beams of this model are as sure as the map is.
    let most = odds(OCCUPIED);
    let cell = |([column, row], log_odds): ([i64; 2], f64)| LocalCell {
        centre_m: [(column as f64 + 0.5) * cell_m, (row as f64 + 0.5) * cell_m],
        occupied: 1.0 / (1.0 + (-log_odds.clamp(-most, most)).exp()),
    };
    log_odds.into_iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::Timestamp;

    use super::*;

    #[test]
    fn a_beam_frees_its_way_and_occupies_its_end() {
        let beam = BeamSample { time: Timestamp(0), bearing_rad: 0.0, range_m: 0.95 };
        let start = Pose::new(0.05, 0.05, 0.0);
        let grid = local_grid(&[(start, &[beam])], 0.1);
        // From 0.05 to 1.0: ten cells and the border; the last is met.
        assert!((10..=11).contains(&grid.len()));
        let (last, before) = grid.split_last().unwrap();
        assert!((last.occupied - OCCUPIED).abs() < 1e-12, "{last:?}");
        assert!(before.iter().all(|cell| (cell.occupied - FREE).abs() < 1e-12));
    }
}

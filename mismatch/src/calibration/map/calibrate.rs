//! Stretch by stretch: the pair of errors that makes the scans match the map.

use pleiad_estimation::{RobotId, Timestamp};
use pleiad_physics::Pose;
use pleiad_recording::{BeamSample, Recording};
use serde::Serialize;

use super::error::MapError;
use super::grid::{Grid, extent};
use super::matched::{Matched, predicted};
use super::scan::{LocalCell, local_grid};
use crate::calibration::reckoned::{Reckoned, reckon};

/// Around the walls the map says that nothing is, so far, metres.
const MARGIN_M: f64 = 1.0;
/// No map has more cells along an axis.
const MOST_CELLS: f64 = 1500.0;

/// Errors per metre driven; backwards they change their sign.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Drift {
    /// `a_trans`: how much farther the robot drives than its odometry says, per metre.
    pub trans: f64,
    /// `a_rot`: how much it turns besides, rad/m.
    pub rot_rad_m: f64,
}

/// How to calibrate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MapOptions {
    /// What is believed at first.
    pub start: Drift,
    /// Weight of what is believed against what a stretch says, from 0 to 1.
    pub gamma: f64,
    /// Driven between matches, metres.
    pub stretch_m: f64,
    /// Side of the grids' cells, metres.
    pub cell_m: f64,
    /// The local grid is of so many scans, the last of them at the end of the stretch.
    pub scans: usize,
    /// `mu_min`: a stretch counts only where `|G| + |G'|`, over the cells that were seen, is at least this. Free cells add
    /// nothing: a metre of wall that is seen whole adds about two over the side of a cell, in each of the grids. The default
    /// is half a metre of wall with cells of 0.1 m: less says at most how far one wall is.
    pub mu_min: f64,
    /// A stretch is searched up to this far from what is believed.
    pub reach: Drift,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            start: Drift::default(),
            gamma: 0.9,
            stretch_m: 1.0,
            cell_m: 0.1,
            scans: 3,
            mu_min: 10.0,
            reach: Drift { trans: 0.06, rot_rad_m: 0.06 },
        }
    }
}

/// What one stretch said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stretch {
    /// Its end, seconds of the recording.
    pub time_s: f64,
    /// Driven from the start of the run, metres.
    pub path_m: f64,
    /// `|G| + |G'|` at the best pair, over the cells that were seen.
    pub seen: f64,
    /// The best pair; absent where too little was seen.
    pub best: Option<Drift>,
    /// Its match, from 0 to 1.
    pub score: Option<f64>,
    /// What is believed from here on.
    pub estimate: Drift,
    /// Where the robot is, by the best pair of every stretch: x, y (metres), yaw (radians).
    pub pose: [f64; 3],
}

/// A calibration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapCalibration {
    /// Stretch by stretch.
    pub stretches: Vec<Stretch>,
    /// What is believed at the end.
    pub estimate: Drift,
}

/// Calibrates a robot's odometry on its scans and the walls of the recording. Of the truth its first pose is used, as where
/// the robot was put.
///
/// # Errors
/// Walls, scans, odometry, a start or a model of the robot are missing; an option is out of range; no stretch can be matched.
pub fn calibrate(
    recording: &Recording,
    robot: RobotId,
    options: &MapOptions,
) -> Result<MapCalibration, MapError> {
    check(options)?;
    let missing = |missing, remedy| MapError::Missing {
        recording: recording.name.clone(),
        robot: robot.0,
        missing,
        remedy,
    };
    let own =
        recording.robots.get(&robot).ok_or_else(|| missing("channel of it", "name a robot that recorded"))?;
    let model = recording
        .nominal
        .as_ref()
        .and_then(|nominal| nominal.model(robot))
        .ok_or_else(|| missing("nominal model of it", "give it a section in nominal.toml"))?;
    let (low, high) = extent(&recording.walls)
        .ok_or_else(|| missing("wall", "write the map into walls.csv with the columns x0,y0,x1,y1"))?;
    let [width_m, height_m] = [0, 1].map(|axis| high[axis] - low[axis] + 2.0 * MARGIN_M);
    if width_m.max(height_m) > MOST_CELLS * options.cell_m {
        return Err(MapError::TooLarge { width_m, height_m, cell_m: options.cell_m });
    }
    let map = Grid::of_walls(&recording.walls, options.cell_m, MARGIN_M)
        .ok_or_else(|| missing("wall", "write the map into walls.csv"))?;
    if own.scans.is_empty() {
        return Err(missing("range scan", "record scan.csv with the columns t,bearing,range"));
    }
    let path = reckon(&own.odometry, &model);
    if path.len() < 2 {
        return Err(missing("odometry", "record wheel_odometry.csv, velocity.csv or increment.csv"));
    }
    let start = own.truth.first().ok_or_else(|| {
        missing("true pose at the start", "write one row into truth.csv: where the robot was put")
    })?;
    let start = Pose::new(start.pose.x_m(), start.pose.y_m(), start.pose.yaw_rad());
    let scans: Vec<&[BeamSample]> = own.scans.chunk_by(|one, other| one.time == other.time).collect();
    let run = Driven { path: &path, scans: &scans, map: &map, options };
    let calibration = run.calibrate(start);
    if calibration.stretches.iter().all(|stretch| stretch.best.is_none()) {
        return Err(MapError::NoMatch {
            recording: recording.name.clone(),
            robot: robot.0,
            stretches: calibration.stretches.len(),
            length_m: options.stretch_m,
        });
    }
    Ok(calibration)
}

fn check(options: &MapOptions) -> Result<(), MapError> {
    let positive = "a finite number above 0";
    let all = [
        ("gamma", options.gamma, (0.0..=1.0).contains(&options.gamma), "a number from 0 to 1"),
        ("stretch_m", options.stretch_m, options.stretch_m > 0.0 && options.stretch_m.is_finite(), positive),
        ("cell_m", options.cell_m, options.cell_m > 0.0 && options.cell_m.is_finite(), positive),
        ("mu_min", options.mu_min, options.mu_min >= 0.0, "0 or more"),
    ];
    match all.into_iter().find(|(_, _, fits, _)| !fits) {
        Some((name, value, _, expected)) => Err(MapError::Option { name, value, expected }),
        None => Ok(()),
    }
}

/// One run with what it is matched against.
struct Driven<'a> {
    path: &'a [Reckoned],
    scans: &'a [&'a [BeamSample]],
    map: &'a Grid,
    options: &'a MapOptions,
}

impl Driven<'_> {
    /// Stretches end at the first scan that is far enough.
    fn calibrate(&self, start: Pose<f64>) -> MapCalibration {
        let options = self.options;
        let mut estimate = options.start;
        let mut pose = start;
        let mut stretches = Vec::new();
        let Some(mut begun) = self.path.first().copied() else {
            return MapCalibration { stretches, estimate };
        };
        for (number, scan) in self.scans.iter().enumerate() {
            let Some(here) = scan.first().and_then(|beam| self.at(beam.time)) else { continue };
            if here.path_m - begun.path_m < options.stretch_m {
                continue;
            }
            let local = self.local(number, &here, estimate);
            let matched =
                Matched { map: self.map, local: &local, start: pose, moves: &self.moves(&begun, &here) };
            let found = matched.search(estimate, options.reach, options.mu_min);
            let best = found.map(|(best, _)| best);
            if let Some(best) = best {
                let (gamma, rest) = (options.gamma, 1.0 - options.gamma);
                estimate = Drift {
                    trans: gamma * estimate.trans + rest * best.trans,
                    rot_rad_m: gamma * estimate.rot_rad_m + rest * best.rot_rad_m,
                };
            }
            let ended = matched.at(best.unwrap_or(estimate));
            pose = ended.pose;
            stretches.push(Stretch {
                time_s: here.time.seconds(),
                path_m: here.path_m,
                seen: ended.seen,
                best,
                score: found.map(|(_, score)| score),
                estimate,
                pose: [pose.x_m, pose.y_m, pose.yaw_rad],
            });
            begun = here;
        }
        MapCalibration { stretches, estimate }
    }

    /// Odometry at an instant; `None` outside.
    fn at(&self, time: Timestamp) -> Option<Reckoned> {
        let after = self.path.partition_point(|at| at.time <= time);
        let before = self.path[after.checked_sub(1)?];
        if before.time == time {
            return Some(before);
        }
        let next = self.path.get(after)?;
        let share = time.seconds_since(before.time) / next.time.seconds_since(before.time);
        let moved = before.pose.between(&next.pose);
        let twist = [moved.x_m, moved.y_m, moved.yaw_rad].map(|part| share * part);
        Some(Reckoned {
            time,
            pose: before.pose.compose(&Pose::new(twist[0], twist[1], twist[2])),
            path_m: before.path_m + share * (next.path_m - before.path_m),
        })
    }

    /// Odometry's motions from one instant to another, each in the frame of its beginning.
    fn moves(&self, from: &Reckoned, to: &Reckoned) -> Vec<Pose<f64>> {
        let first = self.path.partition_point(|at| at.time <= from.time);
        let last = self.path.partition_point(|at| at.time < to.time);
        let within = self.path[first.min(last)..last].iter().map(|at| at.pose);
        let mut before = from.pose;
        let step = |pose: Pose<f64>| {
            let moved = before.between(&pose);
            before = pose;
            moved
        };
        within.chain([to.pose]).map(step).collect()
    }

    /// The local grid in the frame of the robot at the end of a stretch.
    fn local(&self, number: usize, here: &Reckoned, drift: Drift) -> Vec<LocalCell> {
        let recent = &self.scans[(number + 1).saturating_sub(self.options.scans.max(1))..=number];
        let placed: Vec<(Pose<f64>, &[BeamSample])> = recent
            .iter()
            .filter_map(|scan| {
                let then = self.at(scan.first()?.time)?;
                let since = predicted(&Pose::identity(), &self.moves(&then, here), drift);
                Some((since.between(&Pose::identity()), *scan))
            })
            .collect();
        local_grid(&placed, self.options.cell_m)
    }
}

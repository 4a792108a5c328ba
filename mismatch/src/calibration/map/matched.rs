//! One stretch against the map: the pair of errors with the greatest match.

use pleiad_physics::Pose;

use super::calibrate::Drift;
use super::grid::{Grid, Match};
use super::scan::LocalCell;

/// The first search has so many steps to either side, and each of the following ones halves them.
const STEPS: i32 = 6;
const ROUNDS: u32 = 5;
/// The first search takes every so many of the cells in which the robot saw nothing: it has to find the hill, not its summit.
const EVERY: usize = 4;

/// A local grid, and the motions that led to where it was made.
pub(super) struct Matched<'a> {
    pub(super) map: &'a Grid,
    pub(super) local: &'a [LocalCell],
    /// Where the stretch begins.
    pub(super) start: Pose<f64>,
    /// Odometry's motions, each in the frame of its beginning.
    pub(super) moves: &'a [Pose<f64>],
}

/// What a pair of errors gives.
pub(super) struct Ended {
    pub(super) pose: Pose<f64>,
    /// `|G| + |G'|`.
    pub(super) seen: f64,
}

impl Matched<'_> {
    /// Where a pair of errors leads, and how much is seen there.
    pub(super) fn at(&self, drift: Drift) -> Ended {
        let pose = predicted(&self.start, self.moves, drift);
        let mut sums = Match::default();
        self.add(&mut sums, self.local.iter(), &pose);
        Ended { pose, seen: sums.seen }
    }

    /// The pair with the greatest match, within `reach` of the middle. `None` where too little is seen at the middle.
    pub(super) fn search(&self, middle: Drift, reach: Drift, mu_min: f64) -> Option<(Drift, f64)> {
        search(middle, reach, |centre, half, coarse| {
            let (fixed, varied) = self.part(centre, half, if coarse { EVERY } else { 1 });
            move |drift: Drift| {
                let mut sums = fixed;
                self.add(&mut sums, varied.iter().copied(), &predicted(&self.start, self.moves, drift));
                sums.score(if coarse { 0.0 } else { mu_min })
            }
        })
    }

    /// The cells whose part in the match is the same for all pairs around one, since the map is free wherever these
    /// put them: added up; and the others.
    fn part(&self, centre: Drift, half: Drift, every: usize) -> (Match, Vec<&LocalCell>) {
        let pose = predicted(&self.start, self.moves, centre);
        let length_m: f64 = self.moves.iter().map(|moved| moved.x_m.hypot(moved.y_m)).sum();
        let turned_rad = length_m * half.rot_rad_m;
        // The arm of the turn is not longer than the way of the robot.
        let moved_m = length_m * (half.trans + turned_rad * (1.0 + centre.trans.abs() + half.trans));
        let (mut fixed, mut varied) = (Match::default(), Vec::with_capacity(self.local.len()));
        let in_map = placed(&pose);
        let free = self.local.iter().filter(|cell| cell.occupied <= 0.0).step_by(every);
        let occupied = self.local.iter().filter(|cell| cell.occupied > 0.0);
        for cell in free.chain(occupied) {
            let [x, y] = cell.centre_m;
            if self.map.is_free_around(in_map(cell.centre_m), moved_m + turned_rad * x.hypot(y)) {
                fixed.add([cell.occupied, 0.0]);
            } else {
                varied.push(cell);
            }
        }
        (fixed, varied)
    }

    fn add<'c>(&self, sums: &mut Match, cells: impl Iterator<Item = &'c LocalCell>, pose: &Pose<f64>) {
        let in_map = placed(pose);
        for cell in cells {
            sums.add([cell.occupied, self.map.at(in_map(cell.centre_m))]);
        }
    }
}

/// From the frame of a robot to the map.
fn placed(pose: &Pose<f64>) -> impl Fn([f64; 2]) -> [f64; 2] + use<> {
    let (from, (sine, cosine)) = ([pose.x_m, pose.y_m], pose.yaw_rad.sin_cos());
    move |[x, y]| [from[0] + cosine * x - sine * y, from[1] + sine * x + cosine * y]
}

/// Where motions of odometry lead with these errors: `D_trans = d_trans + a_trans l`, `D_rot = d_rot + a_rot l`, the error
/// of the turn half before and half after each motion.
pub(super) fn predicted(start: &Pose<f64>, moves: &[Pose<f64>], drift: Drift) -> Pose<f64> {
    let mut pose = *start;
    for moved in moves {
        let half = Pose::new(0.0, 0.0, 0.5 * drift.rot_rad_m * moved.x_m);
        let along = Pose::new(moved.x_m * (1.0 + drift.trans), moved.y_m, moved.yaw_rad);
        pose = pose.compose(&half).compose(&along).compose(&half);
    }
    pose
}

/// The pair with the greatest score, first over the whole reach and then closer and closer; of equals the one nearest to
/// the middle. `None` where there is no score. `score` is made for the pairs around one, so far to either side, and for
/// the first time roughly.
fn search<S: Fn(Drift) -> Option<f64>>(
    middle: Drift,
    reach: Drift,
    score: impl Fn(Drift, Drift, bool) -> S,
) -> Option<(Drift, f64)> {
    let exactly = score(middle, Drift::default(), false)(middle)?;
    if reach == Drift::default() {
        return Some((middle, exactly));
    }
    let mut best = (middle, exactly);
    let mut step =
        Drift { trans: reach.trans / f64::from(STEPS), rot_rad_m: reach.rot_rad_m / f64::from(STEPS) };
    for round in 0..ROUNDS {
        let (centre, steps) = (best.0, if round == 0 { STEPS } else { 2 });
        let half =
            Drift { trans: f64::from(steps) * step.trans, rot_rad_m: f64::from(steps) * step.rot_rad_m };
        let score = score(centre, half, round == 0);
        best = (centre, score(centre)?);
        for (along, across) in offsets(steps) {
            let drift = Drift {
                trans: centre.trans + f64::from(along) * step.trans,
                rot_rad_m: centre.rot_rad_m + f64::from(across) * step.rot_rad_m,
            };
            if let Some(found) = score(drift).filter(|found| *found > best.1) {
                best = (drift, found);
            }
        }
        step = Drift { trans: 0.5 * step.trans, rot_rad_m: 0.5 * step.rot_rad_m };
    }
    Some(best)
}

/// Steps to either side, the nearest first.
fn offsets(steps: i32) -> Vec<(i32, i32)> {
    let mut all: Vec<(i32, i32)> =
        (-steps..=steps).flat_map(|along| (-steps..=steps).map(move |across| (along, across))).collect();
    all.sort_by_key(|(along, across)| along * along + across * across);
    all.split_off(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_metre_with_errors_is_a_longer_arc() {
        // Ten steps of 0.1 m: the arc of 1.02 m that turns by 0.03 rad, to the order of the steps.
        let moves = vec![Pose::new(0.1, 0.0, 0.0); 10];
        let end = predicted(&Pose::identity(), &moves, Drift { trans: 0.02, rot_rad_m: 0.03 });
        let arc = Pose::exp(1.02, 0.0, 0.03);
        assert!((end.x_m - arc.x_m).abs() < 1e-5 && (end.y_m - arc.y_m).abs() < 1e-5, "{end:?} {arc:?}");
        assert!((end.yaw_rad - 0.03).abs() < 1e-12);
    }

    #[test]
    fn the_search_finds_the_summit_of_a_known_hill_and_stays_where_all_is_level() {
        let hill = |_: Drift, _: Drift, _: bool| {
            |drift: Drift| Some(1.0 - (drift.trans - 0.031).abs() - (drift.rot_rad_m + 0.017).abs())
        };
        let reach = Drift { trans: 0.06, rot_rad_m: 0.06 };
        let (best, _) = search(Drift::default(), reach, hill).unwrap();
        assert!((best.trans - 0.031).abs() < 0.0007 && (best.rot_rad_m + 0.017).abs() < 0.0007, "{best:?}");
        let middle = Drift { trans: 0.01, rot_rad_m: 0.02 };
        assert_eq!(search(middle, reach, |_, _, _| |_| Some(0.5)), Some((middle, 0.5)));
        assert_eq!(search(middle, reach, |_, _, _| |_| None), None);
    }

    /// Cells in which the map is free for every pair of a search are added up once: the match is the same to rounding.
    #[test]
    fn cells_that_are_set_aside_change_no_match() {
        let room =
            [[-3.0, -2.0, 3.0, -2.0], [3.0, -2.0, 3.0, 2.0], [3.0, 2.0, -3.0, 2.0], [-3.0, 2.0, -3.0, -2.0]];
        let map = Grid::of_walls(&room, 0.1, 1.0).unwrap();
        let local: Vec<LocalCell> = (-25..25)
            .flat_map(|x| (-18..18).map(move |y| (x, y)))
            .map(|(x, y)| LocalCell {
                centre_m: [0.1 * f64::from(x), 0.1 * f64::from(y)],
                occupied: if (x + y) % 7 == 0 { 0.5 } else { 0.0 },
            })
            .collect();
        let moves = vec![Pose::new(0.1, 0.0, 0.02); 10];
        let matched = Matched { map: &map, local: &local, start: Pose::new(-0.5, 0.1, 0.2), moves: &moves };
        let (centre, half) =
            (Drift { trans: 0.02, rot_rad_m: -0.03 }, Drift { trans: 0.06, rot_rad_m: 0.06 });
        let (fixed, varied) = matched.part(centre, half, 1);
        assert!(varied.len() < local.len() / 2, "{} of {}", varied.len(), local.len());
        for (along, across) in [(-1.0, -1.0), (-1.0, 1.0), (0.0, 0.3), (1.0, -1.0), (1.0, 1.0)] {
            let drift = Drift {
                trans: centre.trans + along * half.trans,
                rot_rad_m: centre.rot_rad_m + across * half.rot_rad_m,
            };
            let pose = predicted(&matched.start, &moves, drift);
            let (mut part, mut whole) = (fixed, Match::default());
            matched.add(&mut part, varied.iter().copied(), &pose);
            matched.add(&mut whole, local.iter(), &pose);
            let (part, whole) = (part.score(0.0).unwrap(), whole.score(0.0).unwrap());
            assert!((part - whole).abs() < 1e-12, "{part} {whole}");
        }
    }
}

//! Unobservable directions in words.

use nalgebra::{DMatrix, DVector, Matrix2};

use super::analysis::Coordinates;
use crate::RobotId;
use crate::geometry::{Vector2, skew_times};

/// A candidate lies in the null space if what sticks out of it is under this share of its length.
const INSIDE: f64 = 1e-6;
/// Beyond this number of robots only the whole team and single robots are tried, not every sub-team.
const MOST_FOR_SUB_TEAMS: usize = 10;
/// Coordinates of a combination smaller than this share of its largest are not named.
const NAMED: f64 = 0.1;

/// A null space from which named directions are taken one by one.
struct Remainder<'a> {
    null_space: &'a DMatrix<f64>,
    /// Orthonormal basis of what has been named.
    named: Vec<DVector<f64>>,
}

impl Remainder<'_> {
    /// The new part of a direction that is unobservable and not yet named.
    fn new_part(&self, direction: &DVector<f64>) -> Option<DVector<f64>> {
        let length = direction.norm();
        let inside = self.null_space * (self.null_space.transpose() * direction);
        if (direction - &inside).norm() > INSIDE * length {
            return None;
        }
        let mut rest = inside;
        for known in &self.named {
            rest -= known * known.dot(&rest);
        }
        (rest.norm() > INSIDE * length).then(|| rest.normalize())
    }

    /// Names a direction, if it is there to be named.
    fn take(&mut self, direction: &DVector<f64>) -> bool {
        let part = self.new_part(direction);
        self.named.extend(part.clone());
        part.is_some()
    }

    /// Names the rotation of a team about a point of its own, the error `(-J c, 1)` of each robot, and
    /// returns `c`: least squares of what sticks out of the null space, over `c`.
    fn take_rotation(&mut self, robots: usize, team: &[usize]) -> Option<Vector2> {
        let outside = |direction: &DVector<f64>| {
            direction - self.null_space * (self.null_space.transpose() * direction)
        };
        let about = |centre: Vector2, rate: f64| {
            let mut direction = common(robots, team, 2) * rate;
            for index in team {
                set_shift(&mut direction, *index, -skew_times(centre));
            }
            direction
        };
        let residual = outside(&about(Vector2::zeros(), 1.0));
        let columns = [outside(&about(Vector2::x(), 0.0)), outside(&about(Vector2::y(), 0.0))];
        let normal = Matrix2::from_fn(|i, j| columns[i].dot(&columns[j]));
        let target = Vector2::new(columns[0].dot(&residual), columns[1].dot(&residual));
        let centre = -normal.cholesky()?.solve(&target);
        let direction = about(centre, 1.0);
        self.take(&direction).then_some(centre)
    }

    fn left(&self) -> usize {
        self.null_space.ncols() - self.named.len()
    }
}

/// Names the dimensions of a null space by the smallest sets of robots that can move by themselves:
/// single robots, then sub-teams by increasing size, and what is left as combinations of coordinates.
/// Larger sets are listed first.
pub(super) fn describe(
    robots: &[RobotId],
    coordinates: &Coordinates,
    null_space: &DMatrix<f64>,
) -> Vec<String> {
    let mut remainder = Remainder { null_space, named: Vec::new() };
    let mut by_team: Vec<Vec<String>> = Vec::new();
    let teams = teams(robots.len());
    // Rotations about points elsewhere come last: where a robot of the team is free to turn by itself,
    // the others can turn about it, which is better told as a rotation of all.
    for elsewhere in [false, true] {
        for team in &teams {
            if remainder.left() == 0 {
                break;
            }
            by_team.push(match (elsewhere, team.as_slice()) {
                (true, _) => rotation_elsewhere(robots, team, &mut remainder),
                (false, [index]) => single(robots, coordinates, *index, &mut remainder),
                (false, _) => several(robots, team, &mut remainder),
            });
        }
    }
    let mut words: Vec<String> = by_team.into_iter().rev().flatten().collect();
    words.extend(combinations(robots, &remainder));
    words
}

/// Sets of robots to try, smallest first; of equal size the last ones first, because the words are
/// turned around at the end.
fn teams(robots: usize) -> Vec<Vec<usize>> {
    let mut teams: Vec<Vec<usize>> = if robots <= MOST_FOR_SUB_TEAMS {
        (1_u32..1 << robots).map(|mask| (0..robots).filter(|i| mask >> i & 1 == 1).collect()).collect()
    } else {
        (0..robots).map(|i| vec![i]).chain(std::iter::once((0..robots).collect())).collect()
    };
    teams.sort_by(|a, b| a.len().cmp(&b.len()).then_with(|| b.cmp(a)));
    teams
}

/// What several robots can do together.
fn several(robots: &[RobotId], team: &[usize], remainder: &mut Remainder<'_>) -> Vec<String> {
    let whole = team.len() == robots.len();
    let of = if whole { String::new() } else { format!(" of robots {}", list(robots, team)) };
    let mut words = Vec::new();
    for (axis, name) in ["x", "y"].iter().enumerate() {
        if remainder.take(&common(robots.len(), team, axis)) {
            words.push(format!("common translation in {name}{of}"));
        }
    }
    if remainder.take(&common(robots.len(), team, 2)) {
        words.push(format!("common rotation{of}"));
    }
    words
}

/// A rotation about a point that is neither the robot's own nor free.
fn rotation_elsewhere(robots: &[RobotId], team: &[usize], remainder: &mut Remainder<'_>) -> Vec<String> {
    let Some(centre) = remainder.take_rotation(robots.len(), team) else { return Vec::new() };
    let of = match team {
        [index] => format!("rotation of robot {}", robots[*index]),
        _ if team.len() == robots.len() => "common rotation".to_owned(),
        _ => format!("common rotation of robots {}", list(robots, team)),
    };
    vec![format!("{of} about ({:.2}, {:.2})", centre.x, centre.y)]
}

/// Every robot of a team moved alike along one coordinate of its error.
fn common(robots: usize, team: &[usize], axis: usize) -> DVector<f64> {
    let mut direction = DVector::zeros(3 * robots);
    for index in team {
        direction[3 * index + axis] = 1.0;
    }
    direction
}

fn set_shift(direction: &mut DVector<f64>, index: usize, shift: Vector2) {
    direction[3 * index] = shift.x;
    direction[3 * index + 1] = shift.y;
}

/// Position and heading of one robot.
fn single(
    robots: &[RobotId],
    coordinates: &Coordinates,
    index: usize,
    remainder: &mut Remainder<'_>,
) -> Vec<String> {
    let robot = robots[index];
    let mut words = Vec::new();
    let in_x = remainder.take(&common(robots.len(), &[index], 0));
    let in_y = remainder.take(&common(robots.len(), &[index], 1));
    match (in_x, in_y) {
        (true, true) => words.push(format!("position of robot {robot}")),
        (true, false) => words.push(format!("x of robot {robot}")),
        (false, true) => words.push(format!("y of robot {robot}")),
        (false, false) => {}
    }
    let mut turn = common(robots.len(), &[index], 2);
    if let Coordinates::Invariant(positions) = coordinates {
        set_shift(&mut turn, index, -skew_times(positions[index]));
    }
    if remainder.take(&turn) {
        words.push(format!("heading of robot {robot}"));
    }
    words
}

/// What has no name: an orthonormal basis of the rest, each by the coordinates that stand out in it.
fn combinations(robots: &[RobotId], remainder: &Remainder<'_>) -> Vec<String> {
    let mut rest = Remainder { null_space: remainder.null_space, named: remainder.named.clone() };
    let mut words = Vec::new();
    for column in remainder.null_space.column_iter() {
        let Some(part) = rest.new_part(&column.into_owned()) else { continue };
        let largest = part.amax();
        let names: Vec<String> = part
            .iter()
            .enumerate()
            .filter(|(_, value)| value.abs() > NAMED * largest)
            .map(|(state, _)| format!("{} of robot {}", ["x", "y", "heading"][state % 3], robots[state / 3]))
            .collect();
        words.push(format!("a combination of {}", names.join(", ")));
        rest.named.push(part);
    }
    words
}

fn list(robots: &[RobotId], team: &[usize]) -> String {
    team.iter().map(|index| robots[*index].to_string()).collect::<Vec<_>>().join(", ")
}

//! How one component lies in another, by the ties between them: Gauss-Newton from many starts, and whether there is one answer.

use super::ties_of;
use crate::Pose2;
use crate::fact::Absolute;
use crate::fold::FoldConfig;
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::joint::{Component, End, Joint, Measured, Placement, Tie};
use crate::measurement::{self, Linearization};
use crate::sample::Relative;

const HEADINGS: u32 = 12;
const DIRECTIONS: u32 = 12;
const DISTANCES_M: [f64; 5] = [0.7, 1.5, 3.0, 6.0, 12.0];
const ITERATIONS: u32 = 12;
/// Longest step of the heading in one iteration, rad.
const LONGEST_TURN: f64 = 0.5;
/// A heading less certain than this is not Gaussian enough to join by: with 0.3 rad teams come out overconfident.
const WORST_HEADING: f64 = 0.1;
/// Nor is a place less certain than this share of the distances that were measured.
const WORST_SHARE: f64 = 0.25;
/// Another minimum so much less likely is none.
const COST_APART: f64 = 12.0;
/// Where some ties may be of nothing, so many numbers beyond three must agree.
const REDUNDANCY_IN_CLUTTER: usize = 5;
/// Minima that are no farther apart are one.
const SAME_M: f64 = 0.3;
const SAME_RAD: f64 = 0.1;
/// So many different minima are looked at more closely.
const MOST_MINIMA: usize = 8;

/// One answer, and it is good enough.
pub(super) struct Solution {
    pub placement: Placement,
    /// Numbers measured beyond the three that it takes.
    pub redundancy: usize,
}

/// A tie at a linearization point.
struct Row {
    at: Linearization,
    /// The blocks of its anchors with the derivative of the prediction by their errors.
    blocks: Vec<(usize, Matrix3)>,
    /// Derivative by the error of the transform.
    through: Matrix3,
}

/// The ties of a pair of components.
struct Problem<'a> {
    joint: &'a Joint,
    stays: Component,
    moves: Component,
    ties: Vec<(usize, &'a Tie)>,
}

/// Where the search ended.
struct Minimum {
    transform: Pose2,
    cost: f64,
}

/// How `moves` lies in `stays`, if the ties tell.
pub(super) fn solve(
    joint: &Joint,
    config: &FoldConfig,
    stays: Component,
    moves: Component,
) -> Option<Solution> {
    let numbers = ties_of(joint, stays, moves);
    let ties = numbers.into_iter().map(|number| (number, &joint.ties()[number])).collect();
    let mut problem = Problem { joint, stays, moves, ties };
    // One tie in three may be of nothing.
    let spare = problem.ties.len() / 3;
    let wanted = if config.clutter.is_some() { REDUNDANCY_IN_CLUTTER } else { 0 };
    for _ in 0..=spare {
        let redundancy = problem.dimension().checked_sub(3).filter(|redundancy| *redundancy >= wanted)?;
        let (best, placement) = problem.only_minimum()?;
        if redundancy == 0 || best.cost <= chi_square_999(redundancy) || !config.gate[0].is_finite() {
            return Some(Solution { placement, redundancy });
        }
        let worst = problem.worst(&best.transform)?;
        problem.ties.remove(worst);
    }
    None
}

impl Problem<'_> {
    fn dimension(&self) -> usize {
        let of = |(_, tie): &(usize, &Tie)| match &tie.measured {
            Measured::Relative(relative) => measurement::dimension(relative),
            Measured::Heading(_) => 1,
        };
        self.ties.iter().map(of).sum()
    }

    /// The one minimum there is; `None` as long as there is none, or more than one that is likely, or it is too uncertain.
    fn only_minimum(&self) -> Option<(Minimum, Placement)> {
        if self.dimension() < 3 {
            return None;
        }
        let posed =
            self.ties.iter().any(|(_, tie)| matches!(tie.measured, Measured::Relative(Relative::Pose(_))));
        let mut rough: Vec<Minimum> =
            self.starts().into_iter().filter_map(|start| self.descend(start)).collect();
        rough.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let mut distinct: Vec<Minimum> = Vec::new();
        for minimum in rough {
            let new = distinct.iter().all(|known| self.are_apart(&known.transform, &minimum.transform));
            if new && distinct.len() < MOST_MINIMA {
                distinct.push(minimum);
            }
        }
        // One that does not come to rest is no answer, but it may be in the way of one.
        let mut exact: Vec<(Minimum, Option<Placement>)> = distinct
            .into_iter()
            .map(|rough| match self.polish(rough.transform) {
                Some((minimum, placement)) => (minimum, Some(placement)),
                None => (rough, None),
            })
            .collect();
        exact.sort_by(|(a, _), (b, _)| a.cost.total_cmp(&b.cost));
        let mut exact = exact.into_iter();
        let (best, placement) = exact.next()?;
        let placement = placement?;
        let rival = exact.any(|(other, _)| {
            other.cost < best.cost + COST_APART && self.are_apart(&best.transform, &other.transform)
        });
        let sure = !rival && (posed || self.is_sure(&placement));
        sure.then_some((best, placement))
    }

    /// Two transforms put what was measured in different places.
    fn are_apart(&self, one: &Pose2, other: &Pose2) -> bool {
        let turned = one.between(other).yaw_rad().abs() > SAME_RAD;
        turned
            || self.moved_points().any(|point| {
                let apart = one.act(point) - other.act(point);
                apart.x * apart.x + apart.y * apart.y > SAME_M * SAME_M
            })
    }

    /// Places of the anchors of the component that moves, in its own frame.
    fn moved_points(&self) -> impl Iterator<Item = Vector2> + '_ {
        self.ties.iter().flat_map(|(_, tie)| &tie.ends).filter_map(|end| match end {
            End::Anchor(index) if self.joint.component(*index) == Some(self.moves) => {
                Some(self.joint.frame(*index).position())
            }
            _ => None,
        })
    }

    /// The linearization holds over what is uncertain: at the last tie, of how its two ends lie to one another. The transform
    /// itself may be as uncertain as a robot has drifted since its frame began.
    fn is_sure(&self, placement: &Placement) -> bool {
        let tied = self.ties.iter().rev().filter_map(|(_, tie)| {
            let poses = self.poses(tie, &placement.transform)?;
            matches!(tie.measured, Measured::Relative(_)).then_some((tie, poses))
        });
        let Some((tie, [from, to])) = tied.into_iter().next() else { return false };
        let moved = self.moved_end(tie);
        let apart = self.uncertainty(&tie.ends[moved], &tie.ends[1 - moved], placement);
        if apart[(2, 2)].max(0.0).sqrt() >= WORST_HEADING {
            return false;
        }
        if matches!(tie.ends[0], End::Map) {
            return true;
        }
        let between = to.position() - from.position();
        let point = if moved == 0 { from.position() } else { to.position() };
        // A point moved by exp(xi) goes by [I, J p] xi.
        let by = Matrix3::new(1.0, 0.0, -point.y, 0.0, 1.0, point.x, 0.0, 0.0, 0.0);
        let placed = by * apart * by.transpose();
        let square = between.x * between.x + between.y * between.y;
        placed[(0, 0)] + placed[(1, 1)] < WORST_SHARE * WORST_SHARE * square
    }

    /// Covariance of `tau + Ad_T xi_moved - xi_stays` once they are joined.
    fn uncertainty(&self, moved: &End, stays: &End, placement: &Placement) -> Matrix3 {
        let Placement { transform, spread, columns, through, .. } = placement;
        let adjoint = transform.adjoint();
        let mut parts: Vec<(usize, Matrix3)> = Vec::with_capacity(2);
        if let End::Anchor(index) = moved {
            parts.push((*index, adjoint));
        }
        if let End::Anchor(index) = stays {
            parts.push((*index, -Matrix3::identity()));
        }
        let mut before = Matrix3::zeros();
        for (i, by) in &parts {
            for (j, with) in &parts {
                before += by * self.joint.covariance().block(*i, *j) * with.transpose();
            }
        }
        let mut gained = Matrix3::zeros();
        let mut by_transform = Matrix3::zeros();
        for (column, q) in columns.iter().zip(through) {
            let mut v = Vector3::zeros();
            for (index, by) in &parts {
                v += by * Vector3::new(column[3 * index], column[3 * index + 1], column[3 * index + 2]);
            }
            gained += v * v.transpose();
            by_transform += v * q.transpose();
        }
        let cross = spread * by_transform.transpose();
        before + spread - gained + by_transform * spread * by_transform.transpose()
            - cross
            - cross.transpose()
    }

    fn moved_end(&self, tie: &Tie) -> usize {
        usize::from(self.joint.component_of(&tie.ends[0]) != self.moves)
    }

    /// Poses of the two ends in the frame that stays.
    fn poses(&self, tie: &Tie, transform: &Pose2) -> Option<[Pose2; 2]> {
        let pose = |end: &End| match end {
            End::Map => Pose2::identity(),
            End::Point([x, y]) => Pose2::new(*x, *y, 0.0),
            End::Anchor(index) if self.joint.component(*index) == Some(self.moves) => {
                transform.compose(self.joint.frame(*index))
            }
            End::Anchor(index) => *self.joint.frame(*index),
        };
        let sides = tie.ends.each_ref().map(|end| self.joint.component_of(end));
        let across = sides.contains(&self.stays) && sides.contains(&self.moves);
        across.then(|| tie.ends.each_ref().map(pose))
    }

    /// A tie linearized at a transform.
    fn row(&self, tie: &Tie, transform: &Pose2) -> Option<Row> {
        let [from, to] = self.poses(tie, transform)?;
        let (at, signs) = match &tie.measured {
            Measured::Relative(relative) => {
                let at = measurement::of_robot(relative, &from, &to).ok()?;
                (at, [-1.0, 1.0])
            }
            Measured::Heading(heading) => {
                (measurement::of_map(&Absolute::Heading(*heading), &to), [0.0, 1.0])
            }
        };
        let moved = self.moved_end(tie);
        let adjoint = transform.adjoint();
        let blocks = tie.ends.iter().zip(signs).enumerate().filter_map(|(which, (end, sign))| match end {
            End::Anchor(index) if which == moved => Some((*index, at.jacobian * adjoint * sign)),
            End::Anchor(index) => Some((*index, at.jacobian * sign)),
            End::Map | End::Point(_) => None,
        });
        Some(Row { blocks: blocks.collect(), through: at.jacobian * signs[moved], at })
    }

    fn rows(&self, transform: &Pose2) -> Option<Vec<Row>> {
        self.ties.iter().map(|(_, tie)| self.row(tie, transform)).collect()
    }

    /// Covariance of the innovations of two ties, without measurement noise.
    fn covariance(&self, one: &Row, other: &Row) -> Matrix3 {
        let mut sum = Matrix3::zeros();
        for (i, by) in &one.blocks {
            for (j, with) in &other.blocks {
                sum += by * self.joint.covariance().block(*i, *j) * with.transpose();
            }
        }
        sum
    }

    /// Gauss-Newton with each tie for itself, which is quick and finds the same minima nearly.
    fn descend(&self, start: Pose2) -> Option<Minimum> {
        let mut transform = start;
        let mut last = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let rows = self.rows(&transform)?;
            let (mut information, mut along, mut cost) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
            for (row, (_, tie)) in rows.iter().zip(&self.ties) {
                let noise = self.covariance(row, row) + tie.noise.to_matrix();
                let factor = Factor::new(spread(row.at.dimension, &noise))?;
                let whitened = factor.forward(&entries(row.at.dimension, &row.at.innovation));
                cost += whitened.iter().map(|entry| entry * entry).sum::<f64>();
                let columns = [0, 1, 2].map(|axis| {
                    let column: Vec<f64> = (0..row.at.dimension).map(|k| row.through[(k, axis)]).collect();
                    factor.forward(&column)
                });
                for a in 0..3 {
                    for b in 0..3 {
                        information[(a, b)] += dot(&columns[a], &columns[b]);
                    }
                    along[a] += dot(&columns[a], &whitened);
                }
            }
            last = cost;
            let step = solve3(&information, &along)?;
            transform = Pose2::exp(limited(step)).compose(&transform);
        }
        last.is_finite().then_some(Minimum { transform, cost: last })
    }

    /// Gauss-Newton with all correlations, and what follows from the minimum.
    fn polish(&self, start: Pose2) -> Option<(Minimum, Placement)> {
        let mut transform = start;
        let mut found = None;
        for _ in 0..ITERATIONS {
            let rows = self.rows(&transform)?;
            let offsets: Vec<usize> = rows
                .iter()
                .scan(0, |next, row| {
                    let this = *next;
                    *next += row.at.dimension;
                    Some(this)
                })
                .collect();
            let size: usize = rows.iter().map(|row| row.at.dimension).sum();
            let mut w = vec![vec![0.0; size]; size];
            for (i, one) in rows.iter().enumerate() {
                for (j, other) in rows.iter().enumerate().take(i + 1) {
                    let mut block = self.covariance(one, other);
                    if i == j {
                        block += self.ties[i].1.noise.to_matrix();
                    }
                    for a in 0..one.at.dimension {
                        for b in 0..other.at.dimension {
                            w[offsets[i] + a][offsets[j] + b] = block[(a, b)];
                        }
                    }
                }
            }
            let factor = Factor::new(w)?;
            let stacked = |of: &dyn Fn(&Row, usize) -> f64| -> Vec<f64> {
                rows.iter()
                    .flat_map(|row| (0..row.at.dimension).map(|k| of(row, k)).collect::<Vec<_>>())
                    .collect()
            };
            let whitened = factor.forward(&stacked(&|row, k| row.at.innovation[k]));
            let columns = [0, 1, 2].map(|axis| factor.forward(&stacked(&|row, k| row.through[(k, axis)])));
            let mut information = Matrix3::zeros();
            let mut along = Vector3::zeros();
            for a in 0..3 {
                for b in 0..3 {
                    information[(a, b)] = dot(&columns[a], &columns[b]);
                }
                along[a] = dot(&columns[a], &whitened);
            }
            let step = solve3(&information, &along)?;
            // What is left of the innovations when the transform has taken its part.
            let left: Vec<f64> = whitened
                .iter()
                .enumerate()
                .map(|(k, r)| r - columns[0][k] * step.x - columns[1][k] * step.y - columns[2][k] * step.z)
                .collect();
            let cost = dot(&left, &left);
            transform = Pose2::exp(limited(step)).compose(&transform);
            found = Some((rows, offsets, factor, columns, information, left, cost, step));
        }
        let (rows, offsets, factor, columns, information, left, cost, step) = found?;
        if step.x.abs() > 1e-3 || step.y.abs() > 1e-3 || step.z.abs() > 1e-4 {
            return None;
        }
        let spread = inverse3(&information)?;
        let through = (0..left.len()).map(|k| Vector3::new(columns[0][k], columns[1][k], columns[2][k]));
        let placement = Placement {
            transform,
            spread,
            columns: factor.right(&self.gains(&rows, &offsets)),
            through: through.collect(),
            whitened: left,
            used: self.ties.iter().map(|(number, _)| *number).collect(),
        };
        Some((Minimum { transform, cost }, placement))
    }

    /// `P Hx^T`, by columns.
    fn gains(&self, rows: &[Row], offsets: &[usize]) -> Vec<Vec<f64>> {
        let covariance = self.joint.covariance();
        let mut columns = vec![vec![0.0; covariance.size()]; rows.iter().map(|row| row.at.dimension).sum()];
        for (row, offset) in rows.iter().zip(offsets) {
            for (index, by) in &row.blocks {
                for axis in 0..3 {
                    let column = covariance.row(3 * index + axis);
                    for k in 0..row.at.dimension {
                        for (entry, value) in columns[offset + k].iter_mut().zip(&column) {
                            *entry += by[(k, axis)] * value;
                        }
                    }
                }
            }
        }
        columns
    }

    /// The tie that fits worst by itself.
    fn worst(&self, transform: &Pose2) -> Option<usize> {
        let rows = self.rows(transform)?;
        let misfit = |(row, (_, tie)): (&Row, &(usize, &Tie))| {
            let noise = self.covariance(row, row) + tie.noise.to_matrix();
            crate::joint::squared(row.at.dimension, &row.at.innovation, &noise)
        };
        let misfits: Vec<f64> = rows.iter().zip(&self.ties).map(misfit).collect();
        (0..misfits.len()).max_by(|a, b| misfits[*a].total_cmp(&misfits[*b]))
    }

    /// Where to begin: at what a full pose says, else with every heading, and the place that one tie gives then.
    fn starts(&self) -> Vec<Pose2> {
        let mut starts = Vec::new();
        for (_, tie) in &self.ties {
            if let (Measured::Relative(Relative::Pose(seen)), Some([from, to])) =
                (&tie.measured, self.poses(tie, &Pose2::identity()))
            {
                starts.push(if self.moved_end(tie) == 1 {
                    from.compose(seen).compose(&to.inverse())
                } else {
                    to.compose(&seen.inverse()).compose(&from.inverse())
                });
            }
        }
        if !starts.is_empty() {
            return starts;
        }
        let Some((tie, points)) = self.seed() else { return starts };
        let Some([from, to]) = self.poses(tie, &Pose2::identity()) else { return starts };
        for heading in 0..HEADINGS {
            let yaw = std::f64::consts::TAU * f64::from(heading) / f64::from(HEADINGS);
            let turn = Pose2::new(0.0, 0.0, yaw);
            for point in &points {
                let seen = from.act(*point);
                let place = if self.moved_end(tie) == 1 {
                    seen - turn.rotate(to.position())
                } else {
                    to.position() - turn.rotate(seen)
                };
                starts.push(Pose2::new(place.x, place.y, yaw));
            }
        }
        starts
    }

    /// The tie that says most about a place, and where it may have seen what it saw, in the frame it sees from.
    fn seed(&self) -> Option<(&Tie, Vec<Vector2>)> {
        let polar =
            |range: f64, bearing: f64| Vector2::new(range * libm::cos(bearing), range * libm::sin(bearing));
        let points = |tie: &Tie| match &tie.measured {
            Measured::Relative(Relative::Position { x_m, y_m }) => vec![Vector2::new(*x_m, *y_m)],
            Measured::Relative(Relative::RangeBearing { range_m, bearing_rad }) => {
                vec![polar(*range_m, *bearing_rad)]
            }
            Measured::Relative(Relative::Range { range_m }) => {
                let turn = std::f64::consts::TAU / f64::from(DIRECTIONS);
                (0..DIRECTIONS).map(|direction| polar(*range_m, turn * f64::from(direction))).collect()
            }
            Measured::Relative(Relative::Bearing { bearing_rad }) => {
                DISTANCES_M.iter().map(|range| polar(*range, *bearing_rad)).collect()
            }
            Measured::Relative(Relative::Pose(_)) | Measured::Heading(_) => Vec::new(),
        };
        let seeds = self.ties.iter().map(|(_, tie)| (*tie, points(tie)));
        seeds.filter(|(_, points)| !points.is_empty()).min_by_key(|(_, points)| points.len())
    }
}

/// A lower Cholesky factor.
struct Factor(Vec<Vec<f64>>);

impl Factor {
    /// Of a symmetric matrix given by its lower triangle; `None` if it is not positive definite.
    fn new(mut w: Vec<Vec<f64>>) -> Option<Self> {
        for row in 0..w.len() {
            for column in 0..=row {
                let mut sum = w[row][column];
                for k in 0..column {
                    sum -= w[row][k] * w[column][k];
                }
                if row == column {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    w[row][row] = sum.sqrt();
                } else {
                    w[row][column] = sum / w[column][column];
                }
            }
        }
        Some(Self(w))
    }

    /// `L^-1 b`.
    fn forward(&self, b: &[f64]) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(b.len());
        for (row, value) in b.iter().enumerate() {
            let mut sum = *value;
            for (k, earlier) in solved.iter().enumerate() {
                sum -= self.0[row][k] * earlier;
            }
            solved.push(sum / self.0[row][row]);
        }
        solved
    }

    /// `A L^-T`, both by columns.
    fn right(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut solved: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
        for (row, column) in columns.iter().enumerate() {
            let mut next = column.clone();
            for (k, earlier) in solved.iter().enumerate() {
                let factor = self.0[row][k];
                for (entry, value) in next.iter_mut().zip(earlier) {
                    *entry -= factor * value;
                }
            }
            for entry in &mut next {
                *entry /= self.0[row][row];
            }
            solved.push(next);
        }
        solved
    }
}

fn spread(dimension: usize, m: &Matrix3) -> Vec<Vec<f64>> {
    (0..dimension).map(|row| (0..dimension).map(|column| m[(row, column)]).collect()).collect()
}

fn entries(dimension: usize, v: &Vector3) -> Vec<f64> {
    (0..dimension).map(|k| v[k]).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in a.iter().zip(b) {
        sum += x * y;
    }
    sum
}

fn limited(step: Vector3) -> Vector3 {
    let turn = step.z.abs();
    if turn > LONGEST_TURN { step * (LONGEST_TURN / turn) } else { step }
}

/// Whether an information matrix has all three directions, beyond rounding.
fn factor3(information: &Matrix3) -> Option<Factor> {
    let scale = information[(0, 0)].max(information[(1, 1)]).max(information[(2, 2)]);
    let factor = Factor::new(spread(3, information))?;
    let weakest = factor.0.iter().enumerate().map(|(k, row)| row[k]).fold(f64::INFINITY, f64::min);
    (weakest * weakest > 1e-9 * scale).then_some(factor)
}

fn solve3(information: &Matrix3, along: &Vector3) -> Option<Vector3> {
    let inverse = inverse3(information)?;
    Some(inverse * along)
}

fn inverse3(information: &Matrix3) -> Option<Matrix3> {
    let factor = factor3(information)?;
    let columns = [0, 1, 2].map(|axis| {
        let mut unit = vec![0.0; 3];
        unit[axis] = 1.0;
        factor.forward(&unit)
    });
    Some(Matrix3::from_fn(|a, b| dot(&columns[a], &columns[b])))
}

/// The 99.9 % quantile of chi-square (`wilson1931`).
#[allow(clippy::cast_precision_loss, reason = "a few dozen")]
fn chi_square_999(dimension: usize) -> f64 {
    let d = dimension as f64;
    let share = 2.0 / (9.0 * d);
    let root = 1.0 - share + 3.090_232 * share.sqrt();
    d * root * root * root
}

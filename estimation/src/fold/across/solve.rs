//! How one component lies in another, by the ties between them: Gauss-Newton from many starts, and whether there is one answer.

mod dense;
mod starts;

use dense::{Factor, dot, entries, inverse3, solve3, spread};

use super::ties_of;
use crate::Pose2;
use crate::fact::Absolute;
use crate::fold::FoldConfig;
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::joint::{Component, End, Joint, Measured, Placement, Tie};
use crate::measurement::{self, Linearization};
use crate::sample::Relative;

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
/// A minimum found with each tie for itself that is so much less likely is not looked at more closely.
const HOPELESS: f64 = 100.0;
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

/// A Gauss-Newton step over all ties of a pair.
struct Step {
    rows: Vec<Row>,
    /// Of `W`.
    factor: Factor,
    /// `L^-1 Ht`, a row for every number measured.
    through: Vec<Vector3>,
    /// `Ht^T W^-1 Ht`.
    information: Matrix3,
    /// `L^-1 (r - Ht tau)`.
    left: Vec<f64>,
    tau: Vector3,
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
            let hopeless = distinct.first().is_some_and(|best| minimum.cost > best.cost + HOPELESS);
            if new && !hopeless && distinct.len() < MOST_MINIMA {
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
            if is_at_rest(&step, 1e-6) {
                break;
            }
        }
        last.is_finite().then_some(Minimum { transform, cost: last })
    }

    /// Gauss-Newton with all correlations, and what follows from the minimum.
    fn polish(&self, start: Pose2) -> Option<(Minimum, Placement)> {
        let mut transform = start;
        let mut last = None;
        for _ in 0..ITERATIONS {
            let step = self.step(&transform)?;
            transform = Pose2::exp(limited(step.tau)).compose(&transform);
            let done = is_at_rest(&step.tau, 1e-6);
            last = Some(step);
            if done {
                break;
            }
        }
        let step = last.filter(|step| is_at_rest(&step.tau, 1e-3))?;
        let cost = dot(&step.left, &step.left);
        let placement = Placement {
            transform,
            spread: inverse3(&step.information)?,
            columns: step.factor.right(&self.gains(&step.rows)),
            through: step.through,
            whitened: step.left,
            used: self.ties.iter().map(|(number, _)| *number).collect(),
        };
        Some((Minimum { transform, cost }, placement))
    }

    /// One step, with all correlations between ties.
    fn step(&self, transform: &Pose2) -> Option<Step> {
        let rows = self.rows(transform)?;
        let places: Vec<(usize, usize)> = rows
            .iter()
            .enumerate()
            .flat_map(|(tie, row)| (0..row.at.dimension).map(move |component| (tie, component)))
            .collect();
        let mut w = vec![vec![0.0; places.len()]; places.len()];
        for (i, one) in rows.iter().enumerate() {
            for (j, other) in rows.iter().enumerate().take(i + 1) {
                let mut block = self.covariance(one, other);
                if i == j {
                    block += self.ties[i].1.noise.to_matrix();
                }
                for (row, (_, a)) in places.iter().enumerate().filter(|(_, (tie, _))| *tie == i) {
                    for (column, (_, b)) in places.iter().enumerate().filter(|(_, (tie, _))| *tie == j) {
                        w[row][column] = block[(*a, *b)];
                    }
                }
            }
        }
        let factor = Factor::new(w)?;
        let stacked = |of: &dyn Fn(&Row, usize) -> f64| -> Vec<f64> {
            places.iter().map(|(tie, component)| of(&rows[*tie], *component)).collect()
        };
        let whitened = factor.forward(&stacked(&|row, k| row.at.innovation[k]));
        let columns = [0, 1, 2].map(|axis| factor.forward(&stacked(&|row, k| row.through[(k, axis)])));
        let information = Matrix3::from_fn(|a, b| dot(&columns[a], &columns[b]));
        let along = Vector3::from_fn(|a, _| dot(&columns[a], &whitened));
        let tau = solve3(&information, &along)?;
        let through: Vec<Vector3> =
            (0..places.len()).map(|k| Vector3::new(columns[0][k], columns[1][k], columns[2][k])).collect();
        // What is left of the innovations when the transform has taken its part.
        let taken = |q: &Vector3| q.x * tau.x + q.y * tau.y + q.z * tau.z;
        let left = whitened.iter().zip(&through).map(|(r, q)| r - taken(q)).collect();
        Some(Step { rows, factor, through, information, left, tau })
    }

    /// `P Hx^T`, by columns.
    fn gains(&self, rows: &[Row]) -> Vec<Vec<f64>> {
        let covariance = self.joint.covariance();
        let mut columns = Vec::new();
        for row in rows {
            for k in 0..row.at.dimension {
                let mut column = vec![0.0; covariance.size()];
                for (index, by) in &row.blocks {
                    for axis in 0..3 {
                        for (entry, value) in column.iter_mut().zip(covariance.row(3 * index + axis)) {
                            *entry += by[(k, axis)] * value;
                        }
                    }
                }
                columns.push(column);
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
}

/// A step no longer than so many metres, and a tenth as many radians.
fn is_at_rest(step: &Vector3, longest_m: f64) -> bool {
    step.x.abs() <= longest_m && step.y.abs() <= longest_m && step.z.abs() <= 0.1 * longest_m
}

fn limited(step: Vector3) -> Vector3 {
    let turn = step.z.abs();
    if turn > LONGEST_TURN { step * (LONGEST_TURN / turn) } else { step }
}

/// The 99.9 % quantile of chi-square (`wilson1931`).
#[allow(clippy::cast_precision_loss, reason = "a few dozen")]
fn chi_square_999(dimension: usize) -> f64 {
    let d = dimension as f64;
    let share = 2.0 / (9.0 * d);
    let root = 1.0 - share + 3.090_232 * share.sqrt();
    d * root * root * root
}

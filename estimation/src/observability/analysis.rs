//! Rank, null space and bounds.

use nalgebra::{DMatrix, DVector, SVD};

use super::words;
use crate::RobotId;
use crate::geometry::{Vector2, skew_times};

/// Singular values below this share of the largest count as zero. Jacobians are computed to about
/// 1e-15 of their largest entry (lever arms included), true directions in a run of metres and radians
/// stand far above 1e-9.
pub const DEFAULT_TOLERANCE: f64 = 1e-9;

/// Parts of unit null vectors below this count as zero.
const MOVES: f64 = 1e-6;

/// One measurement: its Jacobians by the errors of its participants. Any number of rows.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasurementRow {
    /// Index of the participant in the list of robots, and its block (m x 3).
    pub blocks: Vec<(usize, DMatrix<f64>)>,
}

/// What the three numbers of a robot's error mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Coordinates {
    /// Errors of x, y and heading: the linear textbook case.
    Linear,
    /// The invariant error `xi`, with every robot's position in the map (metres), where the position
    /// error is `[I, J p] xi`.
    Invariant(Vec<Vector2>),
}

/// Whether a robot's error stays bounded: whether no unobservable direction moves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RobotBounds {
    /// Which robot.
    pub robot: RobotId,
    /// No unobservable direction moves its position.
    pub position: bool,
    /// No unobservable direction turns it.
    pub heading: bool,
}

/// What a set of measurements can tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// Size of the state, 3 per robot.
    pub states: usize,
    /// Number of singular values above the tolerance.
    pub rank: usize,
    /// All singular values, as many as states, descending.
    pub singular_values: Vec<f64>,
    /// Orthonormal basis of what cannot be told, `states` x `states - rank`.
    pub null_space: DMatrix<f64>,
    /// The same in words, one for each dimension or (`position of robot 2`) for two.
    pub unobservable: Vec<String>,
    /// Per robot, in the order given.
    pub bounds: Vec<RobotBounds>,
}

/// The observability matrix: the rows of each step times the product of the transitions before it.
/// `transitions[k]` leads from step `k` to step `k + 1`; where there is none, it is the identity.
pub fn stack(states: usize, steps: &[Vec<MeasurementRow>], transitions: &[DMatrix<f64>]) -> DMatrix<f64> {
    let mut product = DMatrix::identity(states, states);
    let mut matrix = DMatrix::zeros(0, states);
    for (step, rows) in steps.iter().enumerate() {
        for row in rows {
            let height = row.blocks.first().map_or(0, |(_, block)| block.nrows());
            let mut h = DMatrix::zeros(height, states);
            for (index, block) in &row.blocks {
                h.view_mut((0, 3 * index), (height, 3)).copy_from(block);
            }
            let at = matrix.nrows();
            matrix = matrix.insert_rows(at, height, 0.0);
            matrix.view_mut((at, 0), (height, states)).copy_from(&(h * &product));
        }
        if let Some(transition) = transitions.get(step) {
            product = transition * product;
        }
        // An orthogonal factor changes neither singular values nor null space.
        if matrix.nrows() > 4 * states {
            matrix = matrix.qr().r();
        }
    }
    matrix
}

impl Observability {
    /// Analyses measurements in coordinates where the error stays put (`Phi = I`).
    pub fn of_rows(robots: &[RobotId], coordinates: &Coordinates, rows: &[MeasurementRow]) -> Self {
        let steps: Vec<Vec<MeasurementRow>> = rows.iter().map(|row| vec![row.clone()]).collect();
        let matrix = stack(3 * robots.len(), &steps, &[]);
        Self::of_matrix(robots, coordinates, &matrix, DEFAULT_TOLERANCE)
    }

    /// Analyses an observability matrix (any number of rows, 3 columns per robot) with a relative
    /// tolerance on its singular values.
    pub fn of_matrix(
        robots: &[RobotId],
        coordinates: &Coordinates,
        matrix: &DMatrix<f64>,
        tolerance: f64,
    ) -> Self {
        let states = 3 * robots.len();
        // The decomposition refuses an empty matrix.
        let mut directions: Vec<(f64, DVector<f64>)> = Vec::with_capacity(states);
        if states > 0 {
            // Zero rows make the decomposition give a full basis of the state space.
            let padded = matrix.clone().resize_vertically(matrix.nrows().max(states), 0.0);
            let svd = SVD::new(padded, false, true);
            for (value, direction) in
                svd.singular_values.iter().zip(svd.v_t.iter().flat_map(|v| v.row_iter()))
            {
                directions.push((*value, direction.transpose()));
            }
        }
        directions.sort_by(|a, b| b.0.total_cmp(&a.0));
        let largest = directions.first().map_or(0.0, |(value, _)| *value);
        let rank =
            directions.iter().filter(|(value, _)| *value > tolerance * largest && *value > 0.0).count();
        let mut null_space = DMatrix::zeros(states, states - rank);
        for (column, (_, direction)) in directions[rank..].iter().enumerate() {
            null_space.set_column(column, direction);
        }
        Self {
            states,
            rank,
            singular_values: directions.iter().map(|(value, _)| *value).collect(),
            unobservable: words::describe(robots, coordinates, &null_space),
            bounds: bounds(robots, coordinates, &null_space),
            null_space,
        }
    }
}

/// Whether any null vector moves or turns each robot.
fn bounds(robots: &[RobotId], coordinates: &Coordinates, null_space: &DMatrix<f64>) -> Vec<RobotBounds> {
    let of_robot = |(index, robot): (usize, &RobotId)| {
        let mut bounds = RobotBounds { robot: *robot, position: true, heading: true };
        for direction in null_space.column_iter() {
            let turn = direction[3 * index + 2];
            let mut shift = Vector2::new(direction[3 * index], direction[3 * index + 1]);
            if let Coordinates::Invariant(positions) = coordinates {
                shift += skew_times(positions[index]) * turn;
            }
            bounds.position &= shift.norm() < MOVES;
            bounds.heading &= turn.abs() < MOVES;
        }
        bounds
    };
    robots.iter().enumerate().map(of_robot).collect()
}

//! What a reading says of the states.

use nalgebra::SVector;

/// Slower than this a steering angle says nothing, m/s.
const LEAST_STEERED_M_S: f64 = 0.01;

/// A scalar measurement model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensor<const N: usize> {
    /// A state, or a sum of states with weights.
    Linear {
        /// The weights.
        row: SVector<f64, N>,
        /// Whether it is an angle, whose innovation is wrapped.
        angle: bool,
    },
    /// A steering angle, `atan(w L / V)` with the yaw rate `w` and the speed `V` of the axle that is not steered.
    Steering {
        /// `L`, from the axle that is not steered forward to the one that is, m: negative for rear steering.
        wheelbase_m: f64,
        /// Which state is the speed.
        speed: usize,
        /// Which state is the yaw rate.
        yaw_rate: usize,
    },
}

impl<const N: usize> Sensor<N> {
    /// Reads a state (`PairOfWheels::LEFT`: an encoder; `YAW_RATE`: a gyro; `X`: a coordinate of a fix).
    pub fn of(state: usize) -> Self {
        Self::sum(&[(state, 1.0)])
    }

    /// Reads a state that is an angle (`HEADING`: a compass, a sun sensor).
    pub fn of_angle(state: usize) -> Self {
        Self::Linear { row: weights(&[(state, 1.0)]), angle: true }
    }

    /// Reads a weighted sum of states: the speed of a wheel is that of the robot and half its track times the yaw
    /// rate.
    pub fn sum(terms: &[(usize, f64)]) -> Self {
        Self::Linear { row: weights(terms), angle: false }
    }

    /// Whether readings are angles.
    pub fn is_angle(&self) -> bool {
        match self {
            Self::Linear { angle, .. } => *angle,
            Self::Steering { .. } => true,
        }
    }

    /// What would be read in a state, and its derivative by the state; `None` where there is no derivative.
    pub fn predict(&self, state: &SVector<f64, N>) -> Option<(f64, SVector<f64, N>)> {
        match *self {
            Self::Linear { row, .. } => Some((row.dot(state), row)),
            Self::Steering { wheelbase_m, speed, yaw_rate } => {
                let (v, w) = (state[speed], state[yaw_rate]);
                if v.abs() < LEAST_STEERED_M_S {
                    return None;
                }
                // Of the quotient and not of the pair: a robot that reverses steers the other way.
                let tangent = wheelbase_m * w / v;
                let slope = 1.0 / (1.0 + tangent * tangent);
                let row = weights(&[(speed, -slope * tangent / v), (yaw_rate, slope * wheelbase_m / v)]);
                Some((libm::atan(tangent), row))
            }
        }
    }
}

/// A row with these entries; those beyond the states are left out.
fn weights<const N: usize>(terms: &[(usize, f64)]) -> SVector<f64, N> {
    let mut row = SVector::zeros();
    for (state, weight) in terms.iter().filter(|(state, _)| *state < N) {
        row[*state] += weight;
    }
    row
}

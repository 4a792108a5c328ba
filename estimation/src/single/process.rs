//! How the states of a robot move on.

use nalgebra::{SMatrix, SVector};

/// Where a state goes in a step, with its derivative and the noise that comes in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction<const N: usize> {
    /// The state after the step.
    pub mean: SVector<f64, N>,
    /// Its derivative by the state before.
    pub transition: SMatrix<f64, N, N>,
    /// Covariance of the process noise of the step.
    pub noise: SMatrix<f64, N, N>,
}

/// A model of motion over named states.
pub trait Process<const N: usize> {
    /// What the states are called, in their order; names carry their units.
    fn names(&self) -> [&'static str; N];

    /// Which of them is the heading, kept in (-pi, pi].
    fn heading(&self) -> usize;

    /// The state after `seconds`, above 0.
    fn predict(&self, state: &SVector<f64, N>, seconds: f64) -> Prediction<N>;
}

/// Process noise: every quantity wanders as a random walk, by so much per square root of a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RandomWalks {
    /// Position along each axis of the map, besides what the speed does: skid, m.
    pub position_m: f64,
    /// Heading, besides what the yaw rate does, rad.
    pub heading_rad: f64,
    /// Speeds, of the robot or of its wheels, m/s.
    pub speed_m_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// What the gyro reads at standstill, where a process has it, rad/s.
    pub gyro_bias_rad_s: f64,
}

/// A unicycle: `x, y, heading, speed V, yaw rate w`; `V` and `w` are random walks.
///
/// `x += V dt cos(heading + w dt/2)`, `y += V dt sin(heading + w dt/2)`, `heading += w dt`: the chord of the arc to
/// second order, where the formula with the heading at the beginning is of first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unicycle {
    /// Process noise.
    pub walks: RandomWalks,
}

/// A robot whose two sides turn without telling how it turns (skid steering): `x, y, heading`, the speeds of its left
/// and right wheels, the yaw rate, which does not follow from them, and the bias of the gyro that reads it; the last four
/// are random walks. Only an absolute measurement tells the yaw rate from the bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairOfWheels {
    /// Process noise.
    pub walks: RandomWalks,
}

/// Position of the planar states, common to all models.
const X: usize = 0;
const Y: usize = 1;
const HEADING: usize = 2;

impl Unicycle {
    /// East, m.
    pub const X: usize = X;
    /// North, m.
    pub const Y: usize = Y;
    /// Heading, rad.
    pub const HEADING: usize = HEADING;
    /// Forward speed, m/s.
    pub const SPEED: usize = 3;
    /// Yaw rate, rad/s.
    pub const YAW_RATE: usize = 4;
}

impl PairOfWheels {
    /// East, m.
    pub const X: usize = X;
    /// North, m.
    pub const Y: usize = Y;
    /// Heading, rad.
    pub const HEADING: usize = HEADING;
    /// Speed of the tread of the left wheels, m/s.
    pub const LEFT: usize = 3;
    /// Speed of the tread of the right wheels, m/s.
    pub const RIGHT: usize = 4;
    /// Yaw rate, rad/s.
    pub const YAW_RATE: usize = 5;
    /// What the gyro reads at standstill, rad/s.
    pub const GYRO_BIAS: usize = 6;
}

impl Process<5> for Unicycle {
    fn names(&self) -> [&'static str; 5] {
        ["x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s"]
    }

    fn heading(&self) -> usize {
        HEADING
    }

    fn predict(&self, state: &SVector<f64, 5>, seconds: f64) -> Prediction<5> {
        driven(state, &[(Self::SPEED, 1.0)], Self::YAW_RATE, seconds, &self.walks)
    }
}

impl Process<7> for PairOfWheels {
    fn names(&self) -> [&'static str; 7] {
        ["x_m", "y_m", "heading_rad", "left_m_s", "right_m_s", "yaw_rate_rad_s", "gyro_bias_rad_s"]
    }

    fn heading(&self) -> usize {
        HEADING
    }

    fn predict(&self, state: &SVector<f64, 7>, seconds: f64) -> Prediction<7> {
        let sides = [(Self::LEFT, 0.5), (Self::RIGHT, 0.5)];
        let mut prediction = driven(state, &sides, Self::YAW_RATE, seconds, &self.walks);
        prediction.noise[(Self::GYRO_BIAS, Self::GYRO_BIAS)] = self.walks.gyro_bias_rad_s.powi(2) * seconds;
        prediction
    }
}

/// Drives a planar robot whose speed is the weighted sum of some of its states.
fn driven<const N: usize>(
    state: &SVector<f64, N>,
    speeds: &[(usize, f64)],
    yaw_rate: usize,
    seconds: f64,
    walks: &RandomWalks,
) -> Prediction<N> {
    let speed: f64 = speeds.iter().map(|(index, weight)| weight * state[*index]).sum();
    let half_turn = 0.5 * state[yaw_rate] * seconds;
    let (sin, cos) = libm::sincos(state[HEADING] + half_turn);
    let mut mean = *state;
    mean[X] += speed * seconds * cos;
    mean[Y] += speed * seconds * sin;
    mean[HEADING] += state[yaw_rate] * seconds;

    let mut transition = SMatrix::<f64, N, N>::identity();
    let (d_x_d_heading, d_y_d_heading) = (-speed * seconds * sin, speed * seconds * cos);
    transition[(X, HEADING)] = d_x_d_heading;
    transition[(Y, HEADING)] = d_y_d_heading;
    transition[(X, yaw_rate)] = 0.5 * seconds * d_x_d_heading;
    transition[(Y, yaw_rate)] = 0.5 * seconds * d_y_d_heading;
    transition[(HEADING, yaw_rate)] = seconds;
    let mut noise = SMatrix::<f64, N, N>::zeros();
    let square = |per_sqrt_s: f64| per_sqrt_s * per_sqrt_s * seconds;
    noise[(X, X)] = square(walks.position_m);
    noise[(Y, Y)] = square(walks.position_m);
    noise[(HEADING, HEADING)] = square(walks.heading_rad);
    noise[(yaw_rate, yaw_rate)] = square(walks.yaw_rate_rad_s);
    for (index, weight) in speeds {
        transition[(X, *index)] = weight * seconds * cos;
        transition[(Y, *index)] = weight * seconds * sin;
        noise[(*index, *index)] = square(walks.speed_m_s);
    }
    Prediction { mean, transition, noise }
}

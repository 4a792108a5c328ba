//! Paths, and how the robot slips on them.
//!
//! The sizes of the slip are chosen so that raw and calibrated odometry err about as much as the published robot did:
//! those two rows of the table are input. What the filter makes of the same runs is not.

use pleiad_physics::{ActiveEffect, Effect, PhysicsError, Scope};
use pleiad_sim_peers::{Scenario, SimulatedRun};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::NAME;
use crate::error::SurveyError;
use crate::solo::{ROBOT, scenario, simulated};

const SCENARIO: &str = include_str!("../../../scenarios/skid_steer.toml");
const SPEED_M_S: f64 = 0.4;
const SPIN_RAD_S: f64 = 0.5;
const PAUSE_S: f64 = 1.0;

/// Mean and spread from run to run of how much wider than believed the track acts.
const TRACK: [f64; 2] = [0.10, 0.12];
/// Its spread from turn to turn.
const TRACK_TURN: f64 = 0.08;
/// Mean and spread of the wheels' radius against nominal: tyres that give.
const RADIUS: [f64; 2] = [-0.03, 0.01];
/// Spread of the difference of the wheels' radii.
const UNEQUAL: f64 = 0.01;
/// How far behind the middle the robot turns about, mean and spread, m.
const ICR_M: [f64; 2] = [0.02, 0.02];
/// Spread of the gyro's scale, and its random walk in rad/s per root of a second.
const GYRO_SCALE: f64 = 0.005;
const GYRO_WALK: f64 = 0.0002;

/// A closed path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// Three sides of 6 m.
    Triangle,
    /// Four sides of 5 m.
    Square,
    /// 8 m ahead and back.
    OutAndBack,
    /// 8 m by 4 m.
    Rectangle,
    /// Four laps of a square of 8 m, for the fixes.
    Laps,
    /// 8 m ahead and two turns each way on the spot, for the calibration.
    Calibration,
}

impl Path {
    /// The four of the published table, in its order.
    pub const PUBLISHED: [Self; 4] = [Self::Triangle, Self::Square, Self::OutAndBack, Self::Rectangle];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Square => "square",
            Self::OutAndBack => "out and back",
            Self::Rectangle => "rectangle",
            Self::Laps => "laps",
            Self::Calibration => "calibration",
        }
    }

    /// Published errors of raw odometry, calibrated odometry and filter, percent of the distance (`goel1999`).
    pub fn published_percent(self) -> Option<[f64; 3]> {
        match self {
            Self::Triangle => Some([22.7, 14.0, 2.5]),
            Self::Square => Some([21.5, 17.4, 0.4]),
            Self::OutAndBack => Some([23.1, 17.1, 0.9]),
            Self::Rectangle => Some([20.5, 15.7, 2.6]),
            Self::Laps | Self::Calibration => None,
        }
    }

    /// What is driven: metres ahead, then radians on the spot.
    fn legs(self) -> Vec<[f64; 2]> {
        let quarter = std::f64::consts::FRAC_PI_2;
        let full = std::f64::consts::TAU;
        match self {
            Self::Triangle => vec![[6.0, full / 3.0], [6.0, full / 3.0], [6.0, 0.0]],
            Self::Square => vec![[5.0, quarter], [5.0, quarter], [5.0, quarter], [5.0, 0.0]],
            Self::OutAndBack => vec![[8.0, full / 2.0], [8.0, 0.0]],
            Self::Rectangle => vec![[8.0, quarter], [4.0, quarter], [8.0, quarter], [4.0, 0.0]],
            Self::Laps => vec![[8.0, quarter]; 16],
            Self::Calibration => vec![[8.0, 2.0 * full], [0.0, -2.0 * full]],
        }
    }

    /// The commands, and when each turn on the spot begins and ends after the first of them.
    fn script(self) -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
        let mut script = vec![[0.0, 0.0, PAUSE_S]];
        let mut turns = Vec::new();
        let mut now_s = PAUSE_S;
        for [ahead_m, turn_rad] in self.legs() {
            if ahead_m > 0.0 {
                script.push([SPEED_M_S, 0.0, ahead_m / SPEED_M_S]);
                script.push([0.0, 0.0, PAUSE_S]);
                now_s += ahead_m / SPEED_M_S + PAUSE_S;
            }
            if turn_rad != 0.0 {
                let lasts_s = turn_rad.abs() / SPIN_RAD_S;
                script.push([0.0, SPIN_RAD_S.copysign(turn_rad), lasts_s]);
                script.push([0.0, 0.0, PAUSE_S]);
                turns.push([now_s, now_s + lasts_s + PAUSE_S]);
                now_s += lasts_s + PAUSE_S;
            }
        }
        (script, turns)
    }
}

/// When GPS is received; never, if empty.
pub(super) type Reception = Vec<[f64; 2]>;

/// A run of a path with the slip of its seed.
pub(super) fn driven(
    path: Path,
    seed: u64,
    reception: &Reception,
) -> Result<(Scenario, SimulatedRun), SurveyError> {
    let mut scenario = scenario(NAME, SCENARIO)?;
    let (script, turns) = path.script();
    scenario.duration_s = script.iter().map(|row| row[2]).sum::<f64>() + 1.0;
    let effects = slip(path, seed, &turns)
        .map_err(|error| SurveyError::Scenario { study: NAME, source: Box::new(error) })?;
    if let Some(robot) = scenario.robots.get_mut(&ROBOT) {
        robot.motion.script = script;
        robot.effects = effects;
        robot.gps.windows_s.clone_from(reception);
        if reception.is_empty() {
            robot.gps.rate_hz = 0.0;
        }
    }
    let run = simulated(NAME, &scenario, seed)?;
    Ok((scenario, run))
}

/// How the robot slips in a run: another draw for each path and seed.
fn slip(path: Path, seed: u64, turns: &[[f64; 2]]) -> Result<Vec<ActiveEffect<f64>>, PhysicsError> {
    let mut random = ChaCha12Rng::seed_from_u64(seed.wrapping_mul(8).wrapping_add(path as u64));
    let mut normal = |[mean, sigma]: [f64; 2]| -> f64 {
        let draw: f64 = StandardNormal.sample(&mut random);
        mean + sigma * draw
    };
    let mut effects = vec![
        ActiveEffect::new(Effect::TrackWidthError, &[normal(TRACK)])?,
        ActiveEffect::new(Effect::WheelRadiusError, &[normal(RADIUS)])?,
        ActiveEffect::new(Effect::UnequalWheelRadii, &[normal([0.0, UNEQUAL])])?,
        ActiveEffect::new(Effect::IcrOffset, &[normal(ICR_M)])?,
        ActiveEffect::new(Effect::GyroScale, &[normal([0.0, GYRO_SCALE])])?,
        ActiveEffect::new(Effect::GyroRandomWalk, &[GYRO_WALK])?,
    ];
    for [from, until] in turns {
        let own = ActiveEffect::new(Effect::TrackWidthError, &[normal([0.0, TRACK_TURN])])?;
        effects.push(own.within(Scope { window_s: Some((*from, *until)), ..Scope::default() }));
    }
    Ok(effects)
}

//! From a plan to a scenario and its answer.

use pleiad_estimation::RobotId;
use pleiad_physics::Effect;
use pleiad_sim_peers::Scenario;
use pleiad_sim_peers::scenario::{LastingSlip, MotionNoise, Policy, RobotSettings, Start};

use super::draw::Draw;
use super::inject::{inject, injected, robot_for, values};
use super::{Case, Plan, What, rare};
use crate::class::Noise;
use crate::error::BenchmarkError;
use crate::seal::{Answer, Injected, sha256};

/// The recording that all cases begin with.
const SCENARIO: &str = include_str!("../../../scenarios/concealed.toml");

/// White slip: forward, left (m per root of a second), yaw (rad per root of a second).
const WHITE: [f64; 3] = [0.002, 0.001, 0.001];
/// Slip that lasts: standard deviations of the velocities (m/s, m/s, rad/s) and their time constant, seconds. Over a
/// second it moves a robot about as far as the white one.
const LASTING: [f64; 3] = [0.002, 0.001, 0.001];
const LASTING_S: f64 = 2.0;
/// Of heavy-tailed noise.
const DEGREES_OF_FREEDOM: f64 = 3.0;

/// The wheels of the masked square: right over left diameter, and the track over the declared one, which together
/// bring a robot back after a square of 4 m driven counter-clockwise (`borenstein1996`).
const DIAMETER_RATIO: f64 = 1.004;
const TRACK_RATIO: f64 = 1.0339;
const SIDE_M: f64 = 4.0;
const SQUARE_SPEED_M_S: f64 = 0.4;
/// A quarter of a turn takes so long, seconds: a whole number of commands, so that it is exact.
const QUARTER_S: f64 = 2.0;
/// It stands still so long at each corner, seconds, while the servo settles.
const CORNER_S: f64 = 0.6;
/// The jitter of its commands, seconds: the steps of the simulation, which commands wait for. Without any declared,
/// those would show as `command_jitter`.
const SQUARE_JITTER_S: f64 = 0.002;
/// And so long at the beginning, seconds: what is commanded then changes between commands, never at one.
const FIRST_S: f64 = 0.62;

/// The share of the typical size of a small effect, and that of the large one over it.
const SMALL: f64 = 0.5;
const LARGE: f64 = 3.0;

/// The speed of a circle, m/s, and its radius, metres.
const CIRCLE_M_S: f64 = 0.5;
const CIRCLE_M: f64 = 0.9;

pub(super) fn build(plan: &Plan) -> Result<Case, BenchmarkError> {
    let mut draw = Draw::of(&plan.id);
    let mut scenario = base(&plan.id)?;
    let seed = draw.seed();
    noise(&mut scenario, plan.noise);
    let mut left_out = Vec::new();
    let mut size = None;
    let injected = match plan.what {
        What::Nothing => Vec::new(),
        What::Effect { effect, size: own } => {
            size = Some(own);
            vec![single(&mut scenario, effect, own, &mut draw)?]
        }
        What::Masked => masked(&mut scenario, &mut draw)?,
        What::Absorbed(effect) => absorbed(&mut scenario, effect, &mut draw)?,
        What::Cancelling(effect) => cancelling(&mut scenario, effect, &mut draw)?,
        What::Buried { small, large } => {
            let robot = robot_for(small, &mut draw);
            let mut all = Vec::new();
            for (effect, own) in [(large, LARGE), (small, SMALL)] {
                let values = values(effect, own, scenario.duration_s, &mut draw);
                all.push(inject(&mut scenario, effect, &values, robot, None)?);
            }
            all
        }
        What::Rare(effect) => vec![rare::rare(&mut scenario, effect, seed, &mut draw)?],
        What::LeftOut(effect) => {
            left_out.push(effect);
            vec![single(&mut scenario, effect, 1.0, &mut draw)?]
        }
        What::Circling(effect) => {
            circle(&mut scenario);
            vec![single(&mut scenario, effect, 1.0, &mut draw)?]
        }
    };
    let answer = Answer {
        id: plan.id.clone(),
        class: plan.class,
        noise: plan.noise,
        size,
        recording_sha256: sha256(format!("{seed} {scenario:?}").as_bytes()),
        injected,
        left_out: left_out.iter().map(|effect| effect.name().to_owned()).collect(),
    };
    Ok(Case { answer, scenario, seed, left_out })
}

/// The scenario without noise of the slip, under the name of a case.
pub(super) fn base(id: &str) -> Result<Scenario, BenchmarkError> {
    let source = |error| BenchmarkError::Simulation { id: id.to_owned(), source: Box::new(error) };
    let mut scenario = Scenario::from_toml(SCENARIO, "concealed.toml").map_err(source)?;
    id.clone_into(&mut scenario.name);
    Ok(scenario)
}

pub(super) fn noise(scenario: &mut Scenario, noise: Noise) {
    for own in scenario.robots.values_mut() {
        match noise {
            Noise::Quiet => {}
            Noise::White => white(own),
            Noise::Coloured => {
                let [speed_m_s, lateral_m_s, yaw_rad_s] = LASTING;
                own.odometry.lasting =
                    LastingSlip { speed_m_s, lateral_m_s, yaw_rad_s, time_constant_s: LASTING_S };
            }
            Noise::HeavyTailed => {
                white(own);
                own.noise_degrees_of_freedom = DEGREES_OF_FREEDOM;
            }
        }
    }
}

fn white(own: &mut RobotSettings) {
    let [speed_m_per_sqrt_s, lateral_m_per_sqrt_s, yaw_rad_per_sqrt_s] = WHITE;
    own.odometry.noise =
        MotionNoise { speed_m_per_sqrt_s, lateral_m_per_sqrt_s, yaw_rad_per_sqrt_s, ..own.odometry.noise };
}

fn single(
    scenario: &mut Scenario,
    effect: Effect,
    size: f64,
    draw: &mut Draw,
) -> Result<Injected, BenchmarkError> {
    let robot = robot_for(effect, draw);
    let values = values(effect, size, scenario.duration_s, draw);
    inject(scenario, effect, &values, robot, None)
}

/// Squares of one sense, on one robot with wheels that bring it back all the same.
fn masked(scenario: &mut Scenario, draw: &mut Draw) -> Result<Vec<Injected>, BenchmarkError> {
    scenario.arena.width_m = 3.0 * (SIDE_M + 1.0);
    scenario.arena.height_m = SIDE_M + 1.0;
    for (index, own) in scenario.robots.values_mut().enumerate() {
        let x_m = (index as f64 - 1.0) * (SIDE_M + 1.0) - 0.5 * SIDE_M;
        own.start = Some(Start { x_m, y_m: -0.5 * SIDE_M, heading_rad: 0.0 });
        own.motion.policy = Policy::Script;
        // A command that comes at another time turns the robot by another angle.
        own.command_jitter_s = SQUARE_JITTER_S;
        let leg = [
            [SQUARE_SPEED_M_S, 0.0, SIDE_M / SQUARE_SPEED_M_S],
            [0.0, 0.0, CORNER_S],
            [0.0, 0.5 * std::f64::consts::PI / QUARTER_S, QUARTER_S],
            [0.0, 0.0, CORNER_S],
        ];
        let lap_s = 4.0 * leg.iter().map(|row| row[2]).sum::<f64>();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few laps")]
        let laps = (scenario.duration_s / lap_s).ceil() as usize;
        own.motion.script = vec![[0.0, 0.0, FIRST_S]];
        own.motion.script.extend(leg.repeat(4 * laps));
    }
    let robot = [1, 2, 3].map(RobotId)[draw.below(3)];
    // The left wheel is larger by half the ratio, the right one smaller by as much.
    let ratio = 2.0 * (1.0 - DIAMETER_RATIO) / (1.0 + DIAMETER_RATIO);
    let unequal = inject(scenario, Effect::UnequalWheelRadii, &[ratio], robot, None)?;
    let track = inject(scenario, Effect::TrackWidthError, &[TRACK_RATIO - 1.0], robot, None)?;
    Ok(vec![unequal, track])
}

/// An effect, and a declared value that brings the mean of its residuals to zero.
fn absorbed(
    scenario: &mut Scenario,
    effect: Effect,
    draw: &mut Draw,
) -> Result<Vec<Injected>, BenchmarkError> {
    let robot = robot_for(effect, draw);
    let duration_s = scenario.duration_s;
    let values = values(effect, 1.0, duration_s, draw);
    let mut all = vec![inject(scenario, effect, &values, robot, None)?];
    let Some(own) = scenario.robots.get_mut(&robot) else { return Ok(all) };
    let tuned = match effect {
        // The radius as it is on average over the run.
        Effect::PayloadAdded => values[1] * (1.0 - values[0] / duration_s),
        // As it is at a usual speed, m/s.
        Effect::SpeedDependentScale => -values[0] * 0.6 * own.motion.speed_m_s,
        // As it is over the way forth and back.
        Effect::ReverseAsymmetry => 0.5 * values[0],
        _ => {
            // The bias as it is on average over the run.
            let spans = duration_s / values[1];
            let bias_rad_s = values[0] * (1.0 - (1.0 - (-spans).exp()) / spans);
            own.declared.gyro_bias_rad_s = Some(bias_rad_s);
            all.push(injected(Effect::GyroBias, &[-bias_rad_s], vec![robot.0], None));
            return Ok(all);
        }
    };
    own.declared.wheel_radius = Some(own.wheel_radius_m * (1.0 + tuned));
    let wrong = 1.0 / (1.0 + tuned) - 1.0;
    all.push(injected(Effect::WheelRadiusError, &[wrong], vec![robot.0], None));
    Ok(all)
}

/// Two effects of opposite sign.
fn cancelling(
    scenario: &mut Scenario,
    effect: Effect,
    draw: &mut Draw,
) -> Result<Vec<Injected>, BenchmarkError> {
    let robot = robot_for(effect, draw);
    let sign = draw.sign();
    let pair: [(Effect, Vec<f64>); 2] = match effect {
        // At a range of 2.5 m.
        Effect::RangeBias => [(effect, vec![0.05 * sign]), (Effect::RangeScale, vec![-0.02 * sign])],
        // At 0.5 m/s.
        Effect::WheelRadiusError => {
            [(effect, vec![0.01 * sign]), (Effect::SpeedDependentScale, vec![0.02 * sign])]
        }
        // Of the bearing, at a range of 2.5 m.
        _ => [(effect, vec![-0.04 * sign]), (Effect::SensorLeverArm, vec![0.0, 0.1 * sign])],
    };
    pair.iter().map(|(effect, values)| inject(scenario, *effect, values, robot, None)).collect()
}

/// All robots circle at one speed in one sense.
fn circle(scenario: &mut Scenario) {
    for (index, own) in scenario.robots.values_mut().enumerate() {
        let x_m = (index as f64 - 1.0) * 4.0;
        own.start = Some(Start { x_m, y_m: -CIRCLE_M, heading_rad: 0.0 });
        own.motion.policy = Policy::Circle;
        own.motion.speed_m_s = CIRCLE_M_S;
        own.motion.radius_m = CIRCLE_M;
    }
}

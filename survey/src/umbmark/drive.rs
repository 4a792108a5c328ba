//! The procedure driven by a simulated robot.

use pleiad_estimation::RobotId;
use pleiad_mismatch::calibration::umbmark::{
    Pace, Run, Turning, UmbmarkError, WheelFactors, square_commands, straight_commands, turn_commands,
};
use pleiad_recording::Recording;
use pleiad_sim_peers::scenario::{DriveKind, Policy, RobotSettings};
use pleiad_sim_peers::{Scenario, simulate};

use crate::error::SurveyError;

/// Squares in each direction.
pub const SQUARES: u64 = 5;
/// Straight lines and turns on the spot, of each so many.
const OTHERS: u64 = 3;
/// A turn on the spot, radians: two turns.
const TURN_RAD: f64 = 4.0 * std::f64::consts::PI;
/// Standing between motions, and after the last, seconds.
const PAUSE_S: f64 = 1.2;
const STANDING_S: f64 = 1.0;
/// Seeds of the runs of one procedure lie apart by one, those of procedures by this.
const RUNS_OF_A_SEED: u64 = 1000;

/// The recordings of one procedure, and the runs in them.
pub struct Driven {
    /// As they would be recorded, named by what was driven.
    pub recordings: Vec<Recording>,
    /// The same, read.
    pub runs: Vec<Run>,
}

/// The robot of a scenario that is calibrated: the only one.
pub(super) fn robot(scenario: &Scenario) -> Result<(RobotId, &RobotSettings), SurveyError> {
    let mut robots = scenario.robots.iter();
    match (robots.next(), robots.next()) {
        (Some((id, settings)), None) if settings.drive.kind != DriveKind::CarLike => Ok((*id, settings)),
        (Some((_, settings)), None) => {
            Err(refused(format!("drive.kind = \"{:?}\": UMBmark turns on the spot", settings.drive.kind)))
        }
        _ => Err(refused(format!("it has {} robots; UMBmark is driven by one", scenario.robots.len()))),
    }
}

pub(super) fn refused(why: String) -> SurveyError {
    SurveyError::Scenario { study: "umbmark", source: why.into() }
}

/// Drives squares both ways, straight lines and turns on the spot. The robot drives by its own odometry, with wheels as
/// `known`. `set` tells runs apart that are driven with one seed, one after the other.
pub(super) fn drive(
    scenario: &Scenario,
    known: WheelFactors,
    seed: u64,
    set: u64,
) -> Result<Driven, SurveyError> {
    let (id, settings) = robot(scenario)?;
    let motion = &settings.motion;
    let pace = Pace {
        speed_m_s: motion.speed_m_s,
        yaw_rate_rad_s: motion.max_yaw_rate_rad_s,
        pause_s: PAUSE_S,
        period_s: 1.0 / settings.command_rate_hz,
        track_m: settings.declared.track_width.unwrap_or(settings.track_width_m) * ratio(settings),
    };
    let square = |turning| square_commands(&pace, known, motion.side_m, turning);
    let mut plan = Vec::new();
    for number in 1..=SQUARES {
        plan.push((format!("cw{number}"), square(Turning::Clockwise)));
        plan.push((format!("ccw{number}"), square(Turning::CounterClockwise)));
    }
    for number in 1..=OTHERS {
        plan.push((format!("straight{number}"), straight_commands(&pace, known, motion.side_m)));
        // Both ways, so that what the stand adds on one side goes out of the mean.
        let angle_rad = if number % 2 == 0 { -TURN_RAD } else { TURN_RAD };
        plan.push((format!("turn{number}"), turn_commands(&pace, known, angle_rad)));
    }
    let mut driven = Driven { recordings: Vec::new(), runs: Vec::new() };
    for (number, (name, rows)) in (0_u64..).zip(plan) {
        let recording = record(scenario, id, rows, seed * RUNS_OF_A_SEED + set * 100 + number, name)?;
        driven.runs.push(Run::of(&recording, id).map_err(study_error)?);
        driven.recordings.push(recording);
    }
    Ok(driven)
}

pub(super) fn study_error(error: UmbmarkError) -> SurveyError {
    SurveyError::Scenario { study: "umbmark", source: Box::new(error) }
}

fn ratio(settings: &RobotSettings) -> f64 {
    match settings.drive.kind {
        DriveKind::SkidSteer => settings.drive.track_ratio,
        _ => 1.0,
    }
}

/// One run by commands.
fn record(
    scenario: &Scenario,
    id: RobotId,
    rows: Vec<[f64; 3]>,
    seed: u64,
    name: String,
) -> Result<Recording, SurveyError> {
    let mut scenario = scenario.clone();
    // The first command is given within a period of commands and of odometry.
    scenario.duration_s = rows.iter().map(|row| row[2]).sum::<f64>() + 0.5 + STANDING_S;
    scenario.name = name;
    if let Some(settings) = scenario.robots.get_mut(&id) {
        settings.motion.policy = Policy::Script;
        settings.motion.script = rows;
    }
    let run = simulate(&scenario, seed)
        .map_err(|source| SurveyError::Scenario { study: "umbmark", source: Box::new(source) })?;
    Ok(run.recording)
}

//! One procedure: measure, correct, and measure again on fresh runs.

use pleiad_mismatch::calibration::umbmark::{Stage, Umbmark, WheelErrors, WheelFactors, calibrate, stage};
use pleiad_physics::Effect;
use pleiad_sim_peers::Scenario;

use super::drive::{Driven, drive, robot, study_error};
use crate::error::SurveyError;

/// A procedure with its outcome.
pub struct Trial {
    /// The runs of the nominal robot.
    pub first: Driven,
    /// The runs of the corrected robot.
    pub second: Driven,
    /// The calibration on the first runs.
    pub calibration: Umbmark,
    /// The second runs, with corrected odometry.
    pub after: Stage,
    /// The first runs with the track and the scale alone corrected.
    pub track_alone: Stage,
    /// The first runs with `c_L` and `c_R` on the wrong wheels.
    pub swapped: Stage,
    /// What was injected.
    pub injected: WheelErrors,
}

impl Trial {
    /// Drives the procedure of a scenario.
    pub(super) fn run(scenario: &Scenario, seed: u64) -> Result<Self, SurveyError> {
        let injected = injected(scenario)?;
        let first = drive(scenario, WheelFactors::NONE, seed, 0)?;
        let calibration = calibrate(&first.runs, WheelFactors::NONE).map_err(study_error)?;
        let swapped = stage(&first.runs, calibration.factors.swapped()).map_err(study_error)?;
        let mean = WheelErrors { e_d: 1.0, ..calibration.factors.errors() }.factors();
        let track_alone = stage(&first.runs, mean).map_err(study_error)?;
        let second = drive(scenario, calibration.factors, seed, 1)?;
        let after = stage(&second.runs, calibration.factors).map_err(study_error)?;
        Ok(Self { first, second, calibration, after, track_alone, swapped, injected })
    }

    /// By how much `E_max,syst` falls.
    pub fn improvement(&self) -> f64 {
        self.calibration.before.e_max_syst_m / self.after.e_max_syst_m
    }
}

/// The ratios that a scenario's effects and mis-declared wheels and track amount to.
fn injected(scenario: &Scenario) -> Result<WheelErrors, SurveyError> {
    let (_, settings) = robot(scenario)?;
    let radius = settings.wheel_radius_m / settings.declared.wheel_radius.unwrap_or(settings.wheel_radius_m);
    let track = settings.track_width_m / settings.declared.track_width.unwrap_or(settings.track_width_m);
    let mut errors = WheelErrors { e_d: 1.0, e_b: track, e_s: radius };
    for active in &settings.effects {
        let value = active.values()[0];
        match active.effect() {
            Effect::UnequalWheelRadii => errors.e_d *= (1.0 - 0.5 * value) / (1.0 + 0.5 * value),
            Effect::TrackWidthError => errors.e_b *= 1.0 + value,
            Effect::WheelRadiusError => errors.e_s *= 1.0 + value,
            _ => {}
        }
    }
    Ok(errors)
}

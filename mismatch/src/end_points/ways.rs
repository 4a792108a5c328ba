//! The ways of a robot from reference pose to reference pose, under a model.

use nalgebra::{DMatrix, DVector};
use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::{ActiveEffect, Effect, Floors};
use pleiad_recording::Recording;

use super::path::{reach_m, steps};
use crate::body;
use crate::diagnosis::Prepared;
use crate::error::MismatchError;

/// Half the step of a derivative, relative errors.
const STEP: f64 = 1e-5;

/// Residuals with their derivatives.
pub(super) struct Ways {
    /// Measured minus predicted, forward, left and yaw of each way, over their sigmas.
    pub(super) residuals: DVector<f64>,
    /// Derivatives of what is predicted by the effects, over the same sigmas: a column each.
    pub(super) columns: DMatrix<f64>,
}

/// A recording of a robot with what is needed to predict its end points.
pub(super) struct Case<'a> {
    own: Prepared<'a>,
    robot: RobotId,
    /// Time, distance and turn of each step of the wheels.
    pub(super) steps: Vec<[f64; 3]>,
    pub(super) floors: Floors,
}

impl<'a> Case<'a> {
    /// `None` if the robot has no wheels recorded.
    pub(super) fn of(recording: &'a Recording, robot: RobotId) -> Result<Option<Self>, MismatchError> {
        let own = Prepared::alone(recording, false)?;
        let Some(model) = own.models.get(&robot) else { return Ok(None) };
        let floors = own.member(robot).map_or_else(Floors::default, |member| member.floors);
        let Some((_, track)) = own.evidence.robot(robot) else { return Ok(None) };
        let steps = steps(track, model);
        Ok((!steps.is_empty()).then_some(Self { own, robot, steps, floors }))
    }

    /// The ways with these errors of geometry added to what is declared; `None` if there is none.
    pub(super) fn ways(&self, effects: &[Effect], errors: &DVector<f64>) -> Option<Ways> {
        let (_, track) = self.own.evidence.robot(self.robot)?;
        let model = self.own.models.get(&self.robot)?;
        let plan = body::plan_of_length(&self.own.evidence, self.robot, 0.0);
        let noise =
            self.own.recording.nominal.as_ref().map(|nominal| nominal.noise.clone()).unwrap_or_default();
        let differences = |errors: &DVector<f64>| -> Vec<[f64; 3]> {
            let mut model = model.clone();
            for (&effect, &size) in effects.iter().zip(errors.iter()) {
                model.effects.extend(ActiveEffect::new(effect, &[size]).ok());
            }
            let mut state = BodyState::default();
            let each = plan.items.iter();
            each.map(|item| body::difference(&item.measured, &item.predicted(track, &model, &mut state)))
                .collect()
        };
        let residuals = differences(errors);
        if residuals.is_empty() {
            return None;
        }
        let mut sigmas = Vec::with_capacity(residuals.len());
        for item in &plan.items {
            let [from_s, to_s] = item.stamps_s();
            let (length_s, reach_m) = (to_s - from_s, reach_m(&self.steps, from_s, to_s));
            // A turn of the first pose, or half-way, swings the end about; half the way by the root of a third.
            let turned = noise.odometry_floor_heading_sigma_rad_per_1s.powi(2) * length_s;
            let yaw = 2.0 * noise.truth_sigma_rad.powi(2) + turned;
            let swing = (noise.truth_sigma_rad.powi(2) + turned / 3.0) * reach_m.powi(2);
            let shift = noise.odometry_floor_pos_sigma_m_per_1s.powi(2) * length_s;
            let place = 2.0 * noise.truth_sigma_m.powi(2) + shift + swing;
            let floor = |variance: f64| variance.max(1e-12).sqrt();
            sigmas.extend([floor(place), floor(place), floor(yaw)]);
        }
        let sigmas = DVector::from_vec(sigmas);
        let flat = |all: &[[f64; 3]]| DVector::from_iterator(3 * all.len(), all.iter().flatten().copied());
        let mut columns = DMatrix::zeros(sigmas.len(), effects.len());
        for index in 0..effects.len() {
            let moved = |step: f64| {
                let mut at = errors.clone();
                at[index] += step;
                flat(&differences(&at))
            };
            // Of what is predicted: residuals fall where predictions rise.
            let slope = (moved(-STEP) - moved(STEP)) / (2.0 * STEP);
            columns.set_column(index, &slope.component_div(&sigmas));
        }
        Some(Ways { residuals: flat(&residuals).component_div(&sigmas), columns })
    }
}

/// The same driven the other way round.
pub(super) fn mirror(recording: &Recording, robot: RobotId) -> Recording {
    let mut other = recording.clone();
    if let Some(own) = other.robots.get_mut(&robot) {
        for sample in &mut own.odometry {
            if let Reading::Wheels { left_rad, right_rad } = &mut sample.reading {
                std::mem::swap(left_rad, right_rad);
            }
        }
    }
    other
}

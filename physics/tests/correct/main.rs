//! Effects that are known are taken out of readings: by closed forms, and by way of the chain and back.

#![allow(clippy::unwrap_used, reason = "helpers of tests, outside a test function")]

mod closed_forms;
mod round_trip;

use pleiad_physics::correct::{Correction, Place};
use pleiad_physics::{ActiveEffect, Drive, Effect, Nominal, Pose, RobotModel};

/// What the estimator believes: 5 cm wheels, 30 cm apart, ideal sensors.
fn ideal() -> Nominal<f64> {
    Nominal::ideal(0.05, 0.3)
}

/// The robot that the estimator believes in, with one effect.
fn with(effect: Effect, values: &[f64]) -> Correction {
    let active = ActiveEffect::new(effect, values).unwrap();
    Correction::new(RobotModel::nominal(Drive::Differential, ideal()).with(active), ideal())
}

fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Place {
    Place { time_s: 3.0, pose: Pose::new(x_m, y_m, yaw_rad) }
}

//! The nominal model with what was found.

use pleiad_physics::{ActiveEffect, RobotModel};
use pleiad_recording::{DeclaredEffect, EffectSpec, Nominal, NominalNoise, NominalRangeSensor, NominalRobot};

use crate::diagnosis::naming::{Estimated, Judged};
use crate::diagnosis::run::Prepared;

/// View of a sensor of which nothing is declared: a half circle, and farther than any map.
const UNDECLARED_RANGE_M: f64 = 100.0;

/// The nominal model of a recording with the effects that were found.
pub(crate) fn corrected(own: &Prepared<'_>, found: &[&Judged]) -> Nominal {
    let mut nominal = own.recording.nominal.clone().unwrap_or_else(|| undeclared(own));
    for judged in found {
        for estimated in &judged.estimated {
            for (robot, declared) in &mut nominal.robots {
                if estimated.term.acts_on(*robot) {
                    declared.effects.push(effect(estimated));
                }
            }
        }
    }
    nominal
}

fn effect(estimated: &Estimated) -> DeclaredEffect {
    let active: ActiveEffect<f64> = estimated.term.active();
    let ci95 = (0..estimated.term.values.len()).map(|parameter| estimated.interval(parameter)).collect();
    DeclaredEffect { active, ci95 }
}

/// The section of a model file that applies an effect to a robot.
pub(crate) fn section(robot: u32, declared: &DeclaredEffect) -> String {
    let spec = EffectSpec::from(declared);
    let parameters = toml::Value::Table(spec.parameters);
    format!("[[robots.r{robot}.effects]]\nname = \"{}\"\nparameters = {parameters}", spec.name)
}

/// The sections of a model file that apply a finding to a robot.
pub(crate) fn sections(robots: &[u32], found: &[Estimated]) -> String {
    let mut sections = Vec::new();
    for robot in robots {
        for estimated in found {
            sections.push(section(*robot, &effect(estimated)));
        }
    }
    sections.join("\n\n")
}

/// A model file for a recording that came without one: what the built-in model holds.
fn undeclared(own: &Prepared<'_>) -> Nominal {
    let first = own.models.values().next();
    let noise = first.map_or_else(NominalNoise::default, |model| NominalNoise {
        range_sigma_m: model.nominal.range_sigma_m,
        bearing_sigma_rad: model.nominal.bearing_sigma_rad,
        ..NominalNoise::default()
    });
    let range_sensor = NominalRangeSensor {
        max_range_m: UNDECLARED_RANGE_M,
        half_fov_rad: std::f64::consts::FRAC_PI_2,
        detection_probability: 1.0,
        range_scale: 1.0,
        ..NominalRangeSensor::default()
    };
    let robots = own.models.iter().map(|(&robot, model)| (robot, declared(model))).collect();
    Nominal { noise, range_sensor, robots }
}

fn declared(model: &RobotModel<f64>) -> NominalRobot {
    NominalRobot {
        wheel_radius: model.nominal.wheel_radius,
        track_width: model.nominal.track_width,
        gyro_scale: model.nominal.gyro_scale,
        drive: model.drive,
        ..NominalRobot::default()
    }
}

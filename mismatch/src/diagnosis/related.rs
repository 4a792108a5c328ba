//! Whether commands and what they should drive go together at all.
//!
//! Where they do not (commands of another run, by another clock, of another robot), the best use of them is to
//! take less of them, and the search would find a limit or a gain that does not exist.

use pleiad_estimation::RobotId;
use pleiad_physics::{ActiveEffect, Effect, RobotModel};

use crate::channel::Channel;
use crate::compare::residuals_of;
use crate::evidence::Evidence;
use crate::residual::{ChannelResiduals, Residual};

/// Commands of which windows correlate less than this with the motion, along and in turns, say nothing of it. A
/// delay of half a window leaves about a half, a limit or a dead band more.
const LEAST_CORRELATION: f64 = 0.3;
/// Commands that vary less than this share of the motion ask for too little for it to be seen.
const LEAST_DEMAND: f64 = 0.5;
/// Fewer windows tell nothing.
const LEAST_WINDOWS: usize = 30;

/// The greatest correlation of what a model predicts from commands with what was measured, if it is too small;
/// `None` if commands and motion go together, or nothing can be said.
pub(crate) fn unrelated(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<f64>,
    found: &ChannelResiduals<f64>,
) -> Option<f64> {
    // Along, and in turns: of the wheels' mean and difference, or of the body.
    let components = match found.channel {
        Channel::Actuator => [0, 1],
        Channel::CommandedBody => [0, 2],
        _ => return None,
    };
    if found.rows.len() < LEAST_WINDOWS {
        return None;
    }
    // Without commands all that was measured is left.
    let idle = model.clone().with(ActiveEffect::new(Effect::ActuatorGain, &[-1.0, -1.0]).ok()?);
    let measured = residuals_of(evidence, robot, &idle, found.channel);
    if measured.rows.len() != found.rows.len() {
        return None;
    }
    let correlations = components.iter().filter_map(|&component| {
        let of = |row: &Residual<f64>| row.values().get(component).copied().unwrap_or(0.0);
        let measured: Vec<f64> = measured.rows.iter().map(of).collect();
        let predicted: Vec<f64> =
            measured.iter().zip(&found.rows).map(|(measured, row)| measured - of(row)).collect();
        correlation(&predicted, &measured)
    });
    correlations.reduce(f64::max).filter(|greatest| *greatest < LEAST_CORRELATION)
}

/// The correlation of a prediction and a measurement about their means; `None` if the prediction varies much less
/// than the measurement, or that not at all.
fn correlation(predicted: &[f64], measured: &[f64]) -> Option<f64> {
    let about_mean = |values: &[f64]| -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| value - mean).collect()
    };
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (predicted, measured) = (about_mean(predicted), about_mean(measured));
    let (asked, moved) = (product(&predicted, &predicted).sqrt(), product(&measured, &measured).sqrt());
    (moved > 0.0 && asked >= LEAST_DEMAND * moved).then(|| product(&predicted, &measured) / (asked * moved))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_that_of_a_closed_form() {
        let a: Vec<f64> = (0..100).map(f64::from).collect();
        let b: Vec<f64> = a.iter().map(|a| 3.0 - 2.0 * a).collect();
        assert!((correlation(&a, &b).unwrap() + 1.0).abs() < 1e-12);
        // Even and odd about the middle.
        let c: Vec<f64> = a.iter().map(|a| 0.01 * (a - 49.5).powi(2)).collect();
        assert!(correlation(&a, &c).unwrap().abs() < 1e-12);
        assert!(correlation(&a, &[1.0; 100]).is_none());
        let little: Vec<f64> = a.iter().map(|a| 0.01 * a).collect();
        assert!(correlation(&little, &a).is_none(), "too little is asked for");
    }
}

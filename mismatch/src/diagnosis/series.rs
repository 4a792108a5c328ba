//! Series to plot.

use crate::diagnosis::fit::{Fit, residuals};
use crate::diagnosis::held_out;
use crate::diagnosis::run::{Judgement, Prepared};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;
use crate::view::{PartialResidual, Plots, ResidualSeries};

/// Gains are summed over this long, seconds.
const GAIN_STEP_S: f64 = 0.5;

pub(crate) fn plots(
    prepared: &[Prepared<'_>],
    units: &[&Unit<'_>],
    fit: &Fit,
    kept: &[Term],
    found: &[&Judgement],
) -> Plots {
    let mut plots = Plots::default();
    for (unit, state) in units.iter().zip(&fit.states) {
        let known = |terms: &[Term]| residuals(unit, terms, &|_| true, None);
        let (Some(nominal), Some(corrected)) = (known(&[]), known(kept)) else { continue };
        for stretch in unit.stretches.iter().filter(|stretch| stretch.rows > 0) {
            for component in 0..stretch.components {
                let indices = || stretch.range().skip(component).step_by(stretch.components);
                plots.residuals.push(ResidualSeries {
                    recording: prepared[unit.recording].recording.name.clone(),
                    robot: unit.members[stretch.member].robot.0,
                    channel: stretch.channel,
                    component,
                    time_s: indices().map(|index| unit.rows[index].time_s).collect(),
                    nominal: indices().map(|index| nominal[index]).collect(),
                    corrected: indices().map(|index| corrected[index]).collect(),
                    sigma: root_mean_square(indices().map(|index| state.noise.sigma[index])),
                    position_m: indices()
                        .map(|index| unit.rows[index].regime.pose.map(|pose| pose.position()))
                        .collect(),
                });
            }
        }
    }
    for (finding, own) in found.iter().enumerate() {
        for (position, &unit) in own.support.units.iter().enumerate() {
            let recording = &prepared[units[unit].recording].recording.name;
            partial(finding, own, position, (units[unit], recording), &mut plots.partial);
        }
    }
    for own in prepared {
        for (robot, recorded) in &own.recording.robots {
            let path: Vec<[f64; 2]> =
                recorded.truth.iter().map(|sample| [sample.pose.x_m(), sample.pose.y_m()]).collect();
            if !path.is_empty() {
                plots.paths.push((robot.0, path));
            }
        }
        for (landmark, place) in &own.recording.landmarks {
            if !plots.landmarks.iter().any(|(known, _)| *known == landmark.0) {
                plots.landmarks.push((landmark.0, *place));
            }
        }
    }
    plots
}

/// Of a series whose noise changes with the driving: so that noise alone has the size of one sigma. Bearings of
/// something else than their name says have no sigma.
fn root_mean_square(sigmas: impl Iterator<Item = f64>) -> f64 {
    let sigmas = sigmas.filter(|sigma| sigma.is_finite());
    let (sum, count) = sigmas.fold((0.0, 0_usize), |(sum, count), sigma| (sum + sigma * sigma, count + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// The partial residuals of a finding in the channel that shows it most, component by component.
fn partial(
    finding: usize,
    own: &Judgement,
    position: usize,
    (unit, recording): (&Unit<'_>, &str),
    all: &mut Vec<PartialResidual>,
) {
    let (with, without) = (&own.support.with.states[position], &own.support.without.states[position]);
    let Some(stretch) = unit.stretch(own.judged.channel) else { return };
    let gain = gain_over_time(unit, with, without);
    for component in 0..stretch.components {
        let indices = || stretch.range().skip(component).step_by(stretch.components);
        let predicted: Vec<f64> =
            indices().map(|index| without.residuals[index] - with.residuals[index]).collect();
        if predicted.iter().all(|value| *value == 0.0) {
            continue;
        }
        all.push(PartialResidual {
            finding,
            recording: recording.to_owned(),
            robot: unit.members[stretch.member].robot.0,
            channel: stretch.channel,
            component,
            time_s: indices().map(|index| unit.rows[index].time_s).collect(),
            predicted,
            residual: indices().map(|index| without.residuals[index]).collect(),
            gain: gain.clone(),
        });
    }
}

/// Log-likelihood gained, summed from the start.
pub(crate) fn gain_over_time(
    unit: &Unit<'_>,
    with: &crate::diagnosis::fit::State,
    without: &crate::diagnosis::fit::State,
) -> Vec<[f64; 2]> {
    let mut order: Vec<usize> = (0..unit.rows.len()).collect();
    order.sort_by(|&a, &b| unit.rows[a].time_s.total_cmp(&unit.rows[b].time_s));
    let mut all: Vec<[f64; 2]> = Vec::new();
    let mut sum = 0.0;
    let gains = held_out::gains(unit, with, without);
    for index in order {
        sum += gains[index];
        let time_s = unit.rows[index].time_s;
        match all.last_mut() {
            Some(last) if time_s - last[0] < GAIN_STEP_S => last[1] = sum,
            _ => all.push([time_s, sum]),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::root_mean_square;

    #[test]
    fn what_has_no_sigma_does_not_widen_the_band_of_the_rest() {
        let band = root_mean_square([3.0, f64::INFINITY, 4.0].into_iter());
        assert!((band - 12.5_f64.sqrt()).abs() < 1e-15, "{band}");
    }
}

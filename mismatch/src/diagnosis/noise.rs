//! How large the noise of each channel is: estimated, never taken from the declaration.
//!
//! The scale of a component is an M-scale (`huber1981`): the `s` at which the mean of `min((r/s)^2, 9)` is what
//! it is for a normal distribution. For normal residuals it is their standard deviation; up to a tenth of wild
//! ones moves it little. With the scales profiled out, a model's log-likelihood is `-sum n log s`.

use std::sync::Arc;

use crate::channel::Channel;
use crate::diagnosis::mesh::{Event, Mesh, Read, is_meshed, is_move};
use crate::diagnosis::mesh_filter::{Filter, LANES};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Column, Unit};

/// A residual counts as this many sigmas at most.
pub(crate) const CLIP: f64 = 5.0;
/// Squares beyond this count as this in a scale.
const TRIM: f64 = 9.0;
/// The mean of `min(z^2, 9)` of a standard normal: `1 - 2 (3 phi(3) + Q(3)) + 18 Q(3)`.
const NORMAL_MEAN: f64 = 0.995_007_302_8;
/// A bearing that is off by more than this, radians, and by more than so many scales, is that of something else
/// than its name says: no effect of a camera turns it so far, and a target that is really behind the robot has
/// leverage on everything that grows with the bearing.
const ELSEWHERE_RAD: f64 = 0.5;
const ELSEWHERE_SCALES: f64 = 20.0;
/// Smallest scale relative to the largest residual: keeps residuals without noise finite.
const SMALLEST: f64 = 1e-12;
/// Rounds in which scale and the share of agitated variance settle.
const AGITATED_ROUNDS: usize = 4;
/// From which scales of a mesh are estimated: of moves per root of a second, metres forward, left, radians.
const MOVES: [f64; 3] = [0.01, 0.005, 0.01];
/// Of readings of which no noise is declared: metres, radians.
const READINGS: [f64; 2] = [0.1, 0.04];

/// The noise of a unit.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    /// One sigma per element, in the unit of the residual; infinite for a bearing of something else than its
    /// name says.
    pub(crate) sigma: Vec<f64>,
    /// One sigma per scale, of elements that are not agitated.
    pub(crate) scales: Vec<f64>,
    /// `-sum log sigma`: the log-likelihood with the scales profiled out, but for a constant.
    pub(crate) log_likelihood: f64,
    /// The same per scale.
    pub(crate) per_scale: Vec<f64>,
    /// What makes innovations of the residuals of a mesh. It stays while models are compared: what they predict is
    /// judged at one noise.
    pub(crate) filter: Option<Arc<Filter>>,
}

impl Noise {
    /// Residuals in sigmas; of a mesh, its innovations.
    pub(crate) fn whitened(&self, unit: &Unit<'_>, residuals: &[f64]) -> Vec<f64> {
        let mut values = residuals.to_vec();
        let filtered = unit.mesh.as_ref().zip(self.filter.as_ref());
        if let Some((mesh, filter)) = filtered {
            filter.innovate(mesh, &mut values);
        }
        for stretch in &unit.stretches {
            if filtered.is_some() && is_meshed(stretch.channel) {
                continue;
            }
            let range = stretch.range();
            for (value, sigma) in values[range.clone()].iter_mut().zip(&self.sigma[range]) {
                *value /= sigma;
            }
        }
        self.forget_masked(unit, &mut values);
        values
    }

    /// The same scales in the mesh of the same team at other references.
    pub(crate) fn refiltered(&self, unit: &Unit<'_>) -> Option<Self> {
        let filter = Filter::new(unit.mesh.as_ref()?, &self.scales, self.filter.as_ref()?.weights.clone());
        Some(Self { filter: Some(Arc::new(filter)), ..self.clone() })
    }

    /// What is left out has an infinite sigma, in a mesh too.
    fn forget_masked(&self, unit: &Unit<'_>, values: &mut [f64]) {
        if unit.mesh.is_some() {
            for (value, sigma) in values.iter_mut().zip(&self.sigma) {
                if sigma.is_infinite() {
                    *value = 0.0;
                }
            }
        }
    }

    /// Derivatives in sigmas, by stretch; `None` of what is zero.
    pub(crate) fn whitened_columns(&self, unit: &Unit<'_>, columns: &[Column]) -> Vec<Vec<Option<Vec<f64>>>> {
        let filtered = unit.mesh.as_ref().zip(self.filter.as_ref());
        let mut all: Vec<Vec<Option<Vec<f64>>>> =
            columns.iter().map(|column| vec![None; column.parts.len()]).collect();
        for (column, parts) in columns.iter().zip(&mut all) {
            for ((own, part), stretch) in column.parts.iter().zip(parts).zip(&unit.stretches) {
                if filtered.is_none() || !is_meshed(stretch.channel) {
                    let sigmas = &self.sigma[stretch.range()];
                    *part = own
                        .as_ref()
                        .map(|own| own.iter().zip(sigmas).map(|(value, sigma)| value / sigma).collect());
                }
            }
        }
        let Some((mesh, filter)) = filtered else { return all };
        let shows = |column: &Column| {
            let mut parts = column.parts.iter().zip(&unit.stretches);
            parts.any(|(part, stretch)| part.is_some() && is_meshed(stretch.channel))
        };
        let shown: Vec<usize> = (0..columns.len()).filter(|&index| shows(&columns[index])).collect();
        let mut lanes = vec![[0.0; LANES]; unit.rows.len()];
        for chunk in shown.chunks(LANES) {
            for (which, stretch) in
                unit.stretches.iter().enumerate().filter(|(_, own)| is_meshed(own.channel))
            {
                for (lane, &index) in chunk.iter().enumerate() {
                    match &columns[index].parts[which] {
                        Some(part) => {
                            for (values, value) in lanes[stretch.range()].iter_mut().zip(part) {
                                values[lane] = *value;
                            }
                        }
                        None => lanes[stretch.range()].iter_mut().for_each(|values| values[lane] = 0.0),
                    }
                }
            }
            filter.whiten(mesh, &mut lanes);
            for (which, stretch) in unit.stretches.iter().enumerate() {
                if !is_meshed(stretch.channel) || is_move(stretch.channel) || stretch.rows == 0 {
                    continue;
                }
                let sigmas = &self.sigma[stretch.range()];
                for (lane, &index) in chunk.iter().enumerate() {
                    let of = |(values, sigma): (&[f64; LANES], &f64)| {
                        if sigma.is_infinite() { 0.0 } else { values[lane] }
                    };
                    all[index][which] = Some(lanes[stretch.range()].iter().zip(sigmas).map(of).collect());
                }
            }
        }
        all
    }
}

/// The factor by which a residual of `z` sigmas is weighted.
pub(crate) fn weight(z: f64) -> f64 {
    if z.abs() <= CLIP { 1.0 } else { CLIP / z.abs() }
}

/// Minus twice the log-likelihood of a residual of `z` sigmas, bounded in its slope.
pub(crate) fn rho(z: f64) -> f64 {
    let size = z.abs();
    if size <= CLIP { z * z } else { CLIP * (2.0 * size - CLIP) }
}

/// Estimates the noise from residuals; that of a mesh stays as it is known.
pub(crate) fn estimate(unit: &Unit<'_>, terms: &[Term], residuals: &[f64], known: Option<&Noise>) -> Noise {
    estimate_from(unit, terms, residuals, known, &|_| true)
}

/// Estimates the noise of all elements from those for which `kept` holds.
pub(crate) fn estimate_from(
    unit: &Unit<'_>,
    terms: &[Term],
    residuals: &[f64],
    known: Option<&Noise>,
    kept: &dyn Fn(usize) -> bool,
) -> Noise {
    let agitation = unit.agitation(terms);
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); unit.scales.len()];
    for (index, &scale) in unit.scale_of.iter().enumerate().filter(|(index, _)| kept(*index)) {
        members[scale].push(index);
    }
    let mut noise = Noise {
        sigma: Vec::new(),
        scales: Vec::new(),
        log_likelihood: 0.0,
        per_scale: Vec::new(),
        filter: None,
    };
    for (which, own) in members.iter().enumerate() {
        if unit.mesh.is_some() && is_meshed(unit.scales[which].0) {
            noise.scales.push(known.map_or_else(|| begin(unit, which), |known| known.scales[which]));
            noise.per_scale.push(0.0);
            continue;
        }
        let agitated: Vec<f64> = own.iter().map(|&index| agitation[index]).collect();
        let values: Vec<f64> = own.iter().map(|&index| residuals[index]).collect();
        let mut spreads = vec![1.0; own.len()];
        let mut scale = m_scale(&mut values.clone());
        if agitated.iter().any(|variance| *variance > 0.0) {
            for _ in 0..AGITATED_ROUNDS {
                for (spread, variance) in spreads.iter_mut().zip(&agitated) {
                    *spread = (1.0 + variance / (scale * scale)).sqrt();
                }
                let mut scaled: Vec<f64> =
                    values.iter().zip(&spreads).map(|(value, spread)| value / spread).collect();
                scale = m_scale(&mut scaled);
            }
        }
        let cost = own.len() as f64 * scale.ln() + spreads.iter().map(|spread| spread.ln()).sum::<f64>();
        noise.scales.push(scale);
        noise.per_scale.push(-cost);
        noise.log_likelihood -= cost;
    }
    let sigma = |((agitation, &which), residual): ((&f64, &usize), &f64)| {
        let scale = noise.scales[which];
        if is_elsewhere(unit.scales[which].0, *residual, scale) {
            f64::INFINITY
        } else {
            scale.hypot(agitation.sqrt())
        }
    };
    noise.sigma = agitation.iter().zip(&unit.scale_of).zip(residuals).map(sigma).collect();
    if let Some(mesh) = &unit.mesh {
        mesh_noise(unit, mesh, residuals, known, kept, &mut noise);
    }
    noise
}

/// Where the estimate of a scale of a mesh begins: with what is declared.
fn begin(unit: &Unit<'_>, scale: usize) -> f64 {
    let (channel, component) = unit.scales[scale];
    let stretch =
        unit.stretches.iter().find(|own| own.rows > 0 && unit.scale_of[own.offset] + component == scale);
    let Some(member) = stretch.map(|own| &unit.members[own.member]) else { return 1.0 };
    let nominal = &member.nominal.nominal;
    let or = |declared: f64, else_: f64| if declared > 0.0 { declared } else { else_ };
    match channel {
        Channel::Gps => or(nominal.gps_sigma_m, READINGS[0]),
        Channel::Heading => or(nominal.heading_sigma_rad, READINGS[1]),
        Channel::RangeToLandmark | Channel::RangeToRobot => or(nominal.range_sigma_m, READINGS[0]),
        Channel::BearingToLandmark | Channel::BearingToRobot => or(nominal.bearing_sigma_rad, READINGS[1]),
        Channel::Actuator | Channel::Body | Channel::CommandedBody | Channel::Gyro => MOVES[component],
    }
}

/// The noise of a mesh: its filter, the sigmas of its innovations, and their likelihood.
fn mesh_noise(
    unit: &Unit<'_>,
    mesh: &Mesh,
    residuals: &[f64],
    known: Option<&Noise>,
    kept: &dyn Fn(usize) -> bool,
    noise: &mut Noise,
) {
    let filter = known.and_then(|known| known.filter.clone()).unwrap_or_else(|| {
        let begun = noise.scales.clone();
        let used = |read: &Read, residual: f64| {
            !is_elsewhere(unit.scales[read.scale].0, residual, begun[read.scale])
        };
        Arc::new(Filter::estimated(mesh, &mut noise.scales, residuals, &used))
    });
    let reads = mesh.events.iter().filter_map(|event| match event {
        Event::Read(own) => Some(own),
        _ => None,
    });
    for (read, root) in reads.zip(&filter.roots) {
        noise.sigma[read.element] = if *root > 0.0 { 1.0 / root } else { f64::INFINITY };
    }
    for stretch in unit.stretches.iter().filter(|own| is_move(own.channel)) {
        for index in stretch.range() {
            noise.sigma[index] = noise.scales[unit.scale_of[index]];
        }
    }
    noise.filter = Some(filter);
    let whitened = noise.whitened(unit, residuals);
    for event in &mesh.events {
        let Event::Read(read) = event else { continue };
        if !kept(read.element) || noise.sigma[read.element].is_infinite() {
            continue;
        }
        let cost = noise.sigma[read.element].ln() + 0.5 * rho(whitened[read.element]);
        noise.per_scale[read.scale] -= cost;
        noise.log_likelihood -= cost;
    }
}

/// Whether a residual is that of a bearing of something else than its name says.
fn is_elsewhere(channel: Channel, residual: f64, scale: f64) -> bool {
    matches!(channel, Channel::BearingToLandmark | Channel::BearingToRobot)
        && residual.abs() > ELSEWHERE_RAD.max(ELSEWHERE_SCALES * scale)
}

/// The M-scale about zero of values, which are reordered.
fn m_scale(values: &mut [f64]) -> f64 {
    let count = values.len() as f64;
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if values.is_empty() || largest == 0.0 {
        return 1.0;
    }
    let floor = largest * SMALLEST;
    let half = values.len() / 2;
    let (_, middle, _) = values.select_nth_unstable_by(half, |a, b| a.abs().total_cmp(&b.abs()));
    let mut scale = (1.4826 * middle.abs()).max(floor);
    for _ in 0..100 {
        let mean = values.iter().map(|value| (value / scale).powi(2).min(TRIM)).sum::<f64>() / count;
        let next = (scale * (mean / NORMAL_MEAN).sqrt()).max(floor);
        if (next - scale).abs() <= 1e-9 * scale {
            return next;
        }
        scale = next;
    }
    scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_wild_values_the_scale_is_the_root_mean_square() {
        let mut values = [3.0, -4.0, 5.0, -1.0, 2.0];
        let rms = (55.0_f64 / 5.0).sqrt();
        assert!((m_scale(&mut values) - rms / NORMAL_MEAN.sqrt()).abs() < 1e-7);
    }

    #[test]
    fn only_a_bearing_far_off_for_its_own_noise_is_of_something_else() {
        assert!(is_elsewhere(Channel::BearingToRobot, -0.6, 0.02));
        assert!(!is_elsewhere(Channel::BearingToRobot, 0.4, 0.02));
        assert!(!is_elsewhere(Channel::BearingToLandmark, 0.6, 0.1));
        assert!(!is_elsewhere(Channel::RangeToRobot, 60.0, 0.02));
    }

    #[test]
    fn wild_values_count_as_three_sigmas() {
        let mut values: Vec<f64> = (0..100).map(|index| if index % 2 == 0 { 1.0 } else { -1.0 }).collect();
        values[7] = 1e6;
        values[50] = -1e9;
        // 98/s^2 + 2 * 9 = 100 * 0.995.
        let expected = (98.0 / (100.0 * NORMAL_MEAN - 18.0)).sqrt();
        assert!((m_scale(&mut values) - expected).abs() < 1e-6);
    }
}

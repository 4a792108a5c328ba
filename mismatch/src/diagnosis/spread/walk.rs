//! A gyro's bias that wanders: `b(t + dt) = b(t) + N(0, q^2 dt)`, read with white noise of unknown size. The
//! likelihood is that of a Kalman filter's innovations (`schweppe1965`), which knows nothing of the first bias.
//!
//! What the encoders say of the yaw rate is wrong at the ends of a window, by a part of a tick: two neighbours have
//! this error with opposite signs. As white noise it would hide a walk, so it is a second state of the filter.
//!
//! A bias that warms up follows a curve instead, and is the rival: the mean's own terms of the gyro's bias are
//! left out of the residuals here.

use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::NEAR_END;
use crate::diagnosis::spread::Explained;
use crate::diagnosis::spread::density::bounded;
use crate::diagnosis::spread::family::{Contrast, Family, Member, Place, Shown, Shows, blocks};
use crate::diagnosis::spread::maximum::{Bounds, Density, maximize, uncertainty};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;
use crate::track::median_step;

/// Logarithm of the sigma of a window.
const NOISE: usize = 0;
/// The bias at the first window, rad/s.
const FIRST: usize = 1;
/// The square of the density of the walk.
const WALK: usize = 2;
/// The bias gained by warming up, rad/s, and the logarithm of its time constant.
const WARM: usize = 3;
const TIME: usize = 4;
/// The variance of the first bias about its parameter: so large that it says nothing, or zero.
const UNKNOWN: usize = 5;
/// The variance that the error at one end of a window adds, (rad/s)^2.
const EDGE: usize = 6;
/// Where its search begins, as a share of the variance of a window.
const EDGE_SHARE: f64 = 0.2;
/// A window that begins so much later than the usual one, as a share, does not begin where the one before ended.
const JOINED: f64 = 1.2;
/// A bias beyond this is none, rad/s.
const LARGEST_BIAS: f64 = 0.1;

struct Readings {
    /// Seconds since the unit's first, and the residual; a unit starts at `None`.
    rows: Vec<(Option<f64>, f64, f64)>,
    blocks: Vec<usize>,
    /// From one window to the next that begins where it ended, seconds.
    usual_s: f64,
}

impl Density for Readings {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn blocks(&self) -> &[usize] {
        &self.blocks
    }

    fn fill(&self, parameters: &[f64], into: &mut [f64]) {
        let white = libm::exp(2.0 * parameters[NOISE]);
        let constant_s = libm::exp(parameters[TIME]);
        let edge = parameters[EDGE];
        // Bias and error at the beginning of the window: means, variances, covariance.
        let (mut bias, mut begun) = (0.0, 0.0);
        let (mut of_bias, mut of_begun, mut between) = (0.0, 0.0, 0.0);
        for ((step_s, age_s, residual), value) in self.rows.iter().zip(into) {
            if let Some(step_s) = step_s {
                of_bias += parameters[WALK] * step_s;
                if *step_s > JOINED * self.usual_s {
                    (begun, of_begun, between) = (0.0, edge, 0.0);
                }
            } else {
                (bias, of_bias) = (parameters[FIRST], parameters[UNKNOWN]);
                (begun, of_begun, between) = (0.0, edge, 0.0);
            }
            let warm = parameters[WARM] * -libm::expm1(-age_s / constant_s);
            // Read: bias, less the error at the beginning, plus that at the end, plus white noise.
            let variance = of_bias - 2.0 * between + of_begun + edge + white;
            let sigma = variance.sqrt();
            let innovation = residual - warm - bias + begun;
            *value = bounded(innovation / sigma, sigma);
            let (gain, gain_end) = ((of_bias - between) / variance, edge / variance);
            bias += gain * innovation;
            begun = gain_end * innovation;
            of_bias -= gain * gain * variance;
            of_begun = edge - gain_end * gain_end * variance;
            between = -gain * gain_end * variance;
        }
    }
}

/// Whether a term of the mean says what the bias of a gyro does in time.
fn is_bias(term: &Term) -> bool {
    matches!(term.effect, Effect::GyroBias | Effect::GyroThermalDrift)
}

/// The gyro of one robot under a fit of the mean without its own terms of bias.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit) -> Option<Family<'u, 'a>> {
    let terms: Vec<Term> = fit.terms.iter().filter(|term| !is_bias(term)).cloned().collect();
    let mut rows = Vec::new();
    let mut places = Vec::new();
    for (position, unit) in units.iter().enumerate() {
        let Some(stretch) = unit.stretch(Channel::Gyro) else { continue };
        let values = unit.values(&terms, &|channel| channel == Channel::Gyro);
        let Some(values) = values.into_iter().flatten().next() else { continue };
        let mut before: Option<f64> = None;
        for (index, residual) in stretch.range().zip(values) {
            let time_s = unit.rows[index].time_s;
            rows.push((before.map(|before| time_s - before), time_s - unit.span_s.0, residual));
            places.push(Place { unit: position, time_s, channel: Channel::Gyro });
            before = Some(time_s);
        }
    }
    let usual_s = median_step(rows.iter().map(|row| row.1));
    // What changes from one window to the next is white noise; a walk is slow beside it.
    let changes: Vec<f64> = rows.windows(2).map(|pair| (pair[1].2 - pair[0].2).powi(2)).collect();
    let sigma = (0.5 * changes.iter().sum::<f64>() / changes.len().max(1) as f64).sqrt();
    if !sigma.is_finite() || sigma <= 0.0 {
        return None;
    }
    let plausible = |effect: Effect, parameter: usize| effect.info().parameters[parameter].plausible;
    let (_, most) = plausible(Effect::GyroRandomWalk, 0);
    let (cold, hot) = plausible(Effect::GyroThermalDrift, 0);
    let (fast, slow) = plausible(Effect::GyroThermalDrift, 1);
    let bounds = vec![
        Bounds { low: sigma.ln() - 8.0, high: sigma.ln() + 8.0, scale: 0.1 },
        Bounds { low: -1.0, high: 1.0, scale: sigma },
        Bounds { low: 0.0, high: most * most, scale: 1e-8 },
        Bounds { low: cold, high: hot, scale: sigma },
        Bounds { low: fast.ln(), high: slow.ln(), scale: 0.1 },
        Bounds { low: 0.0, high: 1.0, scale: 1.0 },
        Bounds { low: 0.0, high: 1.0, scale: sigma * sigma },
    ];
    let walk = Member {
        effect: Effect::GyroRandomWalk,
        parameters: vec![WALK],
        off: vec![0.0],
        start: vec![1e-7],
        shown: vec![Shown::Root(WALK)],
        contrasts: Vec::new(),
        chances: None,
    };
    let warming = Member {
        effect: Effect::GyroThermalDrift,
        parameters: vec![WARM, TIME],
        off: vec![0.0, 60.0_f64.ln()],
        start: vec![2.0 * sigma, 60.0_f64.ln()],
        shown: vec![Shown::Value(WARM), Shown::Exp(TIME)],
        contrasts: Vec::new(),
        chances: None,
    };
    Some(Family {
        density: Box::new(Readings { blocks: blocks(units, &places), usual_s, rows }),
        units: units.to_vec(),
        places,
        bounds,
        start: vec![
            sigma.ln(),
            0.0,
            0.0,
            0.0,
            60.0_f64.ln(),
            LARGEST_BIAS * LARGEST_BIAS,
            EDGE_SHARE * sigma * sigma,
        ],
        nuisances: vec![NOISE, EDGE],
        members: vec![walk, warming],
    })
}

/// Terms of the mean that a walk explains: a curve of warming up, and a bias that the walk could have reached.
pub(super) fn explained(family: &Family<'_, '_>, walk: &Shows, fit: &Fit) -> Vec<Explained> {
    // The first bias as a parameter, beside the walk.
    let mut start = walk.with.parameters.clone();
    start[UNKNOWN] = 0.0;
    let free = [NOISE, EDGE, FIRST, WALK];
    let with = maximize(family.density.as_ref(), &family.bounds, &start, &free, &|_| true);
    let known = uncertainty(family.density.as_ref(), &family.bounds, &with, &free);
    let first = Contrast { weights: vec![(FIRST, 1.0)], threshold: 0.0 };
    let threshold = |term: &Term| {
        let floors = family.units.first().map(|unit| unit.members[0].floors).unwrap_or_default();
        term.parameters()[0].relevance.threshold(&floors)
    };
    let starts_off = |term: &Term| {
        let beyond = |(size, error): (f64, f64)| size - NEAR_END * error > threshold(term);
        known.as_ref().and_then(|known| first.estimate(&with.parameters, known)).is_some_and(beyond)
    };
    let own = |term: &Term| is_bias(term) && family.units.iter().all(|unit| unit.has(term));
    let terms = fit.terms.iter().enumerate().filter(|(_, term)| own(term));
    terms
        .filter(|(_, term)| term.effect == Effect::GyroThermalDrift || !starts_off(term))
        .map(|(position, _)| Explained { position, by: Effect::GyroRandomWalk, part: None })
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    #[test]
    fn innovations_have_the_density_of_the_whole() {
        let times = [0.0, 0.5, 1.0, 1.8, 2.3];
        let residuals = [0.3, -0.1, 0.4, 0.9, 0.5];
        let mut rows = Vec::new();
        for (index, residual) in residuals.iter().enumerate() {
            let step_s = index.checked_sub(1).map(|before| times[index] - times[before]);
            rows.push((step_s, times[index], *residual));
        }
        let readings = Readings { rows, blocks: vec![0; 5], usual_s: 0.6 };
        let (sigma, first, walk, warm, constant_s, unknown) = (0.4_f64, 0.1, 0.09, 0.2, 1.5_f64, 0.25);
        let edge = 0.07;
        let mut values = vec![0.0; 5];
        readings.fill(&[sigma.ln(), first, walk, warm, constant_s.ln(), unknown, edge], &mut values);
        // cov(i, j) = unknown + walk min(t_i, t_j), and where i = j, sigma^2 + 2 edge. Neighbours share an end
        // with opposite signs, but for the pair 0.8 s apart.
        let covariance = DMatrix::from_fn(5, 5, |i, j| {
            let shared = match i.abs_diff(j) {
                0 => sigma * sigma + 2.0 * edge,
                1 if i.min(j) == 2 => 0.0,
                1 => -edge,
                _ => 0.0,
            };
            unknown + walk * times[i].min(times[j]) + shared
        });
        let mean = |time_s: f64| first + warm * (1.0 - (-time_s / constant_s).exp());
        let error = DVector::from_fn(5, |i, _| residuals[i] - mean(times[i]));
        let factor = covariance.cholesky().unwrap();
        let square = error.dot(&factor.solve(&error));
        let log_determinant: f64 = factor.l().diagonal().iter().map(|own| 2.0 * own.ln()).sum();
        let expected = -0.5 * (square + log_determinant + 5.0 * std::f64::consts::TAU.ln());
        assert!((values.iter().sum::<f64>() - expected).abs() < 1e-12);
    }
}

//! A gyro's bias that wanders: `b(t + dt) = b(t) + N(0, q^2 dt)`, read with white noise of unknown size. The
//! likelihood is that of a scalar Kalman filter's innovations (`schweppe1965`), which knows nothing of the first bias.
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
/// A bias beyond this is none, rad/s.
const LARGEST_BIAS: f64 = 0.1;

struct Readings {
    /// Seconds since the unit's first, and the residual; a unit starts at `None`.
    rows: Vec<(Option<f64>, f64, f64)>,
    blocks: Vec<usize>,
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
        let (mut bias, mut variance) = (0.0, 0.0);
        for ((step_s, age_s, residual), value) in self.rows.iter().zip(into) {
            if let Some(step_s) = step_s {
                variance += parameters[WALK] * step_s;
            } else {
                (bias, variance) = (parameters[FIRST], parameters[UNKNOWN]);
            }
            let warm = parameters[WARM] * -libm::expm1(-age_s / constant_s);
            let sigma = (variance + white).sqrt();
            let innovation = residual - warm - bias;
            *value = bounded(innovation / sigma, sigma);
            let gain = variance / (variance + white);
            bias += gain * innovation;
            variance *= 1.0 - gain;
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
        let values = unit.values(&unit.model(&terms), &|channel| channel == Channel::Gyro);
        let Some(values) = values.into_iter().flatten().next() else { continue };
        let mut before: Option<f64> = None;
        for (index, residual) in stretch.range().zip(values) {
            let time_s = unit.rows[index].time_s;
            rows.push((before.map(|before| time_s - before), time_s - unit.span_s.0, residual));
            places.push(Place { unit: position, time_s, channel: Channel::Gyro });
            before = Some(time_s);
        }
    }
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
        density: Box::new(Readings { blocks: blocks(units, &places), rows }),
        units: units.to_vec(),
        places,
        bounds,
        start: vec![sigma.ln(), 0.0, 0.0, 0.0, 60.0_f64.ln(), LARGEST_BIAS * LARGEST_BIAS],
        nuisances: vec![NOISE],
        members: vec![walk, warming],
    })
}

/// Terms of the mean that a walk explains: a curve of warming up, and a bias that the walk could have reached.
pub(super) fn explained(family: &Family<'_, '_>, walk: &Shows, fit: &Fit) -> Vec<Explained> {
    // The first bias as a parameter, beside the walk.
    let mut start = walk.with.parameters.clone();
    start[UNKNOWN] = 0.0;
    let free = [NOISE, FIRST, WALK];
    let with = maximize(family.density.as_ref(), &family.bounds, &start, &free, &|_| true);
    let known = uncertainty(family.density.as_ref(), &family.bounds, &with, &free);
    let first = Contrast { weights: vec![(FIRST, 1.0)], threshold: 0.0 };
    let threshold = |term: &Term| {
        let floors = family.units.first().map(|unit| unit.floors).unwrap_or_default();
        term.parameters()[0].relevance.threshold(&floors)
    };
    let starts_off = |term: &Term| {
        let beyond = |(size, error): (f64, f64)| size - NEAR_END * error > threshold(term);
        known.as_ref().and_then(|known| first.estimate(&with.parameters, known)).is_some_and(beyond)
    };
    let own = |term: &Term| is_bias(term) && family.units.iter().all(|unit| term.acts_on(unit.robot));
    let terms = fit.terms.iter().enumerate().filter(|(_, term)| own(term));
    terms
        .filter(|(_, term)| term.effect == Effect::GyroThermalDrift || !starts_off(term))
        .map(|(position, _)| Explained { position, by: Effect::GyroRandomWalk, part: None })
        .collect()
}

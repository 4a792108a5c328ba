//! A gyro's bias that wanders: `b(t + dt) = b(t) + N(0, q^2 dt)`, in the likelihood of [`yaw`], which knows nothing
//! of the first bias.
//!
//! Slip that lasts makes what the gyro reads beyond the encoders wander too. It is part of what is true without a
//! walk, and truth, where there is any, turns with it. To fit all of that takes time, so that it is asked first
//! whether the gyro wanders at all.
//!
//! A bias that warms up follows a curve instead, and is the rival: the mean's own terms of the gyro's bias are
//! left out of the residuals here.
//!
//! [`yaw`]: crate::diagnosis::spread::yaw

use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::naming::NEAR_END;
use crate::diagnosis::select::LEAST_GAIN;
use crate::diagnosis::spread::Explained;
use crate::diagnosis::spread::family::{Contrast, Family, Member, Place, Shown, Shows, blocks};
use crate::diagnosis::spread::maximum::{Bounds, maximize, uncertainty};
use crate::diagnosis::spread::yaw::{
    EDGE, Event, FIRST, LASTING, NOISE, PARAMETERS, Readings, SLIP, SPREAD, TIME, TRUTH, TURNED, UNKNOWN,
    WALK, WARM,
};
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::Unit;
use crate::track::median_step;

/// Where the search for the edge begins, as a share of the variance of a window.
const EDGE_SHARE: f64 = 0.2;
/// And those for what slip adds.
const SLIP_SHARE: f64 = 0.1;
/// A window that begins so much later than the usual one, as a share, does not begin where the one before ended.
const JOINED: f64 = 1.2;
/// A bias beyond this is none, rad/s.
const LARGEST_BIAS: f64 = 0.1;
/// Slip that lasts shorter is white, seconds.
const SHORTEST_S: f64 = 0.3;
/// Slip may last so long where truth shows it, and where it does not: there it would be a walk by another name.
const LONGEST_S: f64 = 60.0;
const LONGEST_UNSEEN_S: f64 = 10.0;
/// Where the search for its time constant begins, seconds.
const STARTS_S: [f64; 2] = [1.0, 5.0];
/// The component of the channel of the body that is an angle.
const YAW: usize = 2;

/// Residuals with their times.
type Series = Vec<(f64, f64)>;

/// Whether a term of the mean says what the bias of a gyro does in time.
fn is_bias(term: &Term) -> bool {
    matches!(term.effect, Effect::GyroBias | Effect::GyroThermalDrift)
}

/// What a component of a channel shows under terms of the mean.
fn series(unit: &Unit<'_>, terms: &[Term], channel: Channel, component: usize) -> Series {
    let Some(stretch) = unit.stretch(channel) else { return Vec::new() };
    let values = unit.values(terms, &|own| own == channel);
    let Some(values) = values.into_iter().flatten().next() else { return Vec::new() };
    let own = stretch.range().zip(values).skip(component).step_by(stretch.components);
    own.map(|(index, residual)| (unit.rows[index].time_s, residual)).collect()
}

/// From one residual to the next, seconds, and the sigma of what changes between them: what is slow beside the
/// windows is not in it.
fn usual(all: &[Series]) -> (f64, f64) {
    let window_s = median_step(all.iter().flatten().map(|row| row.0));
    let pairs = || all.iter().flat_map(|own| own.windows(2));
    let changes: f64 = pairs().map(|pair| (pair[1].1 - pair[0].1).powi(2)).sum();
    (window_s, (0.5 * changes / pairs().count().max(1) as f64).sqrt())
}

/// When something happens, what, and the channel and time of the residual if one is read then.
type Timed = (f64, Event, Option<(Channel, f64)>);

/// The events of one unit in their order.
fn events(gyro: (&Series, f64), truth: (&Series, f64), first_s: f64) -> Vec<Timed> {
    let mut all = Vec::new();
    let mut of_channel = |(rows, window_s): (&Series, f64), channel: Channel| {
        let mut before: Option<f64> = None;
        for (time_s, residual) in rows {
            let (begin, read) = match channel {
                Channel::Gyro => (Event::GyroBegins, Event::Gyro(time_s - first_s, *residual)),
                _ => (Event::TruthBegins, Event::Truth(*residual)),
            };
            let half_s = 0.5 * window_s;
            if before.is_none_or(|before| time_s - before > JOINED * window_s) {
                all.push((time_s - half_s, begin, None));
            }
            all.push((time_s + half_s, read, Some((channel, *time_s))));
            before = Some(*time_s);
        }
    };
    of_channel(gyro, Channel::Gyro);
    of_channel(truth, Channel::Body);
    // Stable: what is read at an instant comes before what begins there only if it was put so.
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// The gyro of one robot under a fit of the mean without its own terms of bias.
pub(super) fn family<'u, 'a>(units: &[&'u Unit<'a>], fit: &Fit) -> Option<Family<'u, 'a>> {
    let terms: Vec<Term> = fit.terms.iter().filter(|term| !is_bias(term)).cloned().collect();
    let gyro: Vec<Series> = units.iter().map(|unit| series(unit, &terms, Channel::Gyro, 0)).collect();
    let none = vec![Series::new(); units.len()];
    let quick = of_series(units, &gyro, &none, false)?;
    let base = quick.base();
    let wanders = |member: usize| {
        let with = quick.fit(&[member], &base, &|_| true);
        2.0 * (with.log_likelihood - base.log_likelihood) > LEAST_GAIN
    };
    if !(0..quick.members.len()).any(wanders) {
        return Some(quick);
    }
    // References that come from gyro and encoders themselves say nothing of either.
    let truth = |unit: &&Unit<'_>| {
        if unit.evidence.is_by_reference() { Series::new() } else { series(unit, &terms, Channel::Body, YAW) }
    };
    let truth: Vec<Series> = units.iter().map(truth).collect();
    let mut whole = of_series(units, &gyro, &truth, true)?;
    let begun = STARTS_S.map(|start_s| {
        whole.start[LASTING] = start_s.ln();
        whole.base()
    });
    let best = begun.into_iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
    whole.start = best.parameters;
    Some(whole)
}

/// The likelihood of what gyro and truth show; slip is fitted too, or there is none.
fn of_series<'u, 'a>(
    units: &[&'u Unit<'a>],
    gyro: &[Series],
    truth: &[Series],
    slips: bool,
) -> Option<Family<'u, 'a>> {
    let (window_s, sigma) = usual(gyro);
    let (turn_s, turned) = usual(truth);
    if !sigma.is_finite() || sigma <= 0.0 {
        return None;
    }
    let seen = turned.is_finite() && turned > 0.0;
    let mut steps = Vec::new();
    let mut places = Vec::new();
    for (position, unit) in units.iter().enumerate() {
        let mut before = None;
        let own = if seen { &truth[position] } else { &Series::new() };
        for (at_s, event, read) in events((&gyro[position], window_s), (own, turn_s), unit.span_s.0) {
            if before.is_none() {
                steps.push((0.0, Event::First));
            }
            steps.push((at_s - before.unwrap_or(at_s), event));
            before = Some(at_s);
            if let Some((channel, time_s)) = read {
                places.push(Place { unit: position, time_s, channel });
            }
        }
    }
    let readings = Readings { events: steps, blocks: blocks(units, &places), window_s };
    let mut nuisances = vec![NOISE, EDGE];
    if slips {
        nuisances.extend([SLIP, LASTING]);
    }
    if slips && seen {
        nuisances.extend([SPREAD, TRUTH, TURNED]);
    }
    let (bounds, mut start) = parameters(sigma, if seen { turned } else { 0.0 });
    if !slips {
        start[SLIP] = 0.0;
    }
    Some(Family {
        density: Box::new(readings),
        units: units.to_vec(),
        places,
        bounds,
        start,
        nuisances,
        members: members(sigma),
    })
}

/// Bounds and starts, from the sigma of a window of the gyro and of one of truth; zero if there is none.
fn parameters(sigma: f64, turned: f64) -> (Vec<Bounds>, Vec<f64>) {
    let plausible = |effect: Effect, parameter: usize| effect.info().parameters[parameter].plausible;
    let (_, most) = plausible(Effect::GyroRandomWalk, 0);
    let (cold, hot) = plausible(Effect::GyroThermalDrift, 0);
    let (fast, slow) = plausible(Effect::GyroThermalDrift, 1);
    let longest_s = if turned > 0.0 { LONGEST_S } else { LONGEST_UNSEEN_S };
    let (gyro, truth) = (sigma * sigma, turned * turned);
    let of_truth = Bounds { low: 0.0, high: 1.0, scale: truth.max(f64::MIN_POSITIVE) };
    let each: [(usize, Bounds, f64); PARAMETERS] = [
        (NOISE, Bounds { low: sigma.ln() - 8.0, high: sigma.ln() + 8.0, scale: 0.1 }, sigma.ln()),
        (FIRST, Bounds { low: -1.0, high: 1.0, scale: sigma }, 0.0),
        (WALK, Bounds { low: 0.0, high: most * most, scale: 1e-8 }, 0.0),
        (WARM, Bounds { low: cold, high: hot, scale: sigma }, 0.0),
        (TIME, Bounds { low: fast.ln(), high: slow.ln(), scale: 0.1 }, 60.0_f64.ln()),
        (UNKNOWN, Bounds { low: 0.0, high: 1.0, scale: 1.0 }, LARGEST_BIAS * LARGEST_BIAS),
        (EDGE, Bounds { low: 0.0, high: 1.0, scale: gyro }, EDGE_SHARE * gyro),
        (SLIP, Bounds { low: 0.0, high: 1.0, scale: gyro }, SLIP_SHARE * gyro),
        (LASTING, Bounds { low: SHORTEST_S.ln(), high: longest_s.ln(), scale: 0.1 }, STARTS_S[0].ln()),
        (SPREAD, of_truth, SLIP_SHARE * truth),
        (TRUTH, of_truth, EDGE_SHARE * truth),
        (TURNED, of_truth, SLIP_SHARE * truth),
    ];
    let mut bounds = vec![of_truth; PARAMETERS];
    let mut start = vec![0.0; PARAMETERS];
    for (index, bound, begin) in each {
        (bounds[index], start[index]) = (bound, begin);
    }
    (bounds, start)
}

fn members(sigma: f64) -> Vec<Member> {
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
    vec![walk, warming]
}

/// Terms of the mean that a walk explains: a curve of warming up, and a bias that the walk could have reached.
pub(super) fn explained(family: &Family<'_, '_>, walk: &Shows, fit: &Fit) -> Vec<Explained> {
    // The first bias as a parameter, beside the walk.
    let mut start = walk.with.parameters.clone();
    start[UNKNOWN] = 0.0;
    let mut free = family.nuisances.clone();
    free.extend([FIRST, WALK]);
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
    use super::*;

    #[test]
    fn windows_that_adjoin_share_an_end_and_others_begin_anew() {
        let gyro = vec![(0.25, 0.01), (0.75, 0.02), (1.75, 0.03)];
        let truth = vec![(0.5, 0.1)];
        let found = events((&gyro, 0.5), (&truth, 1.0), 0.0);
        let expected = [
            (0.0, Event::GyroBegins),
            (0.0, Event::TruthBegins),
            (0.5, Event::Gyro(0.25, 0.01)),
            (1.0, Event::Gyro(0.75, 0.02)),
            (1.0, Event::Truth(0.1)),
            (1.5, Event::GyroBegins),
            (2.0, Event::Gyro(1.75, 0.03)),
        ];
        assert_eq!(found.iter().map(|own| (own.0, own.1)).collect::<Vec<_>>(), expected);
        assert_eq!(found[4].2, Some((Channel::Body, 0.5)));
    }
}

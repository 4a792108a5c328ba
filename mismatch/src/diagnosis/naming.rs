//! From a fitted term to a finding, or to a nuisance that is none.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::DMatrix;
use pleiad_physics::{Channel as Needed, Effect, Parameter, Scalar};

use crate::channel::Channel;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::entries::composition;
use crate::diagnosis::fit::Fit;
use crate::diagnosis::held_out::{self, Gain};
use crate::diagnosis::profile::{Profile, is_on};
use crate::diagnosis::robust::{Robust, robust};
use crate::diagnosis::scan::rectangles;
use crate::diagnosis::seldom::{Seen, inflation_everywhere, seen};
use crate::diagnosis::select::FAMILYWISE;
use crate::diagnosis::starts::Placing;
use crate::diagnosis::support::Support;
use crate::diagnosis::term::Term;
use crate::diagnosis::touch::touches;
use crate::diagnosis::unit::{Row, Unit};
use crate::diagnosis::wald::wald;
use crate::findings::{Estimate, Place, Verdict};

/// Half the width of a 95 % interval, in standard errors.
pub(crate) const Z_95: f64 = 1.959_963_984_540_054;
/// The near end of this many standard errors must be beyond the threshold of relevance.
pub(crate) const NEAR_END: f64 = 3.0;
/// The cross-fitted gain must exceed this many standard errors.
pub(crate) const GAIN_ERRORS: f64 = 2.0;
/// An effect without a threshold of relevance must change this share of a channel by more than a sigma.
const LEAST_SHARE_CHANGED: f64 = 0.005;
/// A place or regime is named if this share of the gain arises there.
const MAIN_SHARE: f64 = 0.8;

/// What is known of the parameters of a term.
#[derive(Clone, Debug)]
pub(crate) struct Estimated {
    pub(crate) term: Term,
    /// Standard errors in the order of the parameters; `None` for what was not fitted by its derivative.
    pub(crate) errors: Vec<Option<f64>>,
    /// The 95 % intervals of what has no derivative, by the profile of the likelihood; empty if unknown.
    pub(crate) profiled: Vec<Option<[f64; 2]>>,
    /// Half the widths of the 95 % intervals of the others; where unknown, of their standard errors.
    pub(crate) halves: Vec<Option<f64>>,
}

impl Estimated {
    pub(crate) fn of(fit: &Fit, covariance: &DMatrix<f64>, position: usize) -> Self {
        let term = fit.terms[position].clone();
        let error = |parameter: usize| {
            let slot = fit.slots.iter().position(|slot| *slot == (position, parameter))?;
            let variance = covariance[(slot, slot)];
            (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
        };
        let errors = (0..term.values.len()).map(error).collect();
        let mut estimated = Self { term, errors, profiled: Vec::new(), halves: Vec::new() };
        estimated.make_positive();
        estimated
    }

    /// Of two ways to write the same, the one with a positive amplitude: its phase is half a turn away.
    fn make_positive(&mut self) {
        let parameters = self.term.parameters();
        let [.., amplitude, phase] = parameters else { return };
        let turns = phase.unit == "rad" && phase.plausible.1 - phase.plausible.0 > PI;
        if !turns || phase.relevance.threshold(&pleiad_physics::Floors::default()) > 0.0 {
            return;
        }
        let [.., size, angle] = self.term.values.as_mut_slice() else { return };
        if amplitude.plausible.0 < 0.0 && *size < 0.0 {
            let period = phase.plausible.1 - phase.plausible.0;
            let half_turn = if period > 2.0 * PI { PI } else { 0.5 * PI };
            *size = -*size;
            let moved = *angle + half_turn;
            *angle = if half_turn < PI { (2.0 * moved).wrapped() * 0.5 } else { moved.wrapped() };
        }
    }

    /// Finds the intervals of what has no derivative.
    fn profile(&mut self, profile: &Profile<'_, '_>, position: usize) {
        let one = |parameter: usize| match self.errors[parameter] {
            None if is_on(&self.term, parameter) => profile.interval((position, parameter)),
            _ => None,
        };
        self.profiled = (0..self.errors.len()).map(one).collect();
    }

    /// The 95 % interval of a parameter.
    pub(crate) fn interval(&self, parameter: usize) -> Option<[f64; 2]> {
        if let Some(Some(profiled)) = self.profiled.get(parameter) {
            return Some(*profiled);
        }
        let known = self.halves.get(parameter).copied().flatten();
        let half = known.or_else(|| Some(Z_95 * self.errors[parameter]?))?;
        let value = self.term.values[parameter];
        Some([value - half, value + half])
    }

    /// Takes the widths of intervals from the covariance of the final fit: how errors are correlated is seen to, and
    /// how few blocks may say all.
    fn widen(&mut self, fit: &Fit, robust: &Robust, position: usize) {
        let half = |parameter: usize| {
            let slot = fit.slots.iter().position(|slot| *slot == (position, parameter))?;
            let half = robust.quantiles[slot] * robust.covariance[(slot, slot)].max(0.0).sqrt();
            half.is_finite().then_some(half)
        };
        self.halves = (0..self.term.values.len()).map(half).collect();
    }

    /// The parameters as `findings.json` has them; those that were not fitted and are off stay out.
    #[allow(clippy::float_cmp, reason = "the off value itself")]
    pub(crate) fn parameters(&self) -> BTreeMap<String, Estimate> {
        let one = |(index, parameter): (usize, &Parameter)| {
            let value = self.term.values[index];
            if self.errors[index].is_none() && value == parameter.off {
                return None;
            }
            let ci95 = self.interval(index).unwrap_or([value, value]);
            Some((parameter.label(), Estimate { value, unit: parameter.unit.to_owned(), ci95 }))
        };
        self.term.parameters().iter().enumerate().filter_map(one).collect()
    }

    /// Whether the term can be relevant to a unit at all.
    pub(crate) fn may_be_relevant(&self, unit: &Unit<'_>) -> bool {
        self.is_relevant(unit).unwrap_or(true)
    }

    /// Whether the near end of some parameter is beyond its threshold of relevance; `None` if no parameter
    /// has one.
    fn is_relevant(&self, unit: &Unit<'_>) -> Option<bool> {
        let mut known = None;
        for (index, parameter) in self.term.parameters().iter().enumerate() {
            let Some(error) = self.errors[index] else { continue };
            for member in unit.acted_on(&self.term) {
                let threshold = parameter.relevance.threshold(&member.floors);
                if threshold > 0.0 {
                    let size = (self.term.values[index] - parameter.off).abs();
                    known = Some(known.unwrap_or(false) || size - NEAR_END * error > threshold);
                }
            }
        }
        known
    }
}

/// How a term fares under the rules of evidence.
#[derive(Clone, Debug)]
pub(crate) struct Judged {
    /// The parameters of its terms, the main one first.
    pub(crate) estimated: Vec<Estimated>,
    /// A parameter that only the terms together have.
    pub(crate) total: Option<(String, Estimate)>,
    pub(crate) verdict: Option<Verdict>,
    pub(crate) p_familywise: f64,
    pub(crate) channel: Channel,
    pub(crate) place: Place,
    /// The finding happened once, or where a robot was too seldom: it cannot be cross-validated.
    pub(crate) one_off: bool,
}

/// Judges terms that make one finding. `verdict` is `None` for a nuisance: significant, but too small, or of
/// no use on data that it was not fitted on.
pub(crate) fn judge(units: &[&Unit<'_>], support: &Support, gain: Gain, tests: usize) -> Judged {
    let (fit, covariance, group) = (&support.with, &support.covariance, &support.group);
    let mut estimated: Vec<Estimated> =
        group.iter().map(|&position| Estimated::of(fit, covariance, position)).collect();
    let acting: Vec<&Unit<'_>> = support.units.iter().map(|&unit| units[unit]).collect();
    let main = &estimated[0];
    let parameters = estimated.iter().flat_map(|own| own.errors.iter().flatten()).count().max(1);
    let seen = seen(&acting, &main.term);
    let inflation = match seen {
        Seen::Often => support.inflation,
        _ => support.inflation.max(inflation_everywhere(&acting, &support.without, &main.term)),
    };
    let one_off = seen == Seen::Once || is_impulse(main.term.effect);
    let ratio = 2.0 * (support.with.log_likelihood - support.without.log_likelihood) / inflation;
    let p_ratio = upper_tail(ratio, parameters);
    let p_wald = wald(fit, covariance, group).map_or(0.0, |(wald, count)| upper_tail(wald, count));
    let looked =
        if Placing::of(main.term.effect.info()).region.is_some() { rectangles(&acting) } else { 1.0 };
    let p_familywise = (p_ratio.max(p_wald) * tests as f64 * looked).min(1.0);
    let effect = main.term.effect;
    let total = total(&acting, (fit, covariance, group));
    let relevant = acting
        .iter()
        .flat_map(|unit| estimated.iter().filter_map(|own| own.is_relevant(unit)))
        .reduce(|a, b| a || b)
        .unwrap_or_else(|| changes_enough(&acting, support))
        || total.as_ref().is_some_and(|(_, total)| total.ci95[0] > 0.0);
    let errors = if seen == Seen::Seldom { 0.0 } else { GAIN_ERRORS };
    let useful = one_off || gain.is_useful(errors);
    let named = p_familywise < FAMILYWISE && relevant && useful;
    // Without encoders a name that needs them can only be a member of a set.
    let unseen = effect.info().channels.contains(&Needed::Encoders)
        && acting.iter().all(|unit| unit.stretch(Channel::CommandedBody).is_some());
    let verdict = named.then(|| {
        if support.members.len() > 1 || unseen {
            Verdict::CannotTell
        } else if effect.info().bad_data {
            Verdict::BadData
        } else {
            Verdict::Named
        }
    });
    let place = place(&acting, support, &main.term);
    let channel = channel(&acting, support, effect);
    let mut total = total;
    if verdict.is_some() {
        let profile = Profile::new(&acting, fit);
        let robust = robust(&acting, fit);
        for (own, &position) in estimated.iter_mut().zip(group) {
            own.profile(&profile, position);
            if let Some(robust) = &robust {
                own.widen(fit, robust, position);
            }
        }
        if let Some(robust) = &robust {
            total = self::total(&acting, (fit, &robust.covariance, group));
        }
    }
    Judged { estimated, total, verdict, p_familywise, channel, place, one_off }
}

/// Lag and delay together: without encoders their sum is known far better than either, and one of them may
/// have vanished. It is from the stamp of a command to the motion by the reference's clock, in the middle of the
/// recordings: what the robot's clock is found to be ahead by then is taken off, because a drift in the fit
/// shares the same delay between the two.
pub(crate) fn total(
    units: &[&Unit<'_>],
    (fit, covariance, group): (&Fit, &DMatrix<f64>, &[usize]),
) -> Option<(String, Estimate)> {
    let main = &fit.terms[*group.first()?];
    if twin(main.effect).is_none() || !is_unseen(units, main) {
        return None;
    }
    let slot = |term: &usize| fit.slots.iter().position(|slot| *slot == (*term, 0));
    let slots: Vec<usize> = group.iter().map(slot).collect::<Option<_>>()?;
    let mut parts: Vec<(usize, f64)> = slots.into_iter().map(|slot| (slot, 1.0)).collect();
    let acting = || units.iter().filter(|unit| unit.has(main));
    let middles = acting().map(|unit| f64::midpoint(unit.span_s.0, unit.span_s.1));
    let middle_s = middles.sum::<f64>() / acting().count().max(1) as f64;
    for (position, &(term, parameter)) in fit.slots.iter().enumerate() {
        let own = &fit.terms[term];
        let seconds = match own.effect {
            Effect::ClockOffset => 1.0,
            Effect::ClockDrift => 1e-6 * middle_s,
            _ => continue,
        };
        if parameter == 0 && acting().all(|unit| unit.has(own)) {
            parts.push((position, -seconds));
        }
    }
    let each = || parts.iter().copied();
    let variance: f64 =
        each().flat_map(|(a, by)| each().map(move |(b, with)| by * with * covariance[(a, b)])).sum();
    let value: f64 =
        each().map(|(slot, by)| by * fit.terms[fit.slots[slot].0].values[fit.slots[slot].1]).sum();
    let half = Z_95 * variance.max(0.0).sqrt();
    Some(("total_s".to_owned(), Estimate { value, unit: "s".to_owned(), ci95: [value - half, value + half] }))
}

/// Terms that make one finding: without encoders, lag and delay of a robot; else each its own.
pub(crate) fn groups(units: &[&Unit<'_>], terms: &[Term]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (position, term) in terms.iter().enumerate() {
        let partner = groups.iter_mut().find(|group| {
            let other = &terms[group[0]];
            group.len() == 1 && twin(term.effect) == Some(other.effect) && other.whose == term.whose
        });
        match partner {
            Some(group) if is_unseen(units, term) => group.push(position),
            _ => groups.push(vec![position]),
        }
    }
    groups
}

/// The effect that cannot be told from another without encoders.
pub(crate) fn twin(effect: Effect) -> Option<Effect> {
    match effect {
        Effect::ActuatorLag => Some(Effect::CommandDelay),
        Effect::CommandDelay => Some(Effect::ActuatorLag),
        _ => None,
    }
}

/// Whether a term acts on robots without encoders only.
pub(crate) fn is_unseen(units: &[&Unit<'_>], term: &Term) -> bool {
    let mut acting = units.iter().filter(|unit| unit.has(term)).peekable();
    acting.peek().is_some() && acting.all(|unit| unit.stretch(Channel::CommandedBody).is_some())
}

/// Effects of one instant.
fn is_impulse(effect: Effect) -> bool {
    let info = effect.info();
    Placing::of(info).onset.is_some() && info.parameters.iter().any(|parameter| parameter.name == "jump")
}

/// Whether the term changes enough rows by more than a sigma.
fn changes_enough(units: &[&Unit<'_>], support: &Support) -> bool {
    let (mut changed, mut all) = (0_usize, 0_usize);
    for (index, unit) in units.iter().enumerate() {
        let (with, without) = (&support.with.states[index], &support.without.states[index]);
        let whitened = |residuals: &[f64]| with.noise.whitened(unit, residuals);
        let (with, without) = (whitened(&with.residuals), whitened(&without.residuals));
        for stretch in &unit.stretches {
            let range = stretch.range();
            let in_stretch = range.clone().filter(|&row| (with[row] - without[row]).abs() > 1.0).count();
            if in_stretch > 0 {
                changed += in_stretch;
                all += range.len();
            }
        }
    }
    changed as f64 > LEAST_SHARE_CHANGED * all as f64
}

/// The channel in which the term gains most. In a mesh all that a robot does shows in the readings: there it is the
/// first along the signal chain in which the effect can show.
fn channel(units: &[&Unit<'_>], support: &Support, effect: Effect) -> Channel {
    if let Some(unit) = units.iter().find(|unit| unit.mesh.is_some()) {
        let shows = |channel: &Channel| touches(effect, *channel) && unit.stretch(*channel).is_some();
        if let Some(channel) = Channel::ALL.into_iter().find(|channel| shows(channel)) {
            return channel;
        }
    }
    let mut gains: BTreeMap<Channel, f64> = BTreeMap::new();
    for (index, unit) in units.iter().enumerate() {
        let (with, without) = (&support.with.states[index].noise, &support.without.states[index].noise);
        for (scale, (channel, _)) in unit.scales.iter().enumerate() {
            *gains.entry(*channel).or_default() += with.per_scale[scale] - without.per_scale[scale];
        }
    }
    gains.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(Channel::Body, |(channel, _)| channel)
}

/// Regimes in words, the most particular first where several hold.
type Regime = (&'static str, fn(&Row) -> bool);
const REGIMES: [Regime; 8] = [
    ("standing", |row| row.regime.speed_m_s.abs() < 0.01 && row.regime.yaw_rate_rad_s.abs() < 0.02),
    ("turning in place", |row| row.regime.speed_m_s.abs() < 0.05 && row.regime.yaw_rate_rad_s.abs() > 0.1),
    ("driving backwards", |row| row.regime.speed_m_s < -0.02),
    ("turning left", |row| row.regime.yaw_rate_rad_s > 0.1),
    ("turning right", |row| row.regime.yaw_rate_rad_s < -0.1),
    ("speeding up or braking", |row| row.regime.acceleration_m_s2.abs() > 0.3),
    ("turning", |row| row.regime.yaw_rate_rad_s.abs() > 0.1),
    ("driving", |row| row.regime.speed_m_s.abs() > 0.05),
];

/// Where the gain of a term arises.
fn place(units: &[&Unit<'_>], support: &Support, term: &Term) -> Place {
    let placing = Placing::of(term.effect.info());
    let region_m = placing.region.map(|first| {
        [term.values[first], term.values[first + 1], term.values[first + 2], term.values[first + 3]]
    });
    let end_s = units.iter().map(|unit| unit.span_s.1).fold(f64::NEG_INFINITY, f64::max);
    let time = placing.onset.map_or(Vec::new(), |onset| {
        let from_s = term.values[onset];
        vec![[from_s, if is_impulse(term.effect) { from_s } else { end_s }]]
    });
    let mut total = 0.0;
    let mut gains = [0.0; REGIMES.len()];
    let mut counts = [0_usize; REGIMES.len()];
    let mut count = 0;
    for (index, unit) in units.iter().enumerate() {
        let (with, without) = (&support.with.states[index], &support.without.states[index]);
        let each = held_out::gains(unit, with, without);
        for (meaning, gain) in unit.rows.iter().zip(each) {
            total += gain;
            count += 1;
            for ((_, holds), (sum, number)) in REGIMES.iter().zip(gains.iter_mut().zip(&mut counts)) {
                if holds(meaning) {
                    *sum += gain;
                    *number += 1;
                }
            }
        }
    }
    // Of the regimes in which most of the gain arises, the rarest; none if it is most of the run anyway.
    let main = (0..REGIMES.len())
        .filter(|&regime| {
            gains[regime] > MAIN_SHARE * total && (counts[regime] as f64) < MAIN_SHARE * f64::from(count)
        })
        .min_by_key(|&regime| counts[regime]);
    let regime = main.map_or("", |regime| REGIMES[regime].0).to_owned();
    Place { time, region_m, regime }
}

/// A composite of the catalogue that is the same as two terms of one robot together.
pub(crate) fn disguise(terms: &[Term]) -> Vec<(Effect, [usize; 2])> {
    let mut found = Vec::new();
    for &effect in Effect::ALL {
        let Some([first, second]) = composition(effect) else { continue };
        for (a, one) in terms.iter().enumerate().filter(|(_, term)| term.effect == first) {
            let other = terms.iter().position(|term| term.effect == second && term.whose == one.whose);
            if let Some(b) = other {
                found.push((effect, [a, b]));
            }
        }
    }
    found
}

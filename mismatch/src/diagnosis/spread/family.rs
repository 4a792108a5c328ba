//! Effects that share a likelihood: which of them the rows show, and which others would do.

use pleiad_physics::Effect;

use crate::channel::Channel;
use crate::diagnosis::chi_square::upper_tail;
use crate::diagnosis::held_out::{EMBARGO_S, FOLDS, Gain, fold, summed};
use crate::diagnosis::noise;
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN};
use crate::diagnosis::spread::maximum::{
    Bounds, Density, Optimum, Uncertainty, expected, maximize, uncertainty,
};
use crate::diagnosis::support::ODDS;
use crate::diagnosis::unit::{BLOCK_S, Unit};

/// Rows fewer than this say nothing of a spread.
pub(super) const LEAST_ROWS: usize = 50;

/// Where and when a row was measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The position of its unit among those of the family.
    pub(super) unit: usize,
    pub(super) time_s: f64,
    pub(super) channel: Channel,
}

/// How a parameter of the catalogue follows from those of a likelihood.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shown {
    Value(usize),
    /// Of a logarithm.
    Exp(usize),
    /// Of a logarithm, less this.
    ExpLess(usize, f64),
    /// Of a reciprocal.
    Inverse(usize),
    /// Of a square.
    Root(usize),
    /// Not fitted.
    Fixed(f64),
}

impl Shown {
    pub(super) fn value(self, parameters: &[f64]) -> f64 {
        match self {
            Self::Value(index) => parameters[index],
            Self::Exp(index) => libm::exp(parameters[index]),
            Self::ExpLess(index, less) => libm::exp(parameters[index]) - less,
            Self::Inverse(index) => 1.0 / parameters[index],
            Self::Root(index) => parameters[index].sqrt(),
            Self::Fixed(value) => value,
        }
    }

    pub(super) fn error(self, parameters: &[f64], known: &Uncertainty) -> Option<f64> {
        let (index, slope) = match self {
            Self::Value(index) => (index, 1.0),
            Self::Exp(index) | Self::ExpLess(index, _) => (index, libm::exp(parameters[index])),
            Self::Inverse(index) => (index, parameters[index].powi(-2)),
            Self::Root(index) => (index, 0.5 / parameters[index].sqrt()),
            Self::Fixed(_) => return None,
        };
        let error = slope * known.between(index, index)?.sqrt();
        error.is_finite().then_some(error)
    }
}

/// A sum of parameters of a likelihood that must be beyond a size to matter.
#[derive(Clone, Debug)]
pub(super) struct Contrast {
    pub(super) weights: Vec<(usize, f64)>,
    pub(super) threshold: f64,
}

impl Contrast {
    /// Its size and its error.
    pub(super) fn estimate(&self, parameters: &[f64], known: &Uncertainty) -> Option<(f64, f64)> {
        let value: f64 = self.weights.iter().map(|(index, weight)| weight * parameters[*index]).sum();
        let mut variance = 0.0;
        for (one, a) in &self.weights {
            for (other, b) in &self.weights {
                variance += a * b * known.between(*one, *other)?;
            }
        }
        (variance >= 0.0).then(|| (value.abs(), variance.sqrt()))
    }
}

/// An effect within a likelihood.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) effect: Effect,
    /// Its parameters in the likelihood, with their values where it is off and where the search begins.
    pub(super) parameters: Vec<usize>,
    pub(super) off: Vec<f64>,
    pub(super) start: Vec<f64>,
    /// The parameters of the catalogue.
    pub(super) shown: Vec<Shown>,
    /// What must be beyond its size for the effect to matter, beside the catalogue's own thresholds.
    pub(super) contrasts: Vec<Contrast>,
    /// An effect of chance that some rows show wholly and the others not at all: so many rows could. Its
    /// likelihood is no parabola where it is off, so that only the ratio of likelihoods tests it.
    pub(super) chances: Option<usize>,
}

/// A likelihood of rows of one robot with the effects that it knows.
pub(super) struct Family<'u, 'a> {
    pub(super) units: Vec<&'u Unit<'a>>,
    pub(super) places: Vec<Place>,
    pub(super) density: Box<dyn Density + 'u>,
    pub(super) bounds: Vec<Bounds>,
    /// Every parameter where all effects are off.
    pub(super) start: Vec<f64>,
    /// Parameters that are fitted whatever acts.
    pub(super) nuisances: Vec<usize>,
    pub(super) members: Vec<Member>,
}

/// Blocks in time of rows, numbered through the units.
pub(super) fn blocks(units: &[&Unit<'_>], places: &[Place]) -> Vec<usize> {
    let mut firsts = Vec::new();
    let mut count = 0;
    for unit in units {
        firsts.push(count);
        count += unit.blocks + 1;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let block = |place: &Place| {
        let unit = units[place.unit];
        let own = ((place.time_s - unit.span_s.0) / BLOCK_S).max(0.0) as usize;
        firsts[place.unit] + own.min(unit.blocks)
    };
    places.iter().map(block).collect()
}

/// An effect that a family shows.
#[derive(Clone, Debug)]
pub(super) struct Shows {
    /// Its position among the members.
    pub(super) member: usize,
    pub(super) with: Optimum,
    /// Without it, fitted again.
    pub(super) without: Optimum,
    pub(super) known: Uncertainty,
    /// Probability of as strong a sign without it, at this test alone.
    pub(super) p: f64,
    pub(super) gain: Gain,
    pub(super) channel: Channel,
    /// Other effects that explain it about equally.
    pub(super) rivals: Vec<Effect>,
}

#[allow(clippy::float_cmp, reason = "the off value itself")]
fn is_same(value: f64, off: f64) -> bool {
    value == off
}

/// The gain of a row, no more than what a residual of [`noise::CLIP`] sigmas costs: no instant outweighs the rest.
fn bounded_gain(gain: f64) -> f64 {
    let most = 0.5 * noise::CLIP * noise::CLIP;
    gain.clamp(-most, most)
}

impl Family<'_, '_> {
    fn free(&self, active: &[usize]) -> Vec<usize> {
        let own = active.iter().flat_map(|&member| self.members[member].parameters.iter().copied());
        self.nuisances.iter().copied().chain(own).collect()
    }

    /// The likelihood with these members active; the search begins at `from`, with new ones at their start.
    #[allow(clippy::float_cmp, reason = "the off value itself")]
    pub(super) fn fit(&self, active: &[usize], from: &Optimum, kept: &dyn Fn(usize) -> bool) -> Optimum {
        let mut start = from.parameters.clone();
        for (index, member) in self.members.iter().enumerate() {
            for ((&parameter, &off), &begin) in member.parameters.iter().zip(&member.off).zip(&member.start) {
                if !active.contains(&index) {
                    start[parameter] = off;
                } else if is_same(start[parameter], off) {
                    start[parameter] = begin;
                }
            }
        }
        maximize(self.density.as_ref(), &self.bounds, &start, &self.free(active), kept)
    }

    fn nothing(&self) -> Optimum {
        Optimum { parameters: self.start.clone(), log_likelihood: f64::NEG_INFINITY }
    }

    /// The likelihood where nothing acts.
    pub(super) fn base(&self) -> Optimum {
        self.fit(&[], &self.nothing(), &|_| true)
    }

    /// What an optimum with these members is known to.
    pub(super) fn known(&self, active: &[usize], optimum: &Optimum) -> Option<Uncertainty> {
        uncertainty(self.density.as_ref(), &self.bounds, optimum, &self.free(active))
    }

    /// What would be known of these members where they are all but off.
    pub(super) fn expected(&self, active: &[usize], there: &Optimum) -> Option<Uncertainty> {
        expected(self.density.as_ref(), &self.bounds, there, &self.free(active))
    }

    /// Adds effects as long as one is significant among so many tests; then each against its absence and its
    /// rivals.
    pub(super) fn select(&self, base: &Optimum, tests: usize) -> Vec<Shows> {
        if self.places.len() < LEAST_ROWS {
            return Vec::new();
        }
        let mut active: Vec<usize> = Vec::new();
        let mut current = base.clone();
        loop {
            let mut best: Option<(usize, Optimum)> = None;
            for member in (0..self.members.len()).filter(|member| !active.contains(member)) {
                let mut tried = active.clone();
                tried.push(member);
                let fitted = self.fit(&tried, &current, &|_| true);
                let more = best.as_ref().is_none_or(|(_, best)| fitted.log_likelihood > best.log_likelihood);
                let gained = 2.0 * (fitted.log_likelihood - current.log_likelihood);
                if !more || gained < LEAST_GAIN {
                    continue;
                }
                if self.significance(&tried, member, &fitted, &current).0 * (tests as f64) < FAMILYWISE {
                    best = Some((member, fitted));
                }
            }
            let Some((member, fitted)) = best else { break };
            active.push(member);
            current = fitted;
        }
        active.iter().filter_map(|&member| self.shows(member, &active, &current, tests)).collect()
    }

    /// The probability of as strong a sign without a member, and how much its score is inflated.
    fn significance(&self, active: &[usize], member: usize, with: &Optimum, without: &Optimum) -> (f64, f64) {
        let own = &self.members[member];
        let Some(known) = self.known(active, with) else { return (1.0, 1.0) };
        let inflation = known.inflation(&own.parameters);
        let ratio = 2.0 * (with.log_likelihood - without.log_likelihood) / inflation;
        let p = upper_tail(ratio, own.parameters.len());
        // The estimate of a probability or a variance is far from normal where it is small: its error says less
        // than the ratio.
        if own.chances.is_some() || own.shown.iter().any(|shown| matches!(shown, Shown::Root(_))) {
            return (p, inflation);
        }
        let departure: Vec<f64> =
            own.parameters.iter().zip(&own.off).map(|(&index, off)| with.parameters[index] - off).collect();
        match known.wald(&own.parameters, &departure) {
            Some(wald) => (p.max(upper_tail(wald, own.parameters.len())), inflation),
            None => (1.0, inflation),
        }
    }

    fn shows(&self, member: usize, active: &[usize], with: &Optimum, tests: usize) -> Option<Shows> {
        let others: Vec<usize> = active.iter().copied().filter(|other| *other != member).collect();
        // Noise that was fitted beside the member may be far from what explains the most without it.
        let without = [with, &self.nothing()].map(|from| self.fit(&others, from, &|_| true));
        let without =
            without.into_iter().reduce(|a, b| if b.log_likelihood > a.log_likelihood { b } else { a })?;
        let (p, inflation) = self.significance(active, member, with, &without);
        if p * tests as f64 >= FAMILYWISE {
            return None;
        }
        let size = self.members[member].parameters.len();
        let rivals = (0..self.members.len())
            .filter(|rival| !active.contains(rival) && self.members[*rival].parameters.len() <= size)
            .filter(|&rival| {
                let mut tried = others.clone();
                tried.push(rival);
                let fitted = self.fit(&tried, &without, &|_| true);
                2.0 * (with.log_likelihood - fitted.log_likelihood) / inflation < ODDS
            })
            .map(|rival| self.members[rival].effect)
            .collect();
        let known = self.known(active, with)?;
        let gain = self.gain((active, with), (&others, &without));
        let channel = self.channel(with, &without);
        Some(Shows { member, with: with.clone(), without, known, p, gain, channel, rivals })
    }

    /// What one likelihood adds to another in the log-density of other recordings.
    pub(super) fn gain_in(held: &Family<'_, '_>, with: &Optimum, without: &Optimum) -> Gain {
        let (mut high, mut low) = (vec![0.0; held.places.len()], vec![0.0; held.places.len()]);
        held.density.fill(&with.parameters, &mut high);
        held.density.fill(&without.parameters, &mut low);
        let mut sums = vec![0.0; held.density.blocks().iter().max().map_or(0, |last| last + 1)];
        for (&block, (high, low)) in held.density.blocks().iter().zip(high.iter().zip(&low)) {
            sums[block] += bounded_gain(high - low);
        }
        summed(&[sums])
    }

    /// What a member adds to the log-density of folds that neither likelihood saw.
    fn gain(&self, with: (&[usize], &Optimum), without: (&[usize], &Optimum)) -> Gain {
        let (mut high, mut low) = (vec![0.0; self.places.len()], vec![0.0; self.places.len()]);
        let blocks = self.density.blocks();
        let mut sums = vec![0.0; blocks.iter().max().map_or(0, |last| last + 1)];
        for number in 0..FOLDS {
            let fold = |place: &Place| fold(self.units[place.unit], number);
            let kept = |row: usize| {
                let (place, fold) = (&self.places[row], fold(&self.places[row]));
                place.time_s < fold.start - EMBARGO_S || place.time_s >= fold.end + EMBARGO_S
            };
            self.density.fill(&self.fit(with.0, with.1, &kept).parameters, &mut high);
            self.density.fill(&self.fit(without.0, without.1, &kept).parameters, &mut low);
            for (row, place) in self.places.iter().enumerate() {
                if fold(place).contains(&place.time_s) {
                    sums[blocks[row]] += bounded_gain(high[row] - low[row]);
                }
            }
        }
        summed(&[sums])
    }

    /// The channel whose rows gain most, among those in which the effect shows.
    fn channel(&self, with: &Optimum, without: &Optimum) -> Channel {
        let (mut high, mut low) = (vec![0.0; self.places.len()], vec![0.0; self.places.len()]);
        self.density.fill(&with.parameters, &mut high);
        self.density.fill(&without.parameters, &mut low);
        let mut gains = [0.0; Channel::ALL.len()];
        for (place, (high, low)) in self.places.iter().zip(high.iter().zip(&low)) {
            for (gain, channel) in gains.iter_mut().zip(Channel::ALL) {
                if channel == place.channel {
                    *gain += high - low;
                }
            }
        }
        let best = gains.iter().zip(Channel::ALL).max_by(|a, b| a.0.total_cmp(b.0));
        best.map_or(Channel::Body, |(_, channel)| channel)
    }
}

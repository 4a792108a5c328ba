//! Levels as the coordinates of a search.

use super::{Level, Levels, TunableFact, scores};
use crate::fact::{Absolute, Quantity};
use crate::fold::{Clutter, Fact, FoldConfig};
use crate::sample::Relative;

/// Smallest and largest share of outliers that is tried.
const SHARES: [f64; 2] = [1e-5, 0.5];
/// How far a level may go from where it starts, as the logarithm of a factor: a thousand.
const FARTHEST: f64 = 6.9;

/// What is searched: the logarithms of the free levels, and the logit of the share of outliers after them.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    facts: &'a [TunableFact],
    base: Levels,
    free: Vec<Level>,
    reach_m: f64,
}

impl<'a> Problem<'a> {
    /// Over the `free` levels; the others stay what they are in `base`, where the free ones are positive too. Sensors see as
    /// far as `reach_m`.
    pub fn new(facts: &'a [TunableFact], base: Levels, free: Vec<Level>, reach_m: f64) -> Self {
        Self { facts, base, free, reach_m }
    }

    /// The levels that are searched.
    pub fn free(&self) -> &[Level] {
        &self.free
    }

    /// The point of these levels and this share.
    pub fn point(&self, levels: &Levels, share: f64) -> Vec<f64> {
        let logarithms = self.free.iter().map(|level| libm::log(levels[*level]));
        logarithms.chain(std::iter::once(libm::log(share / (1.0 - share)))).collect()
    }

    /// The bounds of the search.
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let [low, high] = SHARES.map(|share| self.point(&self.base, share));
        let last = self.free.len();
        let moved = |point: Vec<f64>, by: f64| {
            point.into_iter().enumerate().map(|(j, x)| if j == last { x } else { x + by }).collect()
        };
        (moved(low, -FARTHEST), moved(high, FARTHEST))
    }

    /// Levels and share of outliers at a point.
    pub fn at(&self, x: &[f64]) -> (Levels, f64) {
        let mut levels = self.base;
        for (level, x) in self.free.iter().zip(x) {
            levels[*level] = libm::exp(*x);
        }
        let share = x.last().map_or(SHARES[0], |x| 1.0 / (1.0 + libm::exp(-x)));
        (levels, share)
    }

    /// The fold whose likelihood is searched: without a gate, outliers weighed by their probability.
    pub fn config(&self, share: f64) -> FoldConfig {
        let clutter = Some(Clutter { share, reach_m: self.reach_m });
        FoldConfig { gate: [f64::INFINITY; 3], clutter, ..FoldConfig::default() }
    }

    /// Log-densities of all facts at a point, zero where there was no measurement.
    pub fn densities(&self, x: &[f64]) -> Vec<f64> {
        let (levels, share) = self.at(x);
        let scores = scores(self.facts, &levels, &self.config(share));
        scores.into_iter().map(|score| score.map_or(0.0, |score| score.log_density)).collect()
    }
}

/// The farthest that anything was seen, or a fix from the origin of the map; `None` if no reading is of a length.
pub fn largest_reading_m(facts: &[TunableFact]) -> Option<f64> {
    let length = |fact: &TunableFact| match fact.gathered() {
        Fact::Boot(_) => None,
        Fact::Observation { quantity, .. } => match quantity {
            Quantity::Robot { relative, .. }
            | Quantity::Landmark { relative, .. }
            | Quantity::Feature { relative, .. } => match *relative {
                Relative::Pose(pose) => Some(pose.position().norm()),
                Relative::Position { x_m, y_m } => Some((x_m * x_m + y_m * y_m).sqrt()),
                Relative::Range { range_m } | Relative::RangeBearing { range_m, .. } => Some(range_m),
                Relative::Bearing { .. } => None,
            },
            Quantity::Absolute(Absolute::Position([x, y])) => Some((x * x + y * y).sqrt()),
            Quantity::Absolute(_) => None,
        },
    };
    facts.iter().filter_map(length).reduce(f64::max)
}

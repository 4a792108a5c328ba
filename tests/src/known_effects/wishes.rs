//! What is wanted of the table, and which rows fall short for a cause that is known.

use super::outcome::{Outcome, Row, mean};

/// The most that a standard error may be, as a share of the size.
const MOST_SIGMA: f64 = 0.2;
/// The mean squared error in standard errors: more where errors are underestimated, less where overestimated.
const MEAN_SQUARE: [f64; 2] = [0.5, 1.7];
/// The share of all intervals of 95 % that hold the truth.
pub const COVERED: [f64; 2] = [0.92, 0.98];

/// What is wanted of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wish {
    /// An interval in every seed, or of a label, the right one.
    Found,
    /// Sigma is at most a fifth of the size.
    Small,
    /// Mean z^2 is not above what is wanted.
    NotTooSure,
    /// Mean z^2 is not below what is wanted.
    NotTooUnsure,
}

/// A row that falls short of a wish.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shortfall {
    /// The effect.
    pub effect: &'static str,
    /// The parameter.
    pub label: String,
    /// The wish.
    pub wish: Wish,
}

impl Row {
    /// The wishes of which this row falls short, among so many seeds.
    pub fn falls_short(&self, seeds: usize) -> Vec<Wish> {
        if let Some(right) = self.right {
            return if right < seeds { vec![Wish::Found] } else { Vec::new() };
        }
        let mut all = Vec::new();
        if self.errors.len() < seeds {
            all.push(Wish::Found);
        }
        if self.errors.is_empty() {
            return all;
        }
        let square = mean(self.z_squares().into_iter());
        if self.sigma() > MOST_SIGMA * self.size {
            all.push(Wish::Small);
        }
        if square > MEAN_SQUARE[1] {
            all.push(Wish::NotTooSure);
        }
        if square < MEAN_SQUARE[0] {
            all.push(Wish::NotTooUnsure);
        }
        all
    }
}

/// Every row that falls short of a wish, in the order of the outcomes.
pub fn shortfalls(outcomes: &[Outcome]) -> Vec<Shortfall> {
    let of_row = |outcome: &Outcome, row: &Row| {
        let effect = outcome.effect.name();
        let label = row.label.clone();
        let one = move |wish| Shortfall { effect, label: label.clone(), wish };
        row.falls_short(outcome.seeds).into_iter().map(one).collect::<Vec<_>>()
    };
    outcomes
        .iter()
        .flat_map(|outcome| outcome.rows.iter().flat_map(move |row| of_row(outcome, row)))
        .collect()
}

/// The share of all intervals that hold the truth; without those of one effect, if one is given.
pub fn covered(outcomes: &[Outcome]) -> f64 {
    let rows = || outcomes.iter().flat_map(|outcome| &outcome.rows);
    let covered: usize = rows().map(|row| row.covered).sum();
    let all: usize = rows().map(|row| row.errors.len()).sum();
    covered as f64 / all as f64
}

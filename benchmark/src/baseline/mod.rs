//! Other methods on the same recordings: they are given the same residuals of the nominal model, and the same
//! effects linearized beside it, both in sigmas.

mod gram;
mod joint;
mod lasso;
mod thresholded;

use std::collections::{BTreeMap, BTreeSet};

use pleiad_mismatch::{Design, DesignColumn, acts_on_every_robot};
use pleiad_physics::Effect;
use serde::{Deserialize, Serialize};

use crate::seal::Answer;

pub use gram::{Folds, Regression};
pub use joint::joint;
pub use lasso::lasso;
pub use thresholded::thresholded;

/// What a method selected of the catalogue.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    /// Effects selected, with their robots (0: all), the strongest first; at most twenty.
    pub strongest: Vec<(String, u32)>,
    /// How many were selected.
    pub selected: usize,
    /// Of the effects injected, how many were selected.
    pub found: usize,
    /// How many effects were injected that have a column at all.
    pub of: usize,
    /// Whether the strongest is one of those injected.
    pub top1: bool,
    /// Selected and not injected.
    pub extra: usize,
}

/// The three methods on a design.
pub fn all(design: &Design, answer: &Answer) -> BTreeMap<String, Selection> {
    let folds = Folds::of(design);
    let named = |name: &str, coefficients: &[f64]| (name.to_owned(), selection(design, coefficients, answer));
    BTreeMap::from([
        named("joint_fit", &joint(&folds)),
        named("lasso", &lasso(&folds)),
        named("sparse_regression", &thresholded(&folds)),
    ])
}

/// An effect of a robot, or of all (0).
type Name = (Effect, u32);

fn name(column: &DesignColumn) -> Name {
    (column.effect, column.robot.map_or(0, |robot| robot.0))
}

/// Coefficients that are not zero, of columns in units of their length, effect by effect.
fn selection(design: &Design, coefficients: &[f64], answer: &Answer) -> Selection {
    let mut sizes: BTreeMap<Name, f64> = BTreeMap::new();
    for (column, value) in design.columns.iter().zip(coefficients) {
        if *value != 0.0 {
            *sizes.entry(name(column)).or_default() += value * value;
        }
    }
    let known: BTreeSet<Name> = design.columns.iter().map(name).collect();
    let injected: BTreeSet<Name> = answer
        .injected
        .iter()
        .filter_map(|own| {
            let effect = Effect::from_name(&own.effect)?;
            let robot = if acts_on_every_robot(effect) { 0 } else { *own.robots.first()? };
            Some((effect, robot)).filter(|name| known.contains(name))
        })
        .collect();
    let mut ordered: Vec<(Name, f64)> = sizes.into_iter().collect();
    ordered.sort_by(|a, b| b.1.total_cmp(&a.1));
    let found = ordered.iter().filter(|(name, _)| injected.contains(name)).count();
    Selection {
        strongest: ordered
            .iter()
            .take(20)
            .map(|((effect, robot), _)| (effect.name().to_owned(), *robot))
            .collect(),
        selected: ordered.len(),
        found,
        of: injected.len(),
        top1: ordered.first().is_some_and(|(name, _)| injected.contains(name)),
        extra: ordered.len() - found,
    }
}

#[cfg(test)]
mod tests;

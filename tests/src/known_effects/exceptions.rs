//! Rows of the table that fall short of a wish, with the cause. The slow test wants these and no others.

use pleiad_physics::Effect;

use super::wishes::{Shortfall, Wish};

/// A shortfall that is known.
#[derive(Clone, Copy, Debug)]
pub struct Exception {
    /// The effect.
    pub effect: Effect,
    /// The parameter.
    pub label: &'static str,
    /// What it falls short of.
    pub wish: Wish,
    /// The cause.
    pub why: &'static str,
}

impl Exception {
    /// Whether it is this shortfall.
    pub fn is(&self, short: &Shortfall) -> bool {
        self.effect.name() == short.effect && self.label == short.label && self.wish == short.wish
    }
}

/// Where no cause was found.
pub const UNKNOWN: &str = "no cause was found";

/// Every shortfall whose cause is known.
pub const EXCEPTIONS: &[Exception] = &[];

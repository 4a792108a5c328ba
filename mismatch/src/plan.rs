//! What is to be compared, prepared before any model is asked.

use crate::residual::{Omission, tally};

/// The windows or readings of one channel in the order of time, and what is not among them. Nothing in it
/// depends on the model that predicts, so that a fit prepares it once.
#[derive(Clone, Debug)]
pub(crate) struct Plan<T> {
    pub(crate) items: Vec<T>,
    pub(crate) omissions: Vec<Omission>,
}

impl<T> Plan<T> {
    pub(crate) fn new() -> Self {
        Self { items: Vec::new(), omissions: Vec::new() }
    }

    /// Nothing to compare, and why.
    pub(crate) fn without(omission: Omission) -> Self {
        Self { items: Vec::new(), omissions: vec![omission] }
    }

    /// Counts one more omission of the kind that `of` makes of a count.
    pub(crate) fn count(&mut self, of: impl Fn(usize) -> Omission) {
        tally(&mut self.omissions, 1, of);
    }

    pub(crate) fn count_many(&mut self, more: usize, of: impl Fn(usize) -> Omission) {
        tally(&mut self.omissions, more, of);
    }
}

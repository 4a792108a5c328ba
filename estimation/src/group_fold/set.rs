//! A set of facts, of which the estimate is a function.

use std::collections::BTreeMap;

use super::{Fact, FoldConfig, Joint, Residual, Space, Unsound};
use crate::fold::FactKey;

/// Facts by their keys. The order in which they were inserted, and how often, leaves no trace.
#[derive(Clone, Debug, PartialEq)]
pub struct FactSet<G: Space<D>, const D: usize> {
    // `None` where two different facts claim one key: neither is folded, whichever came first.
    facts: BTreeMap<FactKey, Option<Fact<G, D>>>,
}

/// What became of a fact that was inserted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Insertion {
    /// It is new.
    Added,
    /// The same fact was there.
    Known,
    /// Another fact with the same key was there: neither counts from now on.
    Contradicted,
}

impl<G: Space<D>, const D: usize> Default for FactSet<G, D> {
    fn default() -> Self {
        Self { facts: BTreeMap::new() }
    }
}

impl<G: Space<D>, const D: usize> FactSet<G, D> {
    /// No fact.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a fact into the set.
    ///
    /// # Errors
    /// [`Unsound`] if it must not be folded; the set is then as it was.
    pub fn insert(&mut self, key: FactKey, fact: Fact<G, D>) -> Result<Insertion, Unsound> {
        fact.check()?;
        let Some(held) = self.facts.get_mut(&key) else {
            self.facts.insert(key, Some(fact));
            return Ok(Insertion::Added);
        };
        if held.is_some_and(|held| held.words() == fact.words()) {
            return Ok(Insertion::Known);
        }
        *held = None;
        Ok(Insertion::Contradicted)
    }

    /// Facts that count, in the order of their keys.
    pub fn facts(&self) -> impl Iterator<Item = (&FactKey, &Fact<G, D>)> {
        self.facts.iter().filter_map(|(key, fact)| Some((key, fact.as_ref()?)))
    }

    /// Keys that two different facts claim.
    pub fn contradicted(&self) -> impl Iterator<Item = &FactKey> {
        self.facts.iter().filter(|(_, fact)| fact.is_none()).map(|(key, _)| key)
    }

    /// The joint that the facts make of nothing, and what became of each.
    pub fn fold(&self, config: &FoldConfig<D>) -> (Joint<G, D>, Vec<(FactKey, Residual<D>)>) {
        let mut joint = Joint::default();
        let records = self.facts().map(|(key, fact)| (*key, joint.fold(config, key, fact))).collect();
        (joint, records)
    }
}

//! Errors of this crate.

use crate::info::EffectInfo;

/// A model that cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhysicsError {
    /// The catalogue has no effect of this name.
    #[error("effect `{name}` is not in the catalogue; `pleiad effects` lists the names")]
    UnknownEffect {
        /// The name given.
        name: String,
    },
    /// An effect has no parameter of this label.
    #[error("effect `{effect}` has no parameter `{label}`; it has: {}", .expected.join(", "))]
    UnknownParameter {
        /// The effect.
        effect: &'static str,
        /// The label given.
        label: String,
        /// The labels it has.
        expected: Vec<String>,
    },
    /// Too few or too many values.
    #[error("effect `{effect}` takes {expected} values, {found} were given")]
    ValueCount {
        /// The effect.
        effect: &'static str,
        /// How many it takes.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// A value that is no number.
    #[error("effect `{effect}`: `{label}` is {value}, expected a number")]
    NotANumber {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        label: String,
        /// The value given.
        value: f64,
    },
}

impl PhysicsError {
    pub(crate) fn unknown_parameter(info: &'static EffectInfo, label: &str) -> Self {
        let expected = info.parameters.iter().map(crate::info::Parameter::label).collect();
        Self::UnknownParameter { effect: info.name, label: label.to_owned(), expected }
    }
}

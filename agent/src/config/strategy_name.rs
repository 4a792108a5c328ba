//! A strategy by its name.

use pleiad_estimation::strategy::StrategyKind;
use serde::{Deserialize as _, Deserializer, Serializer};

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the form that serde calls")]
pub fn serialize<S: Serializer>(kind: &StrategyKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}

pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<StrategyKind, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
}

//! What an observation costs on the wire.

use std::collections::BTreeMap;

use pleiad_estimation::fact::{Body, Entry, EntryId, Quantity};
use pleiad_protocol::encode_entries;

/// Mean payload bytes of a complete relative observation: the message that carries the observer's entry
/// and the one that carries the other half, each published alone. Zero without any.
pub fn per_relative_observation<'a>(entries: impl Iterator<Item = &'a Entry> + Clone) -> f64 {
    let mut observations: BTreeMap<EntryId, usize> = BTreeMap::new();
    for entry in entries.clone() {
        if let Body::Observation(observation) = &entry.body
            && matches!(observation.quantity, Quantity::Robot { .. })
        {
            observations.insert(entry.id, encode_entries(std::slice::from_ref(entry)).len());
        }
    }
    let (mut bytes, mut complete) = (0, 0_u32);
    for entry in entries {
        if let Body::Half(half) = &entry.body
            && let Some(observation) = observations.get(&half.observation)
        {
            bytes += observation + encode_entries(std::slice::from_ref(entry)).len();
            complete += 1;
        }
    }
    if complete == 0 { 0.0 } else { bytes as f64 / f64::from(complete) }
}

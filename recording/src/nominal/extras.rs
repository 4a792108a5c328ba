//! What a robot's section has besides numbers: its drive and its effects.

use std::fmt::Write;

use pleiad_physics::Drive;
use toml::{Table, Value};

use super::{Domain, number};
use crate::effect_spec::{DeclaredEffect, EffectSpec};

/// The keys that this module reads.
pub(super) const DRIVE: [&str; 3] = ["drive", "track_ratio", "wheelbase_m"];
pub(super) const EFFECTS: &str = "effects";

/// What is wrong: the key within the section, what it is, what was expected.
pub(super) struct Wrong {
    pub(super) key: String,
    pub(super) found: String,
    pub(super) expected: String,
}

fn wrong(key: &str, value: Option<&Value>, expected: &str) -> Wrong {
    Wrong { key: key.to_owned(), found: super::found(value), expected: expected.to_owned() }
}

/// The drive that a table states; `None` if it states none.
pub(super) fn drive(table: &Table) -> Result<Option<Drive>, Wrong> {
    let Some(value) = table.get("drive") else {
        return match DRIVE.iter().find(|key| table.contains_key(**key)) {
            Some(key) => Err(wrong(key, table.get(*key), "the key `drive` with it")),
            None => Ok(None),
        };
    };
    let length = |key: &'static str| {
        let found = table.get(key);
        found
            .and_then(number)
            .filter(|&value| Domain::Positive.holds(value))
            .ok_or_else(|| wrong(key, found, Domain::Positive.description()))
    };
    let wheelbase = || {
        let found = table.get("wheelbase_m");
        let expected = "a finite number other than 0: negative if the rear axle is steered";
        let holds = |value: &f64| value.is_finite() && *value != 0.0;
        found.and_then(number).filter(holds).ok_or_else(|| wrong("wheelbase_m", found, expected))
    };
    let (drive, own) = match value.as_str() {
        Some("differential") => (Drive::Differential, None),
        Some("skid_steer") => (Drive::SkidSteer { track_ratio: length("track_ratio")? }, Some("track_ratio")),
        Some("car_like") => (Drive::CarLike { wheelbase_m: wheelbase()? }, Some("wheelbase_m")),
        _ => return Err(wrong("drive", Some(value), "\"differential\", \"skid_steer\" or \"car_like\"")),
    };
    for key in &DRIVE[1..] {
        if table.contains_key(*key) && own != Some(*key) {
            return Err(wrong(key, table.get(*key), &format!("no such key with drive = {value}")));
        }
    }
    Ok(Some(drive))
}

/// The effects of a robot's section.
pub(super) fn effects(table: &Table) -> Result<Vec<DeclaredEffect>, Wrong> {
    let Some(value) = table.get(EFFECTS) else { return Ok(Vec::new()) };
    let expected = "a list of effects, each a section [[robots.rN.effects]] with `name` and `parameters`";
    let items = value.as_array().ok_or_else(|| wrong(EFFECTS, Some(value), expected))?;
    items
        .iter()
        .enumerate()
        .map(|(index, item)| {
            let key = format!("{EFFECTS}[{index}]");
            let spec: EffectSpec = item.clone().try_into().map_err(|error: toml::de::Error| Wrong {
                key: key.clone(),
                found: format!(
                    "an effect that cannot be read ({})",
                    error.to_string().trim().replace('\n', " ")
                ),
                expected: "the keys name, parameters, and if wanted ci95 and within { region_m, time_s }"
                    .to_owned(),
            })?;
            spec.declared().map_err(|error| Wrong {
                key: format!("{key}.{}", error.key),
                found: error.found,
                expected: error.expected,
            })
        })
        .collect()
}

/// Writes both; nothing for a differential drive without effects. Writing to a string cannot fail.
pub(super) fn push(
    text: &mut String,
    section: &str,
    drive: Drive,
    effects: &[DeclaredEffect],
) -> Result<(), String> {
    let _ = match drive {
        Drive::Differential => Ok(()),
        Drive::SkidSteer { track_ratio } => {
            writeln!(text, "drive = \"skid_steer\"\ntrack_ratio = {track_ratio:?}")
        }
        Drive::CarLike { wheelbase_m } => {
            writeln!(text, "drive = \"car_like\"\nwheelbase_m = {wheelbase_m:?}")
        }
    };
    for (index, effect) in effects.iter().enumerate() {
        let spec = EffectSpec::from(effect);
        // What cannot be read back is not written.
        spec.declared().map_err(|error| {
            format!(
                "`{section}.{EFFECTS}[{index}].{}` is {}, expected {}",
                error.key, error.found, error.expected
            )
        })?;
        let _ = writeln!(text, "\n[[{section}.{EFFECTS}]]\nname = {}", Value::from(spec.name.as_str()));
        let _ = writeln!(text, "parameters = {}", inline(&spec.parameters));
        if !spec.ci95.is_empty() {
            let _ = writeln!(text, "ci95 = {}", inline(&spec.ci95));
        }
        if let Some(scope) = spec.within {
            let region = scope.region_m.map(|bounds| format!("region_m = {bounds:?}"));
            let time = scope.time_s.map(|times| format!("time_s = {times:?}"));
            let keys: Vec<String> = region.into_iter().chain(time).collect();
            let _ = writeln!(text, "within = {{ {} }}", keys.join(", "));
        }
    }
    Ok(())
}

/// A table on one line.
fn inline(table: &Table) -> String {
    let keys: Vec<String> = table.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("{{ {} }}", keys.join(", "))
}

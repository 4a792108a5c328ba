//! The keys a scenario may have, and a check of a document against them that knows the lines.
//!
//! The known keys are those of a document written out from the settings' own types, so that the list
//! cannot fall behind them.

use std::collections::BTreeMap;

use pleiad_recording::{EffectSpec, ScopeSpec};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::load::{Document, EFFECTS};
use super::{Declared, Kidnap, ManoeuvreKind, RobotSettings, Start};
use crate::Error;

/// Keys whose value is one of a few words, by the end of their path.
const CHOICES: [(&str, &[&str]); 6] = [
    (
        "motion.policy",
        &[
            "waypoints_random",
            "circle",
            "figure_eight",
            "square",
            "line_back_and_forth",
            "parked",
            "portable_landmarks",
            "one_mover",
            "manoeuvres",
            "script",
        ],
    ),
    ("drive.kind", &["differential", "skid_steer", "car_like"]),
    ("motion.direction", &["counter_clockwise", "clockwise"]),
    ("odometry.kind", &["velocity", "wheels", "increment"]),
    ("relative.kind", &["range_bearing", "pose", "position", "range", "bearing"]),
    ("relative.see", &["robots", "landmarks", "both"]),
];

/// In which line each key of a document stands, by its path (`robots[0].gps.sigma_m`).
#[derive(Debug, Default)]
pub(super) struct Lines(BTreeMap<String, usize>);

impl Lines {
    /// The line of `path`, or of the nearest table around it that is written out.
    pub(super) fn find(&self, path: &str) -> Option<usize> {
        let mut path = path;
        loop {
            if let Some(line) = self.0.get(path) {
                return Some(*line);
            }
            path = path.rsplit_once('.')?.0;
        }
    }

    /// The line of exactly `path`.
    pub(super) fn exact(&self, path: &str) -> Option<usize> {
        self.0.get(path).copied()
    }
}

/// A document that has every key once.
pub(super) fn template() -> Result<Table, toml::ser::Error> {
    let mut settings = RobotSettings { start: Some(Start::default()), ..RobotSettings::default() };
    settings.motion.area_m = Some([0.0; 4]);
    settings.kidnap = vec![Kidnap::default()];
    settings.motion.script = vec![[0.0; 3]];
    settings.motion.manoeuvres = vec![ManoeuvreKind::Standstill];
    settings.gps.windows_s = vec![[0.0; 2]];
    settings.declared = Declared::example();
    let mut defaults = Table::try_from(&settings)?;
    let within = ScopeSpec { region_m: Some([0.0; 4]), time_s: Some([0.0; 2]) };
    let effect = EffectSpec { within: Some(within), ..EffectSpec::default() };
    defaults.insert(EFFECTS.to_owned(), Value::Array(vec![Value::try_from(effect)?]));
    let mut robot = defaults.clone();
    robot.insert("id".to_owned(), Value::Integer(1));
    Table::try_from(Document::example(defaults, robot))
}

/// Checks that every key of `text` is known and every value of the right kind.
///
/// # Errors
/// [`Error::Syntax`], [`Error::UnknownKey`] and [`Error::Value`], with file and line.
pub(super) fn check(text: &str, file: &str) -> Result<Lines, Error> {
    let document = DeTable::parse(text).map_err(|error| Error::Syntax {
        place: place(file, error.span().map(|span| line_of(text, span.start))),
        message: format!("not TOML: {}", error.message()),
    })?;
    let known =
        template().map_err(|error| Error::Syntax { place: file.to_owned(), message: error.to_string() })?;
    let mut walk = Walk { text, file, lines: Lines::default() };
    walk.table(document.get_ref(), &known, "")?;
    Ok(walk.lines)
}

/// `file:line`, or the file alone.
pub(super) fn place(file: &str, line: Option<usize>) -> String {
    line.map_or_else(|| file.to_owned(), |line| format!("{file}:{line}"))
}

/// The line, from 1, of a byte offset; lines count their newlines.
fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

struct Walk<'a> {
    text: &'a str,
    file: &'a str,
    lines: Lines,
}

impl Walk<'_> {
    fn table(&mut self, found: &DeTable<'_>, known: &Table, path: &str) -> Result<(), Error> {
        for (key, value) in found {
            let name = key.get_ref();
            let path = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
            let line = line_of(self.text, key.span().start);
            let Some(expected) = known.get(name.as_ref()) else {
                let nearest = known.keys().min_by_key(|known| edit_distance(known, name));
                return Err(Error::UnknownKey {
                    place: place(self.file, Some(line)),
                    key: path,
                    nearest: nearest.cloned().unwrap_or_default(),
                });
            };
            self.lines.0.insert(path.clone(), line);
            self.value(value, expected, &path)?;
        }
        Ok(())
    }

    fn value(&mut self, found: &Spanned<DeValue<'_>>, expected: &Value, path: &str) -> Result<(), Error> {
        let wrong = |walk: &Self, expected: &str| Error::Value {
            place: place(walk.file, Some(line_of(walk.text, found.span().start))),
            key: path.to_owned(),
            found: walk.text.get(found.span()).unwrap_or_default().to_owned(),
            expected: expected.to_owned(),
        };
        match (expected, found.get_ref()) {
            // The parameters of an effect: its catalogue entry knows them.
            (Value::Table(known), DeValue::Table(_)) if known.is_empty() => Ok(()),
            (Value::Table(known), DeValue::Table(table)) => self.table(table, known, path),
            (Value::Array(known), DeValue::Array(items)) => {
                let Some(expected) = known.first() else { return Ok(()) };
                for (index, item) in items.iter().enumerate() {
                    let path = format!("{path}[{index}]");
                    self.lines.0.insert(path.clone(), line_of(self.text, item.span().start));
                    self.value(item, expected, &path)?;
                }
                Ok(())
            }
            (Value::String(_), DeValue::String(text)) => {
                match CHOICES.iter().find(|(key, _)| path.ends_with(key)) {
                    Some((_, words)) if !words.contains(&text.as_ref()) => {
                        Err(wrong(self, &format!("one of {}", words.join(", "))))
                    }
                    _ => Ok(()),
                }
            }
            (Value::Float(_), DeValue::Float(_) | DeValue::Integer(_))
            | (Value::Integer(_), DeValue::Integer(_))
            | (Value::Boolean(_), DeValue::Boolean(_)) => Ok(()),
            (Value::Table(_), _) => Err(wrong(self, "a table")),
            (Value::Array(_), _) => Err(wrong(self, "an array")),
            (Value::String(_) | Value::Datetime(_), _) => Err(wrong(self, "a text in quotes")),
            (Value::Float(_), _) => Err(wrong(self, "a number")),
            (Value::Integer(_), _) => Err(wrong(self, "a whole number")),
            (Value::Boolean(_), _) => Err(wrong(self, "true or false")),
        }
    }
}

/// Levenshtein's distance: how many letters to insert, delete or replace.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_of_the_textbook_pair_is_three() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }

    #[test]
    fn every_offered_word_is_accepted_by_the_settings() {
        for (key, words) in CHOICES {
            let (table, key) = key.split_once('.').unwrap();
            for word in words {
                let text = format!("[{table}]\n{key} = \"{word}\"\n");
                assert!(toml::from_str::<RobotSettings>(&text).is_ok(), "{text}");
            }
        }
    }

    /// Dotted paths of all known keys, arrays without index.
    fn paths(table: &Table, prefix: &str, out: &mut Vec<String>) {
        for (key, value) in table {
            let path = format!("{prefix}{key}");
            match value {
                Value::Table(inner) => paths(inner, &format!("{path}."), out),
                Value::Array(items) if items.first().is_some_and(Value::is_table) => {
                    paths(items[0].as_table().unwrap(), &format!("{path}."), out);
                }
                _ => out.push(path),
            }
        }
    }

    #[test]
    fn every_key_is_documented_with_the_default_of_the_settings() {
        let guide = include_str!("../../../docs/scenario.md");
        let mut known = Vec::new();
        paths(&template().unwrap(), "", &mut known);
        assert!(known.len() > 90, "defaults and robots both carry the robot settings: {}", known.len());
        for path in known {
            // The guide lists robot settings once, for `[defaults]` and `[[robots]]` alike.
            let path = path.trim_start_matches("defaults.").replace("robots.", "");
            let row = guide.lines().find(|line| line.starts_with(&format!("| `{path}` |")));
            let row = row.unwrap_or_else(|| panic!("docs/scenario.md has no row for `{path}`"));
            let default = row.split('|').nth(3).unwrap().trim().trim_matches('`').to_owned();
            let settings = Table::try_from(RobotSettings::default()).unwrap();
            let mut value = Some(&Value::Table(settings.clone()));
            for part in path.split('.') {
                value = value.and_then(|value| value.get(part));
            }
            if let Some(value) = value {
                let written = match value {
                    Value::String(text) => text.clone(),
                    other => other.to_string(),
                };
                let same_number = default
                    .parse::<f64>()
                    .ok()
                    .zip(written.parse::<f64>().ok())
                    .is_some_and(|(a, b)| (a - b).abs() < 1e-12);
                let pi = default == "pi" && value.as_float() == Some(std::f64::consts::PI);
                assert!(same_number || pi || default == written, "{path}: guide {default}, code {written}");
            }
        }
    }
}

//! Faults as they are written: `[[fault]]` tables in a scenario or in a file of their own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pleiad_protocol::{Message, RobotId};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::plan::{Again, Fault, FaultPlan, Rule};

/// Why faults could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FaultsError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{place}: not TOML: {message}")]
    Syntax {
        /// `file:line`.
        place: String,
        /// What the reader said.
        message: String,
    },
    /// A key that this fault does not have.
    #[error("{place}: unknown key `{key}`; this fault has {known} (all faults: docs/faults.md)")]
    UnknownKey {
        /// `file:line`.
        place: String,
        /// The key, with the tables it is in.
        key: String,
        /// The keys it may have.
        known: String,
    },
    /// A value that makes no sense.
    #[error("{place}: `{key}` is {found}; expected {expected}")]
    Value {
        /// `file:line`.
        place: String,
        /// The key, with the tables it is in.
        key: String,
        /// The value found.
        found: String,
        /// What would be accepted.
        expected: String,
    },
}

/// Keys that every fault of messages may have, every one of processes, and the death of the coordinator.
const LINKS: [&str; 8] = ["what", "from", "to", "messages", "start_s", "end_s", "for_s", "every_s"];
const PROCESSES: [&str; 5] = ["what", "start_s", "end_s", "for_s", "every_s"];
const COORDINATOR: [&str; 2] = ["what", "start_s"];
/// The faults, the keys they share with others, and their own.
const FAULTS: [(&str, &[&str], &[&str]); 15] = [
    ("loss", &LINKS, &["loss"]),
    ("burst", &LINKS, &["loss", "mean_length"]),
    ("delay", &LINKS, &["delay_s", "jitter_s"]),
    ("reorder", &LINKS, &["probability", "by_s"]),
    ("duplicate", &LINKS, &["probability", "within_s"]),
    ("corrupt", &LINKS, &["probability", "bytes"]),
    ("cut", &LINKS, &[]),
    ("partition", &LINKS, &["groups"]),
    ("away", &LINKS, &["robots"]),
    ("slow", &LINKS, &["messages_per_s", "queue"]),
    ("clock", &LINKS, &["offset_s", "drift_ppm"]),
    ("kill", &PROCESSES, &["robots"]),
    ("stop", &PROCESSES, &["robots"]),
    ("disk_full", &PROCESSES, &["robots"]),
    ("coordinator_dies", &COORDINATOR, &[]),
];

impl FaultPlan {
    /// Reads the `[[fault]]` tables of a file; other tables are left to others.
    ///
    /// # Errors
    /// [`FaultsError`], naming file, line, key, what was found and what was expected.
    pub fn load(path: &Path) -> Result<Self, FaultsError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| FaultsError::Read { file: path.to_owned(), source })?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Reads the `[[fault]]` tables of a text; `file` is the name that errors give it.
    ///
    /// # Errors
    /// As [`FaultPlan::load`].
    pub fn from_toml(text: &str, file: &str) -> Result<Self, FaultsError> {
        let source = Source { text, file };
        let document = DeTable::parse(text).map_err(|error| FaultsError::Syntax {
            place: source.place(error.span().map_or(0, |span| span.start)),
            message: error.message().to_owned(),
        })?;
        let mut rules = Vec::new();
        if let Some((_, tables)) = document.get_ref().iter().find(|(key, _)| key.get_ref() == "fault") {
            let DeValue::Array(tables) = tables.get_ref() else {
                return Err(source.wrong("fault", tables, "tables, each begun by [[fault]]"));
            };
            for (index, table) in tables.iter().enumerate() {
                let path = format!("fault[{index}]");
                let DeValue::Table(entries) = table.get_ref() else {
                    return Err(source.wrong(&path, table, "a table, begun by [[fault]]"));
                };
                rules.push(Entry { source: &source, path, table, entries }.rule()?);
            }
        }
        Ok(Self { rules })
    }
}

struct Source<'a> {
    text: &'a str,
    file: &'a str,
}

impl Source<'_> {
    fn place(&self, offset: usize) -> String {
        let line = 1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count();
        format!("{}:{line}", self.file)
    }

    fn wrong(&self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str) -> FaultsError {
        FaultsError::Value {
            place: self.place(value.span().start),
            key: key.to_owned(),
            found: self.text.get(value.span()).unwrap_or_default().to_owned(),
            expected: expected.to_owned(),
        }
    }
}

/// One `[[fault]]`.
struct Entry<'a, 'b> {
    source: &'a Source<'a>,
    path: String,
    table: &'a Spanned<DeValue<'b>>,
    entries: &'a DeTable<'b>,
}

type Value<'a, 'b> = &'a Spanned<DeValue<'b>>;

impl<'a, 'b> Entry<'a, 'b> {
    fn key(&self, key: &str) -> String {
        format!("{}.{key}", self.path)
    }

    fn get(&self, key: &str) -> Option<Value<'a, 'b>> {
        self.entries.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }

    fn missing(&self, key: &str, expected: &str) -> FaultsError {
        FaultsError::Value {
            place: self.source.place(self.table.span().start),
            key: self.key(key),
            found: "missing".to_owned(),
            expected: expected.to_owned(),
        }
    }

    fn rule(&self) -> Result<Rule, FaultsError> {
        let words: Vec<&str> = FAULTS.iter().map(|(word, ..)| *word).collect();
        let expected = format!("one of {}", words.join(", "));
        let Some(what) = self.get("what") else { return Err(self.missing("what", &expected)) };
        let word = what.get_ref().as_str();
        let Some((word, common, own)) = FAULTS.iter().find(|(known, ..)| Some(*known) == word) else {
            return Err(self.source.wrong(&self.key("what"), what, &expected));
        };
        for (key, _) in self.entries {
            let name: &str = key.get_ref();
            if !common.contains(&name) && !own.contains(&name) {
                let known: Vec<&str> = common.iter().chain(own.iter()).copied().collect();
                return Err(FaultsError::UnknownKey {
                    place: self.source.place(key.span().start),
                    key: self.key(name),
                    known: known.join(", "),
                });
            }
        }
        let again = self.again()?;
        let start_s = self.number("start_s", Some(0.0))?;
        let mut end_s = self.number("end_s", Some(f64::INFINITY))?;
        if again.is_none()
            && let Some(length) = self.get("for_s")
        {
            if self.get("end_s").is_some() {
                let expected = "either for_s or end_s, unless every_s is given too";
                return Err(self.source.wrong(&self.key("for_s"), length, expected));
            }
            end_s = start_s + self.number("for_s", None)?;
            if end_s.is_nan() || end_s <= start_s {
                return Err(self.source.wrong(&self.key("for_s"), length, "a positive number of seconds"));
            }
        }
        let rule = Rule {
            fault: self.fault(word)?,
            from: self.robots("from")?.unwrap_or_default(),
            to: self.robots("to")?.unwrap_or_default(),
            messages: self.messages()?,
            start_s,
            end_s,
            again,
        };
        rule.check().map_err(|wrong| {
            let value = self.get(wrong.key).unwrap_or(self.table);
            FaultsError::Value {
                place: self.source.place(value.span().start),
                key: self.key(wrong.key),
                found: wrong.found,
                expected: wrong.expected.to_owned(),
            }
        })?;
        Ok(rule)
    }

    fn again(&self) -> Result<Option<Again>, FaultsError> {
        if self.get("every_s").is_none() {
            return Ok(None);
        }
        let every_s = self.number("every_s", None)?;
        let for_s = match self.get("for_s") {
            Some(_) => self.number("for_s", None)?,
            None => return Err(self.missing("for_s", "how long it lasts each time, in seconds")),
        };
        Ok(Some(Again { every_s, for_s }))
    }

    fn fault(&self, word: &str) -> Result<Fault, FaultsError> {
        Ok(match word {
            "loss" => Fault::Loss { loss: self.number("loss", None)? },
            "burst" => Fault::Burst {
                loss: self.number("loss", None)?,
                mean_length: self.number("mean_length", None)?,
            },
            "delay" => Fault::Delay {
                delay_s: self.number("delay_s", None)?,
                jitter_s: self.number("jitter_s", Some(0.0))?,
            },
            "reorder" => Fault::Reorder {
                probability: self.number("probability", None)?,
                by_s: self.number("by_s", Some(0.1))?,
            },
            "duplicate" => Fault::Duplicate {
                probability: self.number("probability", None)?,
                within_s: self.number("within_s", Some(0.1))?,
            },
            "corrupt" => Fault::Corrupt {
                probability: self.number("probability", None)?,
                bytes: u8::try_from(self.whole("bytes", 1)?).unwrap_or(0),
            },
            "partition" => Fault::Partition { groups: self.groups()? },
            "away" => Fault::Away { robots: self.whom()? },
            "kill" => Fault::Kill { robots: self.whom()? },
            "stop" => Fault::Stop { robots: self.whom()? },
            "disk_full" => Fault::DiskFull { robots: self.whom()? },
            "coordinator_dies" => Fault::CoordinatorDies,
            "slow" => Fault::Slow {
                messages_per_s: self.number("messages_per_s", None)?,
                queue: self.whole("queue", 64)?,
            },
            "clock" => Fault::Clock {
                offset_s: self.number("offset_s", Some(0.0))?,
                drift_ppm: self.number("drift_ppm", Some(0.0))?,
            },
            _ => Fault::Cut,
        })
    }

    fn number(&self, key: &str, default: Option<f64>) -> Result<f64, FaultsError> {
        let Some(value) = self.get(key) else {
            return default.ok_or_else(|| self.missing(key, "a number"));
        };
        match value.get_ref() {
            DeValue::Float(_) | DeValue::Integer(_) => {
                let text = self.source.text.get(value.span()).unwrap_or_default().replace('_', "");
                text.parse().map_err(|_| self.source.wrong(&self.key(key), value, "a decimal number"))
            }
            _ => Err(self.source.wrong(&self.key(key), value, "a number")),
        }
    }

    fn whole(&self, key: &str, default: u32) -> Result<u32, FaultsError> {
        let Some(value) = self.get(key) else { return Ok(default) };
        self.as_whole(key, value)
    }

    fn as_whole(&self, key: &str, value: Value<'_, '_>) -> Result<u32, FaultsError> {
        let text = self.source.text.get(value.span()).unwrap_or_default();
        match value.get_ref() {
            DeValue::Integer(_) => text.parse().ok(),
            _ => None,
        }
        .ok_or_else(|| self.source.wrong(&self.key(key), value, "a whole number from 0"))
    }

    fn list(&self, key: &str, value: Value<'_, '_>) -> Result<BTreeSet<RobotId>, FaultsError> {
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.source.wrong(&self.key(key), value, "robots, as in [1, 2]"));
        };
        items.iter().map(|item| self.as_whole(key, item).map(RobotId)).collect()
    }

    fn robots(&self, key: &str) -> Result<Option<BTreeSet<RobotId>>, FaultsError> {
        self.get(key).map(|value| self.list(key, value)).transpose()
    }

    /// Whom it befalls: at random times one of all, unless some are named.
    fn whom(&self) -> Result<BTreeSet<RobotId>, FaultsError> {
        match self.robots("robots")? {
            None if self.get("every_s").is_none() => {
                Err(self.missing("robots", "robots, as in [1, 2], or every_s: one of all now and then"))
            }
            robots => Ok(robots.unwrap_or_default()),
        }
    }

    fn groups(&self) -> Result<Vec<BTreeSet<RobotId>>, FaultsError> {
        let expected = "groups of robots, as in [[1, 2], [3]]";
        let Some(value) = self.get("groups") else {
            // At random times the groups are random too.
            let again = self.get("every_s").map(|_| Vec::new());
            return again.ok_or_else(|| self.missing("groups", expected));
        };
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.source.wrong(&self.key("groups"), value, expected));
        };
        items.iter().map(|item| self.list("groups", item)).collect()
    }

    fn messages(&self) -> Result<BTreeSet<&'static str>, FaultsError> {
        let Some(value) = self.get("messages") else { return Ok(BTreeSet::new()) };
        let expected = format!("kinds of messages: {}", Message::KINDS.join(", "));
        let DeValue::Array(items) = value.get_ref() else {
            return Err(self.source.wrong(&self.key("messages"), value, &expected));
        };
        let kind = |item: &Spanned<DeValue<'_>>| {
            let known = Message::KINDS.into_iter().find(|kind| item.get_ref().as_str() == Some(kind));
            known.ok_or_else(|| self.source.wrong(&self.key("messages"), item, &expected))
        };
        items.iter().map(kind).collect()
    }
}

#[cfg(test)]
mod tests;

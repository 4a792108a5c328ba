//! What a study gives: claims with what was measured, tables, figures, and the numbers for scripts.

use pleiad_report::{Figure, Table};
use serde::Serialize;

use crate::error::SurveyError;

/// How a study is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StudyOptions {
    /// Number of seeds; `None`: as many as the study needs for its intervals.
    pub seeds: Option<usize>,
    /// The first of them.
    pub first_seed: u64,
}

/// A statement that a run could have proved wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// The statement, in words.
    pub statement: String,
    /// What was measured, with its 95 % interval where it is statistical.
    pub measured: String,
    /// Whether the measurement, its interval included, bears it out.
    pub holds: bool,
}

/// A part of the page, in the order in which it is read.
#[derive(Clone, Debug)]
pub enum Shown {
    /// A paragraph.
    Prose(String),
    /// A table.
    Table(Table),
    /// A figure with its caption.
    Figure(Figure, String),
}

/// The outcome of a study.
#[derive(Clone, Debug)]
pub struct Study {
    /// Name on the command line: `rover`.
    pub name: &'static str,
    /// Title of the page.
    pub title: String,
    /// What it is about, in two or three sentences, with the source.
    pub lead: String,
    /// The claims.
    pub claims: Vec<Claim>,
    /// Tables and figures.
    pub shown: Vec<Shown>,
    /// All numbers, by names that carry their units: the `--json` of the command.
    pub numbers: serde_json::Map<String, serde_json::Value>,
}

impl Study {
    /// Whether every claim holds.
    pub fn holds(&self) -> bool {
        self.claims.iter().all(|claim| claim.holds)
    }
}

/// A study that can be asked for by name.
pub struct Known {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows, in one line.
    pub about: &'static str,
    /// Runs it.
    pub run: fn(&StudyOptions) -> Result<Study, SurveyError>,
}

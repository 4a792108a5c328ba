//! How a study's page is filled.

use pleiad_report::{Figure, Table};
use serde_json::{Map, Value};

use crate::study::{Claim, Shown, Study};

/// A study without content.
pub(crate) fn blank(name: &'static str, title: &str, lead: &str) -> Study {
    Study {
        name,
        title: title.to_owned(),
        lead: lead.to_owned(),
        claims: Vec::new(),
        shown: Vec::new(),
        numbers: Map::new(),
    }
}

pub(crate) fn claim(page: &mut Study, statement: &str, measured: String, holds: bool) {
    page.claims.push(Claim { statement: statement.to_owned(), measured, holds });
}

pub(crate) fn number(page: &mut Study, name: &str, value: impl Into<Value>) {
    page.numbers.insert(name.to_owned(), value.into());
}

pub(crate) fn prose(page: &mut Study, text: &str) {
    page.shown.push(Shown::Prose(text.to_owned()));
}

pub(crate) fn table(page: &mut Study, table: Table) {
    page.shown.push(Shown::Table(table));
}

pub(crate) fn figure(page: &mut Study, figure: Figure, caption: &str) {
    page.shown.push(Shown::Figure(figure, caption.to_owned()));
}

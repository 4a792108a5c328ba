//! The page of results: `docs/benchmarks/concealed.md`.

use std::fmt::Write as _;

use crate::class::{Class, Noise};
use crate::summary::{Mean, Row, Share, Summary};

/// What stands before the tables, with the physics engine first.
const HEAD: &str = include_str!("page/head.md");
/// What stands after them.
const TAIL: &str = include_str!("page/tail.md");
/// So many losses are listed; the rest is in the results.
const LISTED: usize = 200;

/// Writes the page; `command` is how it was made.
pub fn page(summary: &Summary, command: &str) -> String {
    let mut text = String::from(HEAD);
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "\n    {command}\n\n{} recordings. SHA-256 of the answers, written before the first diagnosis: `{}`.\n",
        summary.recordings, summary.answers_sha256
    );
    for class in Class::ALL {
        section(&mut text, class, &summary.rows);
    }
    let _ = write!(text, "\n## Curves\n\nAs data in `summary.json`.\n");
    for curve in summary.curves.iter().filter(|own| own.name.starts_with("named")) {
        let _ = write!(text, "\n{}:", curve.name);
        for point in &curve.points {
            let _ = write!(text, " {} {};", point.at, share(&point.y));
        }
        text.push('\n');
    }
    let _ = write!(text, "\n## Losses\n\n");
    if summary.losses.is_empty() {
        text += "None.\n";
    }
    for loss in summary.losses.iter().take(LISTED) {
        let _ = writeln!(text, "- {loss}");
    }
    if summary.losses.len() > LISTED {
        let _ = writeln!(text, "- and {} more in `results.jsonl`", summary.losses.len() - LISTED);
    }
    text + "\n" + TAIL
}

/// The tables of a class: a row per quantity, a column per noise and size.
fn section(text: &mut String, class: Class, rows: &[Row]) {
    let own: Vec<&Row> = rows.iter().filter(|row| row.class == class).collect();
    if own.is_empty() {
        return;
    }
    let _ = write!(text, "\n## {class}\n");
    let mut groups: Vec<(Noise, Option<f64>)> = Vec::new();
    let mut lines: Vec<(&str, &str)> = Vec::new();
    for row in &own {
        if !groups.contains(&(row.noise, row.size)) {
            groups.push((row.noise, row.size));
        }
        if !lines.contains(&(row.method.as_str(), row.quantity)) {
            lines.push((row.method.as_str(), row.quantity));
        }
    }
    text.push_str("\n| who | quantity |");
    for (noise, size) in &groups {
        let size = size.map_or_else(String::new, |size| format!(", x{size}"));
        let _ = write!(text, " {noise}{size} |");
    }
    text.push_str("\n|---|---|");
    text.push_str(&"---|".repeat(groups.len()));
    text.push('\n');
    for (method, quantity) in lines {
        let _ = write!(text, "| {method} | {quantity} |");
        for (noise, size) in &groups {
            let row = own.iter().find(|row| {
                (row.method.as_str(), row.quantity) == (method, quantity)
                    && (row.noise, row.size) == (*noise, *size)
            });
            let cell = row.map_or_else(String::new, |row| cell(row));
            let _ = write!(text, " {cell} |");
        }
        text.push('\n');
    }
}

fn cell(row: &Row) -> String {
    match (&row.share, &row.mean) {
        (Some(own), _) => share(own),
        (None, Some(own)) => mean(own),
        (None, None) => String::new(),
    }
}

fn share(own: &Share) -> String {
    let [low, high] = own.interval.map(|end| 100.0 * end);
    format!("{} of {} ({low:.0} to {high:.0} %)", own.count, own.of)
}

fn mean(own: &Mean) -> String {
    let error = own.standard_error.map_or_else(String::new, |error| format!(" +- {error:.2}"));
    format!("{:.2}{error}, median {:.3} of {}", own.mean, own.median, own.of)
}

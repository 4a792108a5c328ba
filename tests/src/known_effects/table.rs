//! The tables of `docs/benchmarks/effects.md`.

use std::fmt::Write;

use super::outcome::{Outcome, Row, mean};

/// The table, effect by effect and parameter by parameter, and below it what all intervals together cover.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "| # | effect | parameter [unit] | injected | sigma | sigma/size | bias/sigma | mean z^2 | covered | found |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for outcome in outcomes {
        text += &rows(outcome);
    }
    let covered: usize = outcomes.iter().flat_map(|outcome| &outcome.rows).map(|row| row.covered).sum();
    let all: usize = outcomes.iter().flat_map(|outcome| &outcome.rows).map(|row| row.errors.len()).sum();
    let share = 100.0 * covered as f64 / all as f64;
    let squares = mean(outcomes.iter().flat_map(Outcome::z_squares));
    let _ = writeln!(
        text,
        "\nOf {all} intervals of 95 %, {covered} hold the injected value ({share:.1} %); mean z^2 of all \
         {squares:.2}."
    );
    text
}

/// The rows of one effect.
pub fn rows(outcome: &Outcome) -> String {
    let mut text = String::new();
    let info = outcome.effect.info();
    for (index, row) in outcome.rows.iter().enumerate() {
        let (number, name) =
            if index == 0 { (info.number.to_string(), format!("`{}`", info.name)) } else { <_>::default() };
        let found = format!("{}/{}", outcome.found, outcome.seeds);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {number} | {name} | {} | {found} |", cells(row));
    }
    text
}

fn cells(row: &Row) -> String {
    let name = format!("{} [{}]", row.label, row.unit);
    if let Some(right) = row.right {
        return format!("{name} | {} | label | | | | {right} right", row.truth);
    }
    let count = row.errors.len();
    if count == 0 {
        return format!("{name} | {} | value only | | | |", row.truth);
    }
    let (sigma, bias) = (row.sigma(), row.bias());
    let kind = if row.profile { " (profile)" } else { "" };
    let squares = mean(row.z_squares().into_iter());
    format!(
        "{name} | {} | {sigma:.2e}{kind} | {:.3} | {:.2} | {squares:.2} | {}/{count}",
        row.truth,
        sigma / row.size,
        bias / sigma,
        row.covered
    )
}

//! The tables of `docs/benchmarks/effects.md`.

use std::fmt::Write;

use super::exceptions::{EXCEPTIONS, UNKNOWN};
use super::outcome::{Outcome, Row, mean};
use super::wishes::{COVERED, Shortfall, Wish, covered, shortfalls};

/// The table, effect by effect and parameter by parameter; below it what all intervals together cover, how many
/// rows meet each wish, and which do not and why.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "| # | effect | parameter [unit] | injected | sigma | sigma/size | bias/sigma | mean z^2 | covered | found |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for outcome in outcomes {
        text += &rows(outcome);
    }
    let rows = || outcomes.iter().flat_map(|outcome| &outcome.rows);
    let inside: usize = rows().map(|row| row.covered).sum();
    let all: usize = rows().map(|row| row.errors.len()).sum();
    let share = 100.0 * covered(outcomes);
    let mut squares: Vec<f64> = outcomes.iter().flat_map(Outcome::z_squares).collect();
    squares.sort_by(f64::total_cmp);
    let median = squares.get(squares.len() / 2).copied().unwrap_or(f64::NAN);
    let _ = writeln!(
        text,
        "\nOf {all} intervals of 95 %, {inside} hold the injected value ({share:.1} %). The median of all z^2 is \
         {median:.2}; of a normal distribution it is 0.45."
    );
    let met = (COVERED[0]..=COVERED[1]).contains(&covered(outcomes));
    let _ = writeln!(text, "\nThe wish of 92 to 98 % is {}.", if met { "met" } else { "not met" });
    text + &wishes(outcomes)
}

/// How many rows meet each wish, and those that do not, by cause.
fn wishes(outcomes: &[Outcome]) -> String {
    let short = shortfalls(outcomes);
    let sized = outcomes.iter().flat_map(|outcome| &outcome.rows).filter(|row| row.right.is_none()).count();
    let met = |wishes: &[Wish]| sized - short.iter().filter(|own| wishes.contains(&own.wish)).count();
    let mut text = String::new();
    let _ = writeln!(
        text,
        "\nOf {sized} parameters with a size, {} have an interval in every seed, {} a sigma of at most a fifth of the \
         size, {} a mean z^2 of 0.5 to 1.7 ({} are above, {} below). Those that do not, and why:\n",
        met(&[Wish::Found]),
        met(&[Wish::Small]),
        met(&[Wish::NotTooSure, Wish::NotTooUnsure]),
        sized - met(&[Wish::NotTooSure]),
        sized - met(&[Wish::NotTooUnsure]),
    );
    let mut causes: Vec<&str> = Vec::new();
    for cause in EXCEPTIONS.iter().map(|own| own.why).chain([UNKNOWN]) {
        if !causes.contains(&cause) {
            causes.push(cause);
        }
    }
    for cause in causes {
        let own: Vec<String> = short
            .iter()
            .filter(|own| why(own) == cause)
            .map(|own| format!("`{}` {}", own.effect, own.label))
            .collect();
        if !own.is_empty() {
            let _ = writeln!(text, "- {cause}: {}.", own.join(", "));
        }
    }
    text
}

fn why(short: &Shortfall) -> &'static str {
    EXCEPTIONS.iter().find(|own| own.is(short)).map_or(UNKNOWN, |own| own.why)
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

//! Writes the table of `docs/benchmarks/effects.md`:
//! `cargo run -p pleiad-tests --example effects -- [--seeds N] [--out PAGE] [EFFECT...]`.

use std::io::Write as _;
use std::process::ExitCode;

use pleiad_physics::Effect;
use pleiad_tests::known_effects::{Case, SEEDS, cases, cases_of, rows, run, table};

/// What the table stands between.
const MARKS: [&str; 2] = ["<!-- table -->", "<!-- end -->"];

fn main() -> ExitCode {
    match written(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            let _ = writeln!(std::io::stderr(), "effects: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Puts the table between the marks of a page.
fn replace(file: &str, table: &str) -> Result<(), String> {
    let page = std::fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
    let [begin, end] = MARKS;
    let (before, rest) = page.split_once(begin).ok_or_else(|| format!("{file}: no line {begin}"))?;
    let (_, after) = rest.split_once(end).ok_or_else(|| format!("{file}: no line {end}"))?;
    let page = format!("{before}{begin}\n\n{table}\n{end}{after}");
    std::fs::write(file, page).map_err(|error| format!("{file}: {error}"))
}

fn written(mut arguments: impl Iterator<Item = String>) -> Result<(), String> {
    let mut seeds: Vec<u64> = SEEDS.collect();
    let mut out = None;
    let mut chosen: Vec<Case> = Vec::new();
    while let Some(argument) = arguments.next() {
        let mut value = |what: &str| arguments.next().ok_or_else(|| format!("{argument} needs {what}"));
        match argument.as_str() {
            "--seeds" => {
                let count = value("a number")?;
                let count: u64 = count.parse().map_err(|_| format!("--seeds {count}: expected a number"))?;
                seeds = (1..=count).collect();
            }
            "--out" => out = Some(value("a page")?),
            name => {
                let effect = Effect::from_name(name)
                    .ok_or_else(|| format!("no effect `{name}`; see pleiad effects"))?;
                chosen.extend(cases_of(effect));
            }
        }
    }
    if chosen.is_empty() {
        chosen = cases();
    }
    let begun = std::time::Instant::now();
    let mut progress = std::io::stderr();
    let outcomes = run(&chosen, &seeds, |outcome| {
        let passed_s = begun.elapsed().as_secs_f64();
        let _ = write!(progress, "{passed_s:.0} s\n{}", rows(outcome));
    });
    let text = table(&outcomes);
    match out {
        Some(file) => replace(&file, &text),
        None => write!(std::io::stdout(), "{text}").map_err(|error| error.to_string()),
    }
}

//! Writes the table of `docs/benchmarks/naming.md`:
//! `cargo run -p pleiad-tests --example naming -- [--seeds N] [--out PAGE] [EFFECT...]`.

use std::io::{self, Write as _};
use std::process::ExitCode;
use std::time::Instant;

use pleiad_tests::known_effects::{Case, cases, cases_named};
use pleiad_tests::naming::{Told, row, table, tell};
use pleiad_tests::page::replace;

fn main() -> ExitCode {
    match written(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            let _ = writeln!(io::stderr(), "naming: {message}");
            ExitCode::FAILURE
        }
    }
}

fn written(mut arguments: impl Iterator<Item = String>) -> Result<(), String> {
    let mut seeds = 1;
    let mut out = None;
    let mut chosen: Vec<Case> = Vec::new();
    while let Some(argument) = arguments.next() {
        let mut value = |what: &str| arguments.next().ok_or_else(|| format!("{argument} needs {what}"));
        match argument.as_str() {
            "--seeds" => {
                let count = value("a number")?;
                seeds = count.parse().map_err(|_| format!("--seeds {count}: expected a number"))?;
            }
            "--out" => out = Some(value("a page")?),
            name => chosen.extend(cases_named(name)?),
        }
    }
    if chosen.is_empty() {
        chosen = cases();
    }
    let mut all: Vec<(&Case, Vec<Told>)> = chosen.iter().map(|case| (case, Vec::new())).collect();
    for seed in 1..=seeds {
        for (case, told) in &mut all {
            let begun = Instant::now();
            let own = tell(case, seed);
            let took_s = begun.elapsed().as_secs_f64();
            let _ =
                write!(io::stderr(), "seed {seed} {took_s:.0} s {}", row(case, std::slice::from_ref(&own)));
            told.push(own);
        }
    }
    let text = table(&all);
    match out {
        Some(file) => replace(&file, &text),
        None => write!(io::stdout(), "{text}").map_err(|error| error.to_string()),
    }
}

//! Writes the table of `docs/benchmarks/effects.md`:
//! `cargo run -p pleiad-tests --example effects -- [--first-seed N] [--seeds N] [--out PAGE] [--keep FOLDER] [EFFECT...]`.
//!
//! With a folder, every case that is done is kept there, and one that was kept is not run again.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use pleiad_tests::known_effects::{Case, Outcome, SEEDS, cases, cases_named, rows, run, table};
use pleiad_tests::page::replace;

fn main() -> ExitCode {
    match written(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            let _ = writeln!(std::io::stderr(), "effects: {message}");
            ExitCode::FAILURE
        }
    }
}

fn written(mut arguments: impl Iterator<Item = String>) -> Result<(), String> {
    let mut first = *SEEDS.start();
    let mut count = SEEDS.count() as u64;
    let mut out = None;
    let mut keep = None;
    let mut chosen: Vec<Case> = Vec::new();
    while let Some(argument) = arguments.next() {
        let mut value = |what: &str| arguments.next().ok_or_else(|| format!("{argument} needs {what}"));
        match argument.as_str() {
            "--first-seed" | "--seeds" => {
                let given = value("a number")?;
                let number: u64 =
                    given.parse().map_err(|_| format!("{argument} {given}: expected a number"))?;
                *if argument == "--seeds" { &mut count } else { &mut first } = number;
            }
            "--out" => out = Some(value("a page")?),
            "--keep" => keep = Some(PathBuf::from(value("a folder")?)),
            name => chosen.extend(cases_named(name)?),
        }
    }
    if chosen.is_empty() {
        chosen = cases();
    }
    let seeds: Vec<u64> = (first..first + count).collect();
    let begun = std::time::Instant::now();
    let mut progress = std::io::stderr();
    let mut outcomes = Vec::new();
    for case in &chosen {
        let outcome = kept_or_run(case, &seeds, keep.as_deref())?;
        let passed_s = begun.elapsed().as_secs_f64();
        let _ = write!(progress, "{passed_s:.0} s\n{}", rows(&outcome));
        outcomes.push(outcome);
    }
    let text = table(&outcomes);
    match out {
        Some(file) => replace(&file, &text),
        None => write!(std::io::stdout(), "{text}").map_err(|error| error.to_string()),
    }
}

/// The outcome of a case: from the folder if it is there, and else put there.
fn kept_or_run(case: &Case, seeds: &[u64], folder: Option<&Path>) -> Result<Outcome, String> {
    let Some(folder) = folder else { return Ok(run(case, seeds)) };
    let values: Vec<String> = case.values.iter().map(f64::to_string).collect();
    let first = seeds.first().copied().unwrap_or(0);
    let name = format!("{}_{}_{first}_{}.json", case.effect.name(), values.join("_"), seeds.len());
    let file = folder.join(name);
    let place = file.display();
    if file.exists() {
        let text = std::fs::read_to_string(&file).map_err(|error| format!("{place}: {error}"))?;
        let kept = serde_json::from_str(&text).map_err(|error| format!("{place}: {error}"))?;
        return Outcome::from_json(&kept).ok_or_else(|| format!("{place}: no outcome; remove it"));
    }
    let outcome = run(case, seeds);
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    std::fs::write(&file, outcome.to_json().to_string()).map_err(|error| format!("{place}: {error}"))?;
    Ok(outcome)
}

//! Writes the tables of `docs/benchmarks/clean.md`:
//! `cargo run -p pleiad-tests --example clean -- [--others] [--seeds FROM..TO] [--out PAGE]`.

use std::io::{self, Write as _};
use std::process::ExitCode;

use pleiad_tests::clean::{Group, HUNDRED, OTHERS, Said, table};
use pleiad_tests::page::replace;

fn main() -> ExitCode {
    match written(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            let _ = writeln!(io::stderr(), "clean: {message}");
            ExitCode::FAILURE
        }
    }
}

fn written(mut arguments: impl Iterator<Item = String>) -> Result<(), String> {
    let mut groups: &[Group] = &HUNDRED;
    let mut seeds = 0..u64::MAX;
    let mut out = None;
    while let Some(argument) = arguments.next() {
        let mut value = |what: &str| arguments.next().ok_or_else(|| format!("{argument} needs {what}"));
        match argument.as_str() {
            "--others" => groups = &OTHERS,
            "--seeds" => seeds = range(&value("a range of seeds, as 1..20")?)?,
            "--out" => out = Some(value("a page")?),
            _ => return Err(format!("{argument}: expected --others, --seeds or --out")),
        }
    }
    let mut all: Vec<(&Group, Vec<Said>)> = Vec::new();
    for group in groups {
        let own: Vec<u64> = group.seeds.clone().filter(|seed| seeds.contains(seed)).collect();
        let said = own.into_iter().map(|seed| {
            let said = group.said(seed);
            let _ =
                writeln!(io::stderr(), "{} seed {seed} {:.1} s {:?}", group.name, said.took_s, said.findings);
            said
        });
        all.push((group, said.collect()));
    }
    all.retain(|(_, said)| !said.is_empty());
    let text = table(&all);
    match out {
        Some(file) => replace(&file, &text),
        None => write!(io::stdout(), "{text}").map_err(|error| error.to_string()),
    }
}

/// `FROM..TO`, both included.
fn range(text: &str) -> Result<std::ops::Range<u64>, String> {
    let wrong = || format!("--seeds {text}: expected two numbers, as 1..20");
    let (from, to) = text.split_once("..").ok_or_else(wrong)?;
    let [from, to] = [from, to].map(|end| end.parse::<u64>().map_err(|_| wrong()));
    Ok(from?..to? + 1)
}

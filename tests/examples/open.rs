//! Tells what is found where an entry of the catalogue is left out:
//! `cargo run -p pleiad-tests --example open -- EFFECT SEED...`, or `clean SEED...`.

use std::io::{self, Write as _};
use std::time::Instant;

use pleiad_mismatch::{DiagnoseOptions, diagnose};
use pleiad_sim_peers::simulate;
use pleiad_tests::clean::{HUNDRED, told};
use pleiad_tests::known_effects::cases_named;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut name = arguments.next().unwrap_or_default();
    let known = name == "with";
    if known {
        name = arguments.next().unwrap_or_default();
    }
    let seeds: Vec<u64> = arguments.filter_map(|own| own.parse().ok()).collect();
    for seed in seeds {
        let mut runs = Vec::new();
        if name == "clean" {
            let group = HUNDRED.iter().find(|own| own.seeds.contains(&seed)).unwrap_or(&HUNDRED[0]);
            runs.push((group.scenario(), vec![], Vec::new()));
        } else {
            for case in cases_named(&name).unwrap_or_default() {
                let without = if known { Vec::new() } else { vec![case.effect] };
                runs.push((case.scenario, without, case.values));
            }
        }
        for (scenario, without, values) in runs {
            let Ok(run) = simulate(&scenario, seed) else { continue };
            let begun = Instant::now();
            let options = DiagnoseOptions { leave_out: without, ..DiagnoseOptions::default() };
            let Ok(found) = diagnose(&[run.recording], &options) else { continue };
            let mut out = io::stdout();
            let _ = writeln!(
                out,
                "## {name} {values:?} seed {seed}: {:?} in {:.1} s",
                found.findings.verdict,
                begun.elapsed().as_secs_f64()
            );
            for own in &found.findings.findings {
                let _ = writeln!(out, "  - {} {:?}", told(own), own.expression);
                for (label, value) in &own.parameters {
                    let _ = writeln!(
                        out,
                        "      {label} = {:.5} [{:.5}, {:.5}] {}",
                        value.value, value.ci95[0], value.ci95[1], value.unit
                    );
                }
                if let Some(shape) = &own.shape {
                    let _ = writeln!(out, "      {shape:?}");
                }
            }
            for note in
                found.findings.notes.iter().filter(|note| note.contains("finding") || note.contains("rest"))
            {
                let _ = writeln!(out, "  note {note}");
            }
        }
    }
}

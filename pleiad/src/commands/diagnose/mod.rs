//! `pleiad diagnose`: what physics the nominal model leaves out.

mod choice;
mod corrected;
#[cfg(test)]
mod fixture;
mod page;
mod phrases;
mod sentences;
mod summary;

use std::path::Path;

use anyhow::Context;
use pleiad_benchmark::manoeuvre::{advice, proposals};
use pleiad_mismatch::{DiagnoseOptions, Findings, TruthUse, diagnose};
use pleiad_physics::Effect;
use pleiad_recording::{Nominal, Recording, read_model};
use pleiad_report::{diagnose_report, write_summary};

use crate::cli::{DiagnoseArgs, TruthArg};
use crate::setup::{self, Input};
use crate::{folder, output};

pub fn run(args: &DiagnoseArgs) -> anyhow::Result<()> {
    let leave_out = without(&args.without)?;
    let mut chosen = choice::choose(args)?;
    let model = args.model.as_deref().map(model).transpose()?;
    let spinner = output::spinner("reading");
    let mut recordings = Vec::new();
    for (name, path) in &chosen.recordings {
        spinner.set_message(format!("reading {name}"));
        let mapping = args.reading.mapping.as_deref();
        recordings.push(read(
            name,
            path,
            mapping,
            args.reading.skip_bad_rows,
            model.as_ref(),
            &mut chosen.notes,
        )?);
    }
    // A folder that cannot be written to is told before the work, a new one is made after it.
    let asked = args.out.as_deref().map(|out| folder::create(Some(out), "")).transpose()?;
    spinner.set_message("diagnosing");
    let truth = match args.truth {
        TruthArg::Auto => TruthUse::Auto,
        TruthArg::No => TruthUse::No,
    };
    let options = DiagnoseOptions {
        fit_on: chosen.fit_on,
        test_on: chosen.test_on,
        truth,
        without_landmarks: args.without_landmarks,
        leave_out,
        ..DiagnoseOptions::default()
    };
    let mut diagnosis = diagnose(&recordings, &options)?;
    diagnosis.findings.notes.extend(chosen.notes);
    spinner.set_message("looking for manoeuvres that tell rivals apart");
    advise(&recordings, &mut diagnosis.findings, &options);
    sentences::fill_summaries(&mut diagnosis.findings);
    spinner.set_message("writing the report");
    let out = match asked {
        Some(out) => out,
        None => folder::create(None, &folder_name(&recordings))?,
    };
    corrected::write(&mut diagnosis, &recordings, &out.join("corrected.toml"))?;
    write_summary(&out.join("findings.json"), &diagnosis.findings)?;
    let report = page::report(&diagnosis, &recordings, &chosen.recordings);
    diagnose_report(&report)?.write(&out.join("report.html"))?;
    spinner.finish_and_clear();
    output::print(args.json, &diagnosis.findings, &summary::text(&diagnosis.findings, &out))
}

/// Puts the manoeuvre that tells the rivals of a finding apart in the place of the catalogue's advice, as far as the
/// recordings declare what the robots are.
fn advise(recordings: &[Recording], findings: &mut Findings, options: &DiagnoseOptions) {
    // What the tool itself says in words is as particular as can be.
    for finding in findings.findings.iter_mut().filter(|finding| finding.summary.is_empty()) {
        let all = recordings.iter().find_map(|recording| proposals(recording, finding, options));
        if let (Some(all), Some(known)) = (all, &finding.manoeuvre) {
            finding.manoeuvre = Some(advice(&all, known));
        }
    }
}

fn without(names: &[String]) -> anyhow::Result<Vec<Effect>> {
    let effect = |name: &String| {
        Effect::from_name(name)
            .with_context(|| format!("--without: no effect is called {name}; `pleiad effects` lists them"))
    };
    names.iter().map(effect).collect()
}

fn model(path: &Path) -> anyhow::Result<Nominal> {
    let mut warnings = Vec::new();
    let model = read_model(path, &mut warnings).with_context(|| format!("--model {}", path.display()))?;
    for warning in warnings {
        tracing::warn!("--model {}: {warning}", path.display());
    }
    Ok(model)
}

fn read(
    name: &str,
    path: &Path,
    mapping: Option<&Path>,
    skip_bad_rows: bool,
    model: Option<&Nominal>,
    notes: &mut Vec<String>,
) -> anyhow::Result<Recording> {
    let Input { mut recording, ingest, .. } = setup::open(path, mapping, skip_bad_rows)?;
    // That of the folder given, also where the recording lies within it.
    name.clone_into(&mut recording.name);
    if !ingest.is_clean() {
        let said = ingest.to_string();
        let lines = said.lines().map(str::trim).filter(|line| !line.is_empty());
        notes.extend(lines.map(|line| format!("{name}: {line}")));
    }
    if let Some(model) = model {
        recording.nominal = Some(model.clone());
    }
    Ok(recording)
}

fn folder_name(recordings: &[Recording]) -> String {
    match recordings {
        [one] => format!("diagnose-{}", one.name),
        _ => "diagnose".to_owned(),
    }
}

//! Runs cases: seals the answers, simulates, diagnoses, scores.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use pleiad_mismatch::{DiagnoseOptions, Diagnosis, Findings, TruthUse, design, diagnose};
use pleiad_recording::Recording;
use pleiad_sim_peers::scenario::ManoeuvreKind;
use pleiad_sim_peers::{Scenario, simulate};

use crate::baseline::{self, Selection};
use crate::cases::{Case, Plan, added, plans};
use crate::class::Asked;
use crate::error::BenchmarkError;
use crate::manoeuvre::{LEAST_RATIO, proposals};
use crate::oracle::oracle;
use crate::results::{self, CaseResult};
use crate::score::{Scored, score};
use crate::seal::{Answer, answers_text, sha256};

/// The seal, the answers that it is of, the results, within the folder.
pub const SEAL: &str = "answers.sha256";
/// Written after the last diagnosis.
pub const ANSWERS: &str = "answers.jsonl";
/// A line per case.
pub const RESULTS: &str = "results.jsonl";

/// What to run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which classes.
    pub classes: Vec<Asked>,
    /// The first seed.
    pub first_seed: u64,
    /// How many seeds of each that does not say it.
    pub seeds: u64,
    /// Only cases with one of these in their names; all if empty.
    pub only: Vec<String>,
    /// Takes up a run that stopped.
    pub resume: bool,
    /// Which diagnoses that lack something are run as well, of [`ABLATIONS`].
    pub ablations: Vec<String>,
    /// Whether other methods are run as well.
    pub baselines: bool,
    /// Where seal, answers and results are written.
    pub folder: PathBuf,
}

/// What was run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The hash of all answers, as it was written before the first diagnosis.
    pub sealed: String,
    /// In the order of the cases.
    pub results: Vec<CaseResult>,
    /// How many of them were there already.
    pub resumed: usize,
}

/// The cases of options.
///
/// # Errors
/// There is none.
pub fn chosen(options: &Options) -> Result<Vec<Plan>, BenchmarkError> {
    if options.seeds == 0 {
        return Err(BenchmarkError::NoSeeds);
    }
    let all = plans(&options.classes, options.first_seed, options.seeds);
    if options.only.is_empty() {
        return Ok(all);
    }
    let example = all.first().map_or_else(String::new, |plan| plan.id.clone());
    let wanted = |plan: &Plan| options.only.iter().any(|part| plan.id.contains(part.as_str()));
    let kept: Vec<Plan> = all.into_iter().filter(wanted).collect();
    if kept.is_empty() {
        return Err(BenchmarkError::NoCase { found: options.only.clone(), example });
    }
    Ok(kept)
}

/// Runs all cases that have no result yet. `tell` is told of each.
///
/// # Errors
/// See [`BenchmarkError`].
pub fn run(options: &Options, tell: &mut dyn FnMut(&str)) -> Result<Outcome, BenchmarkError> {
    let plans = chosen(options)?;
    for name in &options.ablations {
        lacking(name, &DiagnoseOptions::default())?;
    }
    let file = options.folder.join(RESULTS);
    if !options.resume && file.exists() {
        return Err(BenchmarkError::AlreadyThere { file });
    }
    fs::create_dir_all(&options.folder)
        .map_err(|source| BenchmarkError::File { file: options.folder.clone(), source })?;
    tell("sealing the answers");
    let answers = answers(&plans)?;
    let text = answers_text(&answers)?;
    let sealed = sha256(text.as_bytes());
    write(&options.folder.join(SEAL), &format!("{sealed}  {ANSWERS}\n"))?;

    let mut expected = BTreeMap::new();
    for answer in &answers {
        expected.insert(answer.id.clone(), answer.hash()?);
    }
    let mut known = results::read(&file, &expected)?;
    let resumed = known.len();
    let mut all = Vec::with_capacity(plans.len());
    for (index, plan) in plans.iter().enumerate() {
        if let Some(result) = known.remove(&plan.id) {
            all.push(result);
            continue;
        }
        let result = one(plan, options)?;
        results::append(&file, &result)?;
        tell(&line(index, plans.len(), &result));
        all.push(result);
    }
    // The answers as they are now are those that were sealed.
    let text = answers_text(&self::answers(&plans)?)?;
    let found = sha256(text.as_bytes());
    if found != sealed {
        return Err(BenchmarkError::BrokenSeal { found, sealed });
    }
    write(&options.folder.join(ANSWERS), &text)?;
    Ok(Outcome { sealed, results: all, resumed })
}

fn answers(plans: &[Plan]) -> Result<Vec<Answer>, BenchmarkError> {
    plans.iter().map(|plan| Ok(plan.build()?.answer)).collect()
}

fn write(file: &Path, text: &str) -> Result<(), BenchmarkError> {
    fs::write(file, text).map_err(|source| BenchmarkError::File { file: file.to_owned(), source })
}

fn one(plan: &Plan, options: &Options) -> Result<CaseResult, BenchmarkError> {
    let case = plan.build()?;
    let recording = recorded(&case, &case.scenario, case.seed)?;
    let asked = DiagnoseOptions { leave_out: case.left_out.clone(), ..DiagnoseOptions::default() };
    let (said, tool) = diagnosed(&case, std::slice::from_ref(&recording), &asked)?;
    let mut ablations = BTreeMap::new();
    for name in &options.ablations {
        let asked = lacking(name, &asked)?;
        ablations.insert(name.clone(), diagnosed(&case, std::slice::from_ref(&recording), &asked)?.1);
    }
    let mismatch = |source| BenchmarkError::Mismatch { id: case.answer.id.clone(), source };
    let oracle = oracle(&recording, &case.answer, &said.findings).map_err(mismatch)?;
    let added = with_manoeuvre(&case, &recording, &said.findings, &asked)?;
    let mut baselines: BTreeMap<String, Selection> = BTreeMap::new();
    if options.baselines {
        let design = design(&recording, &case.left_out).map_err(mismatch)?;
        baselines = baseline::all(&design, &case.answer);
    }
    Ok(CaseResult {
        id: case.answer.id.clone(),
        answer_sha256: case.answer.hash()?,
        class: case.answer.class,
        noise: case.answer.noise,
        size: case.answer.size,
        oracle,
        tool,
        ablations,
        added,
        baselines,
    })
}

/// What can be left away: errors correlated within blocks, onsets and places, rivals, ground truth, and landmarks with it.
pub const ABLATIONS: [&str; 5] = ["no_blocks", "no_scans", "no_sets", "no_truth", "no_landmarks"];

/// A diagnosis that lacks something.
fn lacking(name: &str, asked: &DiagnoseOptions) -> Result<DiagnoseOptions, BenchmarkError> {
    let mut own = asked.clone();
    match name {
        "no_blocks" => own.without.blocks = true,
        "no_scans" => own.without.scans = true,
        "no_sets" => own.without.sets = true,
        "no_truth" => own.truth = TruthUse::No,
        "no_landmarks" => {
            own.truth = TruthUse::No;
            own.without_landmarks = true;
        }
        _ => return Err(BenchmarkError::NoAblation { found: name.to_owned() }),
    }
    Ok(own)
}

fn recorded(case: &Case, scenario: &Scenario, seed: u64) -> Result<Recording, BenchmarkError> {
    let id = || case.answer.id.clone();
    let run = simulate(scenario, seed)
        .map_err(|error| BenchmarkError::Simulation { id: id(), source: Box::new(error) })?;
    let mut recording = run.recording;
    // Nothing of the answer is in what the tool is given, the name included.
    "recording".clone_into(&mut recording.name);
    Ok(recording)
}

fn diagnosed(
    case: &Case,
    recordings: &[Recording],
    asked: &DiagnoseOptions,
) -> Result<(Diagnosis, Scored), BenchmarkError> {
    let begun = Instant::now();
    let said = diagnose(recordings, asked)
        .map_err(|source| BenchmarkError::Mismatch { id: case.answer.id.clone(), source })?;
    let scored = score(&case.answer, &said.findings, begun.elapsed().as_secs_f64());
    Ok((said, scored))
}

/// Drives what the tool proposes, and asks again with both recordings.
fn with_manoeuvre(
    case: &Case,
    recording: &Recording,
    findings: &Findings,
    asked: &DiagnoseOptions,
) -> Result<Option<Scored>, BenchmarkError> {
    let Some(manoeuvre) = proposed(recording, findings, asked) else { return Ok(None) };
    let scenario = added(case, manoeuvre)?;
    let mut second = recorded(case, &scenario, case.seed.wrapping_add(1))?;
    "added".clone_into(&mut second.name);
    Ok(Some(diagnosed(case, &[recording.clone(), second], asked)?.1))
}

/// The manoeuvre that tells the rivals of the first finding that has some apart, if one does.
fn proposed(recording: &Recording, findings: &Findings, asked: &DiagnoseOptions) -> Option<ManoeuvreKind> {
    let best =
        findings.findings.iter().find_map(|own| proposals(recording, own, asked))?.into_iter().next()?;
    (best.ratio_per_minute > LEAST_RATIO).then_some(best.manoeuvre)
}

fn line(index: usize, of: usize, result: &CaseResult) -> String {
    let hits: Vec<String> = result
        .tool
        .matches
        .iter()
        .zip(&result.oracle.effects)
        .map(|(own, known)| {
            let could = match (known.detectable, known.identifiable) {
                (_, true) => "identifiable",
                (true, false) => "detectable",
                _ => "hidden",
            };
            let what = if own.top1 {
                "named"
            } else if own.in_set {
                "in set"
            } else {
                "missed"
            };
            format!("{} {what} ({could}, {:.0})", own.effect, known.gain)
        })
        .collect();
    let extra = if result.tool.extra.is_empty() {
        String::new()
    } else {
        format!("; besides: {}", result.tool.extra.join("; "))
    };
    format!(
        "{}/{of} {} {}, {:.1} s: {}{extra}",
        index + 1,
        result.id,
        result.tool.verdict,
        result.tool.seconds,
        hits.join("; ")
    )
}

#[cfg(test)]
mod tests;

//! `pleiad export`: a recording, and the estimates in a run, in the form of another tool.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::{
    Estimate, Form, IngestReport, McapContents, Overwrite, read_estimates, tum, write_estimates,
    write_folder, write_mcap,
};
use serde::Serialize;

use crate::cli::{ExportArgs, ExportForm};
use crate::run_file::RUN;
use crate::setup::{self, Input};
use crate::{folder, output};

#[derive(Debug, Serialize)]
struct ExportJson {
    recording: String,
    out: String,
    /// From the folder written, or the file itself.
    files: Vec<String>,
    robots: usize,
    /// How many estimates, of all robots.
    estimates: usize,
    ingest: IngestReport,
}

pub fn run(args: &ExportArgs) -> anyhow::Result<()> {
    let input = setup::open(&args.recording, args.reading.mapping.as_deref(), args.reading.skip_bad_rows)?;
    let estimates = estimates(&args.recording, &input)?;
    let mut files = Vec::new();
    let out = match args.to {
        ExportForm::Mcap => {
            let path = file(args.out.as_deref(), &input)?;
            let contents = McapContents {
                recording: Some(&input.recording),
                estimates: estimates.clone(),
                attachments: setup::texts_beside(&input.folder)?,
                ..McapContents::default()
            };
            write_mcap(&path, &contents)?;
            files.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
            path
        }
        ExportForm::Csv => {
            let out = folder::create(args.out.as_deref(), "export")?;
            write_folder(&input.recording, &out, Overwrite::Refuse)?;
            files.push("recording.toml".to_owned());
            for (name, text) in setup::texts_beside(&input.folder)? {
                let path = out.join(&name);
                std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
                files.push(name);
            }
            for (robot, own) in &estimates {
                let name = format!("estimate/robot-{robot}.csv");
                write_estimates(&out.join(&name), own)?;
                files.push(name);
            }
            out
        }
        ExportForm::Tum => trajectories(args.out.as_deref(), &input, &estimates, &mut files)?,
    };
    let json = ExportJson {
        recording: input.recording.name.clone(),
        out: out.display().to_string(),
        files,
        robots: input.recording.robots.len(),
        estimates: estimates.values().map(Vec::len).sum(),
        ingest: input.ingest,
    };
    output::print(args.json, &json, &text(&json))
}

/// The estimates in the file, or in the `run.mcap` of the folder.
fn estimates(path: &Path, input: &Input) -> anyhow::Result<BTreeMap<RobotId, Vec<Estimate>>> {
    let within = path.join(RUN);
    if within.is_file() {
        return Ok(read_estimates(&within)?);
    }
    if input.ingest.form == Form::Mcap && path.is_file() {
        Ok(read_estimates(path)?)
    } else {
        Ok(BTreeMap::new())
    }
}

/// The file to write, which must not be there.
fn file(asked: Option<&Path>, input: &Input) -> anyhow::Result<PathBuf> {
    let path = match asked {
        Some(path) => path.to_owned(),
        None => PathBuf::from(format!("{}.mcap", input.recording.name)),
    };
    if path.exists() {
        bail!("{} is there already: name another file with --out", path.display());
    }
    Ok(path)
}

/// Ground truth and estimates as TUM files.
fn trajectories(
    out: Option<&Path>,
    input: &Input,
    estimates: &BTreeMap<RobotId, Vec<Estimate>>,
    files: &mut Vec<String>,
) -> anyhow::Result<PathBuf> {
    let mut all: Vec<(String, Vec<(Timestamp, Pose2)>)> = Vec::new();
    for (robot, channels) in &input.recording.robots {
        let truth = channels.truth.iter().map(|truth| (truth.time, truth.pose)).collect();
        all.push((format!("truth/robot-{robot}.tum"), truth));
    }
    for (robot, own) in estimates {
        let poses = own.iter().map(|estimate| (estimate.time, estimate.pose)).collect();
        all.push((format!("estimate/robot-{robot}.tum"), poses));
    }
    all.retain(|(_, poses)| !poses.is_empty());
    if all.is_empty() {
        bail!(
            "{} has neither ground truth nor estimates, so there is no trajectory: export a run, or replay it first",
            input.recording.name
        );
    }
    let out = folder::create(out, "export")?;
    for (name, poses) in all {
        tum::write(&out.join(&name), &poses)?;
        files.push(name);
    }
    Ok(out)
}

fn text(json: &ExportJson) -> String {
    let mut text = format!("{}: {} robots, {} estimates\n", json.recording, json.robots, json.estimates);
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(text, "{}: {}", json.out, json.files.join(", "));
    if !json.ingest.is_clean() {
        let _ = writeln!(text, "{}", json.ingest);
    }
    text
}

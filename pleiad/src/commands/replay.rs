//! `pleiad replay`: a recording through the agents of a team.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use pleiad_agent::SettledEstimate;
use pleiad_agent::results::{AgentSummary, Found, FoundLandmark, FoundParameter, FoundRobot};
use pleiad_estimation::{LandmarkId, Timestamp};
use pleiad_recording::{IngestReport, Recording, tum};
use pleiad_report::{ReplayReport, RobotScore, replay_report, run_report, write_summary};
use serde::Serialize;

use super::runner::{self, Feeder, ProcessOptions, Survived};
use crate::cli::ReplayArgs;
use crate::evaluation::{self, NisJson, RunResult};
use crate::setup::{self, Input, ReplayOptions, Team};
use crate::{output, payload, run_file};

/// `replay --json` and `summary.json`.
#[derive(Debug, Serialize)]
pub struct ReplayJson {
    pub recording: String,
    pub command: String,
    pub out: String,
    pub robots: Vec<RobotJson>,
    pub mean_position_rmse_m: Option<f64>,
    pub dead_reckoning_mean_rmse_m: Option<f64>,
    pub online_mean_position_rmse_m: Option<f64>,
    pub facts: FactsJson,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<FoundJson>,
    pub payload_bytes: PayloadJson,
    /// Of the joint filter, which only `exact` has.
    pub nis: Option<NisJson>,
    pub seconds: SecondsJson,
    pub processes: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faults: Option<Survived>,
    pub notes: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ingest: Option<IngestReport>,
}

#[derive(Debug, Serialize)]
pub struct RobotJson {
    pub robot: u32,
    pub position_rmse_m: Option<f64>,
    pub heading_rmse_rad: Option<f64>,
    pub distance_m: f64,
    pub dead_reckoning_rmse_m: Option<f64>,
    pub online_position_rmse_m: Option<f64>,
    pub estimate: String,
}

/// What the team found out besides poses.
#[derive(Debug, Serialize)]
pub struct FoundJson {
    pub parameters: Vec<FoundParameter>,
    pub landmarks: Vec<FoundLandmark>,
    /// Root mean square of the distances of the landmarks from where the recording says that they are.
    pub landmark_rmse_m: Option<f64>,
    /// Robots whose noise is more than stated, or that are not believed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<FoundRobot>,
}

#[derive(Debug, Serialize)]
pub struct FactsJson {
    pub relative: usize,
    pub absolute: usize,
    pub used: usize,
    pub rejected: usize,
    pub skipped: usize,
    pub pending: usize,
    pub void: usize,
}

#[derive(Debug, Serialize)]
pub struct PayloadJson {
    /// Of facts, which only `exact` has; `pleiad faults` counts for the others.
    pub per_relative_observation: Option<f64>,
    pub total: u64,
}

#[derive(Debug, Serialize)]
pub struct SecondsJson {
    pub recorded: f64,
    pub wall: f64,
}

pub fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let input = setup::open(&args.recording, args.reading.mapping.as_deref(), args.reading.skip_bad_rows)?;
    let Input { recording, ingest, folder, .. } = &input;
    let options = ReplayOptions {
        filter: args.filter.clone(),
        landmarks: &args.landmarks,
        absolute: &args.absolute,
        start_s: args.start,
        seconds: args.seconds,
        seed: args.seed,
        noise: args.noise.as_deref(),
        model: args.model.as_deref(),
        folder,
        mrclam: ingest.form == pleiad_recording::Form::Mrclam,
    };
    let team = setup::recorded(recording, &options)?;
    let out = crate::folder::create(args.out.as_deref(), &format!("replay-{}", recording.name))?;
    let result = if args.processes {
        let options = ProcessOptions {
            feeder: Feeder::Samples,
            speed: None,
            restart: false,
            label: "replaying",
            faults: None,
        };
        runner::as_processes(&team, &out, &options)?
    } else {
        runner::in_process(&team, "replaying")?
    };
    let command = command_line();
    let json = write_run(&team, &result, &out, &command, Some(ingest.clone()))?;
    output::print(args.json, &json, &text(&json))
}

/// The command as it was given, for a report to repeat.
pub fn command_line() -> String {
    let words = std::env::args().skip(1).map(|word| {
        let plain = word.chars().all(|c| c.is_ascii_alphanumeric() || "-_./:@=,".contains(c));
        if plain && !word.is_empty() { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
    });
    std::iter::once("pleiad".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Writes trajectories, summary and report, and gives the summary.
pub fn write_run(
    team: &Team,
    result: &RunResult,
    out: &Path,
    command: &str,
    ingest: Option<IngestReport>,
) -> anyhow::Result<ReplayJson> {
    let (first, last) = team.span().context("there is not a single sample")?;
    let replayed = ingest.is_some();
    write_trajectories(result, out)?;
    run_file::write(team, result, out, command, first)?;
    let scores: Vec<RobotScore> =
        result.robots.iter().map(|(robot, own)| evaluation::score(*robot, own, &team.recording)).collect();
    let json = summary(&team.recording, result, &scores, (first, last), out, command, ingest);
    write_summary(&out.join("summary.json"), &json)?;
    let kinds = result.ledger.as_ref().map(|ledger| evaluation::by_kind(ledger, first));
    let (nis, facts) = kinds.unwrap_or_default();
    let payload = json.payload_bytes.per_relative_observation;
    let payload =
        payload.map(|bytes| ("payload of a relative observation".to_owned(), format!("{bytes:.0} bytes")));
    let mut highlights: Vec<_> = payload.into_iter().collect();
    highlights.extend([
        ("all published bytes".to_owned(), json.payload_bytes.total.to_string()),
        (
            "wall-clock time".to_owned(),
            format!("{:.2} s for {:.0} s", json.seconds.wall, json.seconds.recorded),
        ),
    ]);
    if result.processes > 0 {
        highlights.push(("agent processes".to_owned(), result.processes.to_string()));
    }
    let report = ReplayReport {
        name: team.recording.name.clone(),
        seconds: last.seconds_since(first),
        series: evaluation::series(result, &team.recording, first),
        landmarks: evaluation::landmarks(&team.recording),
        scores,
        nis,
        facts,
        highlights,
        notes: result.notes.clone(),
        commands: vec![("this report".to_owned(), command.to_owned())],
    };
    // Without an ingested recording it was a run.
    let document = if replayed { replay_report(&report)? } else { run_report(&report)? };
    document.write(&out.join("report.html"))?;
    Ok(json)
}

fn summary(
    recording: &Recording,
    result: &RunResult,
    scores: &[RobotScore],
    (first, last): (Timestamp, Timestamp),
    out: &Path,
    command: &str,
    ingest: Option<IngestReport>,
) -> ReplayJson {
    let robots = scores.iter().map(|score| RobotJson {
        robot: score.robot.0,
        position_rmse_m: score.settled.map(|accuracy| accuracy.position_rmse_m),
        heading_rmse_rad: score.settled.map(|accuracy| accuracy.heading_rmse_rad),
        distance_m: score.distance_m,
        dead_reckoning_rmse_m: score.dead_reckoning.map(|accuracy| accuracy.position_rmse_m),
        online_position_rmse_m: score.online.map(|accuracy| accuracy.position_rmse_m),
        estimate: result.robots.get(&score.robot).map(|own| own.summary.estimate.clone()).unwrap_or_default(),
    });
    ReplayJson {
        recording: recording.name.clone(),
        command: command.to_owned(),
        out: out.display().to_string(),
        robots: robots.collect(),
        mean_position_rmse_m: evaluation::mean_position_rmse_m(scores.iter(), |score| score.settled),
        dead_reckoning_mean_rmse_m: evaluation::mean_position_rmse_m(scores.iter(), |score| {
            score.dead_reckoning
        }),
        online_mean_position_rmse_m: evaluation::mean_position_rmse_m(scores.iter(), |score| score.online),
        facts: facts(result),
        found: found(recording, result),
        payload_bytes: PayloadJson {
            per_relative_observation: result
                .ledger
                .as_ref()
                .map(|_| payload::per_relative_observation(result.entries())),
            total: result.robots.values().map(|own| own.summary.bytes).sum(),
        },
        nis: result.ledger.as_ref().map(evaluation::nis),
        seconds: SecondsJson { recorded: last.seconds_since(first), wall: result.wall_s },
        processes: result.processes,
        faults: result.survived.clone(),
        notes: result.notes.clone(),
        ingest,
    }
}

/// What is not known beforehand and nobody asks for is left out.
fn found(recording: &Recording, result: &RunResult) -> Option<FoundJson> {
    let found =
        result.robots.values().map(|own| &own.summary.found).max_by_key(|found| found.landmarks.len())?;
    if *found == Found::default() {
        return None;
    }
    let squares: Vec<f64> = found
        .landmarks
        .iter()
        .filter_map(|mapped| {
            let [x, y] = recording.landmarks.get(&LandmarkId(mapped.id))?;
            Some((mapped.x_m - x).powi(2) + (mapped.y_m - y).powi(2))
        })
        .collect();
    let mean = (!squares.is_empty()).then(|| squares.iter().sum::<f64>() / squares.len() as f64);
    Some(FoundJson {
        parameters: found.parameters.clone(),
        landmarks: found.landmarks.clone(),
        landmark_rmse_m: mean.map(f64::sqrt),
        robots: found.robots.clone(),
    })
}

/// What became of the observations: as all robots know it, or as each counted its own.
fn facts(result: &RunResult) -> FactsJson {
    let Some(ledger) = &result.ledger else {
        let sum = |count: fn(&AgentSummary) -> u64| -> usize {
            result
                .robots
                .values()
                .map(|robot| usize::try_from(count(&robot.summary)).unwrap_or(usize::MAX))
                .sum()
        };
        return FactsJson {
            relative: sum(|summary| summary.facts_relative),
            absolute: sum(|summary| summary.facts_absolute),
            used: sum(|summary| summary.facts_used),
            rejected: sum(|summary| summary.facts_rejected),
            skipped: 0,
            pending: sum(|summary| summary.facts_pending),
            void: 0,
        };
    };
    let counts = ledger.counts();
    FactsJson {
        relative: counts.relative,
        absolute: counts.absolute,
        used: counts.used,
        rejected: counts.rejected,
        skipped: counts.skipped,
        pending: counts.pending,
        void: counts.void,
    }
}

fn write_trajectories(result: &RunResult, out: &Path) -> anyhow::Result<()> {
    for (robot, own) in &result.robots {
        let write = |view: &str, estimates: &[SettledEstimate]| {
            let path = out.join(view).join(format!("robot-{robot}.tum"));
            let poses: Vec<_> = estimates.iter().map(|estimate| (estimate.time, estimate.pose)).collect();
            tum::write(&path, &poses)
        };
        write("settled", &own.settled)?;
        write("online", &own.online)?;
    }
    Ok(())
}

fn found_text(found: &FoundJson) -> String {
    let mut text = String::new();
    for FoundParameter { robot, name, value, sigma } in &found.parameters {
        let _ = writeln!(text, "robot {robot}: {name} {value:.4} (sigma {sigma:.4})");
    }
    if !found.landmarks.is_empty() {
        let _ = write!(text, "map of the team: {} landmarks", found.landmarks.len());
        if let Some(rmse_m) = found.landmark_rmse_m {
            let _ = write!(text, ", RMSE {rmse_m:.3} m");
        }
        text.push('\n');
    }
    text
}

/// The summary for people.
pub fn text(json: &ReplayJson) -> String {
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let mut text =
        format!("{}: {:.1} s in {:.1} s\n\n", json.recording, json.seconds.recorded, json.seconds.wall);
    let _ = writeln!(text, "robot  position RMSE m  heading RMSE rad  dead reckoning m  distance m");
    for robot in &json.robots {
        let _ = writeln!(
            text,
            "{:>5}  {:>15}  {:>16}  {:>16}  {:>10.1}",
            robot.robot,
            metres(robot.position_rmse_m),
            metres(robot.heading_rmse_rad),
            metres(robot.dead_reckoning_rmse_m),
            robot.distance_m
        );
    }
    let _ = writeln!(
        text,
        " mean  {:>15}  {:>16}  {:>16}\n",
        metres(json.mean_position_rmse_m),
        "",
        metres(json.dead_reckoning_mean_rmse_m)
    );
    let facts = &json.facts;
    let _ = writeln!(
        text,
        "facts: {} relative, {} absolute; {} used, {} rejected, {} skipped, {} pending, {} void",
        facts.relative, facts.absolute, facts.used, facts.rejected, facts.skipped, facts.pending, facts.void
    );
    if let (Some(nis), Some(bytes)) = (json.nis, json.payload_bytes.per_relative_observation) {
        let _ = writeln!(
            text,
            "NIS per degree of freedom {:.2}, {:.1} % within the 95 % bound; {bytes:.0} bytes per relative observation",
            nis.mean,
            100.0 * nis.within_95,
        );
    }
    if let Some(found) = &json.found {
        text.push_str(&found_text(found));
    }
    if let Some(faults) = &json.faults {
        let what = &faults.befallen;
        let _ = writeln!(
            text,
            "faults: {} kills, {} stops, {} full disks, {} deaths of the coordinator, {} partitions; of {} \
             observations {} lost and {} counted twice; one estimate, that of an undisturbed fold",
            what.kills,
            what.stops,
            what.full_disks,
            what.coordinator_deaths,
            faults.partitions,
            faults.observations,
            faults.lost,
            faults.counted_twice
        );
    }
    for note in &json.notes {
        let _ = writeln!(text, "note: {note}");
    }
    if let Some(ingest) = json.ingest.as_ref().filter(|ingest| !ingest.is_clean()) {
        let _ = writeln!(text, "{ingest}");
    }
    let _ = writeln!(text, "report: {}/report.html", json.out);
    text
}

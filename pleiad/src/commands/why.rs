//! `pleiad why`: the observations of a recording that the estimate does not rest on, each with the reason.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::{Context, bail};
use pleiad_estimation::fact::{Absolute, Body, EntryId, Observation, Quantity, VoidReason};
use pleiad_estimation::fold::{Fact, Outcome, SkipReason};
use pleiad_estimation::{RobotId, Timestamp};
use serde::Serialize;

use super::runner;
use crate::cli::WhyArgs;
use crate::evaluation::RunResult;
use crate::output;
use crate::setup::{self, Input, ReplayOptions};

#[derive(Debug, Serialize)]
struct WhyJson {
    recording: String,
    /// Observations made, of those asked for.
    observations: usize,
    not_used: usize,
    /// How many for which reason, the same words as below.
    reasons: BTreeMap<&'static str, usize>,
    listed: Vec<UnusedJson>,
}

#[derive(Debug, Serialize)]
struct UnusedJson {
    time_s: f64,
    robot: u32,
    of: String,
    reason: &'static str,
    because: String,
    /// Of the innovation, where there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    nis: Option<f64>,
}

/// Why an observation was not used: a word to count by, and a sentence with the remedy.
struct Verdict {
    reason: &'static str,
    because: String,
    nis: Option<f64>,
}

pub fn run(args: &WhyArgs) -> anyhow::Result<()> {
    for (name, value) in [("--at", args.at), ("--within", Some(args.within))] {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
            bail!("{name} {value}: expected seconds, zero or more");
        }
    }
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
    if let Some(robot) = args.robot.filter(|robot| !team.agents.contains_key(&RobotId(*robot))) {
        let known: Vec<_> = team.agents.keys().map(ToString::to_string).collect();
        bail!("--robot {robot}: the recording has robots {}", known.join(", "));
    }
    let (first, _) = team.span().context("there is not a single sample to run on")?;
    let result = runner::in_process(&team, "asking why")?;
    let verdicts = verdicts(&result)?;
    let asked = |id: &EntryId, time: Timestamp| {
        let near = args.at.is_none_or(|at| (time.seconds_since(first) - at).abs() <= args.within);
        near && args.robot.is_none_or(|robot| id.robot.0 == robot)
    };
    let mut json = WhyJson {
        recording: args.recording.display().to_string(),
        observations: 0,
        not_used: 0,
        reasons: BTreeMap::new(),
        listed: Vec::new(),
    };
    let mut observations: Vec<(EntryId, Observation)> = observations(&result).collect();
    observations.sort_by_key(|(id, observation)| (observation.time, *id));
    for (id, observation) in observations.iter().filter(|(id, made)| asked(id, made.time)) {
        json.observations += 1;
        let Some(verdict) = verdicts.get(id) else { continue };
        json.not_used += 1;
        *json.reasons.entry(verdict.reason).or_default() += 1;
        if json.listed.len() < args.limit {
            json.listed.push(UnusedJson {
                time_s: observation.time.seconds_since(first),
                robot: id.robot.0,
                of: subject(&observation.quantity),
                reason: verdict.reason,
                because: verdict.because.clone(),
                nis: verdict.nis,
            });
        }
    }
    output::print(args.json, &json, &text(&json))
}

fn observations(result: &RunResult) -> impl Iterator<Item = (EntryId, Observation)> {
    result.entries().filter_map(|entry| match entry.body {
        Body::Observation(observation) => Some((entry.id, observation)),
        _ => None,
    })
}

/// The observations that moved nothing.
fn verdicts(result: &RunResult) -> anyhow::Result<BTreeMap<EntryId, Verdict>> {
    let ledger = result.ledger.as_ref().context(
        "why is a question to the facts, which only the strategy exact keeps: leave --strategy away",
    )?;
    let mut verdicts = BTreeMap::new();
    for (key, record) in ledger.facts() {
        let (Fact::Observation { .. }, Some(residual)) = (&record.fact, &record.residual) else { continue };
        let verdict = match residual.outcome {
            Outcome::Booted
            | Outcome::Placed
            | Outcome::Used
            | Outcome::UsedAs(_)
            | Outcome::Joined { .. } => {
                continue;
            }
            Outcome::Tied => Verdict {
                reason: "frames not joined",
                because:
                    "it was seen between two frames of which nobody knows yet how they lie to one another; \
                          more sightings between the two would tell"
                        .to_owned(),
                nis: None,
            },
            Outcome::Rejected { threshold } => Verdict {
                reason: "gate",
                because: format!(
                    "its NIS of {:.1} is beyond the gate of {threshold:.1} for {} degrees of freedom: the reading is \
                     wrong, its noise is stated too small (pleiad tune), or the estimate was off",
                    residual.nis, residual.dimension
                ),
                nis: Some(residual.nis),
            },
            Outcome::Skipped(reason) => skipped(reason),
        };
        verdicts.insert(key.id, verdict);
    }
    for (id, reason) in ledger.voids() {
        verdicts.insert(*id, void(*reason));
    }
    for (id, observation) in observations(result) {
        let Quantity::Robot { robot, .. } = observation.quantity else { continue };
        if ledger.unanswered(robot).any(|(waiting, _)| waiting == id) {
            let because = format!(
                "robot {robot} has not said where its odometry had it then: it was not reached, or its odometry ended \
                 before"
            );
            verdicts.insert(id, Verdict { reason: "not answered", because, nis: None });
        }
    }
    Ok(verdicts)
}

fn skipped(reason: SkipReason) -> Verdict {
    let (reason, because) = match reason {
        SkipReason::NotPlaced(robot) => (
            "not placed",
            format!(
                "robot {robot} had no place in the map yet: give it a prior, or let frames join ([filter.join])"
            ),
        ),
        SkipReason::OtherBoot(robot) => {
            ("other boot", format!("robot {robot} had restarted, and this is of a boot that had ended"))
        }
        SkipReason::TooClose => (
            "too close",
            "its target is predicted closer than a millimetre, where a range has no direction".into(),
        ),
        SkipReason::PointHasNoHeading => (
            "no heading",
            "a full pose was measured of a landmark, which is a point: record a position".into(),
        ),
        SkipReason::Noise => (
            "noise",
            "its noise is not declared, has the wrong dimension, or is not positive definite".into(),
        ),
        SkipReason::Itself => ("itself", "the robot says to have seen itself: its name is wrong".into()),
        SkipReason::NotMapped(landmark) => (
            "not mapped",
            format!(
                "landmark {} has no place in the team's map yet, and this does not give it one: a range and a bearing do",
                landmark.0
            ),
        ),
        SkipReason::Distrusted(robot) => (
            "distrusted",
            format!("robot {robot} contradicts the others, and is not believed until it boots again"),
        ),
    };
    Verdict { reason, because, nis: None }
}

fn void(reason: VoidReason) -> Verdict {
    let (reason, because) = match reason {
        VoidReason::BeforeBoot => {
            ("before boot", "it is from before the first odometry of the robot that was seen")
        }
        VoidReason::OdometryGap => {
            ("odometry gap", "the robot that was seen has a hole in its odometry there, or was restarting")
        }
        VoidReason::TrajectoryLost => {
            ("trajectory lost", "the robot that was seen does not keep its trajectory that long")
        }
        VoidReason::Clock => (
            "clock",
            "its stamp is too far in the future of the robot that was seen: one of two clocks is wrong",
        ),
    };
    Verdict { reason, because: because.to_owned(), nis: None }
}

fn subject(quantity: &Quantity) -> String {
    match quantity {
        Quantity::Robot { robot, .. } => format!("robot {robot}"),
        Quantity::Landmark { landmark, .. } | Quantity::Feature { landmark, .. } => {
            format!("landmark {}", landmark.0)
        }
        Quantity::Absolute(Absolute::Pose(_)) => "own pose".to_owned(),
        Quantity::Absolute(Absolute::Position(_)) => "own position".to_owned(),
        Quantity::Absolute(Absolute::Heading(_)) => "own heading".to_owned(),
    }
}

fn text(json: &WhyJson) -> String {
    let mut text = format!(
        "{}: {} of {} observations were not used\n",
        json.recording, json.not_used, json.observations
    );
    for (reason, count) in &json.reasons {
        let _ = writeln!(text, "  {count:>6}  {reason}");
    }
    for one in &json.listed {
        let _ = writeln!(
            text,
            "{:9.3} s  robot {} of {}: {}: {}",
            one.time_s, one.robot, one.of, one.reason, one.because
        );
    }
    if json.not_used > json.listed.len() {
        let more = json.not_used - json.listed.len();
        let _ = writeln!(text, "... and {more} more: --limit, --robot and --at choose");
    }
    text
}

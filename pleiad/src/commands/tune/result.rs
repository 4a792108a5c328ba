//! What was found, beside what was stated, and the files that say it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use pleiad_agent::config::AgentConfig;
use pleiad_estimation::RobotId;
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::likelihood::{Level, Levels, Problem, Range, TunableFact, maximize, scores};
use pleiad_estimation::statistics::{NisSummary, chi_square_quantile};
use serde::Serialize;

use super::gather::Gathered;
use super::search::{self, Found};
use crate::commands::replay::command_line;
use crate::levels;
use crate::setup::{NoiseFile, Team};

/// By so much the log-likelihood may fall for a value to be as good as the best: half the 95 % quantile of chi-square.
const FALL: f64 = 1.92;

/// `tune --json`.
#[derive(Debug, Serialize)]
pub struct TuneJson {
    pub recording: String,
    pub command: String,
    pub measurements: usize,
    pub levels: Vec<LevelJson>,
    pub outliers: OutliersJson,
    pub before: JudgedJson,
    pub after: JudgedJson,
    pub starts: Vec<StartJson>,
    pub tried: Vec<TriedJson>,
    /// Whether the log-likelihood falls in every direction from where the search ended.
    pub maximum: bool,
    pub evaluations: usize,
    pub seconds: f64,
    /// The noise found, as TOML; by robot where their geometry differs.
    pub noise: BTreeMap<String, String>,
    pub notes: Vec<String>,
}

#[derive(Debug, Serialize)]
pub struct LevelJson {
    pub key: &'static str,
    pub start: f64,
    pub value: f64,
    pub interval_95: Option<[f64; 2]>,
    /// Relative: of the logarithm.
    pub standard_error: Option<f64>,
    /// The same where the model is not quite right.
    pub robust_error: Option<f64>,
    pub falls: [f64; 2],
    pub determined: bool,
    /// Whether the log-likelihood is like a parabola as far as the interval goes; an interval on a rough one is too narrow.
    pub smooth: bool,
    /// Largest value that is as good as the best, of a level that the data only bound from above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
}

#[derive(Debug, Serialize)]
pub struct OutliersJson {
    pub share: f64,
    pub interval_95: Option<[f64; 2]>,
    pub reach_m: f64,
    /// By how much more likely the recording is with this share than with next to none.
    pub gain: f64,
    /// Whether that is enough for [filter.clutter] to be written (BIC).
    pub found: bool,
}

/// How well levels describe the recording.
#[derive(Debug, Serialize)]
pub struct JudgedJson {
    pub log_likelihood: f64,
    /// By the filter of a replay, with its gate: all measurements, and those used.
    pub nis: f64,
    pub nis_interval_95: [f64; 2],
    pub nis_used: f64,
    pub nis_median: f64,
    pub within_95: f64,
    pub rejected: usize,
    /// Share of the sum of NIS that is of refused measurements.
    pub nis_share_rejected: f64,
    /// By the fold that is maximized, each measurement weighed by its probability of being of something.
    pub nis_weighed: f64,
    /// How many are of nothing then: the sum of their probabilities.
    pub of_nothing: f64,
    /// Share of the sum of NIS that they have.
    pub nis_share_of_nothing: f64,
}

#[derive(Debug, Serialize)]
pub struct StartJson {
    pub motion_factor: f64,
    pub sensor_factor: f64,
    pub log_likelihood: f64,
    pub best: bool,
    pub converged: bool,
}

#[derive(Debug, Serialize)]
pub struct TriedJson {
    pub key: &'static str,
    pub gain: f64,
    pub kept: bool,
}

pub fn judged(
    name: &str,
    team: &Team,
    gathered: &Gathered,
    found: Found,
    reach_m: f64,
    began: Instant,
) -> anyhow::Result<TuneJson> {
    let Found { problem, maximum, information, starts, tried, evaluations } = found;
    let (mut tuned, share) = problem.at(&maximum.x);
    let mut notes = gathered.notes.clone();
    let mut rows = Vec::new();
    for (index, level) in problem.free().iter().enumerate() {
        let range = &information.ranges[index];
        let row = row(&problem, &maximum.x, maximum.value, (index, *level), range, gathered.start[*level]);
        tuned[*level] = row.value;
        if !row.determined {
            notes.push(undetermined(&row));
        }
        rows.push(row);
    }
    let rough: Vec<&str> =
        rows.iter().filter(|row| row.determined && !row.smooth).map(|row| row.key).collect();
    if !rough.is_empty() {
        notes.push(format!(
            "the log-likelihood is rough about the maximum, because readings are taken or left as a whole: intervals are too \
             narrow for {}",
            rough.join(", ")
        ));
    }
    let measurements = search::count(&problem, &maximum.x);
    let gain = maximum.value - without_outliers(&problem, &maximum.x);
    let garbage = search::pays(gain, measurements);
    let last = information.ranges.last();
    let outliers = OutliersJson {
        share,
        interval_95: last
            .filter(|range| range.is_determined())
            .and_then(|range| range.interval(*maximum.x.last()?))
            .map(|ends| ends.map(|x| 1.0 / (1.0 + (-x).exp()))),
        reach_m,
        gain,
        found: garbage,
    };
    if !information.definite {
        notes.push("the log-likelihood is not that of a maximum where the search ended; intervals are from the scores alone".to_owned());
    }
    let replayed = team.agents.values().next().map(|agent| agent.filter.fold(None)).unwrap_or_default();
    let judge = |levels: &Levels| judge(&gathered.facts, levels, &replayed, reach_m);
    let mut noise = BTreeMap::new();
    for (robot, file) in files(&team.agents, &tuned, garbage.then_some((share, reach_m))) {
        noise.insert(robot, toml::to_string(&file).context("the noise found cannot be written")?);
    }
    Ok(TuneJson {
        recording: name.to_owned(),
        command: command_line(),
        measurements,
        levels: rows,
        outliers,
        before: judge(&gathered.start),
        after: judge(&tuned),
        starts: starts
            .into_iter()
            .map(|end| StartJson {
                motion_factor: end.motion_factor,
                sensor_factor: end.sensor_factor,
                log_likelihood: end.value,
                best: end.best,
                converged: end.converged,
            })
            .collect(),
        tried: tried
            .into_iter()
            .map(|one| TriedJson { key: levels::key(one.level), gain: one.gain, kept: one.kept })
            .collect(),
        maximum: information.definite && maximum.converged,
        evaluations,
        seconds: began.elapsed().as_secs_f64(),
        noise: merged(noise),
        notes,
    })
}

/// A level with its interval; the value it had where the data do not say otherwise.
fn row(
    problem: &Problem,
    x: &[f64],
    value: f64,
    (index, level): (usize, Level),
    range: &Range,
    start: f64,
) -> LevelJson {
    let found = x[index].exp();
    let determined = range.is_determined();
    let fall = |tried: f64| {
        let mut point = x.to_vec();
        point[index] = tried.ln();
        value - problem.densities(&point).iter().sum::<f64>()
    };
    let at_most = if range.bounded[0] { None } else { most(found, &fall) };
    let kept = !determined && start > 0.0 && fall(start) < FALL;
    let value = match at_most {
        _ if kept => start,
        // As likely as the best, and not absurdly small.
        Some(most) if !determined => 0.5 * most,
        _ => found,
    };
    LevelJson {
        key: levels::key(level),
        start,
        value,
        interval_95: range.interval(x[index]).filter(|_| determined).map(|ends| ends.map(f64::exp)),
        standard_error: range.standard_error.filter(|_| determined),
        robust_error: range.robust_error.filter(|_| determined),
        falls: range.falls,
        determined,
        smooth: range.is_smooth(),
        at_most,
    }
}

/// The largest value that is as good as the best, of a level that may be far smaller than `found`.
fn most(found: f64, fall: &dyn Fn(f64) -> f64) -> Option<f64> {
    let mut most = found;
    // A coarse step first: what was found may be anything below.
    for factor in [4.0, 1.1] {
        let mut steps = 0;
        while fall(most * factor) < FALL {
            most *= factor;
            steps += 1;
            if steps > 30 {
                return None;
            }
        }
    }
    Some(most)
}

/// The log-likelihood with next to no outliers, all else as at `x`.
fn without_outliers(problem: &Problem, x: &[f64]) -> f64 {
    let mut point = x.to_vec();
    if let (Some(share), Some(least)) = (point.last_mut(), problem.bounds().0.last()) {
        *share = *least;
    }
    problem.densities(&point).iter().sum()
}

fn undetermined(row: &LevelJson) -> String {
    let what = match row.at_most {
        Some(most) => format!("the data only say that it is at most {}", super::words::short(most)),
        None => "the data do not determine it".to_owned(),
    };
    let then = match row.at_most {
        _ if row.value.to_bits() == row.start.to_bits() => "it keeps its value",
        Some(_) => "half of that is written",
        None => "it is written as it was found",
    };
    format!("{}: {what}; {then}", row.key)
}

fn judge(facts: &[TunableFact], levels: &Levels, replayed: &FoldConfig, reach_m: f64) -> JudgedJson {
    // The levels as they are, the share of outliers that suits them.
    let only = Problem::new(facts, *levels, Vec::new(), reach_m);
    let (lower, upper) = only.bounds();
    let best =
        maximize(&search::evaluator(&only), &only.point(levels, search::SHARE), (&lower, &upper), 0.01);
    let weighed = scores(facts, levels, &only.config(only.at(&best.x).1)).into_iter().flatten();
    let (mut something, mut degrees, mut nothing, mut of_nothing) = (0.0, 0.0, 0.0, 0.0);
    for score in weighed {
        something += score.weight * score.nis;
        degrees += score.weight * score.dimension as f64;
        nothing += (1.0 - score.weight) * score.nis;
        of_nothing += 1.0 - score.weight;
    }
    let config = FoldConfig { relinearize: None, ..*replayed };
    let scores: Vec<_> = scores(facts, levels, &config).into_iter().flatten().collect();
    let all = NisSummary::from_values(scores.iter().map(|score| (score.nis, score.dimension)));
    let used: Vec<_> = scores.iter().filter(|score| score.used).collect();
    let kept = NisSummary::from_values(used.iter().map(|score| (score.nis, score.dimension)));
    let sum = |of: &mut dyn Iterator<Item = f64>| of.sum::<f64>();
    let whole = sum(&mut scores.iter().map(|score| score.nis));
    // Relative to the median of each one's own dimension.
    let mut medians: Vec<f64> =
        scores.iter().map(|score| score.nis / chi_square_quantile(score.dimension as f64, 0.5)).collect();
    medians.sort_by(f64::total_cmp);
    JudgedJson {
        log_likelihood: best.value,
        nis: all.map_or(0.0, |all| all.mean_per_degree),
        nis_interval_95: all.map_or([0.0; 2], |all| [all.interval_95.0, all.interval_95.1]),
        nis_used: kept.map_or(0.0, |kept| kept.mean_per_degree),
        nis_median: medians.get(medians.len() / 2).copied().unwrap_or(0.0),
        within_95: all.map_or(0.0, |all| all.share_within_95),
        rejected: scores.len() - used.len(),
        nis_share_rejected: 1.0 - sum(&mut used.iter().map(|score| score.nis)) / whole.max(f64::MIN_POSITIVE),
        nis_weighed: something / degrees.max(1.0),
        of_nothing,
        nis_share_of_nothing: nothing / (something + nothing).max(f64::MIN_POSITIVE),
    }
}

/// What each robot's agent is to be told.
fn files(
    agents: &BTreeMap<RobotId, AgentConfig>,
    tuned: &Levels,
    clutter: Option<(f64, f64)>,
) -> Vec<(String, NoiseFile)> {
    let file = |(robot, agent): (&RobotId, &AgentConfig)| {
        let mut noise = NoiseFile {
            filter: agent.filter.clone(),
            motion: agent.motion.clone(),
            sensors: agent.sensors.clone(),
            calibration: None,
        };
        noise.filter.clutter = clutter.map(|(share, reach_m)| pleiad_agent::config::ClutterSection {
            share,
            reach_m,
            misnamed: 0.0,
        });
        levels::write(&tuned.rounded(), &mut noise.motion, &mut noise.sensors);
        (robot.to_string(), noise)
    };
    agents.iter().map(file).collect()
}

/// One file where all robots are told the same; under the name "all".
fn merged(noise: BTreeMap<String, String>) -> BTreeMap<String, String> {
    let mut texts = noise.values();
    match texts.next() {
        Some(first) if texts.all(|text| text == first) => BTreeMap::from([(ALL.to_owned(), first.clone())]),
        _ => noise,
    }
}

/// Key of the noise that is every robot's.
pub const ALL: &str = "all";

/// Writes the noise found; of robots that are told different things, a file each.
pub fn write(out: &Path, json: &TuneJson) -> anyhow::Result<()> {
    for (robot, text) in &json.noise {
        let path = if robot == ALL { out.to_owned() } else { beside(out, robot) };
        let text = format!(
            "# Noise levels under which {} is likeliest:\n# {}\n\n{text}",
            json.recording, json.command
        );
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// `NAME-rN.toml` for `NAME.toml`, as a recording keeps them.
fn beside(out: &Path, robot: &str) -> PathBuf {
    let stem = out.file_stem().map_or_else(|| "noise".into(), |stem| stem.to_string_lossy().into_owned());
    out.with_file_name(format!("{stem}-r{robot}.toml"))
}

//! The page of `pleiad slam`: a scenario over seeds, or the robots of a recording one by one.

use std::fmt::Write as _;

use pleiad_estimation::Pose2;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::slam::Association;
use pleiad_estimation::statistics::{Alignment, PosePair, alignment_se2};
use pleiad_report::Table;
use pleiad_sim_peers::Scenario;
use serde_json::{Map, Value, json};

use super::input::{Luck, SlamInput};
use super::judge::Associated;
use super::page::{LikenessSeries, error_figure, likeness_figure, map_figure, sigma_figure};
use super::run::{Ran, RunOptions, per_dimension, pose_error, run, seen_map_error};
use super::theorems::{likeness_of, over_limit};
use crate::error::SurveyError;
use crate::monte_carlo::{Estimate, over_seeds, share};
use crate::study::{Shown, Study};

/// Every so many scans the correlations of the map are looked at.
const LIKENESS_EVERY: usize = 8;

/// What `pleiad slam` was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// How the filter is run.
    pub options: RunOptions,
    /// How many seeds of a scenario.
    pub seeds: usize,
    /// The first of them.
    pub first_seed: u64,
}

/// A page, and its lines for people.
#[derive(Clone, Debug)]
pub struct SlamPage {
    /// The page; it makes no claims.
    pub study: Study,
    /// The same in text.
    pub text: String,
}

/// A run, judged.
struct Judged {
    ran: Ran,
    known: Ran,
    likeness: LikenessSeries,
    pose_nees: Option<f64>,
    map_nees: Option<f64>,
}

fn judged(input: &SlamInput, options: &RunOptions) -> Result<Judged, SurveyError> {
    let mut likeness = LikenessSeries::new();
    let (mut scans, mut errors) = (0_usize, None);
    let ran = run(input, options, |slam, time, births| {
        if scans.is_multiple_of(LIKENESS_EVERY)
            && let Some(found) = likeness_of(slam)
        {
            likeness.push((time, found));
        }
        scans += 1;
        if let Some(truth) = input.recorded.truth_at(time, 0.3) {
            errors = Some((
                per_dimension(&pose_error(slam, &truth)),
                seen_map_error(slam, &truth, births, &input.landmarks).as_ref().and_then(per_dimension),
            ));
        }
    })?;
    // The reference knows its landmarks by name, too.
    let known = RunOptions { known: true, association: Association::Identity, ..*options };
    let known = run(input, &known, |_, _, _| {})?;
    let (pose_nees, map_nees) = errors.unwrap_or_default();
    Ok(Judged { ran, known, likeness, pose_nees, map_nees })
}

/// The numbers of one run.
fn numbers(input: &SlamInput, judged: &Judged) -> Map<String, Value> {
    let Judged { ran, known, pose_nees, map_nees, .. } = judged;
    let limit = over_limit(input, &ran.slam);
    let likeness = likeness_of(&ran.slam);
    let object = json!({
        "robot": input.robot.0,
        "scans": ran.moments.len(),
        "landmarks": ran.map.len(),
        "landmarks_there": input.landmarks.len(),
        "trajectory_error_m": ran.trajectory_error_m(Alignment::None),
        "trajectory_error_aligned_m": ran.trajectory_error_m(Alignment::Se2),
        "trajectory_error_known_landmarks_m": known.trajectory_error_m(Alignment::None),
        "map_error_m": ran.map_error_m(Alignment::None),
        "map_error_aligned_m": ran.map_error_m(Alignment::Se2),
        "nis_per_dof": ran.mean_nis(),
        "nis_per_dof_known_landmarks": known.mean_nis(),
        "pose_nees_per_dof_at_end": pose_nees,
        "map_nees_per_dof_at_end": map_nees,
        "associated": ran.associated,
        "least_correlation_at_end": likeness.map(|like| like.least_correlation),
        "largest_distance_sigma_at_end_m": likeness.map(|like| like.distance_sigma_m),
        "landmark_sigma_at_end_m": limit.map(|limit| limit.sigma_m),
        "landmark_sigma_limit_m": limit.map(|limit| limit.limit_sigma_m),
        "least_over_limit": limit.map(|limit| limit.least),
        "refused_samples": ran.refused,
        "most_waiting_poses": ran.most_waiting_poses,
    });
    if let Value::Object(map) = object { map } else { Map::new() }
}

/// The motion of the whole map that takes it to the truth.
fn alignment(ran: &Ran) -> Pose2 {
    let pose = |p: nalgebra::Vector2<f64>| Pose2::new(p.x, p.y, 0.0);
    let pairs: Vec<PosePair> = ran
        .map
        .iter()
        .filter_map(|mapped| {
            let time = pleiad_estimation::Timestamp(0);
            Some(PosePair { time, estimate: pose(mapped.position), truth: pose(mapped.truth?) })
        })
        .collect();
    alignment_se2(&pairs).unwrap_or_default()
}

fn lead(options: &RunOptions) -> String {
    let association = match options.association {
        Association::Identity => "by the names that sightings carry",
        Association::Nearest => "without names, by nearest neighbour under a gate",
        Association::Joint => {
            "without names, jointly over time: several maps side by side, until sightings tell which is right"
        }
    };
    let measured = if options.without_ranges { "bearings alone" } else { "ranges and bearings" };
    let form = match options.form {
        ErrorForm::Invariant => "right-invariant",
        ErrorForm::Additive => "additive",
    };
    format!(
        "EKF SLAM (Dissanayake, Newman, Clark, Durrant-Whyte, Csorba 2001): vehicle and landmarks in one state, nothing \
         known of the map beforehand. Measured: {measured}. Landmarks are told apart {association}. Error: {form}."
    )
}

fn figures(input: &SlamInput, judged: &Judged, aligned: &Pose2, whose: &str) -> Vec<Shown> {
    let ran = &judged.ran;
    let limit_m = over_limit(input, &ran.slam).map(|limit| limit.limit_sigma_m);
    let moved = if *aligned == Pose2::identity() { "as it is" } else { "moved as a whole onto the true one" };
    vec![
        Shown::Figure(
            map_figure(input, ran, aligned),
            format!(
                "{whose}: the map and the way, {moved}. Ellipses hold 95 %; their common part is what the start was not known by."
            ),
        ),
        Shown::Figure(
            sigma_figure(ran, limit_m),
            format!(
                "{whose}: every landmark's standard deviation falls towards what the vehicle's first \
                 covariance leaves it. Noise of the wheels between the start and the first sightings keeps it above."
            ),
        ),
        Shown::Figure(
            likeness_figure(&judged.likeness),
            format!(
                "{whose}: errors of the landmarks become one error, a shift and a turn of the whole map. A turn moves \
                 opposite landmarks opposite ways, so that coordinates may be anticorrelated; the distance of two landmarks is free \
                 of it. Jumps are landmarks that enter the map."
            ),
        ),
        Shown::Figure(
            error_figure(ran),
            format!("{whose}: errors of the vehicle with three standard deviations."),
        ),
    ]
}

fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// `pleiad slam SCENARIO`.
///
/// # Errors
/// A scenario that cannot be simulated, or an estimate that is not finite.
pub fn on_scenario(scenario: &Scenario, asked: &Asked) -> Result<SlamPage, SurveyError> {
    let seeds: Vec<u64> = (0..asked.seeds as u64).map(|k| asked.first_seed + k).collect();
    let first_seed = asked.first_seed;
    let all = over_seeds(&seeds, |seed| {
        let input = SlamInput::simulated(scenario, seed, Luck::Drawn)?;
        let judged = judged(&input, &asked.options)?;
        let numbers = numbers(&input, &judged);
        Ok::<_, SurveyError>((
            numbers,
            judged.ran.associated,
            (seed == first_seed).then_some((input, judged)),
        ))
    })?;
    let mut text = format!("{}: {} seeds from {first_seed}\n\n", scenario.name, seeds.len());
    let mut table = Table::new(
        "Means over the seeds with 95 % intervals (Student). Map as it is: with the error of the told start.",
        ["", "mean", "95 % interval", "one run's spread"],
    )
    .numeric();
    let rows = [
        ("landmarks in the map", "landmarks", 1),
        ("position error of the vehicle, m", "trajectory_error_m", 3),
        ("the same with landmarks known, m", "trajectory_error_known_landmarks_m", 3),
        ("error of the map as it is, m", "map_error_m", 3),
        ("error of the map moved as a whole, m", "map_error_aligned_m", 3),
        ("NIS per degree of freedom", "nis_per_dof", 3),
        ("NEES of the pose at the end, per degree of freedom", "pose_nees_per_dof_at_end", 2),
        (
            "NEES of the map as the vehicle sees it, at the end, per degree of freedom",
            "map_nees_per_dof_at_end",
            2,
        ),
        ("standard deviation of a landmark at the end, m", "landmark_sigma_at_end_m", 4),
        ("its limit, m", "landmark_sigma_limit_m", 4),
        ("least covariance over its limit", "least_over_limit", 4),
        ("least correlation of two landmarks at the end", "least_correlation_at_end", 5),
    ];
    let mut summary = Map::new();
    for (words, key, decimals) in rows {
        let values: Vec<f64> =
            all.iter().filter_map(|(numbers, ..)| numbers.get(key).and_then(Value::as_f64)).collect();
        let estimate = Estimate::of(&values);
        let mean = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let interval = estimate.map_or("-".to_owned(), |estimate| {
            format!("{:.decimals$} to {:.decimals$}", estimate.interval[0], estimate.interval[1])
        });
        let spread = number(estimate.map(|estimate| estimate.spread), decimals);
        let _ = writeln!(text, "{words:74} {:>10}  {interval}", number(mean, decimals));
        table = table.row([words.to_owned(), number(mean, decimals), interval, spread]);
        summary.insert(key.to_owned(), json!({ "mean": mean, "estimate": estimate }));
    }
    let associated = all.iter().fold(Associated::default(), |sum, (_, one, _)| sum.plus(*one));
    let said = association_words(&associated);
    let _ = writeln!(text, "{said}");
    summary.insert("associated".into(), json!(associated));
    summary.insert("seeds".into(), all.iter().map(|(numbers, ..)| Value::Object(numbers.clone())).collect());
    let mut shown = vec![Shown::Table(table), Shown::Prose(said)];
    for (_, _, kept) in &all {
        if let Some((input, judged)) = kept {
            shown.extend(figures(input, judged, &Pose2::identity(), &format!("Seed {first_seed}")));
        }
    }
    let study = Study {
        name: super::NAME,
        title: format!("SLAM: {}", scenario.name),
        lead: lead(&asked.options),
        claims: Vec::new(),
        shown,
        numbers: summary,
    };
    Ok(SlamPage { study, text })
}

/// How sightings found their landmarks, in words.
fn association_words(associated: &Associated) -> String {
    let [low, high] = share(associated.right, associated.decided());
    format!(
        "Associations: {} right, {} wrong, {} landmarks founded a second time: {:.2} % right (95 % interval {:.2} to {:.2} %, as if \
         independent); {} ambiguous, {} rejected, {} bearings waited.",
        associated.right,
        associated.wrong,
        associated.again,
        100.0 * associated.right as f64 / associated.decided().max(1) as f64,
        100.0 * low,
        100.0 * high,
        associated.ambiguous,
        associated.rejected,
        associated.waiting
    )
}

/// `pleiad slam RECORDING`: every robot alone, beside the same filter told of the landmarks.
///
/// # Errors
/// An estimate that is not finite.
pub fn on_recording(name: &str, inputs: &[SlamInput], options: &RunOptions) -> Result<SlamPage, SurveyError> {
    let indices: Vec<u64> = (0..inputs.len() as u64).collect();
    let all = over_seeds(&indices, |index| {
        let input = &inputs[usize::try_from(index).unwrap_or(0)];
        let judged = judged(input, options)?;
        Ok::<_, SurveyError>((numbers(input, &judged), judged))
    })?;
    let header = [
        "robot",
        "landmarks",
        "map (m)",
        "map moved (m)",
        "way (m)",
        "way moved (m)",
        "known map: way (m)",
        "NIS",
        "right",
        "wrong",
        "twice",
        "rejected",
    ];
    let mut table = Table::new(
        "Every robot alone. Root mean square errors; moved: after the motion of the whole that fits best. Known map: the same \
         filter on the same samples, told where the landmarks are.",
        header,
    )
    .numeric();
    let mut text = format!("{name}: every robot alone\n\n");
    let widths = [5, 9, 7, 13, 7, 13, 18, 6, 7, 6, 6, 8];
    let line = |cells: &[String]| {
        cells.iter().zip(widths).map(|(cell, width)| format!("{cell:>width$}")).collect::<Vec<_>>().join("  ")
    };
    let _ = writeln!(text, "{}", line(&header.map(ToOwned::to_owned)));
    let mut robots = Vec::new();
    let mut shown = Vec::new();
    for (input, (numbers, judged)) in inputs.iter().zip(&all) {
        let of = |key: &str| number(numbers.get(key).and_then(Value::as_f64), 3);
        let associated = &judged.ran.associated;
        let cells = [
            input.robot.to_string(),
            format!("{} of {}", judged.ran.map.len(), input.landmarks.len()),
            of("map_error_m"),
            of("map_error_aligned_m"),
            of("trajectory_error_m"),
            of("trajectory_error_aligned_m"),
            of("trajectory_error_known_landmarks_m"),
            number(judged.ran.mean_nis(), 2),
            associated.right.to_string(),
            associated.wrong.to_string(),
            associated.again.to_string(),
            associated.rejected.to_string(),
        ];
        let _ = writeln!(text, "{}", line(&cells));
        table = table.row(cells);
        robots.push(Value::Object(numbers.clone()));
        shown.extend(figures(input, judged, &alignment(&judged.ran), &format!("Robot {}", input.robot)));
    }
    let mut summary = Map::new();
    let keys = [
        "map_error_m",
        "map_error_aligned_m",
        "trajectory_error_m",
        "trajectory_error_aligned_m",
        "trajectory_error_known_landmarks_m",
    ];
    for key in keys {
        let values: Vec<f64> =
            all.iter().filter_map(|(numbers, _)| numbers.get(key).and_then(Value::as_f64)).collect();
        let mean = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let _ = writeln!(text, "mean {key}: {}", number(mean, 3));
        summary.insert(format!("mean_{key}"), json!(mean));
    }
    summary.insert("robots".into(), Value::Array(robots));
    shown.insert(0, Shown::Table(table));
    let study = Study {
        name: super::NAME,
        title: format!("SLAM: {name}"),
        lead: lead(options),
        claims: Vec::new(),
        shown,
        numbers: summary,
    };
    Ok(SlamPage { study, text })
}

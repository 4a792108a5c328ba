//! What many runs say of each variant.

use pleiad_estimation::statistics::{NeesSummary, NisSummary, Whiteness};
use pleiad_estimation::strategy::Deviation;
use serde::Serialize;

use super::trial::{Look, Score, Trial};
use crate::cli::VariantArg;

/// The probability that a consistent filter is outside an interval at any of the times judged.
const ALPHA: f64 = 0.01;

/// A variant over all runs.
#[derive(Debug, Serialize)]
pub struct Row {
    pub variant: String,
    /// NEES of the whole team per dimension, in the coordinates of the filter; per time, in the second half, and where a
    /// consistent filter has it at every time with 99 %.
    pub joint_anees: Vec<Option<f64>>,
    pub joint_anees_second_half: Option<f64>,
    pub joint_anees_interval: Option<(f64, f64)>,
    /// Looks where the covariance is not positive definite.
    pub undefined: usize,
    /// The same with the motion common to the team taken apart from that of each robot.
    pub apart_anees: Vec<Option<f64>>,
    pub apart_anees_second_half: Option<f64>,
    /// Of the robots by themselves, all together; their errors are correlated, so that there is no interval.
    pub robot_anees_second_half: Option<f64>,
    /// Root mean square over runs and robots, per time.
    pub position_rmse_m: Vec<f64>,
    pub heading_rmse_rad: Vec<f64>,
    /// In the second half, with its standard error over the runs, and over that of the first variant.
    pub position_rmse_second_half_m: f64,
    pub position_rmse_error_m: f64,
    pub position_rmse_ratio: f64,
    pub heading_rmse_second_half_rad: f64,
    /// Innovations.
    pub nis_per_degree: Option<f64>,
    pub nis_interval_95: Option<(f64, f64)>,
    pub rejected_percent: f64,
    pub whiteness: Option<f64>,
    pub whiteness_bound_95: Option<f64>,
    /// Seconds of folding for a look, on average.
    pub seconds_per_look: f64,
}

pub fn rows(variants: &[VariantArg], trials: &[Trial]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for (index, variant) in variants.iter().enumerate() {
        let scores: Vec<&Score> = trials.iter().map(|trial| &trial.scores[index]).collect();
        let mut row = row(&variant.name, &scores);
        let first =
            rows.first().map_or(row.position_rmse_second_half_m, |row| row.position_rmse_second_half_m);
        row.position_rmse_ratio = row.position_rmse_second_half_m / first;
        rows.push(row);
    }
    rows
}

fn row(variant: &str, scores: &[&Score]) -> Row {
    let times = scores.first().map_or(0, |score| score.looks.len());
    let late = times / 2;
    let joint = nees(scores, |look| Some(look.joint.clone()));
    let apart = nees(scores, |look| look.apart.clone());
    let robots = scores.first().and_then(|score| score.looks.first()).map_or(0, |look| look.robots.len());
    let own: Vec<Option<f64>> = (0..robots)
        .map(|robot| second_half(nees(scores, |look| Some(look.robots[robot].clone())).as_ref()))
        .collect();
    let rmse = |time: usize, of: fn(&Look) -> f64| {
        (scores.iter().map(|score| of(&score.looks[time])).sum::<f64>() / scores.len() as f64).sqrt()
    };
    // Mean squares of the second half, one for each run.
    let squares = |of: fn(&Look) -> f64| -> Vec<f64> {
        let of_run = |score: &&Score| {
            let looks = &score.looks[late..];
            looks.iter().map(of).sum::<f64>() / looks.len() as f64
        };
        scores.iter().map(of_run).collect()
    };
    let (position, heading) = (squares(|look| look.position_m2), squares(|look| look.heading_rad2));
    let count = scores.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let root = mean(&position).sqrt();
    let variance = position.iter().map(|value| (value - root * root).powi(2)).sum::<f64>() / (count - 1.0);
    let nis = NisSummary::from_values(scores.iter().flat_map(|score| score.nis.iter().copied()));
    let white =
        Whiteness::from_streams(scores.iter().flat_map(|score| score.streams.iter().map(Vec::as_slice)));
    let measured: usize = scores.iter().map(|score| score.nis.len()).sum();
    let rejected: usize = scores.iter().map(|score| score.rejected).sum();
    let per_time = |summary: &Option<NeesSummary>| -> Vec<Option<f64>> {
        summary.iter().flat_map(|summary| &summary.times).map(|time| time.anees).collect()
    };
    Row {
        variant: variant.to_owned(),
        joint_anees: per_time(&joint),
        joint_anees_second_half: second_half(joint.as_ref()),
        joint_anees_interval: joint.as_ref().and_then(|joint| Some(joint.times.first()?.interval)),
        undefined: joint.iter().flat_map(|joint| &joint.times).map(|time| time.undefined).sum(),
        apart_anees: per_time(&apart),
        apart_anees_second_half: second_half(apart.as_ref()),
        robot_anees_second_half: own
            .iter()
            .copied()
            .collect::<Option<Vec<f64>>>()
            .map(|own| own.iter().sum::<f64>() / robots.max(1) as f64),
        position_rmse_m: (0..times).map(|time| rmse(time, |look| look.position_m2)).collect(),
        heading_rmse_rad: (0..times).map(|time| rmse(time, |look| look.heading_rad2)).collect(),
        position_rmse_second_half_m: root,
        position_rmse_error_m: (variance / count).sqrt() / (2.0 * root),
        position_rmse_ratio: 1.0,
        heading_rmse_second_half_rad: mean(&heading).sqrt(),
        nis_per_degree: nis.map(|nis| nis.mean_per_degree),
        nis_interval_95: nis.map(|nis| nis.interval_95),
        rejected_percent: 100.0 * rejected as f64 / measured.max(1) as f64,
        whiteness: white.map(|white| white.correlation),
        whiteness_bound_95: white.map(|white| white.bound_95),
        seconds_per_look: scores.iter().map(|score| score.seconds).sum::<f64>() / count / times.max(1) as f64,
    }
}

fn nees(scores: &[&Score], of: impl Fn(&Look) -> Option<Deviation>) -> Option<NeesSummary> {
    let runs: Option<Vec<Vec<Deviation>>> =
        scores.iter().map(|score| score.looks.iter().map(&of).collect()).collect();
    NeesSummary::from_runs(&runs?, ALPHA)
}

/// The mean over the times of the second half; `None` where it is undefined at one of them.
fn second_half(summary: Option<&NeesSummary>) -> Option<f64> {
    let times = &summary?.times;
    let late = &times[times.len() / 2..];
    let sum: Option<f64> = late.iter().map(|time| time.anees).sum();
    Some(sum? / late.len() as f64)
}

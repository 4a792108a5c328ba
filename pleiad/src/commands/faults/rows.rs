//! The table: what the runs of one strategy at one level have in common.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_estimation::statistics::NeesSummary;
use pleiad_estimation::strategy::{Deviation, StrategyKind};
use serde::Serialize;

use super::run::RunScore;

/// Probability that a consistent filter fails in a row, corrected within it for the number of times.
const ALPHA: f64 = 0.05;

/// One row of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub strategy: &'static str,
    pub loss_percent: f64,
    pub burst: f64,
    pub seeds: usize,
    /// Mean over the seeds of the root mean square position error of the online estimates.
    pub position_rmse_during_m: Option<f64>,
    /// Standard error of that mean.
    pub position_rmse_during_error_m: Option<f64>,
    pub position_rmse_end_m: Option<f64>,
    pub position_rmse_healed_m: Option<f64>,
    pub position_rmse_healed_error_m: Option<f64>,
    /// The same strategy on the same worlds without any fault, in the time of the fault.
    pub lossless_rmse_m: Option<f64>,
    pub lossless_rmse_healed_m: Option<f64>,
    /// Mean over the judged times; none where it is undefined.
    pub joint_anees: Option<f64>,
    /// At one time, for a consistent filter; corrected for the number of times.
    pub joint_anees_interval: Option<(f64, f64)>,
    /// Whether it was in the interval at every time.
    pub joint_consistent: Option<bool>,
    /// Runs and times at which the joint covariance was unknown or indefinite, of all.
    pub joint_undefined_percent: f64,
    /// Least over greatest eigenvalue of the joint covariance, the worst of all runs.
    pub joint_least_eigenvalue_share: Option<f64>,
    pub robot_anees: Vec<Option<f64>>,
    pub robot_anees_interval: Option<(f64, f64)>,
    /// Of the exact strategy the largest difference to the oracle over the accepted facts, of any number of
    /// any replica; of the others the distance of the final positions to those of the exact strategy without
    /// faults, m.
    pub oracle_difference_healed: Option<f64>,
    /// Whether the replicas of the exact strategy ended with the same bits.
    pub replicas_identical: Option<bool>,
    pub facts_lost: Option<u64>,
    pub facts_counted_twice: u64,
    pub facts_pending: u64,
    /// Updates of pairs whose factors were of different versions.
    pub disagreements: u64,
    /// Messages that the codec refused.
    pub messages_refused: u64,
    /// Mean of a run.
    pub messages: f64,
    pub bytes: f64,
    pub bytes_per_relative_observation: Option<f64>,
}

/// Mean and its standard error.
fn mean(values: impl Iterator<Item = Option<f64>>) -> (Option<f64>, Option<f64>) {
    let values: Vec<f64> = values.flatten().collect();
    if values.is_empty() {
        return (None, None);
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let spread = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
    let error = (values.len() > 1).then(|| (spread / (count - 1.0) / count).sqrt());
    (Some(mean), error)
}

/// NEES across runs at the judged times; runs where it is unknown count as undefined.
fn nees<'a>(runs: impl Iterator<Item = &'a [Option<Deviation>]>) -> (Option<NeesSummary>, usize, usize) {
    let runs: Vec<&[Option<Deviation>]> = runs.collect();
    let all: usize = runs.iter().map(|run| run.len()).sum();
    // Where a run has no joint covariance at a time, the statistic of that time rests on the others.
    let complete: Vec<Vec<Deviation>> =
        runs.iter().filter_map(|run| run.iter().cloned().collect::<Option<Vec<_>>>()).collect();
    let missing = all - complete.iter().map(Vec::len).sum::<usize>();
    let summary = NeesSummary::from_runs(&complete, ALPHA);
    let indefinite =
        summary.iter().flat_map(|summary| &summary.times).map(|time| time.undefined).sum::<usize>();
    (summary, missing + indefinite, all)
}

/// The row of one strategy at one level; `lossless` are its runs without any fault, `truth` those of the
/// exact strategy without any, all in the order of the seeds.
pub fn row(
    kind: StrategyKind,
    (loss_percent, burst): (f64, f64),
    runs: &[RunScore],
    lossless: &[RunScore],
    exact: &[RunScore],
) -> Row {
    let (during, during_error) = mean(runs.iter().map(|run| run.rmse_during_m));
    let (healed, healed_error) = mean(runs.iter().map(|run| run.rmse_healed_m));
    let (joint, undefined, all) = nees(runs.iter().map(|run| run.joint.as_slice()));
    let joint = joint.filter(|_| undefined < all);
    let mut robots: BTreeMap<RobotId, Vec<&[Option<Deviation>]>> = BTreeMap::new();
    for (robot, deviations) in runs.iter().flat_map(|run| &run.robots) {
        robots.entry(*robot).or_default().push(deviations);
    }
    let robots: Vec<Option<NeesSummary>> =
        robots.into_values().map(|runs| nees(runs.into_iter()).0).collect();
    let difference = |(run, exact): (&RunScore, &RunScore)| {
        let apart = run
            .last
            .iter()
            .filter_map(|(robot, pose)| Some((exact.last.get(robot)?.position() - pose.position()).norm()));
        apart.fold(0.0, f64::max)
    };
    let oracle = if kind == StrategyKind::Exact {
        runs.iter().filter_map(|run| run.oracle_difference).max_by(f64::total_cmp)
    } else {
        runs.iter().zip(exact).map(difference).max_by(f64::total_cmp)
    };
    let count = runs.len() as f64;
    let bytes = runs.iter().map(|run| run.bytes as f64).sum::<f64>();
    let relative: u64 = if kind == StrategyKind::Exact {
        // Every replica counts all facts.
        runs.iter().map(|run| run.counts.relative / run.robots.len().max(1) as u64).sum()
    } else {
        runs.iter().map(|run| run.counts.relative).sum()
    };
    Row {
        strategy: kind.name(),
        loss_percent,
        burst,
        seeds: runs.len(),
        position_rmse_during_m: during,
        position_rmse_during_error_m: during_error,
        position_rmse_end_m: mean(runs.iter().map(|run| run.rmse_end_m)).0,
        position_rmse_healed_m: healed,
        position_rmse_healed_error_m: healed_error,
        lossless_rmse_m: mean(lossless.iter().map(|run| run.rmse_during_m)).0,
        lossless_rmse_healed_m: mean(lossless.iter().map(|run| run.rmse_healed_m)).0,
        joint_anees: joint.as_ref().and_then(|joint| joint.overall),
        joint_anees_interval: joint.as_ref().and_then(|joint| Some(joint.times.first()?.interval)),
        joint_consistent: joint.as_ref().map(NeesSummary::is_consistent),
        joint_undefined_percent: if all == 0 { 100.0 } else { 100.0 * undefined as f64 / all as f64 },
        joint_least_eigenvalue_share: runs
            .iter()
            .filter_map(|run| run.least_definiteness)
            .min_by(f64::total_cmp),
        robot_anees: robots.iter().map(|robot| robot.as_ref().and_then(|robot| robot.overall)).collect(),
        robot_anees_interval: robots
            .iter()
            .flatten()
            .next()
            .and_then(|robot| Some(robot.times.first()?.interval)),
        oracle_difference_healed: oracle,
        replicas_identical: runs.iter().map(|run| run.identical).try_fold(true, |all, one| Some(all && one?)),
        facts_lost: runs.iter().map(|run| run.facts_lost).try_fold(0, |all, one| Some(all + one?)),
        facts_counted_twice: runs.iter().map(|run| run.facts_counted_twice).sum(),
        facts_pending: runs.iter().map(|run| run.facts_pending).sum(),
        disagreements: runs.iter().map(|run| run.counts.disagreed).sum(),
        messages_refused: runs.iter().map(|run| run.refused_messages).sum(),
        messages: runs.iter().map(|run| run.messages as f64).sum::<f64>() / count,
        bytes: bytes / count,
        bytes_per_relative_observation: (relative > 0).then(|| bytes / relative as f64),
    }
}

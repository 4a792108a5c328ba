//! How well a team was localized: estimates against ground truth, innovations against chi-square.

use std::collections::BTreeMap;

use pleiad_agent::SettledEstimate;
use pleiad_agent::results::AgentSummary;
use pleiad_estimation::fact::{Absolute, Entry, Quantity};
use pleiad_estimation::fold::{Fact, Outcome};
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Relative;
use pleiad_estimation::statistics::{NisSummary, PosePair, heading_rmse_rad};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_recording::Recording;
use pleiad_report::{
    Accuracy, FactCount, Landmark, NisPoint, NisSeries, RobotScore, RobotSeries, TeamSeries,
};
use serde::Serialize;

use crate::commands::Survived;
use crate::setup::TRUTH_GAP_S;

/// What one robot's agent left behind, from whichever process.
pub struct RobotResult {
    pub settled: Vec<SettledEstimate>,
    pub online: Vec<SettledEstimate>,
    pub summary: AgentSummary,
}

/// What a run left behind.
pub struct RunResult {
    pub robots: BTreeMap<RobotId, RobotResult>,
    /// All facts, as one of the robots held them at the end (all the same, or it is said in `notes`); `None`
    /// where the strategy keeps none.
    pub ledger: Option<Ledger>,
    pub notes: Vec<String>,
    /// Wall-clock seconds of the run itself.
    pub wall_s: f64,
    /// Agent processes; 0 if all ran in this one.
    pub processes: usize,
    /// What the processes came through, if something was to go wrong.
    pub survived: Option<Survived>,
}

impl RunResult {
    /// All entries held.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> + Clone {
        self.ledger.iter().flat_map(|ledger| {
            let logs: Vec<_> = ledger.digests().map(|digest| digest.log).collect();
            logs.into_iter().flat_map(|log| ledger.entries(log, 0))
        })
    }
}

/// Estimates with the truth at their times.
pub fn pairs(
    estimates: impl Iterator<Item = (Timestamp, Pose2)>,
    robot: RobotId,
    recording: &Recording,
) -> Vec<PosePair> {
    estimates
        .filter_map(|(time, estimate)| {
            let truth = recording.truth_at(robot, time, TRUTH_GAP_S)?;
            Some(PosePair { time, truth, estimate })
        })
        .collect()
}

fn accuracy(pairs: &[PosePair]) -> Option<Accuracy> {
    let position = pleiad_estimation::statistics::absolute_trajectory_error(
        pairs,
        pleiad_estimation::statistics::Alignment::None,
    )?;
    Some(Accuracy { position_rmse_m: position.rmse, heading_rmse_rad: heading_rmse_rad(pairs)? })
}

/// The score of one robot.
pub fn score(robot: RobotId, result: &RobotResult, recording: &Recording) -> RobotScore {
    let of = |estimates: &[SettledEstimate], pose: fn(&SettledEstimate) -> Pose2| {
        accuracy(&pairs(estimates.iter().map(|estimate| (estimate.time, pose(estimate))), robot, recording))
    };
    RobotScore {
        robot,
        distance_m: result.summary.distance_m,
        settled: of(&result.settled, |estimate| estimate.pose),
        online: of(&result.online, |estimate| estimate.pose),
        dead_reckoning: of(&result.settled, |estimate| estimate.nominal),
    }
}

/// The mean over robots of a root mean square position error.
pub fn mean_position_rmse_m<'a>(
    scores: impl Iterator<Item = &'a RobotScore>,
    which: impl Fn(&RobotScore) -> Option<Accuracy>,
) -> Option<f64> {
    let values: Vec<f64> = scores.filter_map(which).map(|accuracy| accuracy.position_rmse_m).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The series a report draws.
pub fn series(result: &RunResult, recording: &Recording, start: Timestamp) -> TeamSeries {
    let robots = result.robots.iter().map(|(robot, result)| {
        let settled = &result.settled;
        let seconds = |estimate: &SettledEstimate| estimate.time.seconds_since(start);
        RobotSeries {
            robot: *robot,
            time_s: settled.iter().map(seconds).collect(),
            estimate: settled.iter().map(|estimate| estimate.pose).collect(),
            covariance: settled.iter().map(|estimate| estimate.covariance).collect(),
            truth: settled.iter().map(|e| recording.truth_at(*robot, e.time, TRUTH_GAP_S)).collect(),
            dead_reckoning: Some(settled.iter().map(|e| (seconds(e), e.nominal)).collect()),
        }
    });
    TeamSeries { robots: robots.collect() }
}

/// The map, for a report.
pub fn landmarks(recording: &Recording) -> Vec<Landmark> {
    recording.landmarks.iter().map(|(id, [x_m, y_m])| Landmark { id: *id, x_m: *x_m, y_m: *y_m }).collect()
}

/// Root of the trace of the position covariance.
pub fn position_sigma_m(covariance: &Symmetric3) -> f64 {
    let [xx, _, yy, ..] = covariance.0;
    (xx + yy).max(0.0).sqrt()
}

/// Root mean square of the position sigma over robots and times in `[from_s, to_s]`.
pub fn team_sigma_m(result: &RunResult, start: Timestamp, from_s: f64, to_s: f64) -> Option<f64> {
    let mut squares = Vec::new();
    for robot in result.robots.values() {
        for estimate in &robot.settled {
            let seconds = estimate.time.seconds_since(start);
            if (from_s..=to_s).contains(&seconds) {
                squares.push(position_sigma_m(&estimate.covariance).powi(2));
            }
        }
    }
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// `nis` of the JSON summaries.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct NisJson {
    /// Mean of NIS per degree of freedom: 1 for a consistent filter.
    pub mean: f64,
    /// Degrees of freedom together.
    pub dof: usize,
    /// Share of innovations within the 95 % bound of their dimension.
    pub within_95: f64,
}

/// Innovations of all measurements, those that the gate refused included.
pub fn nis(ledger: &Ledger) -> NisJson {
    let residuals = ledger.facts().filter_map(|(_, record)| record.residual);
    NisSummary::from_values(residuals.map(|residual| (residual.nis, residual.dimension))).map_or(
        NisJson::default(),
        |summary| NisJson {
            mean: summary.mean_per_degree,
            dof: summary.degrees_of_freedom,
            within_95: summary.share_within_95,
        },
    )
}

fn kind(quantity: &Quantity) -> String {
    let of = |relative: &Relative| match relative {
        Relative::Pose(_) => "pose",
        Relative::Position { .. } => "position",
        Relative::Range { .. } => "range",
        Relative::Bearing { .. } => "bearing",
        Relative::RangeBearing { .. } => "range and bearing",
    };
    match quantity {
        Quantity::Robot { relative, .. } => format!("{} to a robot", of(relative)),
        Quantity::Landmark { relative, .. } => format!("{} to a landmark", of(relative)),
        Quantity::Feature { relative, .. } => format!("{} to a landmark of the team's map", of(relative)),
        Quantity::Absolute(Absolute::Position(_)) => "position fix".to_owned(),
        Quantity::Absolute(Absolute::Heading(_)) => "heading".to_owned(),
        Quantity::Absolute(Absolute::Pose(_)) => "pose in the map".to_owned(),
    }
}

/// Innovations and what became of the facts, per kind of observation.
pub fn by_kind(ledger: &Ledger, start: Timestamp) -> (Vec<NisSeries>, Vec<FactCount>) {
    let mut series: BTreeMap<String, NisSeries> = BTreeMap::new();
    let mut counts: BTreeMap<String, FactCount> = BTreeMap::new();
    for (key, record) in ledger.facts() {
        let (Fact::Observation { quantity, .. }, Some(residual)) = (&record.fact, record.residual) else {
            continue;
        };
        if residual.outcome == Outcome::Placed {
            continue;
        }
        let name = kind(quantity);
        let count = counts.entry(name.clone()).or_insert_with(|| FactCount {
            kind: name.clone(),
            used: 0,
            rejected: 0,
            pending: 0,
        });
        match residual.outcome {
            Outcome::Used | Outcome::UsedAs(_) => count.used += 1,
            Outcome::Rejected { .. } => count.rejected += 1,
            _ => {}
        }
        if residual.dimension > 0 {
            let series = series.entry(name.clone()).or_insert_with(|| NisSeries {
                name,
                degrees_of_freedom: residual.dimension,
                points: Vec::new(),
            });
            let used = matches!(residual.outcome, Outcome::Used | Outcome::UsedAs(_));
            series.points.push(NisPoint { time_s: key.time.seconds_since(start), nis: residual.nis, used });
        }
    }
    let pending: usize = ledger.pending_by_robot().values().sum();
    if pending > 0 {
        let kind = "of a robot that has not answered".to_owned();
        counts.insert(kind.clone(), FactCount { kind, used: 0, rejected: 0, pending: pending as u64 });
    }
    (series.into_values().collect(), counts.into_values().collect())
}

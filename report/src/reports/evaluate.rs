//! The report of a filter over many runs, beside variants of it.

use crate::number::duration;
use crate::{Axis, Colour, Document, Figure, ReportError, Table, Trace};

/// What the variants did.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluateReport {
    /// Of the scenario.
    pub name: String,
    /// Length of a run, s.
    pub seconds: f64,
    /// Runs.
    pub seeds: u64,
    /// When they were judged, s.
    pub times_s: Vec<f64>,
    /// One for each variant.
    pub rows: Vec<EvaluateRow>,
    /// The command that makes this report again.
    pub command: String,
}

/// A variant over all runs.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluateRow {
    /// Its name.
    pub variant: String,
    /// NEES per dimension of the whole team, per time.
    pub joint_anees: Vec<Option<f64>>,
    /// Mean of the second half.
    pub joint_anees_second_half: Option<f64>,
    /// Where a consistent filter has it.
    pub interval: Option<(f64, f64)>,
    /// With the motion common to the team taken apart.
    pub apart_anees: Vec<Option<f64>>,
    /// Mean of the second half.
    pub apart_anees_second_half: Option<f64>,
    /// Of the robots by themselves.
    pub robot_anees_second_half: Option<f64>,
    /// Per time, m.
    pub position_rmse_m: Vec<f64>,
    /// Of the second half, m.
    pub position_rmse_second_half_m: f64,
    /// Its standard error, m.
    pub position_rmse_error_m: f64,
    /// Over that of the first variant.
    pub position_rmse_ratio: f64,
    /// NIS per degree of freedom.
    pub nis_per_degree: Option<f64>,
    /// Measurements that the gate refused, percent.
    pub rejected_percent: f64,
    /// Correlation of successive innovations.
    pub whiteness: Option<f64>,
    /// Folding, ms.
    pub milliseconds: f64,
}

/// The report: table, consistency over time, error over time.
///
/// # Errors
/// None so far.
pub fn evaluate_report(report: &EvaluateReport) -> Result<Document, ReportError> {
    let anees = |name: &str| Axis::new(name, "-").logarithmic();
    let document = Document::new("Is the filter as good as it says?")
        .lead(format!(
            "{}: {} runs of {}, every variant on the same facts.",
            report.name,
            report.seeds,
            duration(report.seconds)
        ))
        .table(table(report))
        .section("Consistency")
        .prose(
            "NEES per dimension across the runs, at times fixed beforehand: 1 for a filter that is as good as it says, more \
             for one that is overconfident. The band holds a consistent filter at all times with 99 %.",
        )
        .figure(
            over_time(report, anees("joint ANEES, common motion apart"), true, |row| row.apart_anees.clone()),
            "The whole team, with the motion common to it taken apart from that of each robot.",
        )
        .figure(
            over_time(report, anees("joint ANEES, as stacked"), true, |row| row.joint_anees.clone()),
            "The whole team, errors stacked in the filter's own coordinates.",
        )
        .section("Error")
        .figure(
            over_time(report, Axis::new("position RMSE", "m").from_zero(), false, |row| {
                row.position_rmse_m.iter().copied().map(Some).collect()
            }),
            "Root mean square over runs and robots.",
        );
    Ok(document.reproduce("this report", report.command.clone()))
}

fn over_time(
    report: &EvaluateReport,
    axis: Axis,
    band: bool,
    values: impl Fn(&EvaluateRow) -> Vec<Option<f64>>,
) -> Figure {
    let mut figure = Figure::new(Axis::new("time", "s"), axis).height(380);
    let interval = report.rows.first().and_then(|row| row.interval).filter(|_| band);
    if let Some((low, high)) = interval {
        let (lower, upper) = (vec![low; report.times_s.len()], vec![high; report.times_s.len()]);
        figure = figure.trace(Trace::band("99 %", &report.times_s, &lower, &upper, Colour::Ink));
    }
    for (index, row) in report.rows.iter().enumerate() {
        let y: Vec<f64> = values(row).into_iter().map(|value| value.unwrap_or(f64::NAN)).collect();
        figure = figure.trace(Trace::line(&row.variant, &report.times_s, &y, Colour::Series(index)));
    }
    figure
}

fn table(report: &EvaluateReport) -> Table {
    let ratio = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let mut table = Table::new(
        "The second half of the runs. RMSE: position, with its standard error over the runs, and over that of the first \
         variant. ANEES: NEES per dimension, - where undefined. White: correlation of successive innovations.",
        [
            "variant",
            "RMSE m",
            "ratio",
            "joint ANEES",
            "apart",
            "robot",
            "NIS",
            "refused %",
            "white",
            "folding ms",
        ],
    )
    .numeric();
    for row in &report.rows {
        table = table.row([
            row.variant.clone(),
            format!("{:.3} ± {:.3}", row.position_rmse_second_half_m, row.position_rmse_error_m),
            format!("{:.2}", row.position_rmse_ratio),
            ratio(row.joint_anees_second_half),
            ratio(row.apart_anees_second_half),
            ratio(row.robot_anees_second_half),
            row.nis_per_degree.map_or("-".to_owned(), |value| format!("{value:.3}")),
            format!("{:.2}", row.rejected_percent),
            row.whiteness.map_or("-".to_owned(), |value| format!("{value:.3}")),
            format!("{:.1}", row.milliseconds),
        ]);
    }
    table
}

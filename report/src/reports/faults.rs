//! The report of what loss does to each strategy.

use crate::number::{bytes, duration};
use crate::{Axis, Colour, Document, Figure, ReportError, Table, Trace};

/// What the strategies did.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultsReport {
    /// Of the scenario or recording.
    pub name: String,
    /// Length of a run, s.
    pub seconds: f64,
    /// When the fault began and ended, s.
    pub fault_s: (f64, f64),
    /// Runs of each row.
    pub seeds: usize,
    /// Whether the seeds are worlds of their own.
    pub independent_worlds: bool,
    /// One for each strategy and level.
    pub rows: Vec<FaultsRow>,
    /// The command that makes this report again.
    pub command: String,
}

/// A strategy at one level of the fault.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultsRow {
    /// Its name.
    pub strategy: String,
    /// Share of messages lost, percent.
    pub loss_percent: f64,
    /// Mean number of messages lost in a row.
    pub burst: f64,
    /// Online position error during the fault, m.
    pub rmse_during_m: Option<f64>,
    /// Its standard error.
    pub rmse_during_error_m: Option<f64>,
    /// At its end.
    pub rmse_end_m: Option<f64>,
    /// After healing.
    pub rmse_healed_m: Option<f64>,
    /// Without any fault, at the time of the fault.
    pub lossless_rmse_m: Option<f64>,
    /// NEES per dimension of the whole team; `None` where there is no joint covariance.
    pub joint_anees: Option<f64>,
    /// Where it lies for a consistent filter.
    pub joint_anees_interval: Option<(f64, f64)>,
    /// Per robot.
    pub robot_anees: Vec<Option<f64>>,
    /// Where they lie for a consistent filter.
    pub robot_anees_interval: Option<(f64, f64)>,
    /// Of the exact strategy to the oracle, of the others to the exact one.
    pub oracle_difference: Option<f64>,
    /// Observations without effect at the end.
    pub facts_lost: Option<u64>,
    /// Used more than once.
    pub facts_counted_twice: u64,
    /// Still waiting at the end.
    pub facts_pending: u64,
    /// Sent in a run.
    pub bytes: f64,
}

impl FaultsRow {
    fn mean_robot_anees(&self) -> Option<f64> {
        let known: Vec<f64> = self.robot_anees.iter().flatten().copied().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }
}

/// The report: table, error by loss, consistency by loss.
///
/// # Errors
/// None so far.
pub fn faults_report(report: &FaultsReport) -> Result<Document, ReportError> {
    let (from_s, to_s) = report.fault_s;
    let mut document = Document::new("What loss does to each strategy")
        .lead(format!(
            "{}: {}, messages lost from {from_s:.0} s to {to_s:.0} s, {} seeds. Every strategy ran on the same \
             worlds over the same network.",
            report.name,
            duration(report.seconds),
            report.seeds
        ))
        .table(table(report))
        .section("Error");
    for burst in bursts(report) {
        document = document.figure(
            by_loss(report, burst, Axis::new("online position RMSE during the fault", "m").from_zero(), |row| {
                row.rmse_during_m
            }),
            format!(
                "Online position error during the fault, mean over the seeds, {}. Points that are missing are \
                 undefined.",
                burst_words(burst)
            ),
        );
    }
    document = document.section("Consistency").prose(
        "NEES per dimension, averaged over robots, times within the fault and seeds: 1 for a filter that is as good \
         as it says, more for one that is overconfident, less for a conservative one.",
    );
    for burst in bursts(report) {
        let axis = Axis::new("ANEES of a robot", "-").logarithmic();
        document = document.figure(
            by_loss(report, burst, axis, FaultsRow::mean_robot_anees),
            format!("Consistency of the robots' own estimates, {}.", burst_words(burst)),
        );
    }
    if !report.independent_worlds {
        document = document.prose(
            "A recording is one realization: its NEES describes this run, and there is no interval to hold it \
             against.",
        );
    }
    Ok(document.reproduce("this report", report.command.clone()))
}

fn burst_words(burst: f64) -> String {
    if burst > 1.0 { format!("bursts of {burst} messages on average") } else { "independent loss".to_owned() }
}

/// The burst lengths that occur with loss.
fn bursts(report: &FaultsReport) -> Vec<f64> {
    let mut bursts: Vec<f64> =
        report.rows.iter().filter(|row| row.loss_percent > 0.0).map(|row| row.burst).collect();
    bursts.sort_by(f64::total_cmp);
    bursts.dedup();
    bursts
}

fn strategies(report: &FaultsReport) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for row in &report.rows {
        if !names.contains(&row.strategy.as_str()) {
            names.push(&row.strategy);
        }
    }
    names
}

fn by_loss(
    report: &FaultsReport,
    burst: f64,
    axis: Axis,
    value: impl Fn(&FaultsRow) -> Option<f64>,
) -> Figure {
    let mut figure = Figure::new(Axis::new("messages lost", "%"), axis).height(380);
    for (index, strategy) in strategies(report).into_iter().enumerate() {
        let rows = report.rows.iter().filter(|row| {
            let same = row.burst.total_cmp(&burst).is_eq() || row.loss_percent == 0.0;
            row.strategy == strategy && same
        });
        let (x, y): (Vec<f64>, Vec<f64>) =
            rows.map(|row| (row.loss_percent, value(row).unwrap_or(f64::NAN))).unzip();
        // The exact strategy in the colour of the text, the others in those of the palette.
        let colour = if index == 0 { Colour::Ink } else { Colour::Series(index - 1) };
        figure = figure.trace(Trace::line(strategy, &x, &y, colour));
    }
    figure
}

fn table(report: &FaultsReport) -> Table {
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let ratio = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let mut table = Table::new(
        "Strategies by level of loss. RMSE: position, online, mean over the seeds with its standard error. ANEES: \
         NEES per dimension; - where undefined. Oracle: largest difference of any number for `exact`, distance to \
         `exact` in metres for the others.",
        [
            "strategy",
            "loss %",
            "burst",
            "during m",
            "at end m",
            "healed m",
            "lossless m",
            "joint ANEES",
            "interval",
            "robot ANEES",
            "oracle",
            "lost",
            "twice",
            "pending",
            "sent",
        ],
    )
    .numeric();
    for row in &report.rows {
        let during = match (row.rmse_during_m, row.rmse_during_error_m) {
            (Some(value), Some(error)) => format!("{value:.3} ± {error:.3}"),
            (value, _) => metres(value),
        };
        let interval = row.joint_anees_interval.filter(|_| report.independent_worlds);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of bytes")]
        let sent = bytes(row.bytes as u64);
        table = table.row([
            row.strategy.clone(),
            row.loss_percent.to_string(),
            row.burst.to_string(),
            during,
            metres(row.rmse_end_m),
            metres(row.rmse_healed_m),
            metres(row.lossless_rmse_m),
            ratio(row.joint_anees),
            interval.map_or("-".to_owned(), |(low, high)| format!("{low:.2} – {high:.2}")),
            ratio(row.mean_robot_anees()),
            row.oracle_difference.map_or("-".to_owned(), |value| format!("{value:.1e}")),
            row.facts_lost.map_or("-".to_owned(), |lost| lost.to_string()),
            row.facts_counted_twice.to_string(),
            row.facts_pending.to_string(),
            sent,
        ]);
    }
    table
}

//! The table for people, and the report.

use std::fmt::Write as _;

use pleiad_report::{Document, EvaluateReport, EvaluateRow, ReportError, evaluate_report};

use super::EvaluateJson;
use super::rows::Row;

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// The table for people.
pub fn text(json: &EvaluateJson) -> String {
    let mut text = format!(
        "{}: {} runs of {:.0} s, seeds {} to {}, {:.0} facts each\n\n",
        json.scenario,
        json.seeds,
        json.seconds,
        json.first_seed,
        json.first_seed + json.seeds - 1,
        json.facts
    );
    let _ = writeln!(
        text,
        "{:<14} {:>15} {:>6} {:>9}  {:>7} {:>7} {:>7}  {:>6} {:>9} {:>7} {:>8}",
        "second half:",
        "RMSE m",
        "ratio",
        "heading",
        "joint",
        "apart",
        "robot",
        "NIS",
        "refused %",
        "white",
        "ms"
    );
    for row in &json.rows {
        let rmse = format!("{:.3} ± {:.3}", row.position_rmse_second_half_m, row.position_rmse_error_m);
        let _ = writeln!(
            text,
            "{:<14} {:>15} {:>6.2} {:>9.4}  {:>7} {:>7} {:>7}  {:>6} {:>9.2} {:>7} {:>8.1}",
            row.variant,
            rmse,
            row.position_rmse_ratio,
            row.heading_rmse_second_half_rad,
            number(row.joint_anees_second_half, 2),
            number(row.apart_anees_second_half, 2),
            number(row.robot_anees_second_half, 2),
            number(row.nis_per_degree, 3),
            row.rejected_percent,
            number(row.whiteness, 3),
            1e3 * row.seconds_per_look
        );
    }
    let interval = |row: &Row| {
        let (low, high) = row.joint_anees_interval?;
        Some(format!("{low:.2} to {high:.2}"))
    };
    let _ = writeln!(
        text,
        "\njoint, apart, robot: NEES per dimension, mean over the times of the second half (1 for a consistent filter); of the \
         whole team at one time {} with 99 %\napart: the motion common to the team taken apart from that of each robot \
         (docs/theory.md)\nwhite: correlation of successive innovations of one sensor and target, {} with 95 %",
        json.rows.first().and_then(interval).unwrap_or_else(|| "-".to_owned()),
        number(json.rows.first().and_then(|row| row.whiteness_bound_95), 3),
    );
    let _ = writeln!(text, "report: {}/report.html", json.out);
    text
}

/// The report.
pub fn page(json: &EvaluateJson) -> Result<Document, ReportError> {
    let rows = json.rows.iter().map(|row| EvaluateRow {
        variant: row.variant.clone(),
        joint_anees: row.joint_anees.clone(),
        joint_anees_second_half: row.joint_anees_second_half,
        interval: row.joint_anees_interval,
        apart_anees: row.apart_anees.clone(),
        apart_anees_second_half: row.apart_anees_second_half,
        robot_anees_second_half: row.robot_anees_second_half,
        position_rmse_m: row.position_rmse_m.clone(),
        position_rmse_second_half_m: row.position_rmse_second_half_m,
        position_rmse_error_m: row.position_rmse_error_m,
        position_rmse_ratio: row.position_rmse_ratio,
        nis_per_degree: row.nis_per_degree,
        rejected_percent: row.rejected_percent,
        whiteness: row.whiteness,
        milliseconds: 1e3 * row.seconds_per_look,
    });
    evaluate_report(&EvaluateReport {
        name: json.scenario.clone(),
        seconds: json.seconds,
        seeds: json.seeds,
        times_s: json.times_s.clone(),
        rows: rows.collect(),
        command: json.command.clone(),
    })
}

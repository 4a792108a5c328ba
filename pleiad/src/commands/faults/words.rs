//! The table for people, and the report.

use std::fmt::Write as _;

use pleiad_report::{Document, FaultsReport, FaultsRow, ReportError, faults_report};

use super::FaultsJson;

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// The table for people.
pub fn text(json: &FaultsJson) -> String {
    let mut text = format!(
        "{}: {:.0} s, fault from {:.0} to {:.0} s\n\n",
        json.input, json.seconds, json.fault_start_s, json.fault_end_s
    );
    let _ = writeln!(
        text,
        "{:<18} {:>5} {:>5}  {:>15} {:>8} {:>15} {:>8}  {:>6} {:>13} {:>6}  {:>9} {:>6} {:>6} {:>7} {:>9}",
        "strategy",
        "loss%",
        "burst",
        "RMSE during m",
        "at end",
        "healed",
        "lossless",
        "joint",
        "interval",
        "robot",
        "oracle",
        "lost",
        "twice",
        "pending",
        "kB"
    );
    for row in &json.rows {
        let with_error = |value: Option<f64>, error: Option<f64>| match (value, error) {
            (Some(value), Some(error)) => format!("{value:.3} ± {error:.3}"),
            _ => number(value, 3),
        };
        let robots: Vec<f64> = row.robot_anees.iter().flatten().copied().collect();
        let mean = (!robots.is_empty()).then(|| robots.iter().sum::<f64>() / robots.len() as f64);
        let interval =
            row.joint_anees_interval.map_or("-".to_owned(), |(low, high)| format!("{low:.2} - {high:.2}"));
        let _ = writeln!(
            text,
            "{:<18} {:>5} {:>5}  {:>15} {:>8} {:>15} {:>8}  {:>6} {:>13} {:>6}  {:>9} {:>6} {:>6} {:>7} {:>9.1}",
            row.strategy,
            row.loss_percent,
            row.burst,
            with_error(row.position_rmse_during_m, row.position_rmse_during_error_m),
            number(row.position_rmse_end_m, 3),
            with_error(row.position_rmse_healed_m, row.position_rmse_healed_error_m),
            number(row.lossless_rmse_m, 3),
            number(row.joint_anees, 2),
            interval,
            number(mean, 2),
            row.oracle_difference_healed.map_or("-".to_owned(), |value| format!("{value:.1e}")),
            row.facts_lost.map_or("-".to_owned(), |lost| lost.to_string()),
            row.facts_counted_twice,
            row.facts_pending,
            row.bytes / 1000.0
        );
    }
    text.push_str(
        "\njoint, robot: NEES per dimension across the seeds (1 for a consistent filter); -: undefined\n\
         oracle: exact: largest difference of any number of any replica; others: distance to exact, m\n",
    );
    if !json.independent_worlds {
        text.push_str("one recording is one realization: its NEES describes, and has no interval\n");
    }
    for note in &json.notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(text, "report: {}/report.html", json.out);
    text
}

/// The report.
pub fn page(json: &FaultsJson) -> Result<Document, ReportError> {
    let rows = json.rows.iter().map(|row| FaultsRow {
        strategy: row.strategy.to_owned(),
        loss_percent: row.loss_percent,
        burst: row.burst,
        rmse_during_m: row.position_rmse_during_m,
        rmse_during_error_m: row.position_rmse_during_error_m,
        rmse_end_m: row.position_rmse_end_m,
        rmse_healed_m: row.position_rmse_healed_m,
        lossless_rmse_m: row.lossless_rmse_m,
        joint_anees: row.joint_anees,
        joint_anees_interval: row.joint_anees_interval,
        robot_anees: row.robot_anees.clone(),
        robot_anees_interval: row.robot_anees_interval,
        oracle_difference: row.oracle_difference_healed,
        facts_lost: row.facts_lost,
        facts_counted_twice: row.facts_counted_twice,
        facts_pending: row.facts_pending,
        bytes: row.bytes,
    });
    faults_report(&FaultsReport {
        name: json.input.clone(),
        seconds: json.seconds,
        fault_s: (json.fault_start_s, json.fault_end_s),
        seeds: json.rows.first().map_or(0, |row| row.seeds),
        independent_worlds: json.independent_worlds,
        rows: rows.collect(),
        command: json.command.clone(),
    })
}

//! The report of a diagnosis.

mod data;
mod details;
mod page;
mod words;

pub use data::{
    Claim, DiagnoseReport, DiagnosedRecording, Evidence, Found, HorizonError, NotTested, ParameterEstimate,
    ResidualColumns, RobotRollOut, STAGES, ShapeColumns, SmallestDetectable, StageTest,
};

use crate::{Document, ReportError};

/// The report of a diagnosis: page one for whoever drives the robot, then the evidence.
///
/// # Errors
/// [`ReportError::ResidualColumns`] if the columns of a series differ in length.
pub fn diagnose_report(report: &DiagnoseReport) -> Result<Document, ReportError> {
    for series in &report.residuals {
        let found = [series.nominal.len(), series.corrected.len(), series.position_m.len()];
        check(series.robot, &series.channel, series.time_s.len(), &found)?;
    }
    for evidence in &report.evidence {
        let found = [evidence.predicted.len(), evidence.residual.len()];
        check(evidence.robot, &evidence.channel, evidence.time_s.len(), &found)?;
    }
    for shape in &report.shapes {
        check(shape.robot, &shape.channel, shape.x.len(), &[shape.residual.len()])?;
    }
    let names: Vec<&str> = report.recordings.iter().map(|recording| recording.name.as_str()).collect();
    let mut document = Document::new(format!("Diagnosis: {}", names.join(", ")));
    document = page::page_one(report, document);
    document = details::details(report, document);
    for (what, command) in &report.commands {
        document = document.reproduce(what, command);
    }
    Ok(document)
}

fn check(
    robot: pleiad_estimation::RobotId,
    channel: &str,
    expected: usize,
    found: &[usize],
) -> Result<(), ReportError> {
    match found.iter().find(|found| **found != expected) {
        Some(&found) => {
            Err(ReportError::ResidualColumns { robot, channel: channel.to_owned(), found, expected })
        }
        None => Ok(()),
    }
}

//! Below page one: the evidence.

use super::data::{DiagnoseReport, Evidence, Found};
use super::words::{heading, standing};
use crate::figures::diagnose::{
    gain_floor, partial_figure, residual_floors, roll_out_panels, series_panels, spread_figure, strip_figure,
};
use crate::number::with_interval;
use crate::{Document, Panel, Table, quantity};

/// Partial residuals shown per finding: those of the largest gain.
const PARTIALS: usize = 6;

/// Adds everything below page one.
pub(super) fn details(report: &DiagnoseReport, mut document: Document) -> Document {
    document = document.part("The evidence");
    for (index, finding) in report.findings.iter().enumerate() {
        document = evidence(index, finding, report, document);
    }
    document = residuals(report, document);
    let panels = roll_out_panels(&report.roll_outs);
    if !panels.is_empty() {
        document = document.section("Predictions over the horizon").panels(
            panels,
            "Root mean square error of the pose predicted from odometry over each horizon, at places that the fit did \
             not see. Dotted: nominal model; dashed: nominal model with its own parameters refitted; solid: corrected.",
        );
    }
    document = undetected(report, document);
    document = untestable(report, document);
    if !report.notes.is_empty() {
        document = document.section("Remarks").list(report.notes.clone());
    }
    document
}

fn evidence(index: usize, finding: &Found, report: &DiagnoseReport, mut document: Document) -> Document {
    document = document.section(format!("Finding {}", heading(index + 1, finding, &report.robots)));
    if let Some(equation) = &finding.equation {
        document = document.prose(format!("Model: `{equation}`. It shows most in {}.", finding.channel));
    }
    if !finding.parameters.is_empty() {
        document = document.table(parameters(finding));
    }
    let mut own: Vec<&Evidence> =
        report.evidence.iter().filter(|evidence| evidence.finding == index).collect();
    own.sort_by(|a, b| total(b).total_cmp(&total(a)));
    own.truncate(PARTIALS);
    let panels: Vec<Panel> = own
        .iter()
        .filter_map(|evidence| {
            let heading = crate::figures::diagnose::name_of(evidence);
            Some(Panel { heading: super::words::capital(&heading), figure: partial_figure(evidence)? })
        })
        .collect();
    document = document.panels(
        panels,
        "Partial residuals: what is left of the residual if everything but this finding is corrected, over what the \
         finding predicts there. Points around the dashed line of slope one are explained; a flat cloud is not. Large \
         points are means of twelve groups.",
    );
    if let Some(strip) = strip_figure(&own, &finding.time_s) {
        document = document.figure(
            strip,
            "When the finding earns its keep: log-likelihood gained per half second (above) and summed from the start \
             (below). An effect that is always there climbs with the driving that excites it; an event climbs once.",
        );
    }
    if let Some(floor) = gain_floor(report, finding, &own) {
        document = document.figure(
            floor,
            "Where on the floor the log-likelihood is gained, summed per square; negative sums take the first colour. \
             Grey: true path. Diamonds: landmarks.",
        );
    }
    document
}

fn total(evidence: &Evidence) -> f64 {
    evidence.gain.last().map_or(0.0, |[_, sum]| *sum)
}

fn parameters(finding: &Found) -> Table {
    let mut table = Table::new(
        format!("Parameters with 95 % confidence intervals. {}", standing(finding)),
        ["Parameter", "Estimate (95 % interval)"],
    )
    .numeric();
    for own in &finding.parameters {
        table = table.row([format!("`{}`", own.name), with_interval(own.value, own.ci95, &own.unit)]);
    }
    table
}

fn residuals(report: &DiagnoseReport, mut document: Document) -> Document {
    let Some(spread) = spread_figure(&report.residuals, &report.robots) else { return document };
    document = document.section("Residuals before and after").figure(
        spread,
        "Size of the residuals (measured minus predicted, root mean square) in units of their noise. Open: nominal model; \
         filled: corrected model. Noise alone gives 1.",
    );
    let floors = residual_floors(report);
    if !floors.is_empty() {
        document = document.panels(
            floors,
            "Size of the residuals over the floor, all robots and channels, root mean square in units of their noise, in \
             the same colours before and after. Diamonds: landmarks.",
        );
    }
    for (channel, panels) in series_panels(&report.residuals) {
        document = document.panels(
            panels,
            format!(
                "{}: residuals over time in units of their noise, under the nominal model (above) and the corrected one \
                 (below). Thinned for drawing; every peak is kept.",
                super::words::capital(&channel)
            ),
        );
    }
    document
}

fn undetected(report: &DiagnoseReport, document: Document) -> Document {
    if report.undetected.is_empty() {
        return document;
    }
    let mut table = Table::new(
        "Effects that were tested and not found, and the size from which they would have been found with a probability of \
         80 %. A smaller one can be there unseen.",
        ["Effect", "Robot", "Parameter", "Smallest detectable"],
    )
    .numeric();
    for own in &report.undetected {
        let robot = own.robot.map_or("all".to_owned(), |robot| robot.to_string());
        let unit = if own.unit == "1" { "" } else { &own.unit };
        table =
            table.row([own.title.clone(), robot, format!("`{}`", own.parameter), quantity(own.size, unit)]);
    }
    document.section("Smallest effects that would have been found").table(table)
}

fn untestable(report: &DiagnoseReport, document: Document) -> Document {
    if report.untestable.is_empty() {
        return document;
    }
    let mut table =
        Table::new("Effects that these recordings cannot show, large or small.", ["Effect", "Robot", "Why"]);
    for own in &report.untestable {
        let robot = own.robot.map_or("all".to_owned(), |robot| robot.to_string());
        table = table.row([own.title.clone(), robot, own.why.clone()]);
    }
    document.section("Not tested").table(table)
}

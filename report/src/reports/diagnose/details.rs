//! Below page one: the evidence.

use pleiad_estimation::RobotId;

use super::data::{DiagnoseReport, Evidence, Found};
use super::words::{heading, standing};
use crate::figures::diagnose::{
    gain_floor, name_of_shape, partial_figure, residual_floors, roll_out_panels, series_panels, shape_figure,
    spread_figure, strip_figure,
};
use crate::number::{two_digits, with_interval};
use crate::{Document, Panel, Table};

/// Partial residuals shown per finding: those of the largest gain.
const PARTIALS: usize = 6;

const WHEN: &str = "When the log-likelihood is gained: per half second (above) and summed from the start (below). What \
     is always there climbs with the driving that excites it; an event climbs once.";
const WHERE: &str = "Where it is gained: summed per square of the floor; losses take the first colour. Grey: true path; \
     diamonds: landmarks; outline: the region found.";

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
        let more = finding
            .effect
            .as_ref()
            .map_or(String::new(), |effect| format!(" More on it: `pleiad effects {effect}`."));
        document =
            document.prose(format!("Model: `{equation}`. It shows most in {}.{more}", finding.channel));
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
         points are means of stripes.",
    );
    let shapes = report.shapes.iter().filter(|shape| shape.finding == index).take(PARTIALS);
    let shapes = shapes.filter_map(|shape| {
        let heading = super::words::capital(&name_of_shape(shape));
        Some(Panel { heading, figure: shape_figure(shape)? })
    });
    let shapes: Vec<Panel> = shapes.collect();
    if !shapes.is_empty() {
        document = document.panels(
            shapes,
            "The same over what it depends on, with the curve that was found. Large points are means of stripes.",
        );
    }
    let when = strip_figure(&own, &finding.time_s).map(|figure| ("When", figure));
    let place = gain_floor(report, finding, &own).map(|figure| ("Where", figure));
    let caption = match (&when, &place) {
        (Some(_), None) => WHEN.to_owned(),
        (None, Some(_)) => WHERE.to_owned(),
        _ => format!("{WHEN} {WHERE}"),
    };
    let panels = [when, place].into_iter().flatten();
    let panel = |(heading, figure): (&str, _)| Panel { heading: heading.to_owned(), figure };
    document.panels(panels.map(panel).collect(), caption)
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
                 (below). Of many, the line is the mean of short runs and the band holds every one.",
                super::words::capital(&channel)
            ),
        );
    }
    document
}

/// A row per parameter, a column per robot.
fn undetected(report: &DiagnoseReport, document: Document) -> Document {
    if report.undetected.is_empty() {
        return document;
    }
    let mut rows: Vec<(&str, &str, &str)> = Vec::new();
    for own in &report.undetected {
        let row = (own.title.as_str(), own.parameter.as_str(), own.unit.as_str());
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    let robots: Vec<Option<RobotId>> = std::iter::once(None)
        .chain(report.robots.iter().copied().map(Some))
        .filter(|robot| report.undetected.iter().any(|own| own.robot == *robot))
        .collect();
    let names =
        robots.iter().map(|robot| robot.map_or("All robots".to_owned(), |robot| format!("Robot {robot}")));
    let header = ["Effect", "Parameter", "Unit"].map(str::to_owned).into_iter().chain(names);
    let mut table = Table::new(
        "Effects that were tested and not found: the size from which they would have been found with a probability of 80 %. \
         A smaller one can be there unseen.",
        header,
    )
    .numeric();
    for (title, parameter, unit) in rows {
        let size = |robot: &Option<RobotId>| {
            let own = report.undetected.iter().find(|own| {
                own.robot == *robot && own.title == title && own.parameter == parameter && own.unit == unit
            });
            own.map_or("–".to_owned(), |own| two_digits(own.size))
        };
        let unit = if unit == "1" { "–" } else { unit };
        let cells = [title.to_owned(), format!("`{parameter}`"), unit.to_owned()];
        table = table.row(cells.into_iter().chain(robots.iter().map(size)));
    }
    document.section("Smallest effects that would have been found").table(table)
}

/// A row per effect and reason.
fn untestable(report: &DiagnoseReport, document: Document) -> Document {
    if report.untestable.is_empty() {
        return document;
    }
    let mut rows: Vec<(&str, &str, Vec<Option<RobotId>>)> = Vec::new();
    for own in &report.untestable {
        match rows.iter_mut().find(|(title, why, _)| *title == own.title && *why == own.why) {
            Some((_, _, robots)) => robots.push(own.robot),
            None => rows.push((&own.title, &own.why, vec![own.robot])),
        }
    }
    let mut table =
        Table::new("Effects that these recordings cannot show, large or small.", ["Effect", "Robots", "Why"]);
    for (title, why, of) in rows {
        let robots: Vec<String> = of.iter().flatten().map(ToString::to_string).collect();
        let robots = if robots.len() < of.len() { "all".to_owned() } else { robots.join(", ") };
        table = table.row([title.to_owned(), robots, why.to_owned()]);
    }
    document.section("Not tested").table(table)
}

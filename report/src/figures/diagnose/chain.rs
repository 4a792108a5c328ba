//! The signal chain with the places of the findings.

use std::collections::BTreeMap;
use std::fmt::Write;

use pleiad_estimation::RobotId;

use crate::html::escape;
use crate::reports::diagnose::{Claim, DiagnoseReport, STAGES};

/// All in units of the drawing, about a pixel.
const NAMES: f64 = 84.0;
const COLUMN: f64 = 106.0;
const BOX: f64 = 84.0;
const HEAD: f64 = 44.0;
const ROW: f64 = 40.0;
const MARK: f64 = 13.0;
/// Of more robots than this, only those with findings are drawn.
pub(crate) const MANY: usize = 12;
/// Marks side by side in a cell; more are counted.
const MARKS: usize = 3;

/// The chain as boxes from left to right and, per robot, the numbers of the findings below their stages.
pub(crate) fn chain_drawing(report: &DiagnoseReport) -> String {
    let found = marks(report);
    let robots: Vec<RobotId> = if report.robots.len() > MANY {
        report.robots.iter().copied().filter(|robot| found.keys().any(|(own, _)| own == robot)).collect()
    } else {
        report.robots.clone()
    };
    let width = NAMES + COLUMN * STAGES.len() as f64;
    let height = HEAD + ROW * robots.len() as f64 + 8.0;
    let mut svg = format!(
        "<svg class=\"chain\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">",
        escape(&spoken(report))
    );
    // Writing to a string cannot fail, here and below.
    for (column, stage) in STAGES.iter().enumerate() {
        let (centre, left) = (centre(column), centre(column) - BOX / 2.0);
        let hit = report.findings.iter().any(|finding| finding.stage == *stage);
        let class = if hit { "stage hit" } else { "stage" };
        let _ = write!(
            svg,
            "<rect class=\"{class}\" x=\"{left}\" y=\"4\" width=\"{BOX}\" height=\"28\" rx=\"6\"/>\
             <text class=\"{class}\" x=\"{centre}\" y=\"22.5\">{stage}</text>"
        );
        if column + 1 < STAGES.len() {
            let (from, to) = (left + BOX + 3.0, left + COLUMN - 3.0);
            let _ = write!(svg, "<path class=\"arrow\" d=\"M{from} 18H{to}m-5 -4l5 4l-5 4\"/>");
        }
    }
    for (row, robot) in robots.iter().enumerate() {
        let y = HEAD + ROW * (row as f64 + 0.5);
        let _ = write!(
            svg,
            "<path class=\"rule\" d=\"M0 {}H{width}\"/><text class=\"robot\" x=\"0\" y=\"{}\">robot {robot}</text>",
            y - ROW / 2.0,
            y + 4.5
        );
        for (column, stage) in STAGES.iter().enumerate() {
            svg += &cell(report, found.get(&(*robot, *stage)), *robot, stage, centre(column), y);
        }
    }
    svg + "</svg>"
}

fn centre(column: usize) -> f64 {
    NAMES + COLUMN * (column as f64 + 0.5)
}

/// The findings of every robot and stage, by position.
fn marks(report: &DiagnoseReport) -> BTreeMap<(RobotId, &str), Vec<usize>> {
    let mut marks: BTreeMap<(RobotId, &str), Vec<usize>> = BTreeMap::new();
    for (index, finding) in report.findings.iter().enumerate() {
        for robot in &finding.robots {
            marks.entry((*robot, &finding.stage)).or_default().push(index);
        }
    }
    marks
}

fn cell(
    report: &DiagnoseReport,
    found: Option<&Vec<usize>>,
    robot: RobotId,
    stage: &str,
    x: f64,
    y: f64,
) -> String {
    if let Some(found) = found {
        let shown = found.len().min(MARKS);
        let step = 2.0 * MARK + 4.0;
        let left = x - step * (shown as f64 - 1.0) / 2.0;
        let mut marks = String::new();
        for (position, index) in found.iter().take(shown).enumerate() {
            marks += &mark(report.findings[*index].claim, index + 1, left + step * position as f64, y);
        }
        if found.len() > shown {
            let at = left + step * (shown as f64 - 0.5) + 2.0;
            let _ = write!(
                marks,
                "<text class=\"more\" x=\"{at}\" y=\"{}\">+{}</text>",
                y + 4.5,
                found.len() - shown
            );
        }
        return marks;
    }
    let tests = || report.tested.iter().filter(|test| test.robot == robot && test.stage == stage);
    if tests().any(|test| test.testable) {
        format!("<circle class=\"clear\" cx=\"{x}\" cy=\"{y}\" r=\"3\"/>")
    } else if tests().next().is_some() {
        format!("<text class=\"untested\" x=\"{x}\" y=\"{}\">not testable</text>", y + 4.0)
    } else {
        String::new()
    }
}

/// The number of a finding in a shape that tells the claim without its colour.
fn mark(claim: Claim, number: usize, x: f64, y: f64) -> String {
    let (class, shape) = match claim {
        Claim::CannotTell => ("either", format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{MARK}\"/>")),
        Claim::Form | Claim::Unnameable => {
            let (r, x0, y0) = (MARK + 3.0, x, y);
            ("nameless", format!("<path d=\"M{x0} {}l{r} {r}l-{r} {r}l-{r} -{r}z\"/>", y0 - r))
        }
        Claim::BadData => {
            let side = 2.0 * MARK - 2.0;
            let (left, top) = (x - side / 2.0, y - side / 2.0);
            ("data", format!("<rect x=\"{left}\" y=\"{top}\" width=\"{side}\" height=\"{side}\" rx=\"2\"/>"))
        }
        _ => ("named", format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{MARK}\"/>")),
    };
    format!("<g class=\"mark {class}\">{shape}<text x=\"{x}\" y=\"{}\">{number}</text></g>", y + 4.5)
}

fn spoken(report: &DiagnoseReport) -> String {
    let place = |(index, finding): (usize, &crate::reports::diagnose::Found)| {
        let robots: Vec<String> = finding.robots.iter().map(ToString::to_string).collect();
        format!("finding {} at stage {} of robot {}", index + 1, finding.stage, robots.join(", "))
    };
    let places: Vec<String> = report.findings.iter().enumerate().map(place).collect();
    let chain = STAGES.join(" to ");
    if places.is_empty() {
        format!("{chain}: nothing found")
    } else {
        format!("{chain}: {}", places.join("; "))
    }
}

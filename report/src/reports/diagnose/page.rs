//! Page one: what is wrong, where, how sure, what to change, what to drive.

use std::collections::BTreeMap;

use super::data::{Claim, DiagnoseReport, Found};
use super::words::{
    capital, heading, how_sure, joined, mean_per_100_m, metres, overview, particulars, place, prediction,
    rivals, robots, sentence,
};
use crate::figures::diagnose::{MANY, chain_drawing};
use crate::number::duration;
use crate::{Card, Document, Table};

/// Findings whose sentences open the page.
const OPENING: usize = 3;

/// Adds page one.
pub(super) fn page_one(report: &DiagnoseReport, document: Document) -> Document {
    let mut document = document.conclusion(report.claim.tone(), report.claim.overall(), overview(report));
    let opening = report.findings.iter().take(OPENING).map(|finding| sentence(finding, &report.robots));
    let opening: Vec<String> = opening.collect();
    if !opening.is_empty() {
        document = document.lead(opening.join(" "));
    }
    document = facts(report, document).drawing(chain_drawing(report), chain_caption(report));
    for (index, finding) in report.findings.iter().enumerate() {
        document = document.card(card(index + 1, finding, report));
    }
    if report.roll_outs.iter().any(|own| own.per_100_m.iter().all(|error| error.is_finite())) {
        document = document.section("What the correction is worth").table(per_100_m(report));
    }
    document = manoeuvres(report, document);
    not_tested(report, document)
}

fn facts(report: &DiagnoseReport, document: Document) -> Document {
    let names: Vec<String> = report
        .recordings
        .iter()
        .map(|recording| format!("{} ({})", recording.name, duration(recording.seconds)))
        .collect();
    let which = if names.len() == 1 { "Recording" } else { "Recordings" };
    let tested = if report.test_on.is_empty() || report.test_on == report.fit_on {
        "parts left out of the fit".to_owned()
    } else {
        report.test_on.join(", ")
    };
    let whole = || report.recordings.iter().map(|recording| recording.name.clone()).collect();
    let fitted: Vec<String> = if report.fit_on.is_empty() { whole() } else { report.fit_on.clone() };
    let document = document
        .fact(which, names.join(", "))
        .fact("Robots", report.robots.len().to_string())
        .fact("Fitted on", fitted.join(", "))
        .fact("Tested on", tested);
    match mean_per_100_m(report) {
        Some(error) => document.fact("Error per 100 m driven", error),
        None => document,
    }
}

fn chain_caption(report: &DiagnoseReport) -> String {
    let has = |claim| report.findings.iter().any(|finding| finding.claim == claim);
    let mut shapes = Vec::new();
    if has(Claim::Named) {
        shapes.push("filled circle: named".to_owned());
    }
    if has(Claim::CannotTell) {
        shapes.push("ring: one of several effects".to_owned());
    }
    if has(Claim::Form) || has(Claim::Unnameable) {
        shapes.push("diamond: no known effect explains it".to_owned());
    }
    if has(Claim::BadData) {
        shapes.push("square: the data are wrong".to_owned());
    }
    shapes.push("dot: tested, nothing found".to_owned());
    let numbers = if report.findings.is_empty() { "" } else { " Numbers are those of the findings." };
    let left_out = if report.robots.len() > MANY { " Robots without a finding are left out." } else { "" };
    format!(
        "From command to reading: where on which robot something is missing.{numbers} {}.{left_out}",
        capital(&shapes.join("; "))
    )
}

fn card(number: usize, finding: &Found, report: &DiagnoseReport) -> Card {
    Card::new(finding.claim.tone(), finding.claim.badge(), heading(number, finding, &report.robots))
        .sentence(particulars(finding, &report.robots))
        .particular("How sure", how_sure(finding))
        .particular("Rivals", rivals(finding))
        .particular("Where it acts", place(finding))
        .particular("Predictions", prediction(&finding.roll_outs))
        .particular("Drive next", finding.manoeuvre.as_deref().map(capital).unwrap_or_default())
        .code("Change", &finding.configuration)
}

fn per_100_m(report: &DiagnoseReport) -> Table {
    let caption = "Error of dead reckoning per 100 m driven, root mean square, from roll-outs over the longest \
                   horizon.";
    let mut table =
        Table::new(caption, ["Robot", "Nominal model", "Corrected model", "Of the error remains"]).numeric();
    for own in &report.roll_outs {
        let [before, after] = own.per_100_m;
        if !(before.is_finite() && after.is_finite()) {
            continue;
        }
        let share = if before > 0.0 { format!("{:.0} %", 100.0 * after / before) } else { "–".to_owned() };
        table = table.row([own.robot.to_string(), metres(before), metres(after), share]);
    }
    table
}

fn manoeuvres(report: &DiagnoseReport, document: Document) -> Document {
    let items: Vec<String> = report
        .findings
        .iter()
        .enumerate()
        .filter_map(|(index, finding)| {
            let drive = finding.manoeuvre.as_ref()?;
            let whose = capital(&robots(&finding.robots, &report.robots));
            Some(format!("{whose}: {drive} (finding {}).", index + 1))
        })
        .collect();
    if items.is_empty() { document } else { document.section("What to drive next").list(items) }
}

/// What could not be tested, by reason.
fn not_tested(report: &DiagnoseReport, document: Document) -> Document {
    if report.untestable.is_empty() {
        return document;
    }
    let mut reasons: BTreeMap<&str, BTreeMap<&str, Vec<Option<pleiad_estimation::RobotId>>>> =
        BTreeMap::new();
    for own in &report.untestable {
        reasons.entry(&own.why).or_default().entry(&own.title).or_default().push(own.robot);
    }
    let item = |(why, effects): (&&str, &BTreeMap<&str, Vec<Option<pleiad_estimation::RobotId>>>)| {
        // Effects that the same robots lack are told together.
        let mut by_robots: BTreeMap<&Vec<Option<pleiad_estimation::RobotId>>, Vec<String>> = BTreeMap::new();
        for (title, of) in effects {
            by_robots.entry(of).or_default().push((*title).to_owned());
        }
        let groups: Vec<String> = by_robots
            .iter()
            .map(|(of, titles)| {
                let known: Vec<_> = of.iter().flatten().copied().collect();
                let whose = if known.len() < of.len() || known.is_empty() {
                    "every robot".to_owned()
                } else {
                    robots(&known, &report.robots)
                };
                format!("{whose}: {}", joined(titles, "and"))
            })
            .collect();
        format!("{}. {}.", capital(why.trim_end_matches('.')), capital(&groups.join("; ")))
    };
    document.section("What could not be tested").list(reasons.iter().map(item))
}

//! What a study leaves: a page, a summary, and lines for people.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::bail;
use pleiad_report::{Document, Verdict, write_summary};
use pleiad_survey::{Shown, Study};
use serde_json::{Value, json};

use crate::output;

/// Writes `report.html` and `summary.json` into the folder and prints the study. An error if a claim does not hold:
/// a script should notice.
pub fn finish(study: &Study, out: &Path, as_json: bool, command: &str) -> anyhow::Result<()> {
    show(study, out, as_json, command)?;
    let failed = study.claims.iter().filter(|claim| !claim.holds).count();
    if failed > 0 {
        bail!("{}: {failed} of {} claims do not hold", study.name, study.claims.len());
    }
    Ok(())
}

/// Writes `report.html` and `summary.json` into the folder, and gives what is in the second.
pub fn write(study: &Study, out: &Path, command: &str) -> anyhow::Result<Value> {
    let summary = summary(study);
    write_summary(&out.join("summary.json"), &summary)?;
    write_page(study, out, command)?;
    Ok(summary)
}

/// The same for a command whose product is something else than its claims: they are shown, whatever they say.
pub fn show(study: &Study, out: &Path, as_json: bool, command: &str) -> anyhow::Result<()> {
    let summary = write(study, out, command)?;
    output::print(as_json, &summary, &text(study, out))
}

/// The page alone, `report.html`.
pub fn write_page(study: &Study, out: &Path, command: &str) -> anyhow::Result<()> {
    Ok(page(study, command).write(&out.join("report.html"))?)
}

fn summary(study: &Study) -> Value {
    let mut object = study.numbers.clone();
    object.insert("study".into(), json!(study.name));
    object.insert("claims".into(), json!(study.claims));
    Value::Object(object)
}

fn page(study: &Study, command: &str) -> Document {
    let mut document = Document::new(study.title.clone()).lead(study.lead.clone());
    for claim in &study.claims {
        let verdict = if claim.holds { Verdict::Holds } else { Verdict::Fails };
        document = document.verdict(verdict, format!("{}: {}", claim.statement, claim.measured));
    }
    for shown in &study.shown {
        document = match shown {
            Shown::Prose(text) => document.prose(text.clone()),
            Shown::Table(table) => document.table(table.clone()),
            Shown::Figure(figure, caption) => document.figure(figure.clone(), caption.clone()),
        };
    }
    document.reproduce("this study", command)
}

fn text(study: &Study, out: &Path) -> String {
    let mut text = format!("{}\n\n", study.title);
    for claim in &study.claims {
        let word = if claim.holds { "holds" } else { "DOES NOT HOLD" };
        let _ = writeln!(text, "{word:13} {}\n{:13} {}", claim.statement, "", claim.measured);
    }
    let _ = writeln!(text, "\nreport: {}", out.join("report.html").display());
    text
}

//! The findings in a few lines, for a terminal.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use pleiad_mismatch::{Finding, Findings, Verdict};
use pleiad_report::quantity;

use super::sentences::{claim_words, robots, title};

/// So many reasons why effects were not tested are told.
const REASONS: usize = 6;
/// So many effects are told by their names.
const NAMES: usize = 6;
/// So many notes are told.
const NOTES: usize = 12;
/// Below this a probability is only called smaller.
const LEAST_PROBABILITY: f64 = 1e-12;

pub(super) fn text(findings: &Findings, out: &Path) -> String {
    let mut text = format!("{}: {}\n", findings.recordings.join(", "), claim_words(findings.verdict));
    for (index, finding) in findings.findings.iter().enumerate() {
        let _ = writeln!(text, "\n{}. {}", index + 1, lines(finding));
    }
    text.push('\n');
    for own in &findings.roll_outs {
        let [before, after] = own.error_per_100_m;
        if before.is_finite() && after.is_finite() {
            let (before, after) = (quantity(before, "m"), quantity(after, "m"));
            let _ = writeln!(text, "robot {}: error per 100 m {before} before, {after} after", own.robot);
        }
    }
    let mut tested: Vec<&str> = findings.undetected.iter().map(|own| own.effect.as_str()).collect();
    tested.extend(findings.findings.iter().filter_map(|own| own.effect.as_deref()));
    tested.sort_unstable();
    tested.dedup();
    if !tested.is_empty() {
        let _ = writeln!(
            text,
            "tested: {} effects; how large each would have to be is in the report",
            tested.len()
        );
    }
    not_tested(findings, &mut text);
    for note in findings.notes.iter().take(NOTES) {
        let _ = writeln!(text, "note: {note}");
    }
    if findings.notes.len() > NOTES {
        let _ = writeln!(text, "note: {} more in the report", findings.notes.len() - NOTES);
    }
    let _ = writeln!(text, "corrected model: {}/corrected.toml", out.display());
    let _ = writeln!(text, "report: {}/report.html", out.display());
    text
}

/// The effects that could not be tested, by reason, and whose.
fn not_tested(findings: &Findings, text: &mut String) {
    let mut reasons: Vec<&str> = findings.untestable.iter().map(|own| own.why.as_str()).collect();
    reasons.sort_unstable();
    reasons.dedup();
    for why in reasons.iter().take(REASONS) {
        let own = || findings.untestable.iter().filter(|own| own.why == *why);
        let names: BTreeSet<&str> = own().map(|own| own.effect.as_str()).collect();
        let known: BTreeSet<u32> = own().filter_map(|own| own.robot).collect();
        let known: Vec<u32> = known.into_iter().collect();
        let what = if names.len() > NAMES {
            format!("{} effects", names.len())
        } else {
            names.into_iter().collect::<Vec<_>>().join(", ")
        };
        let whose = if known.is_empty() { String::new() } else { format!(" of {}", robots(&known)) };
        let _ = writeln!(text, "not tested: {what}{whose}: {why}");
    }
    if reasons.len() > REASONS {
        let _ = writeln!(text, "not tested: {} more reasons in the report", reasons.len() - REASONS);
    }
}

fn lines(finding: &Finding) -> String {
    let mut text =
        format!("{} ({}): {}", robots(&finding.robots), finding.stage, claim_words(finding.verdict));
    if finding.verdict == Verdict::CannotTell {
        let names: Vec<&str> = finding.support_set.iter().map(|name| title(name)).collect();
        let _ = write!(text, ": {}", names.join(" / "));
    }
    if finding.verdict == Verdict::Form && finding.support_set.len() > 1 {
        let _ = write!(text, ": on these data the same as {}", finding.support_set[1..].join(" / "));
    }
    let _ = write!(text, "\n   {}", finding.summary);
    let held_out = &finding.held_out;
    let (gain, error) = (quantity(held_out.log_score_gain, ""), quantity(held_out.log_score_gain_se, ""));
    let p = if finding.p_familywise < LEAST_PROBABILITY {
        format!("below {LEAST_PROBABILITY:e}")
    } else {
        quantity(finding.p_familywise, "")
    };
    let _ = write!(text, "\n   p {p}; held-out log score {gain} ± {error}");
    if let Some(manoeuvre) = &finding.manoeuvre {
        let _ = write!(text, "\n   drive next: {manoeuvre}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::{fixture, sentences};
    use super::*;

    #[test]
    fn a_terminal_shows_each_finding_in_a_few_plain_lines_and_then_where_the_report_is() {
        let mut findings = fixture::findings();
        sentences::fill_summaries(&mut findings);
        let expected = "square: named

1. robot 2 (wheel): named
   robot 2: its left and right wheels differ by 1.00 % (0.97..1.03 %), the left one larger
   p 1.00e-6; held-out log score 40.0 ± 5.00

2. robot 1 (actuator): these data cannot tell several effects apart: transport delay / actuator lag (first order)
   robot 1: its commands take effect 50 ms (40..60 ms) later than declared
   p 1.00e-6; held-out log score 40.0 ± 5.00
   drive next: steps of speed, 30 s

robot 2: error per 100 m 3.00 m before, 0.400 m after
tested: 3 effects; how large each would have to be is in the report
not tested: steer_trim: no steering angle was recorded
note: square: ends early
corrected model: out/corrected.toml
report: out/report.html
";
        assert_eq!(text(&findings, Path::new("out")), expected);
    }
}

//! The report of a diagnosis: what page one says, that every figure shows something, that it stays small.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail as tests do")]

mod fixture;
mod page;

use fixture::diagnosis;
use page::{PLOTLY, check_figures, figures, outside_references};
use pleiad_estimation::RobotId;
use pleiad_report::{Claim, DiagnoseReport, ReportError, diagnose_report};

const HOSTILE: &str = "</script><script>alert('x')</script><img src=\"http://evil.example/\" onerror=a&b>";

fn render(report: &DiagnoseReport) -> String {
    diagnose_report(report).unwrap().render()
}

/// What is read: the page without its scripts, styles and tags.
fn text(html: &str) -> String {
    let body = html.split("<main>").nth(1).unwrap().split("</footer>").next().unwrap();
    let without_data = body
        .split("<script")
        .enumerate()
        .map(|(index, piece)| if index == 0 { piece } else { piece.split_once("</script>").unwrap().1 });
    let mut text = String::new();
    let mut inside = false;
    for character in without_data.collect::<String>().chars() {
        match character {
            '<' => inside = true,
            '>' => inside = false,
            other if !inside => text.push(other),
            _ => {}
        }
    }
    text.replace("&#39;", "'").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
}

/// The report with only these findings, under this overall claim.
fn with(claim: Claim, keep: impl Fn(&Claim) -> bool) -> DiagnoseReport {
    let mut report = diagnosis(3, 120, 1);
    report.claim = claim;
    let kept: Vec<usize> =
        (0..report.findings.len()).filter(|index| keep(&report.findings[*index].claim)).collect();
    report.evidence.retain(|own| kept.contains(&own.finding));
    for own in &mut report.evidence {
        own.finding = kept.iter().position(|index| *index == own.finding).unwrap();
    }
    report.findings = kept.iter().map(|index| report.findings[*index].clone()).collect();
    report
}

#[test]
fn page_one_says_what_is_wrong_where_how_sure_and_what_to_do() {
    let html = render(&diagnosis(3, 240, 1));
    let all = text(&html);
    let first = all.split("The evidence").next().unwrap();
    for said in [
        "Robot 2: its left and right wheels differ by 1.00 % (0.97..1.03 %), the left one larger.",
        "1. Robot 2, wheel: unequal wheel diameters named",
        "Probability of a false alarm below 1e-12.",
        "+412 ± 20 (20.6 standard errors). Replicated and predictive, rivals not excluded.",
        "[robots.r2.effects.unequal_wheel_radii]\nratio = 0.0100",
        "2. Robot 1, sensor: cannot tell sensor yaw misalignment from compass declination, constant heading offset",
        "3. Robot 3, body: something that no known effect explains",
        "+31 ± 19 (1.63 standard errors). Not confirmed on data that the fit did not see.",
        "where x is 1..2.5 m and y is -1..0.5 m",
        "4. Robot 1, clock: clock offset bad data",
        "5. Every robot, world: slope (gravity)",
        "2.16 m before, 0.252 m after (mean of 3 robots)",
        "Robot 1: look at the same landmark from near and from far, 40 s (finding 2).",
        "No GPS was recorded. Robots 1 and 3: GPS latency and GPS lever arm.",
        "No steering angle was recorded. Every robot: steer trim (car-like).",
    ] {
        assert!(first.contains(said), "not on page one: {said}\n{first}");
    }
    assert!(!all.contains("the cause"), "no cause is claimed");
    assert!(all.contains("Finding 1. Robot 2") && all.contains("pleiad diagnose recordings/square"));
}

#[test]
fn every_verdict_has_its_words() {
    let cases = [
        (Claim::Named, "it has a name"),
        (Claim::CannotTell, "these data cannot tell which of several effects it is"),
        (Claim::Unnameable, "that no known effect explains"),
        (Claim::BadData, "The data are wrong, not the physics."),
        (Claim::NothingMissing, "Nothing missing."),
        (Claim::Untestable, "Too little could be tested."),
    ];
    for (claim, words) in cases {
        let report = with(claim, |own| *own == claim);
        let html = render(&report);
        assert!(text(&html).contains(words), "{claim:?}: {words}");
        check_figures(&html);
        for (_, other) in cases.iter().filter(|(other, _)| *other != claim && report.findings.is_empty()) {
            assert!(!text(&html).contains(other), "{claim:?} also says {other}");
        }
    }
}

#[test]
fn nothing_found_is_told_with_what_would_have_been_seen_and_what_was_not_tested() {
    let html = text(&render(&with(Claim::NothingMissing, |_| false)));
    assert!(html.contains("what could not be tested is not excluded"), "{html}");
    assert!(html.contains("Smallest effects that would have been found") && html.contains("0.0021"));
    let nothing = text(&render(&with(Claim::Untestable, |_| false)));
    assert!(nothing.contains("This is no statement that nothing is missing"), "{nothing}");
    assert!(!nothing.contains("Nothing that was tested stands out"));
}

#[test]
fn the_chain_marks_each_finding_at_its_robot_and_stage() {
    let html = render(&diagnosis(3, 60, 1));
    let chain = html.split("<svg class=\"chain\"").nth(1).unwrap().split("</svg>").next().unwrap();
    // One named at one robot, one of the world at all three; one each of the others.
    assert_eq!(chain.matches("class=\"mark named\"").count(), 4);
    for kind in ["either", "nameless", "data"] {
        assert_eq!(chain.matches(&format!("class=\"mark {kind}\"")).count(), 1, "{kind}");
    }
    assert!(chain.contains("finding 1 at stage wheel of robot 2"));
    assert_eq!(chain.matches("not testable").count(), 1);
    let clean = render(&with(Claim::NothingMissing, |_| false));
    assert!(!clean.contains("class=\"mark ") && clean.contains("class=\"clear\""));
}

#[test]
fn every_figure_shows_something_and_has_units() {
    let html = render(&diagnosis(3, 240, 1));
    check_figures(&html);
    // Spread, two floors, nine panels of residuals, three of roll-outs; and of the findings five partial
    // residuals, four strips, and floors where a gain is positive.
    assert!(figures(&html).len() >= 2 + 1 + 9 + 3 + 5 + 4, "{}", figures(&html).len());
}

#[test]
fn a_diagnosis_without_residuals_or_roll_outs_has_no_empty_figures() {
    let mut report = diagnosis(2, 60, 1);
    report.residuals.clear();
    report.evidence.clear();
    report.roll_outs.clear();
    report.paths.clear();
    let html = render(&report);
    assert!(figures(&html).is_empty());
    assert!(html.contains("<svg class=\"chain\"") && !html.contains("What the correction is worth"));
    let mut still = diagnosis(2, 60, 1);
    for own in &mut still.residuals {
        own.sigma = 0.0;
    }
    for own in &mut still.evidence {
        own.predicted.fill(0.0);
        own.gain.clear();
    }
    check_figures(&render(&still));
}

#[test]
fn numbers_that_are_not_finite_are_gaps() {
    let mut report = diagnosis(2, 60, 1);
    for own in &mut report.residuals {
        own.nominal[3] = f64::NAN;
        own.corrected[4] = f64::INFINITY;
        own.position_m[5] = None;
    }
    for own in &mut report.evidence {
        own.predicted[2] = f64::NAN;
        own.gain[7][1] = f64::NAN;
    }
    for finding in &mut report.findings {
        finding.p_familywise = f64::NAN;
        finding.gain = [f64::NAN; 2];
        for parameter in &mut finding.parameters {
            parameter.ci95 = [f64::NAN; 2];
        }
    }
    for own in &mut report.roll_outs {
        own.per_100_m = [f64::NAN, 1.0];
        own.horizons[0].position_m[1] = f64::NAN;
    }
    report.undetected[0].size = f64::INFINITY;
    let html = render(&report);
    check_figures(&html);
    let own = html.replace(PLOTLY, "");
    assert!(!own.contains("NaN") && !own.contains(":inf") && !own.contains(">inf"));
    let said = text(&html);
    assert!(said.contains("interval unknown") && said.contains("was not computed"));
    assert!(said.contains("Not tested on data that the fit did not see"));
    assert!(!said.contains("Error per 100 m driven"), "an error that is not known is not told");
}

#[test]
fn it_refers_to_nothing_outside_itself_and_hostile_text_stays_text() {
    let html = render(&diagnosis(3, 120, 1));
    assert_eq!(outside_references(&html), Vec::<String>::new());
    let mut report = diagnosis(2, 60, 1);
    for finding in &mut report.findings {
        finding.title = HOSTILE.into();
        finding.stage = HOSTILE.into();
        finding.sentences = vec![HOSTILE.into()];
        finding.rivals = vec![HOSTILE.into()];
        finding.regime = HOSTILE.into();
        finding.manoeuvre = Some(HOSTILE.into());
        finding.equation = Some(HOSTILE.into());
        finding.configuration = HOSTILE.into();
    }
    for own in &mut report.residuals {
        own.channel = HOSTILE.into();
        own.component = HOSTILE.into();
        own.recording = HOSTILE.into();
    }
    report.notes = vec![HOSTILE.into()];
    report.recordings[0].name = HOSTILE.into();
    let own = render(&report).replace(PLOTLY, "");
    assert_eq!(own.matches("<script").count(), figures(&own).len() + 2);
    assert!(!own.contains("<img"), "not escaped");
}

#[test]
fn five_robots_over_twenty_five_minutes_stay_below_ten_megabytes() {
    // Windows of 0.2 s throughout, which is the densest channel.
    let html = render(&diagnosis(5, 1_500, 5));
    assert!(html.len() < 6_000_000, "{} bytes", html.len());
}

#[test]
fn with_many_robots_the_chain_shows_those_with_findings() {
    let mut report = diagnosis(30, 20, 1);
    report.findings.truncate(2);
    report.evidence.retain(|own| own.finding < 2);
    let html = render(&report);
    let chain = html.split("<svg class=\"chain\"").nth(1).unwrap().split("</svg>").next().unwrap();
    assert_eq!(chain.matches("class=\"robot\"").count(), 2);
    assert!(text(&html).contains("Robots without a finding are left out"));
}

#[test]
fn columns_of_unequal_length_are_refused() {
    let mut report = diagnosis(2, 20, 1);
    report.residuals[0].corrected.pop();
    let error = diagnose_report(&report).unwrap_err();
    assert!(
        matches!(error, ReportError::ResidualColumns { robot: RobotId(1), found: 19, expected: 20, .. }),
        "{error}"
    );
}

#[test]
fn equal_diagnoses_give_equal_bytes() {
    assert_eq!(render(&diagnosis(2, 60, 1)), render(&diagnosis(2, 60, 1)));
}

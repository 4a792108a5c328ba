//! What is claimed, in words.

use pleiad_estimation::RobotId;

use super::data::{Claim, DiagnoseReport, Found, HorizonError};
use crate::document::Tone;
use crate::quantity;

/// Below this a probability is only called smaller.
const LEAST_PROBABILITY: f64 = 1e-12;
/// The horizon that page one tells, seconds.
const TOLD_HORIZON_S: f64 = 5.0;
/// A smaller relative change of an error of prediction is none.
const UNCHANGED: f64 = 0.005;

impl Claim {
    /// A word or two, for a badge.
    pub(super) fn badge(self) -> &'static str {
        match self {
            Self::Named => "named",
            Self::CannotTell => "cannot tell",
            Self::Form => "missing, a form",
            Self::Unnameable => "missing, unnameable",
            Self::BadData => "bad data",
            Self::NothingMissing => "nothing missing",
            Self::Untestable => "untestable",
        }
    }

    /// After a number of findings.
    fn counted(self) -> &'static str {
        match self {
            Self::CannotTell => "with several explanations that these data cannot tell apart",
            Self::Form => "that no known effect explains but a formula describes",
            Self::Unnameable => "that no known effect explains",
            Self::BadData => "of bad data",
            other => other.badge(),
        }
    }

    pub(super) fn tone(self) -> Tone {
        match self {
            Self::NothingMissing => Tone::Good,
            Self::Named | Self::BadData => Tone::Bad,
            Self::CannotTell | Self::Form | Self::Unnameable | Self::Untestable => Tone::Open,
        }
    }

    /// What is claimed of everything together.
    pub(super) fn overall(self) -> &'static str {
        match self {
            Self::Named => "The model leaves something out, and it has a name.",
            Self::CannotTell => {
                "The model leaves something out; these data cannot tell which of several effects it is."
            }
            Self::Form => {
                "The model leaves something out that no known effect explains; a formula describes it."
            }
            Self::Unnameable => "The model leaves something out that no known effect explains.",
            Self::BadData => "The data are wrong, not the physics.",
            Self::NothingMissing => "Nothing missing.",
            Self::Untestable => "Too little could be tested.",
        }
    }
}

/// `robot 2`, `robots 1 and 3`, `every robot`.
pub(super) fn robots(of: &[RobotId], all: &[RobotId]) -> String {
    let names: Vec<String> = of.iter().map(ToString::to_string).collect();
    match names.as_slice() {
        [] => "no robot".to_owned(),
        [one] => format!("robot {one}"),
        _ if !all.is_empty() && all.iter().all(|robot| of.contains(robot)) => "every robot".to_owned(),
        several => format!("robots {}", joined(several, "and")),
    }
}

/// `a`, `a and b`, `a, b and c`.
pub(super) fn joined(items: &[String], word: &str) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} {word} {last}", first.join(", ")),
    }
}

/// The text with its first letter capital.
pub(super) fn capital(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
}

/// What is wrong, and where in the chain.
pub(super) fn heading(number: usize, finding: &Found, all: &[RobotId]) -> String {
    let place = format!("{number}. {}, {}", capital(&robots(&finding.robots, all)), finding.stage);
    match finding.claim {
        Claim::CannotTell => format!("{place}: {}", either(finding)),
        Claim::Unnameable => format!("{place}: something that no known effect explains"),
        _ => format!("{place}: {}", finding.title),
    }
}

/// `cannot tell A from B`.
pub(super) fn either(finding: &Found) -> String {
    if finding.rivals.is_empty() {
        return format!("cannot tell {} from other effects", finding.title);
    }
    format!("cannot tell {} from {}", finding.title, joined(&finding.rivals, "or"))
}

/// What a finding amounts to, led by whose it is.
pub(super) fn sentence(finding: &Found, all: &[RobotId]) -> String {
    let says = if finding.claim == Claim::CannotTell { either(finding) } else { says(finding) };
    format!("{}: {says}.", capital(&robots(&finding.robots, all)))
}

/// The same below a heading that has said what cannot be told apart.
pub(super) fn particulars(finding: &Found, all: &[RobotId]) -> String {
    if finding.claim != Claim::CannotTell || finding.sentences.is_empty() {
        return sentence(finding, all);
    }
    format!("If it is {}: {}.", finding.title, says(finding))
}

fn says(finding: &Found) -> String {
    let says =
        if finding.sentences.is_empty() { finding.title.clone() } else { finding.sentences.join("; ") };
    says.trim_end_matches('.').to_owned()
}

/// How sure, in words and numbers.
pub(super) fn how_sure(finding: &Found) -> String {
    let chance = if !finding.p_familywise.is_finite() {
        "The probability of a false alarm was not computed.".to_owned()
    } else if finding.p_familywise < LEAST_PROBABILITY {
        "Probability of a false alarm below 1e-12.".to_owned()
    } else {
        format!("Probability of a false alarm {}.", plain(finding.p_familywise))
    };
    let [gain, error] = finding.gain;
    if !gain.is_finite() {
        return format!("{chance} Not tested on data that the fit did not see.");
    }
    let times = if error > 0.0 && error.is_finite() {
        format!(" ({} standard errors)", plain(gain / error))
    } else {
        String::new()
    };
    let sign = if gain > 0.0 { "+" } else { "" };
    let (gain, error) = (plain(gain), plain(error));
    format!(
        "{chance} Log score on data that the fit did not see {sign}{gain} ± {error}{times}. {}",
        standing(finding)
    )
}

/// Three significant digits, without zeros at the end.
fn plain(value: f64) -> String {
    let text = quantity(value, "");
    if text.contains('.') && !text.contains('e') {
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    text.replace(".00e", "e")
}

/// Whether the gain on unseen data exceeds twice its standard error.
pub(super) fn is_predictive(finding: &Found) -> bool {
    finding.gain[0] > 2.0 * finding.gain[1]
}

/// What may be claimed of it: never a cause.
pub(super) fn standing(finding: &Found) -> &'static str {
    if is_predictive(finding) {
        "Replicated and predictive, rivals not excluded."
    } else {
        "Not confirmed on data that the fit did not see."
    }
}

/// The rivals that remain.
pub(super) fn rivals(finding: &Found) -> String {
    if finding.claim == Claim::Form {
        let others = if finding.rivals.is_empty() {
            "No other simple form does about as well".to_owned()
        } else {
            format!("On these data the same: {}", joined(&finding.rivals, "or"))
        };
        return format!(
            "No effect of the catalogue explains it; a form is a description and no cause. {others}."
        );
    }
    if finding.claim == Claim::Unnameable {
        return "Every effect of the catalogue was tried and falls short; the shape below is a description."
            .to_owned();
    }
    if finding.rivals.is_empty() {
        return "None in the catalogue does about as well; what the catalogue lacks is not excluded."
            .to_owned();
    }
    format!("{} would explain these data about as well.", capital(&joined(&finding.rivals, "or")))
}

/// Where it acts.
pub(super) fn place(finding: &Found) -> String {
    let mut parts = Vec::new();
    if !finding.regime.is_empty() {
        parts.push(finding.regime.clone());
    }
    if !finding.time_s.is_empty() {
        let shown: Vec<String> = finding
            .time_s
            .iter()
            .take(4)
            .map(|[from, to]| format!("{}..{} s", plain(*from), plain(*to)))
            .collect();
        let more = finding.time_s.len().saturating_sub(4);
        let rest = if more > 0 { format!(" and {more} more intervals") } else { String::new() };
        parts.push(format!("at {}{rest}", shown.join(", ")));
    }
    if let Some([x0, x1, y0, y1]) = finding.region_m {
        let at = plain;
        parts.push(format!("where x is {}..{} m and y is {}..{} m", at(x0), at(x1), at(y0), at(y1)));
    }
    if parts.is_empty() {
        "Everywhere and throughout.".to_owned()
    } else {
        format!("{}.", capital(&parts.join(", ")))
    }
}

/// The error of a prediction over the told horizon, three models.
pub(super) fn prediction(roll_outs: &[HorizonError]) -> String {
    let distance = |own: &HorizonError| (own.horizon_s - TOLD_HORIZON_S).abs();
    let nearest = roll_outs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let Some(own) = nearest.filter(|own| own.position_m.iter().all(|error| error.is_finite())) else {
        return String::new();
    };
    // A sensor or a servo changes nothing of where the wheels lead.
    let [before, _, after] = own.position_m;
    if (before - after).abs() < UNCHANGED * before {
        return format!(
            "Where the wheels lead does not depend on it: after {} s of driving blind the predicted position is off by \
             {} with and without it.",
            plain(own.horizon_s),
            metres(before)
        );
    }
    let [nominal, refitted, corrected] = own.position_m.map(metres);
    format!(
        "After {} s of driving blind the predicted position is off by {nominal} (nominal model), {refitted} (its own \
         parameters refitted), {corrected} (corrected).",
        plain(own.horizon_s)
    )
}

/// Millimetres below 10 cm.
pub(super) fn metres(value: f64) -> String {
    if value.abs() < 0.1 { quantity(1e3 * value, "mm") } else { quantity(value, "m") }
}

/// The mean error per 100 m over the robots for which it is known, before and after.
pub(super) fn mean_per_100_m(report: &DiagnoseReport) -> Option<String> {
    let known = || report.roll_outs.iter().filter(|own| own.per_100_m.iter().all(|error| error.is_finite()));
    let count = known().count();
    let mean = |which: usize| known().map(|own| own.per_100_m[which]).sum::<f64>() / count as f64;
    let of = if count > 1 { format!(" (mean of {count} robots)") } else { String::new() };
    (count > 0).then(|| format!("{} before, {} after{of}", metres(mean(0)), metres(mean(1))))
}

/// What the page begins with.
pub(super) fn overview(report: &DiagnoseReport) -> String {
    match report.claim {
        Claim::NothingMissing => {
            "Nothing that was tested stands out of the noise. The smallest effects that would have been seen are listed \
             below; what could not be tested is not excluded."
                .to_owned()
        }
        Claim::Untestable => {
            "This is no statement that nothing is missing: the reasons are listed below.".to_owned()
        }
        _ => {
            let count = report.findings.len();
            let findings = if count == 1 { "1 finding".to_owned() } else { format!("{count} findings") };
            let counted: Vec<String> = [Claim::Named, Claim::CannotTell, Claim::Form, Claim::Unnameable, Claim::BadData]
                .into_iter()
                .map(|claim| (claim, report.findings.iter().filter(|finding| finding.claim == claim).count()))
                .filter(|(_, count)| *count > 0)
                .map(|(claim, count)| format!("{count} {}", claim.counted()))
                .collect();
            format!("{findings}: {}.", joined(&counted, "and"))
        }
    }
}

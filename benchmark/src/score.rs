//! Findings held against answers, by the definitions of the design: findings are matched one to one to what was
//! injected, robots included; what is left over is extra.

pub mod forms;

use std::f64::consts::PI;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_mismatch::{Estimate, Finding, Findings, Place, Verdict};
use pleiad_physics::{Effect, Fit};
use serde::{Deserialize, Serialize};

use crate::seal::{Answer, Injected};

/// A larger set counts as none.
pub const LARGEST_SET: usize = 3;

/// What was said of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scored {
    /// The strongest claim.
    pub verdict: String,
    /// One per effect injected, in the order of the answer.
    pub matches: Vec<Match>,
    /// Findings with a name that match nothing: verdict, set, robots.
    pub extra: Vec<String>,
    /// Findings without a name: what they say in place of one.
    pub nameless: Vec<String>,
    /// The smallest familywise probability of any finding, as minus its logarithm to base 10; 0 without findings.
    pub evidence: f64,
    /// The largest gain on data left out of any finding, in standard errors; 0 without findings.
    pub gain_z: f64,
    /// How long it took, seconds.
    pub seconds: f64,
}

/// What became of an effect that was injected.
#[allow(clippy::struct_excessive_bools, reason = "each is counted on its own")]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Match {
    /// The effect.
    pub effect: String,
    /// Its robots.
    pub robots: Vec<u32>,
    /// A finding is on its robots and at its stage of the signal chain.
    pub localized: bool,
    /// The finding's own name is right.
    pub top1: bool,
    /// It is among the first three of the set.
    pub top3: bool,
    /// It is in a set of at most three.
    pub in_set: bool,
    /// The size of that set.
    pub set_size: Option<usize>,
    /// The verdict of the finding that matches.
    pub verdict: Option<String>,
    /// Values, where the name is right.
    pub parameters: Vec<ParameterError>,
    /// Overlap of where it was found with where it acts: intersection over union.
    pub overlap: Option<f64>,
}

/// A parameter that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterError {
    /// Its name.
    pub label: String,
    /// What was injected.
    pub truth: f64,
    /// What was found.
    pub value: f64,
    /// Whether the 95 % interval holds the truth; `None` without an interval.
    pub covered: Option<bool>,
}

/// Scores findings.
pub fn score(answer: &Answer, findings: &Findings, seconds: f64) -> Scored {
    let owners = matched(answer, &findings.findings);
    let matches = answer.injected.iter().zip(&owners);
    let matches = matches.map(|(own, finding)| {
        let found = finding.map(|index| &findings.findings[index]);
        one(own, found, &findings.findings)
    });
    let left = || {
        let all = findings.findings.iter().enumerate();
        all.filter(|(index, _)| !owners.contains(&Some(*index))).map(|(_, finding)| finding)
    };
    let evidence = |finding: &Finding| -finding.p_familywise.max(f64::MIN_POSITIVE).log10();
    let gain_z = |finding: &Finding| {
        finding.held_out.log_score_gain / finding.held_out.log_score_gain_se.max(f64::MIN_POSITIVE)
    };
    let most = |of: &dyn Fn(&Finding) -> f64| findings.findings.iter().map(of).fold(0.0, f64::max);
    Scored {
        verdict: word(findings.verdict).to_owned(),
        matches: matches.collect(),
        extra: left().filter(|own| own.effect.is_some()).map(told).collect(),
        nameless: findings.findings.iter().filter(|own| own.effect.is_none()).map(told).collect(),
        evidence: most(&evidence),
        gain_z: most(&gain_z),
        seconds,
    }
}

/// The finding of each injected effect: right names first, then sets, so that each finding answers once.
fn matched(answer: &Answer, findings: &[Finding]) -> Vec<Option<usize>> {
    let mut owners: Vec<Option<usize>> = vec![None; answer.injected.len()];
    for by_name in [true, false] {
        for (position, own) in answer.injected.iter().enumerate() {
            if owners[position].is_some() {
                continue;
            }
            let fits = |finding: &Finding| {
                let named = finding.effect.as_deref() == Some(own.effect.as_str());
                let member =
                    finding.support_set.len() <= LARGEST_SET && finding.support_set.contains(&own.effect);
                finding.robots == own.robots && if by_name { named } else { member }
            };
            owners[position] =
                (0..findings.len()).find(|index| !owners.contains(&Some(*index)) && fits(&findings[*index]));
        }
    }
    owners
}

fn one(own: &Injected, found: Option<&Finding>, all: &[Finding]) -> Match {
    let info = Effect::from_name(&own.effect).map(Effect::info);
    let stage = info.map_or("", |info| info.stage.name());
    let mut result = Match {
        effect: own.effect.clone(),
        robots: own.robots.clone(),
        localized: all.iter().any(|finding| finding.robots == own.robots && finding.stage == stage),
        ..Match::default()
    };
    let Some(found) = found else { return result };
    let set = &found.support_set;
    let member = |name: &String| *name == own.effect;
    result.localized = true;
    result.top1 = found.effect.as_deref() == Some(own.effect.as_str());
    result.top3 = result.top1 || set.iter().take(LARGEST_SET).any(member);
    result.in_set = set.len() <= LARGEST_SET && set.iter().any(member);
    result.set_size = result.in_set.then_some(set.len());
    result.verdict = Some(word(found.verdict).to_owned());
    if result.top1 {
        let of = |label: &str| found.parameters.get(label);
        result.parameters = parameters(own, &|label| of(label).map(|own| (own.value, Some(own.ci95))));
        result.overlap = overlap(own, found);
    }
    result
}

/// A value with its 95 % interval, if it has one.
pub type Found = (f64, Option<[f64; 2]>);

/// The sizes of an effect that was injected, as they were found.
pub fn parameters(own: &Injected, found: &dyn Fn(&str) -> Option<Found>) -> Vec<ParameterError> {
    let Some(effect) = Effect::from_name(&own.effect) else { return Vec::new() };
    let mut all = Vec::new();
    for parameter in effect.info().parameters {
        let label = parameter.label();
        let Some(&truth) = own.parameters.get(&label) else { continue };
        #[allow(clippy::float_cmp, reason = "a size that is off was not injected")]
        let absent = parameter.off == 0.0 && truth == parameter.off;
        if parameter.fit == Fit::Choice || absent {
            continue;
        }
        let Some((value, ci95)) = found(&label) else { continue };
        // Directions that are whole turns apart, or half turns of a line, are the same.
        let period = parameter.plausible.1 - parameter.plausible.0;
        let error = match parameter.unit {
            "rad" if period > 2.0 * PI => wrap_angle(value - truth),
            "rad" if period > PI => 0.5 * wrap_angle(2.0 * (value - truth)),
            _ => value - truth,
        };
        let same = value - error;
        let covered = ci95.map(|[low, high]| (low..=high).contains(&same));
        all.push(ParameterError { label, truth, value: truth + error, covered });
    }
    all
}

/// Intersection over union of where it acts and where it was found, in place or else in time.
fn overlap(own: &Injected, found: &Finding) -> Option<f64> {
    if let Some(truth) = own.region_m {
        let place = found.place.region_m.or_else(|| {
            let of = |label: &str| found.parameters.get(label).map(|own: &Estimate| own.value);
            Some([of("region_m.x_min")?, of("region_m.x_max")?, of("region_m.y_min")?, of("region_m.y_max")?])
        });
        return Some(place.map_or(0.0, |place| of_rectangles(truth, place)));
    }
    let truth = own.time_s?;
    Some(of_times(truth, &found.place))
}

/// Of two rectangles `[x0, x1, y0, y1]`.
pub fn of_rectangles(a: [f64; 4], b: [f64; 4]) -> f64 {
    let area = |[x0, x1, y0, y1]: [f64; 4]| (x1 - x0).max(0.0) * (y1 - y0).max(0.0);
    let both = area([a[0].max(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].min(b[3])]);
    both / (area(a) + area(b) - both).max(f64::MIN_POSITIVE)
}

/// Of an interval and those of a finding; throughout is no interval.
fn of_times(truth: [f64; 2], place: &Place) -> f64 {
    let length = |[from, to]: [f64; 2]| (to - from).max(0.0);
    let both: f64 = place.time.iter().map(|own| length([own[0].max(truth[0]), own[1].min(truth[1])])).sum();
    let found: f64 = place.time.iter().map(|own| length(*own)).sum();
    both / (length(truth) + found - both).max(f64::MIN_POSITIVE)
}

/// A finding in a few words.
pub fn told(finding: &Finding) -> String {
    let what = match (&finding.effect, &finding.expression) {
        (Some(_), _) => finding.support_set.join(" / "),
        (None, Some(expression)) => {
            format!("{expression} [{}]", finding.expression_units.as_deref().unwrap_or("?"))
        }
        (None, None) => "no name".to_owned(),
    };
    format!("{} {what} on {:?}", word(finding.verdict), finding.robots)
}

/// A verdict as in `findings.json`.
pub fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Named => "named",
        Verdict::CannotTell => "cannot_tell",
        Verdict::Form => "form",
        Verdict::Unnameable => "unnameable",
        Verdict::BadData => "bad_data",
        Verdict::NothingMissing => "nothing_missing",
        Verdict::Untestable => "untestable",
    }
}

#[cfg(test)]
mod tests;

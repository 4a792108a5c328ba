//! Findings in plain sentences.

use pleiad_mismatch::{Estimate, Finding, Findings, Verdict};
use pleiad_physics::Effect;
use pleiad_report::with_interval;

use super::phrases::PHRASES;

/// What an effect is, in a few words; its name if it is not in the catalogue.
pub(super) fn title(name: &str) -> &str {
    Effect::from_name(name).map_or(name, |effect| effect.info().summary)
}

/// A verdict, in a few words.
pub(super) fn claim_words(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Named => "named",
        Verdict::CannotTell => "these data cannot tell several effects apart",
        Verdict::Form => "something is missing that no known effect explains; a formula describes it",
        Verdict::Unnameable => "something is missing that no known effect explains",
        Verdict::BadData => "the data are wrong, not the physics",
        Verdict::NothingMissing => "nothing missing",
        Verdict::Untestable => "too little could be tested",
    }
}

/// `robot 2`, `robots 1, 2, 3`.
pub(super) fn robots(numbers: &[u32]) -> String {
    let names: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    format!("{} {}", if names.len() == 1 { "robot" } else { "robots" }, names.join(", "))
}

/// Says a finding in words where nothing has been said yet.
pub(super) fn fill_summaries(findings: &mut Findings) {
    for finding in &mut findings.findings {
        if finding.summary.is_empty() {
            let said = sentences(finding);
            let what = finding.effect.as_deref().or(finding.expression.as_deref()).map_or("", title);
            let said = if said.is_empty() { what.to_owned() } else { said.join("; ") };
            finding.summary = format!("{}: {said}", robots(&finding.robots));
        }
    }
}

/// What a finding amounts to: the phrases of its effect, or its parameters by name.
pub(super) fn sentences(finding: &Finding) -> Vec<String> {
    let of = |name: &String| -> Vec<String> {
        let own = PHRASES.iter().filter(|(effect, _)| effect == name);
        own.filter_map(|(_, phrase)| fill(phrase, finding)).collect()
    };
    let said = finding.effect.as_ref().map(of).unwrap_or_default();
    if !said.is_empty() {
        return said;
    }
    let shape = finding.expression.as_ref().map(|expression| {
        let units = finding.expression_units.as_ref().map_or(String::new(), |units| format!(" [{units}]"));
        format!("the shape {expression}{units} describes it")
    });
    let plain = |(name, own): (&String, &Estimate)| {
        format!("{name} is {}", with_interval(own.value, own.ci95, &own.unit))
    };
    let curve = finding.shape.as_ref().map(|own| {
        let share = &own.residual_share;
        let [low, high] = share.ci95.map(|end| 100.0 * end);
        format!(
            "its {} is off by a curve over {} that explains {} of what is left there",
            own.of,
            own.regressor,
            with_interval(100.0 * share.value, [low, high], "%")
        )
    });
    shape.into_iter().chain(curve).chain(finding.parameters.iter().map(plain)).collect()
}

/// The phrase with its parameters filled in; `None` if the finding lacks one.
fn fill(phrase: &str, finding: &Finding) -> Option<String> {
    let mut text = String::with_capacity(2 * phrase.len());
    for (index, part) in phrase.split(['{', '}']).enumerate() {
        if index % 2 == 0 {
            text += part;
            continue;
        }
        let (name, how) = part.split_once(':')?;
        let mut how = how.split('|');
        let unit = how.next()?;
        let own = finding.parameters.get(name)?;
        text += &said(own, unit, how.next().zip(how.next()));
    }
    Some(text)
}

/// An estimate in another unit, with the word for its sign.
fn said(own: &Estimate, unit: &str, words: Option<(&str, &str)>) -> String {
    match unit {
        "label" => return format!("{:.0}", own.value),
        "wheel" => return if own.value > 0.5 { "right" } else { "left" }.to_owned(),
        _ => {}
    }
    let (factor, shown) = conversion(unit);
    let (value, [low, high]) = (factor * own.value, own.ci95.map(|end| factor * end));
    let Some((positive, negative)) = words else { return with_interval(value, [low, high], shown) };
    // Sizes and words only where the sign is certain.
    let (size, word) = if value < 0.0 && high < 0.0 {
        (with_interval(-value, [-high, -low], shown), negative)
    } else {
        (with_interval(value, [low, high], shown), positive)
    };
    if word.starts_with(',') { format!("{size}{word}") } else { format!("{size} {word}") }
}

/// From SI units to the unit of a phrase, and how it is written.
fn conversion(unit: &str) -> (f64, &str) {
    match unit {
        "%" => (100.0, "%"),
        "%/min" => (6_000.0, "% per minute"),
        "mm" | "mm/s" | "ms" => (1e3, unit),
        "deg" => (1_f64.to_degrees(), "°"),
        "deg/s" => (1_f64.to_degrees(), "°/s"),
        other => (1.0, other),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::finding;
    use super::*;

    #[test]
    fn estimates_are_told_in_units_that_people_read() {
        let cases = [
            (
                finding("unequal_wheel_radii", &[("ratio", 0.01, [0.0097, 0.0103], "1")]),
                "its left and right wheels differ by 1.00 % (0.97..1.03 %), the left one larger",
            ),
            (
                finding("track_width_error", &[("relative", -0.0393, [-0.0397, -0.0389], "1")]),
                "its effective track is 3.93 % (3.89..3.97 %) narrower than declared",
            ),
            (
                finding("command_delay", &[("delay_s", 0.12, [0.1194, 0.1206], "s")]),
                "its commands take effect 120.0 ms (119.4..120.6 ms) later than declared",
            ),
            (
                // The sign is open: the value keeps it.
                finding("gyro_scale", &[("relative", -0.001, [-0.004, 0.002], "1")]),
                "its gyro reads -0.1 % (-0.4..0.2 %) too much",
            ),
        ];
        for (finding, expected) in cases {
            assert_eq!(sentences(&finding), [expected]);
        }
    }

    #[test]
    fn a_phrase_whose_parameter_was_not_fitted_is_not_said() {
        let sag = finding("battery_sag", &[("gain_per_s", -5e-4, [-6e-4, -4e-4], "1/s")]);
        assert_eq!(
            sentences(&sag),
            ["its motors turn 3.0 % per minute (2.4..3.6 % per minute) slower as time passes"]
        );
    }

    #[test]
    fn an_effect_without_a_phrase_is_told_by_its_parameters() {
        let other = finding("something_new", &[("c", 2.0, [1.0, 3.0], "1/m")]);
        assert_eq!(sentences(&other), ["c is 2.0 1/m (1.0..3.0 1/m)"]);
    }

    #[test]
    fn what_has_no_name_is_told_by_its_shape() {
        let mut other = finding("x", &[("coefficient", 2.0, [1.0, 3.0], "s")]);
        other.effect = None;
        other.expression = Some("v |w|".into());
        other.expression_units = Some("s".into());
        assert_eq!(
            sentences(&other),
            ["the shape v |w| [s] describes it", "coefficient is 2.0 s (1.0..3.0 s)"]
        );
    }

    #[test]
    fn every_phrase_speaks_of_an_effect_of_the_catalogue_and_of_its_parameters() {
        for (name, phrase) in PHRASES {
            let effect = Effect::from_name(name).unwrap_or_else(|| panic!("{name}"));
            for part in phrase.split(['{', '}']).skip(1).step_by(2) {
                let label = part.split(':').next().unwrap();
                assert!(effect.info().parameter(label).is_some(), "{name} has no {label}");
            }
        }
    }
}

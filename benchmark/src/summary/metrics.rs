//! The quantities of a group of cases.

use std::collections::BTreeSet;

use super::{CaseResult, Class, Effect, Group, Match, Mean, ParameterError, Row, Scored, Share};
use crate::oracle::Known;
use crate::score::forms;

/// The tool's own name among methods.
const TOOL: &str = "tool";
/// Overlap from which a place or a time is found.
const OVERLAP: f64 = 0.7;
/// A gain is told only where it is above so many standard errors.
const TELLING: f64 = 3.0;
/// The share of the oracle's gain that is wanted.
const GAIN: f64 = 0.9;

struct Rows<'r> {
    group: &'r Group<'r>,
    all: Vec<Row>,
}

impl Rows<'_> {
    fn share(&mut self, method: &str, quantity: &'static str, all: impl IntoIterator<Item = bool>) {
        self.push(method, quantity, Share::of(all), None);
    }

    fn mean(&mut self, method: &str, quantity: &'static str, all: impl IntoIterator<Item = f64>) {
        self.push(method, quantity, None, Mean::of(all));
    }

    fn push(&mut self, method: &str, quantity: &'static str, share: Option<Share>, mean: Option<Mean>) {
        let (class, noise, size) = self.group.0;
        if share.is_some() || mean.is_some() {
            let size = size.map(f64::from_bits);
            self.all.push(Row { class, noise, size, method: method.to_owned(), quantity, share, mean });
        }
    }
}

/// All quantities of a group.
pub(super) fn rows(group: &Group<'_>) -> Vec<Row> {
    let cases = &group.1;
    let mut rows = Rows { group, all: Vec::new() };
    said(&mut rows, TOOL, cases, |own| Some(&own.tool));
    reached(&mut rows, cases);
    of_class(&mut rows, cases);
    let ablations: BTreeSet<&String> = cases.iter().flat_map(|own| own.ablations.keys()).collect();
    for name in ablations {
        said(&mut rows, name, cases, |own| own.ablations.get(name));
    }
    let methods: BTreeSet<&String> = cases.iter().flat_map(|own| own.baselines.keys()).collect();
    for name in methods {
        let own = || cases.iter().filter_map(|own| own.baselines.get(name).map(|selected| (own, selected)));
        let plain = |case: &CaseResult| case.oracle.effects.iter().all(|known| known.identifiable);
        let acting = || own().filter(|(case, selected)| selected.of > 0 && plain(case));
        rows.share(name, "strongest is right, of identifiable", acting().map(|(_, selected)| selected.top1));
        rows.share(
            name,
            "selected, of identifiable",
            acting().map(|(_, selected)| selected.found == selected.of),
        );
        rows.mean(name, "extra names per recording", own().map(|(_, selected)| selected.extra as f64));
        rows.share(name, "recordings with an extra name", own().map(|(_, selected)| selected.extra > 0));
    }
    rows.all
}

/// Effects with what is known of them.
fn pairs<'c>(
    cases: &'c [&'c CaseResult],
    of: impl Fn(&'c CaseResult) -> Option<&'c Scored> + Copy + 'c,
) -> impl Iterator<Item = (&'c Match, &'c Known)> + 'c {
    let scored = move |own: &&'c CaseResult| Some((*own, of(own)?));
    cases.iter().filter_map(scored).flat_map(|(own, scored)| scored.matches.iter().zip(&own.oracle.effects))
}

/// What a diagnosis, whole or in part, said.
fn said<'c>(
    rows: &mut Rows<'_>,
    method: &str,
    cases: &'c [&'c CaseResult],
    of: impl Fn(&'c CaseResult) -> Option<&'c Scored> + Copy + 'c,
) {
    let all = || cases.iter().filter_map(move |own| of(own));
    let left_out = cases.first().is_some_and(|own| own.class == Class::OutOfCatalogue);
    if !left_out {
        let clear = || pairs(cases, of).filter(|(_, known)| known.identifiable).map(|(found, _)| found);
        let seen = || pairs(cases, of).filter(|(_, known)| known.detectable).map(|(found, _)| found);
        rows.share(method, "localized, of detectable", seen().map(|own| own.localized));
        rows.share(method, "top-1, of identifiable", clear().map(|own| own.top1));
        rows.share(method, "top-3, of identifiable", clear().map(|own| own.top3));
        rows.share(method, "in the set, of identifiable", clear().map(|own| own.in_set));
        rows.share(method, "in the set, of detectable", seen().map(|own| own.in_set));
        rows.mean(method, "set size", seen().filter_map(|own| own.set_size).map(|size| size as f64));
        let alike = || {
            let known = pairs(cases, of).filter(|(_, known)| known.detectable && !known.identifiable);
            known.map(|(found, _)| found.verdict.as_deref() != Some("named"))
        };
        rows.share(method, "not named, of detectable and not identifiable", alike());
        let hidden = || pairs(cases, of).filter(|(_, known)| !known.detectable).map(|(found, _)| found);
        rows.share(method, "nothing said, of not detectable", hidden().map(|own| own.verdict.is_none()));
        let found = || pairs(cases, of).flat_map(|(found, _)| &found.parameters);
        covered(rows, method, "intervals that hold the truth, after selection", found());
        rows.mean(method, "relative error of parameters", found().map(relative));
        let overlaps = || clear().filter_map(|own| own.overlap);
        rows.share(
            method,
            "overlap at least 0.7, of identifiable and named",
            overlaps().map(|own| own >= OVERLAP),
        );
        rows.mean(method, "extra names per recording", all().map(|own| own.extra.len() as f64));
        rows.share(method, "recordings with an extra name", all().map(|own| !own.extra.is_empty()));
    }
    rows.mean(method, "seconds per diagnosis", all().map(|own| own.seconds));
}

fn relative(own: &ParameterError) -> f64 {
    (own.value - own.truth).abs() / own.truth.abs().max(f64::MIN_POSITIVE)
}

fn covered<'c>(
    rows: &mut Rows<'_>,
    method: &str,
    quantity: &'static str,
    all: impl Iterator<Item = &'c ParameterError>,
) {
    rows.share(method, quantity, all.filter_map(|own| own.covered));
}

/// What could be reached, and how much of it was.
fn reached(rows: &mut Rows<'_>, cases: &[&CaseResult]) {
    let known = || cases.iter().flat_map(|own| &own.oracle.effects);
    rows.share("oracle", "detectable", known().map(|own| own.detectable));
    rows.share("oracle", "identifiable", known().map(|own| own.identifiable));
    let imposed = known().flat_map(|own| &own.parameters);
    covered(rows, "oracle", "intervals that hold the truth, true model imposed", imposed);
    let left_out = cases.first().is_some_and(|own| own.class == Class::OutOfCatalogue);
    if left_out {
        return;
    }
    let gains = || {
        cases.iter().filter_map(|own| {
            let [truth, error, refit, tool] = own.oracle.held_out?;
            (truth - refit > TELLING * error).then(|| (tool - refit) / (truth - refit))
        })
    };
    rows.mean(TOOL, "share of the oracle's gain", gains());
    rows.share(TOOL, "at least 0.9 of the oracle's gain", gains().map(|own| own >= GAIN));
    let worse = cases.iter().filter(|own| !own.tool.evidence.total_cmp(&0.0).is_eq()).filter_map(|own| {
        let [_, _, refit, tool] = own.oracle.held_out?;
        Some(tool < refit)
    });
    rows.share(TOOL, "worse than the refitted nominal, of recordings with a finding", worse);
}

/// What is asked of one class alone.
fn of_class(rows: &mut Rows<'_>, cases: &[&CaseResult]) {
    let Some(class) = cases.first().map(|own| own.class) else { return };
    match class {
        Class::Clean => {
            rows.share(TOOL, "with a named finding", cases.iter().map(|own| !own.tool.extra.is_empty()));
            let any = |own: &&CaseResult| !own.tool.extra.is_empty() || !own.tool.nameless.is_empty();
            rows.share(TOOL, "with any finding", cases.iter().map(any));
        }
        Class::OutOfCatalogue => {
            // Where something else does as well, its name is no wrong one.
            let seen = || cases.iter().filter(|own| own.oracle.effects.iter().all(|known| known.detectable));
            let clear = || seen().filter(|own| !own.oracle.is_reproduced());
            let wrong = |own: &CaseResult| own.tool.extra.iter().any(|said| !said.starts_with("cannot_tell"));
            rows.share(TOOL, "what remains reproduces it", seen().map(|own| own.oracle.is_reproduced()));
            rows.share(TOOL, "wrong name", clear().map(|own| wrong(own)));
            rows.share(
                TOOL,
                "cannot_tell, with a name in the set",
                clear().map(|own| !wrong(own) && !own.tool.extra.is_empty()),
            );
            let effect =
                |own: &CaseResult| own.tool.matches.first().and_then(|own| Effect::from_name(&own.effect));
            let forms = |own: &CaseResult| effect(own).map_or(&[][..], forms::right);
            let expressible = || clear().filter(|own| !forms(own).is_empty());
            let right = |own: &CaseResult| {
                let said = |effect| forms::is_right(effect, &own.tool.nameless);
                own.tool.extra.is_empty() && effect(own).is_some_and(said)
            };
            rows.share(TOOL, "right form, of what products express", expressible().map(|own| right(own)));
            let others = || clear().filter(|own| forms(own).is_empty());
            let form = |own: &CaseResult| own.tool.nameless.iter().any(|said| said.starts_with("form "));
            let shape =
                |own: &CaseResult| own.tool.nameless.iter().any(|said| said.starts_with("unnameable "));
            rows.share(
                TOOL,
                "unnameable and no more, of the others",
                others().map(|own| own.tool.extra.is_empty() && shape(own) && !form(own)),
            );
            rows.share(TOOL, "a form, of the others", others().map(|own| form(own)));
            let nothing = |own: &CaseResult| own.tool.extra.is_empty() && own.tool.nameless.is_empty();
            rows.share(TOOL, "nothing said, of the others", others().map(|own| nothing(own)));
        }
        Class::Unidentifiable => {
            let seen = || cases.iter().filter(|own| own.oracle.effects.iter().all(|known| known.detectable));
            let said = |own: &CaseResult| own.tool.verdict == "cannot_tell";
            rows.share(TOOL, "cannot_tell, of detectable", seen().map(|own| said(own)));
            let proposed = |own: &CaseResult| own.added.is_some();
            rows.share(TOOL, "a manoeuvre is proposed, of detectable", seen().map(|own| proposed(own)));
            let named = cases.iter().filter_map(|own| own.added.as_ref());
            let named = named.map(|own| !own.matches.is_empty() && own.matches.iter().all(|one| one.top1));
            rows.share(TOOL, "named once the manoeuvre is added", named);
        }
        Class::Decoy => {
            let physics = |own: &&CaseResult| own.tool.extra.iter().any(|said| !is_bad_data(said));
            rows.share(TOOL, "with physics named", cases.iter().map(physics));
        }
        _ => {}
    }
}

/// Whether a finding told in words blames the data.
fn is_bad_data(said: &str) -> bool {
    let effects = said.split([' ', '/']).filter_map(Effect::from_name);
    let mut effects = effects.peekable();
    effects.peek().is_some() && effects.all(|effect| effect.info().bad_data)
}
